"""Units: factors near powers of ten or near pi / 180 that no robot has."""

from __future__ import annotations

import numpy as np

from kmpc_lite.learn.checks.case import Case, power_of
from kmpc_lite.learn.checks.evidence import headings

GRIP = 15.0
"""Acceleration that no wheel can give, one and a half times gravity [m/s^2]."""
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
    (0.42, 0.62, "x=ft y=ft", "the path is three times as long as v says: x and y are in feet"),
    (-0.62, -0.5, "v=km/h", "the path is a quarter of what v says: v is in km/h"),
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


def beyond_grip(case: Case) -> str | None:
    """Both lengths and speeds are in mm: nothing on wheels takes such turns."""
    if not (case.moves.sure and case.turns.sure) or time_unit(case):
        return None
    motion, n = case.evidence.motion, max(case.moves.length, case.turns.length)
    seconds = motion.time[n:] - motion.time[:-n]
    good = seconds > 0.0
    if length_unit(case) or not good.any():
        return None
    speed = np.abs(motion.position[n:] - motion.position[:-n])[good] / seconds[good]
    turned = headings(motion, case.degrees)
    rate = np.abs(turned[n:] - turned[:-n])[good] / seconds[good]
    pull = float(np.quantile(speed * rate, 0.9))
    if pull < GRIP:
        return None
    return (
        f"the robot would be pulled aside by {pull:.0f} m/s^2 in its turns, more than wheels can "
        "hold: lengths and speeds are in mm (--units x=mm y=mm v=mm/s)"
    )
