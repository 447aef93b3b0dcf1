"""The emulated autopilot's pose: from GPS, or from motion capture that may fall silent.

And the handful of ArduPilot parameters that the emulated rover has, with their delivered values.
"""

from __future__ import annotations

import math
import random
from collections.abc import Mapping

from kmpc_lab.emulator.rover.physics import RoverPhysics

INT8, INT16, INT32, REAL32 = 2, 4, 6, 9  # MAV_PARAM_TYPE
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
GOOD = 1 | 2 | 4 | 8 | 16 | 32 | 256 | 512
"""EKF_STATUS_REPORT: attitude, velocities, positions and their predictions."""
LOST = 1 | 4 | 32 | 128  # attitude and height only, horizontal position held constant
UNINITIALIZED = 1024
LOOKS_VALID = 7.0  # how long the pose looks valid after motion capture has stopped, as measured [s]
FED = 0.25  # motion capture must come at least this often to be taken for the first time [s]
WANDER = 8.0
"""Time constant of the position's slow error [s]: with 1 cm it moves by 1.6 mm in 0.1 s, what a
model's one-step error on the firmware has more than on an emulator without; the firmware's position
was 1 to 4 cm off."""
ORIGIN = (47.3769, 8.5417, 408.0)  # where the GPS is: latitude, longitude [deg], altitude [m]


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


class Estimator:
    """Pose estimate, ENU, and its flags.

    `parameters`: say where the pose comes from. `settled`: when after boot the EKF has its position
    and, with GPS, its origin [s]. `noise`: with GPS: standard deviation of a slow error of the
    position, each axis [m]. `seed`: of that error.
    """

    def __init__(
        self, parameters: Parameters, settled: float, noise: float = 0.0, seed: int = 0
    ) -> None:
        self._noise, self._random = noise, random.Random(seed)
        self._error = (0.0, 0.0)
        self._parameters, self._settled = parameters, settled
        self.origin: tuple[float, float, float] | None = None
        self.pose = (0.0, 0.0, 0.0)  # x, y [m], theta [rad]
        self.broken = False  # set by a test: the filter has lost its position
        self._uptime, self._fed, self._ever = 0.0, -math.inf, False

    def vision(self, x: float, y: float, theta: float, uptime: float) -> None:
        """Take a pose from outside, where one is wanted."""
        if self._parameters.motion_capture and all(map(math.isfinite, (x, y, theta))):
            self._ever = self._ever or (uptime - self._fed <= FED and self.origin is not None)
            self._fed, self.pose = uptime, (x, y, theta)

    def step(self, physics: RoverPhysics, uptime: float, dt: float) -> None:
        """Follow the rover: with GPS all but a slow error, else its motion since the last pose."""
        self._uptime = uptime
        if not self._parameters.motion_capture:
            self.pose = self._wander(*physics.pose, dt)
            if uptime >= self._settled and self.origin is None:
                self.origin = ORIGIN
            return
        x, y, theta = self.pose
        # the motion is measured in the body's frame, which the estimate may have turned
        turned = theta - physics.pose[2]
        east, north, turn = physics.velocity
        x += (east * math.cos(turned) - north * math.sin(turned)) * dt
        y += (east * math.sin(turned) + north * math.cos(turned)) * dt
        self.pose = (x, y, theta + turn * dt)

    def _wander(self, x: float, y: float, theta: float, dt: float) -> tuple[float, float, float]:
        """Put the slow error on a pose."""
        if not self._noise:
            return x, y, theta
        kick = self._noise * math.sqrt(2.0 * dt / WANDER)
        east, north = (
            error * (1.0 - dt / WANDER) + self._random.gauss(0.0, kick) for error in self._error
        )
        self._error = (east, north)
        return x + east, y + north, theta

    @property
    def position_ok(self) -> bool:
        """Whether a position is known: LOCAL_POSITION_NED goes out, GUIDED may be entered."""
        if self.broken or self.origin is None or self._uptime < self._settled:
            return False
        return not self._parameters.motion_capture or (
            self._ever and self._uptime - self._fed <= LOOKS_VALID
        )

    @property
    def flags(self) -> int:
        """Flags of EKF_STATUS_REPORT."""
        if self._uptime < min(1.0, self._settled):
            return UNINITIALIZED
        return GOOD if self.position_ok else LOST
