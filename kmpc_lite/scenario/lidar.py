"""The simulated lidar of a scenario: its section ``[lidar]``, without which all is known."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from kmpc_lite.control.options import USUAL_OBSTACLES
from kmpc_lite.errors import ScenarioError
from kmpc_lite.scenario.values import (
    LIDAR,
    Read,
    at_least_zero,
    check_section,
    numbers,
    to_toml,
    whole_number,
)

FARTHEST, FASTEST = 1000.0, 1000.0
"""Largest reach and mount [m], and highest rate [Hz]."""


@dataclass(frozen=True)
class LidarSpec:
    """A scanner as its data sheet has it."""

    reach: float = 4.0
    """How far it sees [m]."""
    beams: int = 360
    """Number of beams, spread evenly all around."""
    noise: float = 0.01
    """Standard deviation of a range [m]."""
    dropout: float = 0.01
    """Share of beams that come back without a range."""
    nearest: float = 0.05
    """Least range [m]."""
    rate: float = 0.0
    """Turns a second [Hz]; 0: one for each step of the controller."""
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where it sits on the robot: ahead, left [m], and its heading [rad]."""


READERS: dict[str, Read] = {
    "reach": at_least_zero(FARTHEST, zero=False),
    "beams": whole_number(1, USUAL_OBSTACLES.scan_beams),
    "noise": at_least_zero(1.0),
    "dropout": at_least_zero(1.0),
    "nearest": at_least_zero(FARTHEST),
    "rate": at_least_zero(FASTEST),
    "mount": numbers(3, most=FARTHEST),
}


def read_lidar(where: str, value: Any) -> LidarSpec | None:
    """Read the section; None if there is none.

    Raises ScenarioError: names the key, what was expected and what came.
    """
    if value is None:
        return None
    check_section(where, value, READERS)
    spec = LidarSpec(**{key: READERS[key](f"{where} {key}", found) for key, found in value.items()})
    if not spec.nearest < spec.reach:
        raise ScenarioError(f"{where} nearest: expected less than the reach, got {spec.nearest:g}")
    return spec


def lidar_to_toml(spec: LidarSpec | None) -> list[str]:
    """Lines of the section that `read_lidar` reads back; none without a lidar."""
    if spec is None:
        return []
    return [f"[{LIDAR}]", *(f"{key} = {to_toml(value)}" for key, value in asdict(spec).items()), ""]
