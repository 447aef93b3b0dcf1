"""What a robot may drive of a plan: the largest share from which it comes to rest clear.

`safe_motion` finds it; `backup` keeps the last one, which `control/fallback.py` drives on, or
brakes, when the QP solver fails or no motion is clear.
"""
