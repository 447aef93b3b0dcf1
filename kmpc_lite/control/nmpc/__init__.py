"""The nonlinear program: QP, solver, SQP passes.

The answer of a QP solver that fails has the status `QPStatus.FAILED`; the controller then drives
what `safe_stop.backup` gives.
"""
