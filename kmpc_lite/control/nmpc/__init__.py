"""The nonlinear program: QP, solver, SQP passes."""
