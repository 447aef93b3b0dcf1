"""The handful of ArduPilot parameters that the emulated rover has, with their delivered values."""

from __future__ import annotations

import math
from collections.abc import Mapping

INT8, INT16, INT32, REAL32 = 2, 4, 6, 9
"""MAV_PARAM_TYPE"""
DEFAULTS: dict[str, tuple[float, int]] = {
    "SYSID_THISMAV": (1, INT16),
    "SYSID_MYGCS": (255, INT16),
    "FRAME_CLASS": (1, INT8),
    "INITIAL_MODE": (0, INT8),
    "SCHED_LOOP_RATE": (50, INT16),
    "ARMING_CHECK": (1, INT32),
    "FS_ACTION": (2, INT8),
    "FS_TIMEOUT": (1.5, REAL32),
    "FS_GCS_ENABLE": (0, INT8),
    "FS_GCS_TIMEOUT": (5, REAL32),
    "FS_EKF_ACTION": (1, INT8),
    "RC_OVERRIDE_TIME": (3, REAL32),
    "WP_SPEED": (2, REAL32),
    "CRUISE_SPEED": (2, REAL32),
    "ATC_ACCEL_MAX": (1, REAL32),
    "ATC_DECEL_MAX": (0, REAL32),
    "ATC_STR_ANG_P": (2, REAL32),
    "ATC_STR_ACC_MAX": (120, REAL32),
    "ATC_STR_RAT_MAX": (120, REAL32),
    "ATC_STR_RAT_FF": (0.2, REAL32),
    "ATC_STR_RAT_P": (0.2, REAL32),
    "MOT_SPD_SCA_BASE": (1, REAL32),
    "GPS1_TYPE": (1, INT8),
    "VISO_TYPE": (0, INT8),
    "EK3_SRC1_POSXY": (3, INT8),
    "EK3_SRC1_VELXY": (3, INT8),
    "EK3_SRC1_POSZ": (1, INT8),
    "EK3_SRC1_VELZ": (3, INT8),
    "EK3_SRC1_YAW": (1, INT8),
}
LOOP_RATES = (10.0, 400.0)
LARGEST = 65535.0
MOTION_CAPTURE = {
    "VISO_TYPE": 1.0,
    "GPS1_TYPE": 0.0,
    "EK3_SRC1_POSXY": 6.0,
    "EK3_SRC1_VELXY": 6.0,
    "EK3_SRC1_POSZ": 1.0,
    "EK3_SRC1_VELZ": 0.0,
    "EK3_SRC1_YAW": 6.0,
}
"""What to set for a pose from outside."""


class Parameters:
    """Named numbers, in a fixed order.

    `changed`: values other than delivered; ValueError for a name that is not there or a value out
    of range.
    """

    def __init__(self, changed: Mapping[str, float] | None = None) -> None:
        self._values = {name: float(value) for name, (value, _) in DEFAULTS.items()}
        self.names = tuple(DEFAULTS)
        for name, value in (changed or {}).items():
            if name not in self._values or not self.set(name, value):
                raise ValueError(
                    f"parameter {name}: expected one of {', '.join(self.names)} with a value in "
                    f"its range, got {value!r}"
                )

    def __getitem__(self, name: str) -> float:
        """Value of a parameter."""
        return self._values[name]

    def __contains__(self, name: object) -> bool:
        """Whether there is one of that name."""
        return name in self._values

    def set(self, name: str, value: float) -> bool:
        """Change one; False if there is none, or for a value out of range."""
        low, high = LOOP_RATES if name == "SCHED_LOOP_RATE" else (0.0, LARGEST)
        if name not in self._values or not (math.isfinite(value) and low <= value <= high):
            return False
        self._values[name] = float(value) if self.kind(name) == REAL32 else float(round(value))
        return True

    def kind(self, name: str) -> int:
        """MAV_PARAM_TYPE of a parameter."""
        return DEFAULTS[name][1]

    @property
    def motion_capture(self) -> bool:
        """Whether the pose is taken from outside."""
        return (
            self["VISO_TYPE"] == 1.0 and self["EK3_SRC1_POSXY"] == 6.0 and self["GPS1_TYPE"] == 0.0
        )
