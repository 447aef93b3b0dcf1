"""The stop trajectory that every plan must have, and what is driven when there is no plan.

`stop_trajectory` checks a plan for a stop; `backup` keeps the last stop trajectory, which
`control/fallback.py` drives, or brakes, when the QP solver fails or no stop is clear.
"""
