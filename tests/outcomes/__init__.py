"""Outcome drives: closed-loop drives over everything that has ever failed.

Each row of `outcomes.rows` is one drive with fixed seeds and a name that says what happened. What
comes of it on a plant independent of the controller is compared with `expected.csv`.
"""
