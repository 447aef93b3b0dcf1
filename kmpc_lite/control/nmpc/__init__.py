"""The nonlinear program: QP, solver, SQP passes; where it fails, `verification` takes over."""
