"""The simulated lidar of a scenario: its section ``[lidar]``, without which all is known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from kmpc_lite.control.options.sight import USUAL_OBSTACLES
from kmpc_lite.errors import ScenarioError, did_you_mean
from kmpc_lite.scenario.shapes import to_toml
from kmpc_lite.scenario.values import read_number

LIDAR = "lidar"
"""Name of the section."""
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


MOST = {"reach": FARTHEST, "noise": 1.0, "dropout": 1.0, "nearest": FARTHEST, "rate": FASTEST}


def read_lidar(where: str, value: Any) -> LidarSpec | None:
    """Read the section; None if there is none.

    Raises
    ------
    ScenarioError
        Names the key, what was expected and what came.
    """
    if value is None:
        return None
    if not isinstance(value, Mapping):
        raise ScenarioError(f"{where} must be a section, got {value!r:.40}")
    names = [field.name for field in fields(LidarSpec)]
    for key in value:
        if key not in names:
            hint = did_you_mean(key, names)
            raise ScenarioError(f"{where} {key}: unknown key{hint}; expected {', '.join(names)}")
    spec = LidarSpec(**{key: _read(f"{where} {key}", key, found) for key, found in value.items()})
    if not spec.nearest < spec.reach:
        raise ScenarioError(f"{where} nearest: expected less than the reach, got {spec.nearest:g}")
    return spec


def _read(where: str, key: str, value: Any) -> Any:
    if key == "mount":
        if not isinstance(value, list) or len(value) != 3:
            raise ScenarioError(f"{where}: expected 3 numbers, got {value!r:.40}")
        return tuple(read_number(where, part, FARTHEST) for part in value)
    if key == "beams":
        most = USUAL_OBSTACLES.scan_beams
        whole = isinstance(value, int) and not isinstance(value, bool)
        if not whole or not 1 <= value <= most:
            raise ScenarioError(f"{where}: expected a whole number 1 .. {most}, got {value!r:.40}")
        return value
    number = read_number(where, value, MOST[key])
    if number < 0.0 or (key == "reach" and number == 0.0):
        raise ScenarioError(
            f"{where}: expected a number {'>' if key == 'reach' else '>='} 0, got {value!r:.40}"
        )
    return number


def lidar_to_toml(spec: LidarSpec | None) -> list[str]:
    """Lines of the section that `read_lidar` reads back; none without a lidar."""
    if spec is None:
        return []
    values = {**asdict(spec), "mount": list(spec.mount)}
    return [f"[{LIDAR}]", *(f"{key} = {to_toml(value)}" for key, value in values.items()), ""]
