"""Headings and frames: theta in degrees, in a mirror, from north, off the robot's nose."""

from __future__ import annotations

from math import degrees

import numpy as np

from kmpc_lite.learn.checks.case import OFFSET, Case, positions_mirrored, theta_unit
from kmpc_lite.learn.checks.evidence import heading_offset

SURE = 4.0
"""Standard errors that make a direction sure."""


def theta_in_degrees(case: Case) -> str | None:
    """Headings that make sense as degrees only."""
    if not case.degrees:
        return None
    return (
        "theta is in degrees: the robot moves along it, and turns as told, only if read so; "
        f"--units theta={theta_unit(case)}"
    )


def mirrored(case: Case) -> str | None:
    """The path is that of the mirrored heading."""
    if case.sign > 0:
        return None
    offset = degrees(heading_offset(case.evidence, case.reading)[0])
    if not positions_mirrored(case):
        compass = ": a compass's, clockwise from north" if 60.0 < offset < 120.0 else ""
        return (
            f"theta turns the other way than the path: it is clockwise{compass}; "
            f"--units theta={theta_unit(case)}"
        )
    quarter = round(offset / 90.0) % 4
    option = {0: "--units y=-m", 2: "--units x=-m"}.get(quarter, "--frame swapped")
    what = {0: "y has the other sign", 2: "x has the other sign"}.get(
        quarter, "x and y are exchanged"
    )
    return f"the path is seen in a mirror, though theta turns as told: {what}; {option}"


def turns_the_other_way(case: Case) -> str | None:
    """Positive omega lowers theta, and the path agrees with theta."""
    if case.sign < 0 or not case.turns.sure or case.turns.factor.real > 0.0:
        return None
    return (
        "omega > 0 lowers theta: either the poses are x north, y east, theta clockwise "
        "(--frame ned), or omega is clockwise (--units omega=-rad/s)"
    )


def rotated(case: Case) -> str | None:
    """The motion goes aside of the heading by a fixed angle."""
    if case.sign < 0 or not case.moves.sure or case.degrees:
        return None
    offset, error = heading_offset(case.evidence, case.reading)
    plain = np.angle(case.moves.factor)
    if min(abs(degrees(offset)), abs(degrees(plain))) < OFFSET or abs(offset) < SURE * error:
        return None
    if abs(degrees(offset)) > 180.0 - OFFSET:
        return (
            "v > 0 drives backwards, against theta: v has the other sign (--units v=-m/s), or "
            "theta is off by half a turn (--units theta=rad+3.1416)"
        )
    return (
        f"the robot drives {degrees(offset):+.0f} degrees off theta, always: theta is not the "
        f"direction of its nose; --units theta={theta_unit(case)}"
    )
