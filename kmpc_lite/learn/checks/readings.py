"""How a log is to be read: sign and unit of theta, frames, and factors that no robot has."""

from __future__ import annotations

from math import degrees, log10
from typing import NamedTuple

import numpy as np

from kmpc_lite.learn.checks.evidence import Evidence, Explained, heading_offset
from kmpc_lite.learn.logs import Log

BETTER = 0.6
"""A reading of theta that explains less than this share of what another explains is wrong."""
FITS = 0.3
"""Share that the better reading has to explain."""
OFFSET = 25.0
"""Angle between motion and heading above which it is reported [degrees]."""
NOISE = 3.0
"""An expected motion is seen where a tenth of it is this many times its measurement's noise."""


class Case(NamedTuple):
    """A log, its motion, and the reading of theta that fits best."""

    log: Log
    evidence: Evidence
    moves: Explained
    """Displacements under the best reading of theta."""
    turns: Explained
    """Turns under that reading."""
    sign: int
    """Of theta, that fits."""
    degrees: bool
    """Whether theta fits as degrees."""

    @property
    def reading(self) -> tuple[int, bool]:
        """How theta fits."""
        return self.sign, self.degrees


def make_case(log: Log, evidence: Evidence) -> Case:
    """Choose the reading of theta that fits: the given one, unless another is far better."""
    moves, turns = evidence.moves, evidence.turns
    given, best = moves[1, False], moves[evidence.best]
    sign, as_degrees = 1, False
    if best.sure and best.share > FITS and given.share < BETTER * best.share:
        sign, as_degrees = evidence.best
        other = moves[sign, not as_degrees]
        if as_degrees and other.share >= BETTER * best.share:
            as_degrees = False
    wrong_turn = turns[False].share < BETTER * turns[True].share
    if turns[True].sure and turns[True].share > FITS and wrong_turn:
        as_degrees = True
    elif turns[False].sure and 1.15 < power_of(turns[False]) < 2.4 and not best.sure:
        as_degrees = True
    return Case(log, evidence, moves[sign, as_degrees], turns[as_degrees], sign, as_degrees)


def power_of(explained: Explained) -> float:
    """Power of ten of a factor."""
    return log10(max(abs(explained.factor), 1e-30))


def percent(explained: Explained) -> str:
    """A share in words."""
    return f"{100.0 * max(explained.share, 0.0):.0f} %"


def positions_mirrored(case: Case) -> bool:
    """Whether theta turns as commanded, so that x and y are what is mirrored."""
    return case.turns.sure and case.turns.factor.real > 0.0


def theta_unit(case: Case) -> str:
    """What --units theta= is to be."""
    offset, _ = heading_offset(case.evidence, case.reading) if case.moves.sure else (0.0, 0.0)
    turned = case.sign < 0 and not positions_mirrored(case)
    unit = ("-" if turned else "") + ("deg" if case.degrees else "rad")
    if abs(degrees(offset)) < OFFSET or not turned and case.sign < 0:
        return unit
    near = 90.0 * round(degrees(offset) / 90.0)
    angle = near if abs(degrees(offset) - near) < 20.0 else degrees(offset)
    return unit + (f"{angle:+.0f}" if case.degrees else f"{np.radians(angle):+.4f}")


SURE = 4.0
"""Standard errors that make a direction sure."""


def theta_in_degrees(case: Case) -> str | None:
    """Headings that make sense as degrees only."""
    if not case.degrees:
        return None
    return (
        "theta is in degrees: the robot moves along it, and turns as commanded, only if read so; "
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
    return f"the path is seen in a mirror, though theta turns as commanded: {what}; {option}"


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


PLAUSIBLE_PERIODS = (2e-4, 20.0)
"""Between the rows of a log [s]."""


def time_unit(case: Case) -> str | None:
    """Displacements and turns are both a thousandth, or less, of what speed times time gives."""
    powers = [power_of(e) for e in (case.moves, case.turns) if e.sure]
    period = case.evidence.motion.period
    for unit, power in (("ms", 3), ("us", 6), ("ns", 9)):
        near = [abs(p + power) < 1.2 for p in powers]
        low, high = PLAUSIBLE_PERIODS
        fits = low < period * 10.0**-power < high and (len(powers) == 2 or period > 0.9)
        if powers and all(near) and fits:
            return (
                f"the robot would move and turn by 1e{-power} of what speed times time gives, with "
                f"{period:.3g} s between poses: t is in {unit}; --units t={unit}"
            )
    if len(powers) == 2 and min(powers) > 2.0 and abs(powers[0] - powers[1]) < 1.0:
        return (
            f"the robot would move and turn by 1e{round(powers[0])} of what speed times time "
            f"gives, with {period:.3g} s between poses: t is in a larger unit than was said; "
            "--units t=s"
        )
    return None


LENGTHS = (
    (2.4, 4.0, "x=mm y=mm", "the path is a thousand times as long as v says: x and y are in mm"),
    (1.5, 2.4, "x=cm y=cm", "the path is a hundred times as long as v says: x and y are in cm"),
    (-2.4, -1.5, "v=cm/s", "the path is a hundredth of what v says: v is in cm/s"),
    (-4.0, -2.4, "v=mm/s", "the path is a thousandth of what v says: v is in mm/s, or x, y in km"),
)
"""Powers of ten between which a factor of the speed lies, the option, and the reason."""


def length_unit(case: Case) -> str | None:
    """Displacements are a power of ten of what v gives, turns are not."""
    if not case.moves.sure or time_unit(case) or counted_rows(case):
        return None
    power = power_of(case.moves)
    for low, high, option, reason in LENGTHS:
        if low <= power < high and not (case.log.shares and abs(power) < 1.0):
            return f"{reason} (factor {abs(case.moves.factor):.3g}); --units {option}"
    if abs(power) >= 4.0:
        return (
            f"the path is {abs(case.moves.factor):.3g} times as long as v says: expected m and "
            "m/s (longitude and latitude are neither); --units x=... y=... v=..."
        )
    return None


TURNS = (
    (-1.22, -0.82, "omega=rpm", "turns come out at {:.2g} of omega: omega is in rpm"),
    (
        *(-2.7, -1.22, "omega=deg/s"),
        "turns come out at {:.2g} of omega, about pi / 180: omega is in degrees a second",
    ),
    (-30.0, -2.7, "omega=...", "turns come out at {:.2g} of omega: expected rad/s"),
    (
        *(1.15, 2.4, "theta=deg"),
        "turns are {:.3g} times what omega says, about 180 / pi: theta is in degrees",
    ),
    (2.4, 3.3, "theta=mrad", "turns are {:.3g} times what omega says: theta is in mrad"),
    (3.3, 4.2, "theta=cdeg", "turns are {:.3g} times what omega says: theta is in 1 / 100 degrees"),
    (4.2, 30.0, "theta=...", "turns are {:.3g} times what omega says: expected rad"),
)
"""Powers of ten between which a factor of the turns lies, the option, and the reason."""


def turn_unit(case: Case) -> str | None:
    """Turns are 57 times, or a 57th of, what omega gives."""
    if not case.turns.sure or time_unit(case) or counted_rows(case):
        return None
    power, factor = power_of(case.turns), abs(case.turns.factor)
    for low, high, option, reason in TURNS:
        if low <= power < high and not (case.degrees and option == "theta=deg"):
            return f"{reason.format(factor)}; --units {option}"
    return None


def counted_rows(case: Case) -> str | None:
    """Times that are 0, 1, 2, ..., though speeds say that a row takes no second."""
    steps = np.diff(case.log.poses.time)
    if not (case.moves.sure and case.turns.sure and len(steps) and (steps == 1.0).all()):
        return None
    seconds, other = abs(case.moves.factor), abs(case.turns.factor)
    if 0.5 < seconds < 2.0 or not 0.7 < seconds / other < 1.4:
        return None
    return (
        f"t counts rows: the speeds say that one takes about {seconds:.2g} s; "
        f"--units t={seconds:.2g}, or better what it is"
    )
