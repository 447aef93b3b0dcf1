"""What arrays are called, and how long a state and a command are."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

Array = NDArray[Any]
"""Any NumPy array; its shape and unit stand in the docstring of whoever takes or gives it."""
STATES = 3  # length of a robot state ``(x [m], y [m], theta [rad])``
INPUTS = 2  # length of a command ``(v [m/s], omega [rad/s])``
