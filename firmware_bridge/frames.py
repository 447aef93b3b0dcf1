"""Two frames: ours is ENU, autopilots use NED.

ENU has x east, y north and theta counter-clockwise from east; NED has yaw clockwise from north.

Body axes follow: ours points left (FLU), theirs right (FRD), so a turn rate changes its sign and
forward speed does not.
"""

from __future__ import annotations

import math


def wrap(angle: float) -> float:
    """Bring an angle into (-pi, pi] [rad].

    Examples
    --------
    >>> round(wrap(3.0 * math.pi), 6)
    3.141593
    """
    turned = math.remainder(angle, 2.0 * math.pi)
    return math.pi if turned <= -math.pi else turned


def ned_to_enu(north: float, east: float, yaw: float) -> tuple[float, float, float]:
    """Turn a NED pose (m, m, rad) into ours: (x, y, theta), theta in (-pi, pi].

    Examples
    --------
    >>> ned_to_enu(2.0, 1.0, 0.0) == (1.0, 2.0, math.pi / 2)
    True
    """
    return east, north, wrap(math.pi / 2.0 - yaw)


def enu_to_ned(x: float, y: float, theta: float) -> tuple[float, float, float]:
    """Turn a pose of ours (m, m, rad) into NED: (north, east, yaw), yaw in (-pi, pi].

    Examples
    --------
    >>> enu_to_ned(1.0, 2.0, math.pi / 2)
    (2.0, 1.0, 0.0)
    """
    return y, x, wrap(math.pi / 2.0 - theta)


def forward_speed(v_north: float, v_east: float, yaw: float) -> float:
    """Return the speed along the nose [m/s] of a NED velocity at a NED yaw [rad].

    It is negative in reverse.

    Examples
    --------
    >>> forward_speed(0.0, -0.5, math.pi / 2)
    -0.5
    """
    return v_north * math.cos(yaw) + v_east * math.sin(yaw)
