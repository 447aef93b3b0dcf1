"""Whether the vehicle's local frame still has the origin that it had when the drive began.

After a restart the autopilot sets a new origin where it then stands; another station may set one,
too. Poses look as good as before, but the map is shifted: nothing may move until somebody has
looked.
"""

from __future__ import annotations

FARTHEST = 10
"""An origin that moves by more than this is another one [1e-7 degrees]: 0.1 m."""


class FrameWatch:
    """Doubts the frame after a restart or a jump of clock or origin, until it is confirmed."""

    def __init__(self) -> None:
        self.doubt = ""
        """Why the frame may have moved, empty where nothing says so."""
        self.doubts = 0
        """How often the frame was doubted."""
        self._resets = 0
        self._origin: tuple[int, int] | None = None

    def on_clock(self, resets: int) -> None:
        """Take how often the vehicle's clock has begun anew."""
        if resets != self._resets:
            self._resets = resets
            self._doubt("the autopilot was restarted, or its clock jumped")

    def on_origin(self, latitude: int, longitude: int) -> None:
        """Take where the vehicle says its origin is [1e-7 degrees]."""
        before, self._origin = self._origin, (latitude, longitude)
        if (
            before is not None
            and max(abs(a - b) for a, b in zip(before, self._origin, strict=True)) > FARTHEST
        ):
            self._doubt("the autopilot's origin has moved")

    def confirm(self) -> None:
        """Trust the frame again, after it was checked on the map."""
        self.doubt = ""

    def _doubt(self, why: str) -> None:
        self.doubt, self.doubts = why, self.doubts + 1
