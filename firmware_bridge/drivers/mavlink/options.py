"""Options of the MAVLink driver, as the [board] table of a robot file gives them."""

from __future__ import annotations

import stat
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from firmware_bridge.messages import ConfigError
from firmware_bridge.options import is_number, three_numbers
from kmpc_lite.reading import read_bytes

GCS, COMPANION = "gcs", "companion"
EKF, MOCAP = "ekf", "mocap"
KEY_BYTES, MAX_KEY_BYTES = 32, 4096
EARTH = (90.0, 180.0, 1e4)  # largest latitude, longitude [degrees] and altitude [m] of an origin


@dataclass(frozen=True)
class MavlinkOptions:
    """Ids on the link, and what is asked of the vehicle.

    Raises ConfigError: names the option that is wrong.
    """

    system: int = 1  # the only system that is obeyed
    component: int = 1  # the only component of it that is obeyed: 1 is the autopilot
    role: str = GCS
    """"gcs": a ground station, which ArduPilot's GCS failsafe watches; "companion": a computer on
    board."""
    own_system: int | None = None
    """Our system id: 255 for a ground station, the vehicle's for a companion."""
    own_component: int | None = None
    """Our component id: 190 for a ground station, 191 for a companion."""
    rate: float = 40.0  # pose telemetry to ask for [Hz]; less is taken where it is denied
    arm: bool = False  # whether to switch to GUIDED and arm on connect; if not, the pilot does both
    pose: str = EKF  # "ekf": the vehicle's own sensors; "mocap": poses given to `feed_pose`
    origin: tuple[float, float, float] | None = None
    """With mocap: latitude, longitude [deg], altitude [m] to call the origin; ArduPilot obeys no
    set-point without one."""
    failsafe: bool = True  # turn ArduPilot's GCS failsafe on where it is off (the parameter stays)
    key_file: str | None = None
    """Signing key: 32 bytes, or 64 hexadecimal digits; readable by its owner only."""

    def __post_init__(self) -> None:
        """Check types and ranges."""
        for name in ("system", "component", "own_system", "own_component"):
            value = getattr(self, name)
            if value is not None and (
                isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= 255
            ):
                raise ConfigError(f"{name}: expected a MAVLink id from 1 to 255, got {value!r}")
        _one_of("role", self.role, GCS, COMPANION)
        _one_of("pose", self.pose, EKF, MOCAP)
        for name in ("arm", "failsafe"):
            if not isinstance(getattr(self, name), bool):
                raise ConfigError(f"{name}: expected true or false, got {getattr(self, name)!r}")
        if not is_number(self.rate) or not 1.0 <= self.rate <= 400.0:
            raise ConfigError(f"rate: expected 1 to 400 Hz, got {self.rate!r}")
        if self.origin is not None:
            place = three_numbers(self.origin)
            if place is None or any(abs(x) > most for x, most in zip(place, EARTH, strict=True)):
                raise ConfigError(
                    "origin: expected [latitude, longitude, altitude] in degrees and m, "
                    f"got {self.origin!r}"
                )
        if self.key_file is not None and not isinstance(self.key_file, str):
            raise ConfigError(f"key_file: expected a path, got {self.key_file!r}")
        if self.us == (self.system, self.component):
            raise ConfigError(
                f"own_system: {self.us[0]} with own_component {self.us[1]} is the vehicle itself"
            )

    @property
    def us(self) -> tuple[int, int]:
        """Our system and component id."""
        system, component = (255, 190) if self.role == GCS else (self.system, 191)
        return self.own_system or system, self.own_component or component

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> MavlinkOptions:
        """Read a TOML table; ConfigError names the key that is wrong or unknown."""
        if not isinstance(table, Mapping):
            raise ConfigError(f"[board]: expected a table, got {table!r}")
        known = [entry.name for entry in fields(cls)]
        for key in table:
            if key not in known:
                raise ConfigError(
                    f"board.{key}: unknown key; [board] of a mavlink robot takes {', '.join(known)}"
                )
        values: dict[str, Any] = {
            key: tuple(value) if isinstance(value, list) else value for key, value in table.items()
        }
        try:
            options = cls(**values)
            options.read_key()
        except ConfigError as error:
            raise ConfigError(f"board.{error}") from None
        return options

    def read_key(self) -> bytes | None:
        """Read the signing key from its file, None without one."""
        if self.key_file is None:
            return None
        path = Path(self.key_file)
        try:
            mode, raw = path.stat().st_mode, read_bytes(path, MAX_KEY_BYTES)
        except OSError as error:
            raise ConfigError(f"key_file: {path}: {error.strerror}") from None
        if mode & (stat.S_IRWXG | stat.S_IRWXO):
            raise ConfigError(
                f"key_file: {path}: others than its owner may use it: chmod 600 {path}"
            )
        if len(raw) == KEY_BYTES:
            return raw
        try:
            key = bytes.fromhex(raw.decode("ascii"))
        except ValueError:
            key = b""
        if len(key) != KEY_BYTES:
            raise ConfigError(
                f"key_file: {path}: expected 32 bytes or 64 hexadecimal digits, "
                f"got {len(raw)} bytes"
            )
        return key


def _one_of(name: str, value: object, *allowed: str) -> None:
    if value not in allowed:
        raise ConfigError(f"{name}: expected {' or '.join(map(repr, allowed))}, got {value!r}")
