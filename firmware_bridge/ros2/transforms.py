"""TF: the newest transform of every frame, chained from one frame to another."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]
"""(4, 4) rotation and translation [m]: takes a point of the source frame into the target."""
MOST_FRAMES = 500
DEEPEST = 32
"""Longest chain of transforms."""
FARTHEST = 1e5
"""Translations beyond this are no robot's [m]."""
UNIT = 0.1
"""A quaternion's squared length may differ from 1 by so much."""


class Link(NamedTuple):
    """A frame's place in its parent."""

    parent: str
    matrix: Matrix
    stamp: float
    """Of the message's header [s]."""
    received: float
    """Our clock [s]; infinite for a static transform, which does not age."""


class Planar(NamedTuple):
    """A place in the plane."""

    x: float
    """[m]"""
    y: float
    """[m]"""
    theta: float
    """Of the x axis, counter-clockwise [rad]."""
    upright: float
    """Cosine of the tilt: 1 upright, -1 upside down."""


class Transforms:
    """Takes TF messages, and says where a frame lies in another.

    Parameters
    ----------
    longest : float
        A transform that moves and has not come for so long is not believed [s].
    """

    def __init__(self, longest: float) -> None:
        self._longest = longest
        self._links: dict[str, Link] = {}
        self.refused = 0

    def take(self, message: Any, now: float, static: bool) -> None:
        """Take a TFMessage that came at `now` [s]; what is not finite is refused."""
        for transform in message.transforms:
            parent, child = bare(transform.header.frame_id), bare(transform.child_frame_id)
            matrix = pose_matrix(transform.transform.translation, transform.transform.rotation)
            full = child not in self._links and len(self._links) >= MOST_FRAMES
            if matrix is None or not parent or not child or parent == child or full:
                self.refused += 1
                continue
            stamp = stamp_of(transform.header)
            self._links[child] = Link(parent, matrix, stamp, math.inf if static else now)

    def link(self, frame: str) -> Link | None:
        """Newest transform of a frame to its parent."""
        return self._links.get(bare(frame))

    def lookup(self, target: str, source: str, now: float) -> Matrix | None:
        """Where the source frame lies in the target; None if no chain of fresh ones leads there.

        The newest transforms are used, whatever their stamps.
        """
        if target == source:
            return np.eye(4)
        up, down = self._chain(bare(source), now), self._chain(bare(target), now)
        common = next((frame for frame in up if frame in down), None)
        if common is None:
            return None
        to_common, from_common = up[common], down[common]
        found: Matrix = inverse(from_common) @ to_common
        return found

    def _chain(self, frame: str, now: float) -> dict[str, Matrix]:
        """Ancestors of a frame, nearest first, and where the frame lies in each."""
        chain = {frame: np.eye(4)}
        matrix = np.eye(4)
        for _ in range(DEEPEST):
            link = self._links.get(frame)
            if link is None or now - link.received > self._longest or link.parent in chain:
                break
            frame, matrix = link.parent, link.matrix @ matrix
            chain[frame] = matrix
        return chain


def bare(frame: str) -> str:
    """Name of a frame without the slash that ROS 1 put before it."""
    return frame.removeprefix("/")


def stamp_of(header: Any) -> float:
    """Time of a header [s]."""
    return float(header.stamp.sec) + 1e-9 * float(header.stamp.nanosec)


def pose_matrix(position: Any, orientation: Any) -> Matrix | None:
    """Matrix of a position [m] and a quaternion; None where they are none."""
    x, y, z, w = orientation.x, orientation.y, orientation.z, orientation.w
    place = position.x, position.y, position.z
    length = x * x + y * y + z * z + w * w
    # NaN fails every comparison
    if not abs(length - 1.0) <= UNIT or not all(abs(c) <= FARTHEST for c in place):
        return None
    s = 2.0 / length
    matrix = np.eye(4)
    matrix[:3, :3] = (
        (1.0 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)),
        (s * (x * y + z * w), 1.0 - s * (x * x + z * z), s * (y * z - x * w)),
        (s * (x * z - y * w), s * (y * z + x * w), 1.0 - s * (x * x + y * y)),
    )
    matrix[:3, 3] = place
    return matrix


def inverse(matrix: Matrix) -> Matrix:
    """Matrix of the way back."""
    back = np.eye(4)
    back[:3, :3] = matrix[:3, :3].T
    back[:3, 3] = -matrix[:3, :3].T @ matrix[:3, 3]
    return back


def planar(matrix: Matrix) -> Planar:
    """Seen from above.

    Examples
    --------
    >>> planar(planar_matrix(1.0, 2.0, 0.5))
    Planar(x=1.0, y=2.0, theta=0.5, upright=1.0)
    """
    theta = math.atan2(matrix[1, 0], matrix[0, 0])
    return Planar(float(matrix[0, 3]), float(matrix[1, 3]), theta, float(matrix[2, 2]))


def planar_matrix(x: float, y: float, theta: float) -> Matrix:
    """Matrix of a place in the plane: x, y [m], theta [rad]."""
    matrix = np.eye(4)
    matrix[:2, :2] = ((math.cos(theta), -math.sin(theta)), (math.sin(theta), math.cos(theta)))
    matrix[:2, 3] = x, y
    return matrix
