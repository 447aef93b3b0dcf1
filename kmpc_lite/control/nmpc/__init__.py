"""The nonlinear program: QP, solver, SQP passes.

The answer of a QP solver that fails has the status `QPStatus.FAILED`; `control/fallback.py` then
says what the robot does.
"""
