"""The newest time of a signing key, on disk.

The newest signing time that was accepted is kept, so that recordings stay refused after a restart:
a computer without a battery-backed clock starts in 1970, when every recorded frame looks new.
"""

from __future__ import annotations

import os
from pathlib import Path

from firmware_bridge.drivers.mavlink.codec import SIGNING_EPOCH
from firmware_bridge.messages import ConfigError

PERIOD = 30.0
"""Between writes [s]: as seldom as ArduPilot itself writes its own."""
LONGEST = 32


class SigningStamp:
    """Keeps the newest time stamp of a key beside it, as KEY.stamp.

    `key_file`: of the key; None: nothing is signed, and nothing kept. Raises ConfigError if the
    file is there and cannot be read.
    """

    def __init__(self, key_file: str | None) -> None:
        self._path = None if key_file is None else Path(f"{key_file}.stamp")
        self._kept = self._read()
        self._due = -float("inf")
        self.problem = ""
        """Why it cannot be kept."""

    @property
    def unix_time(self) -> float:
        """Unix time of the stamp that is kept [s]; 0 without one."""
        return SIGNING_EPOCH + self._kept * 1e-5 if self._kept else 0.0

    def keep(self, stamp: int, now: float) -> None:
        """Write a newer stamp [10 us since 2015], every 30 s at most; `now` is monotonic [s]."""
        if self._path is None or stamp <= self._kept or now < self._due:
            return
        self._due = now + PERIOD
        part = self._path.with_name(self._path.name + ".part")
        try:
            part.unlink(missing_ok=True)
            with open(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
                file.write(f"{stamp}\n")
                file.flush()
                os.fsync(file.fileno())
            part.replace(self._path)
        except OSError as error:
            self.problem = (
                f"{self._path}: cannot keep the signing time: {error.strerror or error}: after a "
                "restart without a clock, recorded frames would be accepted"
            )
        else:
            self._kept, self.problem = stamp, ""

    def _read(self) -> int:
        if self._path is None:
            return 0
        try:
            with open(self._path, encoding="ascii") as file:
                text = file.read(LONGEST)
            stamp = int(text)
            if not 0 <= stamp < 2**48:
                raise ValueError
        except FileNotFoundError:
            return 0
        except OSError as error:
            raise ConfigError(f"key_file: {self._path}: {error.strerror or error}") from None
        except ValueError:
            raise ConfigError(
                f"key_file: {self._path}: expected one number, the newest signing time in 10 us: "
                "remove the file if no other program can send to the vehicle"
            ) from None
        return stamp
