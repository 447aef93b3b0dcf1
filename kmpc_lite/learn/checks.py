"""What is suspect in a log, before anything is learned from it.

The factors by which a motion follows its commands tell units, its direction tells frames, and what
is left over tells whether heading, commands and motion belong together at all. A check is either
sure, for one reading fits several times better than every other, or silent. None depends on how
large or fast a robot is.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from math import degrees, radians
from typing import NamedTuple

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.lag import LONGEST as LATEST
from kmpc_lite.learn.logs import Log
from kmpc_lite.learn.motion import DEGREES, GOOD, TIMES, Match, Motion, gather, match, moving_sum
from kmpc_lite.learn.still import TURNED, find_still

OFFSET, SURE = 25.0, 4.0
"""Angle between motion and heading above which it is reported [degrees]; standard errors that make
it sure."""
PERIODS = (1e-4, 5.0)
"""Time between two rows of any log [s]."""
UNIT = 1.3
"""A factor is that of a unit within such a factor; a robot's own gains are no unit."""
USUAL = (0.25, 4.0)
"""Factors that a robot may have: slip, gears, a turn that skids."""


class Case(NamedTuple):
    """A log, its motion, and the reading of theta that fits."""

    log: Log
    motion: Motion
    moves: Match
    """Steps under that reading."""
    turns: Match
    """Turns under that reading."""
    sign: int
    """Of theta, that fits."""
    degrees: bool
    """Whether theta fits as degrees."""

    @property
    def period(self) -> float:
        """Between two rows, in the unit of t."""
        return self.motion.period

    @property
    def mirrored_path(self) -> bool:
        """Whether theta turns as commanded, so that x and y are what is mirrored."""
        return self.turns.sure and self.turns.factor.real * self.sign > 0.0


def make_case(log: Log, motion: Motion) -> Case:
    """Choose the reading of theta that fits: the given one, unless another is far better."""
    moves, turns = {}, {}
    for sign, as_degrees in product((1, -1), (False, True)):
        steps, turned = motion.turned(sign, as_degrees)
        moves[sign, as_degrees] = match(motion, steps, motion.asked[:, 0])
        turns[sign, as_degrees] = match(motion, turned, motion.asked[:, 1].real)
    best = max(moves, key=lambda key: moves[key].share)
    sign, as_degrees = best if moves[1, False].loses_to(moves[best].share) else (1, False)
    if as_degrees and not moves[sign, False].loses_to(moves[best].share):
        as_degrees = False
    if turns[1, False].loses_to(turns[1, True].share) and turns[1, True].sure:
        as_degrees = True
    plain = turns[1, False]
    if not moves[best].sure and plain.sure and _is_unit(abs(plain.factor), 1.0 / DEGREES):
        as_degrees = True
    key = (sign, as_degrees)
    return Case(log, motion, moves[key], turns[key], sign, as_degrees)


def _is_unit(factor: float, unit: float) -> bool:
    return unit / UNIT < factor < unit * UNIT


def heading_offset(case: Case) -> tuple[float, float]:
    """Direction of the motion off the heading, and how sure it is [rad].

    Turning moves a sensor that does not stand on the turning centre; that is regressed too.
    """
    motion, best = case.motion, case.moves
    late = max(0, round(best.lag))
    steps = motion.turned(case.sign, case.degrees)[0][late:]
    asked = np.where(motion.whole[:, None], motion.asked, 0.0)[: len(motion.asked) - late]
    x = np.column_stack([moving_sum(column, best.length) for column in asked.T])
    y = moving_sum(steps, best.length)
    size = np.sqrt(np.maximum((np.abs(x) ** 2).sum(axis=0), 1e-300))
    scaled = x / size
    weights, _, rank, _ = np.linalg.lstsq(scaled, y, rcond=1e-3)
    if rank < 2:
        return float(np.angle(best.factor)), 0.0 if size[1] <= 1e-150 else np.pi
    left = y - scaled @ weights
    count = max(len(y) / max(best.length, motion.change), 2.0)
    inverse = np.linalg.inv((scaled.conj().T @ scaled).real)
    spread = np.sqrt(np.vdot(left, left).real * inverse[0, 0] / count)
    return float(np.angle(weights[0])), float(spread / max(abs(weights[0]), 1e-300))


def theta_unit(case: Case) -> str:
    """What --units theta= is to be."""
    offset = degrees(heading_offset(case)[0]) if case.moves.sure else 0.0
    turned = case.sign < 0 and not case.mirrored_path
    unit = ("-" if turned else "") + ("deg" if case.degrees else "rad")
    if abs(offset) < OFFSET or (not turned and case.sign < 0):
        return unit
    near = 90.0 * round(offset / 90.0)
    angle = near if abs(offset - near) < 20.0 else offset
    return unit + (f"{angle:+.0f}" if case.degrees else f"{radians(angle):+.4f}")


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
    offset = degrees(heading_offset(case)[0])
    if not case.mirrored_path:
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
    """Positive omega lowers theta at whatever causal delay, and the path agrees with theta."""
    turns = case.turns
    if case.sign < 0 or not turns.sure or turns.factor.real > 0.0:
        return None
    if not turns._replace(share=turns.reverse).loses_to(turns.share):
        return None
    return (
        "omega > 0 lowers theta: either the poses are x north, y east, theta clockwise "
        "(--frame ned), or omega is clockwise (--units omega=-rad/s)"
    )


def rotated(case: Case) -> str | None:
    """The motion goes aside of the heading by a fixed angle."""
    if case.sign < 0 or not case.moves.sure or case.degrees:
        return None
    offset, error = heading_offset(case)
    plain = np.angle(case.moves.factor)
    if min(abs(degrees(offset)), abs(degrees(plain))) < OFFSET or abs(offset) < SURE * error:
        return None
    if abs(degrees(offset)) > 180.0 - OFFSET:
        if not case.moves._replace(share=case.moves.reverse).loses_to(case.moves.share):
            return None
        return (
            "v > 0 drives backwards, against theta: v has the other sign (--units v=-m/s), or "
            "theta is off by half a turn (--units theta=rad+3.1416)"
        )
    return (
        f"the robot drives {degrees(offset):+.0f} degrees off theta, always: theta is not the "
        f"direction of its nose; --units theta={theta_unit(case)}"
    )


def time_unit(case: Case) -> str | None:
    """Rows that follow each other as those of no log do."""
    if PERIODS[0] < case.period < PERIODS[1]:
        return None
    told = f"rows are {case.period:.3g} s apart"
    for unit, size in (("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)):
        if case.period > PERIODS[1] and PERIODS[0] <= size * case.period < PERIODS[1]:
            return f"{told}: t is in {unit}; --units t={unit}"
    if case.period < PERIODS[0]:
        return f"{told}: t is in a larger unit than was said; --units t=s"
    return f"{told}: t is hardly in s; --units t=..."


def _is_usual(match: Match) -> bool:
    return USUAL[0] < abs(match.factor) < USUAL[1]


def both_units(case: Case) -> str | None:
    """The robot moves and turns by the same strange factor: of t, or of both commands."""
    moves, turns = case.moves, case.turns
    if not (moves.sure and turns.sure) or _is_usual(moves) or time_unit(case):
        return None
    by, other = abs(moves.factor), abs(turns.factor)
    if not 0.5 < by / other < 2.0 or case.log.shares:
        return None
    if case.log.wheel_speeds:
        named = next(
            (f"{u}: --units left={u} right={u}" for u, s in SPEEDS.items() if _is_unit(by, s)),
            "--units left=rpm right=rpm --wheel-radius M, or left=rad/s, or what it is",
        )
        return (
            f"the wheels run {by:.3g} m for each unit of left and right in a second: they are not "
            f"in m/s; {named}"
        )
    return (
        f"the robot moves and turns by {by:.3g} of what v and omega say: t, or both of them, are "
        "in another unit (--units t=... or v=... omega=...)"
    )


SPEEDS = {"mm/s": 1e-3, "cm/s": 1e-2}
"""Units of speed that are a power of ten of m/s."""
LENGTHS_OF = {
    1e3: ("--units x=mm y=mm", "the path is a thousand times as long as v says: x and y are in mm"),
    1e2: ("--units x=cm y=cm", "the path is a hundred times as long as v says: x and y are in cm"),
    1e-2: ("--units v=cm/s", "the path is a hundredth of what v says: v is in cm/s"),
    1e-3: ("--units v=mm/s", "the path is a thousandth of what v says: v is in mm/s"),
}
"""Options and reasons by factors of the speed."""
TURNS_OF = {
    DEGREES: ("--units omega=deg/s", "about pi / 180: omega is in degrees a second"),
    np.pi / 30.0: ("--units omega=rpm", "about pi / 30: omega is in rpm"),
    1.0 / DEGREES: ("--units theta=deg", "about 180 / pi: theta is in degrees"),
    1e3: ("--units theta=mrad", "about 1000: theta is in mrad"),
}
"""The same of turns."""


def length_unit(case: Case) -> str | None:
    """Steps are another size than v gives, turns are not."""
    if not case.moves.sure or _is_usual(case.moves) or time_unit(case) or both_units(case):
        return None
    by, headers = abs(case.moves.factor), case.log.header_units
    if case.log.shares and 0.1 < by < 10.0:
        return None
    sides = [n for n in ("x", "y") if n in headers]
    if sides and case.turns.sure and _is_usual(case.turns):
        told = f"{', '.join(sides)} in {headers[sides[0]]}"
        other = "" if case.log.wheel_speeds else ", or v is in another unit (--units v=...)"
        return (
            f"the path is {by:.3g} times as long as v says: the header has {told}, which they "
            f"hardly are: --units x=m y=m{other}"
        )
    for unit, (option, reason) in LENGTHS_OF.items():
        if _is_unit(by, unit) and not case.log.wheel_speeds:
            return f"{reason} (factor {by:.3g}); {option}"
    return (
        f"the path is {by:.3g} times as long as v says: expected m and m/s (longitude and latitude "
        "are neither); --units x=... y=... v=..."
    )


def turn_unit(case: Case) -> str | None:
    """Turns are another size than omega gives, steps are not."""
    turns = case.turns
    if not turns.sure or turns.factor.real < 0.0 or time_unit(case) or both_units(case):
        return None
    by = abs(turns.factor)
    if _is_usual(turns) or (case.log.shares and 0.1 < by < 10.0):
        return None
    told = f"turns come out at {by:.3g} of omega"
    for unit, (option, reason) in TURNS_OF.items():
        if _is_unit(by, unit) and not (case.degrees and unit > 1.0):
            return f"{told}, {reason}; {option}"
    if case.log.wheel_speeds:
        return f"{told}, moves at {abs(case.moves.factor):.3g} of v: is --track right, in m?"
    return f"{told}: expected rad/s (deg/s: 0.0175, rpm: 0.105); --units omega=... theta=..."


def unrelated(case: Case) -> str | None:
    """Neither steps nor turns follow the commands."""
    seen = [m for m in (case.moves, case.turns) if m.chance < 1.0]
    # who always drives ahead is explained by that alone, whatever the commands were
    lost = case.turns.absent and np.ptp(np.unwrap(case.motion.theta)) > TURNED
    if not (lost or (seen and all(m.absent for m in seen))) or clocks_differ(case):
        return None
    shares = (f"{100.0 * max(m.share, 0.0):.0f} %" for m in (case.moves, case.turns))
    return (
        "the motion does not follow the commands, in no usual unit and at no delay: poses and "
        "commands of different drives, or other columns or topics than meant (--columns, "
        f"--topics); {case.log.commands.source} explains {' of the steps and '.join(shares)} of "
        "the turns"
    )


def clocks_differ(case: Case) -> str | None:
    """The motion comes before its command, at no delay behind it, or long after it."""
    if time_unit(case) or both_units(case):
        return None
    if (early := _early(case)) > AHEAD:
        return (
            f"the motion comes {early:.2f} s before its command: their clocks differ; "
            f"--shift {-early:.2f}"
        )
    late = _delay(case)
    if late is None or late < LATE:
        return None
    return (
        f"the motion comes {late:.2f} s after its command: their clocks differ; --shift {late:.2f}"
    )


AHEAD, LATE = 0.5, 2.5
"""So much before, and after, its command a motion is of another clock [s]."""


def _early(case: Case) -> float:
    """How long before its command the motion comes [s]; 0 if a delay explains it as well."""
    both = [m for m in (case.moves, case.turns) if max(m.share, m.early) > max(GOOD, m.chance)]
    best = max(both, key=lambda m: m.early - m.share, default=Match())
    ahead = any(1.0 - m.share > TIMES * (1.0 - m.early) for m in both)
    early = -best.early_lag * case.period
    sure = ahead and all(m.early > 0.95 * m.share for m in both) and early > 2.0 * case.period
    return early if sure else 0.0


def _delay(case: Case) -> float | None:
    """How long after its command the motion comes [s]; None if the log does not show it.

    A command that hardly changes explains the motion at any delay, so it tells none.
    """
    found = []
    for k, best in enumerate((case.moves, case.turns)):
        given = case.motion.asked[case.motion.whole, k]
        if best.sure and given.std() > 0.05 * np.abs(given).max(initial=0.0):
            found.append(best)
    if not found:
        return None
    return max(0.0, max(found, key=lambda m: m.share).lag * case.period)


CHECKS: dict[str, Callable[[Case], str | None]] = {
    "time": time_unit,
    "degrees": theta_in_degrees,
    "unrelated": unrelated,
    "frame": mirrored,
    "rotation": rotated,
    "turn direction": turns_the_other_way,
    "units": both_units,
    "length": length_unit,
    "turn rate": turn_unit,
    "clocks": clocks_differ,
}
"""By name, in the order in which they are reported."""


class Suspect(NamedTuple):
    """Something in a log that is hardly meant."""

    name: str
    """Of the check."""
    reason: str
    """What is wrong and which option mends it, in a line."""


class LogVerdict(NamedTuple):
    """Result of all checks of a log."""

    suspects: tuple[Suspect, ...]
    delay: float | None
    """How long after its command the motion comes [s]; None if the log does not show it."""
    notes: tuple[str, ...] = ()
    """What is doubtful of its delay."""

    def refuse(self, log: Log) -> None:
        """Refuse a log in which something is suspect.

        Raises
        ------
        DataError
            In one line, with the option that mends it.
        """
        if self.suspects:
            count = len(self.suspects) - 1
            more = f" ({count} more: kmpc inspect)" if count else ""
            raise DataError(
                f"{log.name}: {self.suspects[0].reason}{more}; --force learns from it as it is"
            )


def judge(log: Log) -> LogVerdict:
    """Look at a log with every check, in the order of `CHECKS`.

    Parameters
    ----------
    log : Log
        As it was read, with what the user said of units and frames.
    """
    if still := find_still(log):
        return LogVerdict((Suspect("still", still),), None)
    motion = gather(log)
    if motion is None:  # too short, or without overlap: cutting it into episodes says so
        return LogVerdict((), None)
    case = make_case(log, motion)
    found = [(name, check(case)) for name, check in CHECKS.items()]
    suspects = tuple(Suspect(name, reason) for name, reason in found if reason)
    notes = [
        f"ambiguous: the commands are periodic: {what} that come {m.lag * case.period:.2f} s and "
        f"{m.rival * case.period:.2f} s after them look alike"
        for what, m in (("steps", case.moves), ("turns", case.turns))
        if m.sure and m.rival is not None and not suspects
    ]
    early = 0.0 if suspects else _early(case)
    if early > 0.0:
        notes = [
            f"the motion precedes its command by {early:.2f} s, which is impossible; its delay "
            f"counts as zero. If the clocks differ: --shift {-early:.2f}"
        ]
    return LogVerdict(suspects, None if notes else _delay(case), tuple(notes[:1]))


TOO_LATE = 1.2
"""A motion that comes later than this many times what a model can know is refused."""


def tell_delay(delay: float, dt: float) -> str:
    """How long after its command the motion comes [s], and whether a model of period dt knows it.

    Examples
    --------
    >>> tell_delay(0.2, 0.1)
    'comes 0.20 s after its command'
    """
    told = f"comes {delay:.2f} s after its command"
    known = max(LATEST, dt)
    if delay <= known:
        return told
    return (
        f"{told}: later than the {known:.3g} s that a model with a period of {dt:.3g} s can know, "
        f"so it predicts badly; where it is the clocks that differ, --shift {delay:.2f}"
    )


def refuse_late(name: str, delay: float, dt: float) -> None:
    """Refuse a log, by its name, whose motion comes later [s] than a model of period dt can know.

    A robot that is driven by such a model does not see what it does, and runs into what it sees.

    Raises
    ------
    DataError
        With the options that mend it.
    """
    if delay > TOO_LATE * max(LATEST, dt):
        raise DataError(
            f"{name}: motion {tell_delay(delay, dt)}; where the robot is that late, --force learns "
            "all the same: do not drive by it"
        )
