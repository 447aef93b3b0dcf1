"""What a robot may drive of a plan: the largest share from which it comes to rest clear.

`safe_motion` finds it; the last one is driven on by `control/fallback.py`, which else brakes, when
the QP solver fails or no motion is clear.
"""
