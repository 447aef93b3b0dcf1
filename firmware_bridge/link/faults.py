"""What happens to frames on their way over a bad link, drawn from a seed.

They are dropped, duplicated, corrupted, reordered, delayed, split and cut.
"""

from __future__ import annotations

import itertools
import random
from dataclasses import dataclass, fields

from firmware_bridge.messages import ConfigError


@dataclass(frozen=True)
class Faults:
    """What happens to frames on their way: probabilities per frame, and times [s]."""

    drop: float = 0.0
    duplicate: float = 0.0
    corrupt: float = 0.0
    """One to three bytes changed."""
    reorder: float = 0.0
    """Held back until the next frame has passed."""
    split: float = 0.0
    """Arrives in two to four pieces."""
    cut: float = 0.0
    """The cable comes out in the middle of the frame, for `cut_for`."""
    cut_for: float = 0.1
    delay: float = 0.0
    """Each frame is late by up to this much; order is kept."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        for entry in fields(self):
            value = getattr(self, entry.name)
            high = 3600.0 if entry.name in ("delay", "cut_for") else 1.0
            if not 0.0 <= value <= high:
                raise ConfigError(f"faults: {entry.name}: expected 0 to {high:g}, got {value}")


class FaultyPath:
    """One direction of a wire: the same frames in the same order suffer the same."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._held: bytes | None = None
        self._due = -float("inf")
        self.faults = 0
        """How many faults there were."""

    def forget(self) -> None:
        """Lose the frame that is held back."""
        self._held = None

    def through(
        self, data: bytes, faults: Faults, now: float
    ) -> tuple[list[tuple[float, bytes]], bool]:
        """Send one frame at a time [s].

        Returns
        -------
        tuple
            Pieces with the time at which each arrives [s], and whether the cable came out.
        """
        draw = self._random.random
        frames = [data]
        if draw() < faults.drop:
            self.faults += 1
            return [], False
        if data and draw() < faults.corrupt:
            self.faults += 1
            damaged = bytearray(data)
            for _ in range(self._random.randint(1, 3)):
                damaged[self._random.randrange(len(damaged))] ^= self._random.randint(1, 255)
            frames = [bytes(damaged)]
        if draw() < faults.duplicate:
            self.faults += 1
            frames *= 2
        if self._held is not None:
            frames.append(self._held)
            self._held = None
        elif draw() < faults.reorder:
            self.faults += 1
            self._held, frames = frames[0], frames[1:]
        pieces: list[bytes] = []
        for frame in frames:
            if len(frame) > 1 and draw() < faults.split:
                self.faults += 1
                marks = sorted(
                    {
                        self._random.randrange(1, len(frame))
                        for _ in range(self._random.randint(1, 3))
                    }
                )
                pieces += [frame[a:b] for a, b in itertools.pairwise([0, *marks, len(frame)])]
            else:
                pieces.append(frame)
        cut = bool(data) and draw() < faults.cut
        if cut:
            self.faults += 1
            pieces = [data[: self._random.randrange(len(data))]]
        late = []
        for piece in pieces:
            self._due = max(self._due, now + faults.delay * draw())
            late.append((self._due, piece))
        return late, cut
