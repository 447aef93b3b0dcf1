"""The ``wheels`` of a robot file's ``[robot]``: on either side, a car's, or an omni's."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from firmware_bridge.kinematics import KINDS, curvature_of
from firmware_bridge.messages import ConfigError, Speeds
from firmware_bridge.options import bounded, check, from_table

STEERING = ("wheelbase", "steering_angle", "steering_rate")
"""What a motor board must know of a car, too: ``[geometry]`` or ``wheels`` says it."""
COLUMNS = {"differential": ("v", "omega"), "car": ("v", "curvature"), "omni": ("v", "vy", "omega")}
"""Of the commands in a recorded CSV."""


@dataclass(frozen=True)
class Wheels:
    """What a robot drives on."""

    kind: str = "differential"
    turning_radius: float | None = bounded(1e-3, 1e3, "m", None)
    """Of a car: the tightest circle on which its pose drives [m] ..."""
    wheelbase: float | None = bounded(1e-2, 100.0, "m", None)
    """... or the distance between its axles [m] ..."""
    steering_angle: float | None = bounded(1e-2, 1.5, "rad", None)
    """... and the largest angle of its front wheels [rad], for a pose at the rear axle."""
    steering_rate: float | None = bounded(1e-3, 1e3, "1/m/s", None)
    """How fast a car's curvature can change [1/m per second]; at once if not given."""
    reverse: bool = True
    """Whether a car may drive backwards."""

    def __post_init__(self) -> None:
        """Check the ranges, and that a car's numbers are a car's."""
        check(self)
        if self.kind not in KINDS:
            raise ConfigError(f"kind: expected {', '.join(KINDS)}, got {self.kind!r}")
        if self.kind != "car":
            for key in ("turning_radius", *STEERING):
                if getattr(self, key) is not None:
                    raise ConfigError(f"{key}: only a car has one, and kind is {self.kind}")
        elif self.turning_radius is None and None in (self.wheelbase, self.steering_angle):
            raise ConfigError(
                "turning_radius: missing: expected it [m], or wheelbase [m] and steering_angle "
                "[rad], of a car"
            )
        elif self._lock is not None and self.radius < 0.999 * self._lock:
            raise ConfigError(
                f"turning_radius: {self.radius:g} m is less than the wheels can be steered to, "
                f"{self._lock:.3g} m"
            )

    @property
    def _lock(self) -> float | None:
        """Radius at the largest steering angle [m], if it is known."""
        if self.wheelbase is None or self.steering_angle is None:
            return None
        return self.wheelbase / math.tan(self.steering_angle)

    @property
    def radius(self) -> float:
        """Of a car's tightest circle [m]; zero for others."""
        return self.turning_radius or self._lock or 0.0

    @property
    def table(self) -> dict[str, Any]:
        """What `kmpc_lite.control.wheels.read_wheels` takes."""
        if self.kind != "car":
            return {"kind": self.kind}
        steered = {"turning_radius": self.radius, "steering_rate": self.steering_rate}
        return {"kind": "car", **steered, "reverse": self.reverse}

    @property
    def steering(self) -> dict[str, float]:
        """What a motor board must know of a car, as far as it is given."""
        told = {key: getattr(self, key) for key in STEERING}
        return {key: value for key, value in told.items() if value is not None}

    @property
    def vehicle(self) -> dict[str, str | float]:
        """What a model learned on these wheels depends on: plain values."""
        car = {"turning_radius": self.radius} if self.kind == "car" else {}
        return {} if self.kind == "differential" else {"wheels": self.kind, **car}

    @property
    def columns(self) -> tuple[str, ...]:
        """Of the commands in a recorded CSV."""
        return COLUMNS[self.kind]

    def row(self, speeds: Speeds, curvature: float = 0.0) -> tuple[float, ...]:
        """Give speeds as these columns; a car that stands keeps the `curvature` it had [1/m]."""
        v, omega, vy = speeds
        if self.kind == "car":
            return v, curvature_of(v, omega, 1.0 / self.radius, curvature)
        return (v, vy, omega) if self.kind == "omni" else (v, omega)


TWO_SIDES = Wheels()


def read_wheels(told: Any, geometry: Mapping[str, Any]) -> Wheels:
    """Read `robot.wheels`: a kind, or a table; what ``[geometry]`` says of a car counts, too.

    Examples
    --------
    >>> read_wheels({"kind": "car", "steering_angle": 0.4}, {"wheelbase": 0.26}).radius.__round__(3)
    0.615
    """
    if told is None:
        return TWO_SIDES
    table = {"kind": told} if isinstance(told, str) else told
    if isinstance(table, Mapping) and table.get("kind") == "car":
        table = {**{key: geometry[key] for key in STEERING if key in geometry}, **table}
    return from_table(Wheels, table, "robot.wheels")
