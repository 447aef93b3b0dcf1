"""What the phases of a demo share, and how its rover sees."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from kmpc_lite.scenario.files import Scenario


@dataclass(frozen=True)
class Stage:
    """What the recording and the drive share."""

    file: Path
    """Robot file."""
    rover: Callable[..., AbstractContextManager[None]]
    """Starts the emulated rover with options, and ends it with the block."""
    scenario: Scenario
    folder: Path
    say: Callable[[str], None]
    quiet: bool
    lidar: str | None
    """Of the drive: then the only source of obstacles."""

    @property
    def eyes(self) -> dict[str, str | None]:
        """``[lidar]`` section of the drive."""
        link = None if self.lidar == "mavlink" else f"pty:{self.file.parent}/lidar"
        # the map has no walls around it: beams that end nowhere have nothing before them
        return {"driver": self.lidar, "no_return": "free", "link": link} if self.lidar else {}

    @property
    def seeing(self) -> list[str]:
        """Options of `kmpc emulate` that let the rover see."""
        named = {"--lidar": self.lidar, "--lidar-link": self.eyes.get("link")}
        return [word for name, value in named.items() if value for word in (name, value)]
