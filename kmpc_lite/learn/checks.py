"""What is suspect in a log, before anything is learned from it.

The factors by which a motion follows its commands tell units, its direction tells frames, and what
is left over tells whether heading, commands and motion belong together at all. A check is either
sure, for one reading fits several times better than every other, or silent. None depends on how
large or fast a robot is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import degrees, radians
from typing import NamedTuple

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.lag import LONGEST
from kmpc_lite.learn.logs import ALIKE, Log, parse_units, reread
from kmpc_lite.learn.motion import DEGREES, GOOD, TIMES, Match, Motion, gather, match, moving_sum

OFFSET, SURE = 25.0, 4.0
"""Angle between motion and heading above which it is reported [degrees]; standard errors that make
it sure."""
PERIODS = (1e-4, 5.0)  # time between two rows of any log [s]
USUAL, OF_SHARES = (0.25, 4.0), (0.1, 10.0)
"""Factors that a robot may have of its own: slip, gears, a turn that skids; and one whose commands
are shares of what its motors can do."""
AHEAD, LATE, TOO_LATE = 0.5, 2.5, 1.2
"""So much before, and after, its command a motion is of another clock [s]; one that comes later
than so many times what a model can know is refused."""
TURNED = 1.0  # headings that a robot has taken whose x and y must both have changed [rad]


@dataclass(frozen=True)
class Case:
    """A log, its motion, and the reading of theta that fits."""

    log: Log
    motion: Motion
    moves: Match  # steps under that reading
    turns: Match  # turns under that reading
    sign: int  # of theta, that fits
    scale: float
    """Of theta, that fits: 1, or that of degrees; where it was read in those, of radians."""

    @classmethod
    def of(cls, log: Log, motion: Motion) -> Case:
        """Choose the reading of theta that fits: the given one, unless another is far better."""
        moves, turns = {}, {}
        read = abs(parse_units({"theta": log.units.get("theta", "rad")})["theta"].scale)
        other = DEGREES if read == 1.0 else 1.0 / read
        for sign, scale in product((1, -1), (1.0, other)):
            steps, turned = motion.turned(sign, scale)
            moves[sign, scale] = match(motion, steps, motion.asked[:, 0])
            turns[sign, scale] = match(motion, turned, motion.asked[:, 1].real)
        best = max(moves, key=lambda key: moves[key].share)
        sign, scale = best if moves[1, 1.0].loses_to(moves[best].share) else (1, 1.0)
        if scale != 1.0 and not moves[sign, 1.0].loses_to(moves[best].share):
            scale = 1.0
        plain, else_ = turns[1, 1.0], turns[1, other]
        if else_.sure and plain.loses_to(else_.share):
            scale = other
        alike = 1.0 / ALIKE < abs(plain.factor) * other < ALIKE
        if alike and plain.sure and not moves[best].sure:
            scale = other
        key = (sign, scale)
        return cls(log, motion, moves[key], turns[key], sign, scale)

    @property
    def period(self) -> float:
        """Between two rows, in the unit of t."""
        return self.motion.period

    @property
    def mirrored_path(self) -> bool:
        """Whether theta turns as commanded, so that x and y are what is mirrored."""
        return self.turns.sure and self.turns.factor.real * self.sign > 0.0

    def is_usual(self, match: Match) -> bool:
        """Whether a robot may have the factor by which its motion follows what was asked."""
        low, high = OF_SHARES if self.log.shares else USUAL
        return low < abs(match.factor) < high

    @cached_property
    def offset(self) -> tuple[float, float]:
        """Direction of the motion off the heading, and how sure it is [rad].

        Turning moves a sensor that does not stand on the turning centre; that is regressed too.
        """
        motion, best = self.motion, self.moves
        late = max(0, round(best.lag))
        steps = motion.turned(self.sign, self.scale)[0][late:]
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

    @property
    def theta_unit(self) -> str:
        """What mends theta."""
        offset = degrees(self.offset[0]) if self.moves.sure else 0.0
        turned = self.sign < 0 and not self.mirrored_path
        angle = 0.0
        if abs(offset) >= OFFSET and (turned or self.sign > 0):
            near = 90.0 * round(offset / 90.0)
            angle = near if abs(offset - near) < 20.0 else offset
        told = self.log.unit("theta", -self.scale if turned else self.scale, radians(angle))
        return f"--units {told}"

    @property
    def early(self) -> float:
        """How long before its command the motion comes [s]; 0 if a delay explains it as well."""
        both = [m for m in (self.moves, self.turns) if max(m.share, m.early) > max(GOOD, m.chance)]
        best = max(both, key=lambda m: m.early - m.share, default=Match())
        ahead = any(1.0 - m.share > TIMES * (1.0 - m.early) for m in both)
        early = -best.early_lag * self.period
        sure = ahead and all(m.early > 0.95 * m.share for m in both) and early > 2.0 * self.period
        return early if sure else 0.0

    @property
    def delay(self) -> float | None:
        """How long after its command the motion comes [s]; None if the log does not show it.

        A command that hardly changes explains the motion at any delay, so it tells none.
        """
        found = []
        for k, best in enumerate((self.moves, self.turns)):
            given = self.motion.asked[self.motion.whole, k]
            if best.sure and given.std() > 0.05 * np.abs(given).max(initial=0.0):
                found.append(best)
        return max(0.0, max(found, key=lambda m: m.share).lag * self.period) if found else None


def _time_unit(case: Case) -> str | None:
    """Rows that follow each other as those of no log do."""
    if PERIODS[0] < case.period < PERIODS[1]:
        return None
    told = f"rows are {case.period:.3g} s apart"
    if case.period < PERIODS[0]:
        return f"{told}: t is in a larger unit than was said; --units t=s"
    for unit, size in (("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)):
        if PERIODS[0] <= size * case.period < PERIODS[1]:
            return f"{told}: t is in {unit}; --units t={unit}"
    return f"{told}: t is hardly in s; --units t=..."


def _theta_unit(case: Case) -> str | None:
    """Headings that make sense in another unit only."""
    if case.scale == 1.0:
        return None
    unit = "degrees" if case.scale < 1.0 else "radians"
    return (
        f"theta is in {unit}: the robot moves along it, and turns as commanded, only if read so; "
        f"{case.theta_unit}"
    )


def _unrelated(case: Case) -> str | None:
    """Neither steps nor turns follow the commands."""
    seen = [m for m in (case.moves, case.turns) if m.chance < 1.0]
    # who always drives ahead is explained by that alone, whatever the commands were
    lost = case.turns.absent and np.ptp(np.unwrap(case.motion.theta)) > TURNED
    lost = lost or bool(seen and all(m.absent for m in seen))
    if not lost or _clocks_differ(case):
        return None
    shares = (f"{100.0 * max(m.share, 0.0):.0f} %" for m in (case.moves, case.turns))
    return (
        "the motion does not follow the commands, in no usual unit and at no delay: poses and "
        "commands of different drives, or other columns or topics than meant (--columns, "
        f"--topics); {case.log.commands.source} explains {' of the steps and '.join(shares)} of "
        "the turns"
    )


def _mirrored(case: Case) -> str | None:
    """The path is that of the mirrored heading."""
    if case.sign > 0:
        return None
    offset = degrees(case.offset[0])
    if not case.turns.sure:
        other = f", or y has the other sign (--units {case.log.unit('y', -1.0)})"
        other = other if abs(offset) < OFFSET else ""
        return f"the path is seen in a mirror: theta is clockwise ({case.theta_unit}){other}"
    if not case.mirrored_path:
        compass = ": a compass's, clockwise from north" if 60.0 < offset < 120.0 else ""
        return (
            f"theta turns the other way than the path: it is clockwise{compass}; {case.theta_unit}"
        )
    what, option = {
        0: ("y has the other sign", f"--units {case.log.unit('y', -1.0)}"),
        2: ("x has the other sign", f"--units {case.log.unit('x', -1.0)}"),
    }.get(round(offset / 90.0) % 4, ("x and y are exchanged", "--frame swapped"))
    return f"the path is seen in a mirror, though theta turns as commanded: {what}; {option}"


def _rotated(case: Case) -> str | None:
    """The motion goes aside of the heading by a fixed angle."""
    if case.sign < 0 or not case.moves.sure or case.scale != 1.0:
        return None
    offset, error = case.offset
    plain = np.angle(case.moves.factor)
    if min(abs(degrees(offset)), abs(degrees(plain))) < OFFSET or abs(offset) < SURE * error:
        return None
    if abs(degrees(offset)) <= 180.0 - OFFSET:
        return (
            f"the robot drives {degrees(offset):+.0f} degrees off theta, always: theta is not the "
            f"direction of its nose; {case.theta_unit}"
        )
    if not case.moves._replace(share=case.moves.reverse).loses_to(case.moves.share):
        return None
    return (
        "v > 0 drives backwards, against theta: v has the other sign (--units "
        f"{case.log.unit('v', -1.0)}), or theta is off by half a turn (--units "
        f"{case.log.unit('theta', 1.0, np.pi)})"
    )


def _turns_the_other_way(case: Case) -> str | None:
    """Positive omega lowers theta at whatever causal delay, and the path agrees with theta."""
    turns = case.turns
    backwards = case.sign > 0 and turns.sure and turns.factor.real <= 0.0
    if not backwards or not turns._replace(share=turns.reverse).loses_to(turns.share):
        return None
    if case.log.wheel_speeds:
        return (
            "the robot turns to the side whose wheel is faster: left and right are exchanged; "
            "--columns left=... right=..."
        )
    return (
        "omega > 0 lowers theta: either the poses are x north, y east, theta clockwise "
        f"(--frame ned), or omega is clockwise (--units {case.log.unit('omega', -1.0)})"
    )


def _both_units(case: Case) -> str | None:
    """The robot moves and turns by the same strange factor: of t, or of both commands."""
    moves, turns = case.moves, case.turns
    if not (moves.sure and turns.sure) or case.is_usual(moves) or _time_unit(case):
        return None
    by, other = abs(moves.factor), abs(turns.factor)
    if not 0.5 < by / other < 2.0 or case.log.shares:
        return None
    if case.log.steered:
        unit = case.log.unit("v", by) or f"v={by:.3g}, the size of its unit [m/s]"
        return f"the car drives {by:.3g} of what v says: --units {unit}"
    if not case.log.wheel_speeds:
        return (
            f"the robot moves and turns by {by:.3g} of what v and omega say: t, or both of them, "
            "are in another unit (--units t=... or v=... omega=...)"
        )
    named = "--units left=rpm right=rpm --wheel-radius M, or left=rad/s, or what it is"
    if by < 0.1 and (told := reread("v", None, by)):
        named = f"{told}: --units left={told} right={told}"
    return (
        f"the wheels run {by:.3g} m for each unit of left and right in a second: they are not "
        f"in m/s; {named}"
    )


def _every_unit(log: Log, columns: Iterable[str], factor: float) -> str | None:
    """Options that make of each column `factor` times what it was; None without a unit of one."""
    told = [log.unit(n, factor) for n in columns]
    return None if None in told else " ".join(map(str, told))


def _length_unit(case: Case) -> str | None:
    """Steps are another size than v gives, turns are not."""
    if not case.moves.sure or case.is_usual(case.moves) or _time_unit(case) or _both_units(case):
        return None
    by, told, wheels = abs(case.moves.factor), case.log.units, case.log.wheel_speeds
    longer = f"the path is {by:.3g} times as long as v says"
    ways = [n for n in ("v", "lateral") if n in case.log.columns]
    places = _every_unit(case.log, "xy", 1.0 / by)
    speed = None if wheels else _every_unit(case.log, ways, by)
    read = [f"{n} was read in {told[n]}" for n in ("x", "y", "v", "lateral") if n in told]
    meant = read and places and not places.startswith("x=km")
    if meant and case.turns.sure and case.is_usual(case.turns):
        other = f", or --units {speed}" if speed else ""
        return f"{longer}: {', '.join(read)}; --units {places}{other}"
    option, what = (places, "x and y are") if by > 1.0 else (speed, "v is")
    if option and not wheels and not read:
        return f"{longer}: {what} in {option.split()[0].partition('=')[2]}; --units {option}"
    return (
        f"{longer}: expected m and m/s (longitude and latitude are neither); --units x=... y=... "
        "v=..."
    )


def _turn_unit(case: Case) -> str | None:
    """Turns are another size than omega gives, steps are not."""
    turns = case.turns
    if not turns.sure or turns.factor.real < 0.0 or case.is_usual(turns):
        return None
    if _time_unit(case) or _both_units(case):
        return None
    by = abs(turns.factor)
    told = f"turns come out at {by:.3g} of omega"
    if case.log.wheel_speeds:
        return f"{told}, moves at {abs(case.moves.factor):.3g} of v: is --track right, in m?"
    # steps along theta tell that it is read as it should be
    if (unit := case.log.unit("omega", by)) and (case.moves.sure or by < 1.0):
        return f"{told}: it is in {unit.partition('=')[2]}; --units {unit}"
    if case.scale == 1.0 and (unit := case.log.unit("theta", 1.0 / by)):
        return f"{told}: theta is in {unit.partition('=')[2]}; --units {unit}"
    return f"{told}: expected rad/s (deg/s: 0.0175, rpm: 0.105); --units omega=... theta=..."


def _clocks_differ(case: Case) -> str | None:
    """The motion comes before its command, at no delay behind it, or long after it."""
    if _time_unit(case) or _both_units(case):
        return None
    if (early := case.early) > AHEAD:
        told, shift = f"{early:.2f} s before", -early
    elif (late := case.delay) is not None and late >= LATE:
        told, shift = f"{late:.2f} s after", late
    else:
        return None
    return f"the motion comes {told} its command: their clocks differ; --shift {shift:.2f}"


CHECKS: tuple[Callable[[Case], str | None], ...] = (
    _time_unit,
    _theta_unit,
    _unrelated,
    _mirrored,
    _rotated,
    _turns_the_other_way,
    _both_units,
    _length_unit,
    _turn_unit,
    _clocks_differ,
)
"""In the order in which they are reported."""


class LogVerdict(NamedTuple):
    """Result of all checks of a log."""

    suspects: tuple[str, ...]  # what is hardly meant and which option mends it, in a line each
    delay: float | None = None
    """How long after its command the motion comes [s]; None if the log does not show it."""
    notes: tuple[str, ...] = ()  # what is doubtful of its delay

    def refuse(self, log: Log) -> None:
        """Refuse a log in which something is suspect.

        Raises DataError: in one line, with the option that mends it.
        """
        if self.suspects:
            count = len(self.suspects) - 1
            more = f" ({count} more: kmpc inspect)" if count else ""
            told = f"{log.name}: {self.suspects[0]}{more}"
            raise DataError(f"{told}; --force learns from it as it is")


def judge(log: Log) -> LogVerdict:
    """Look at a log with every check, in the order of `CHECKS`.

    `log`: as it was read, with what the user said of units and frames.
    """
    if still := _find_still(log):
        return LogVerdict((still,))
    motion = gather(log)
    if motion is None:  # too short, or without overlap: cutting it into episodes says so
        return LogVerdict(())
    if np.iscomplexobj(motion.asked) and (told := _find_aside(log, motion)):
        return LogVerdict((told,))
    case = Case.of(log, motion)
    if suspects := tuple(reason for check in CHECKS if (reason := check(case))):
        return LogVerdict(suspects, case.delay)
    notes = [
        f"ambiguous: the commands are periodic: {what} that come {m.lag * case.period:.2f} s and "
        f"{m.rival * case.period:.2f} s after them look alike"
        for what, m in (("steps", case.moves), ("turns", case.turns))
        if m.sure and m.rival is not None
    ]
    if (early := case.early) > 0.0:
        notes = [
            f"the motion precedes its command by {early:.2f} s, which is impossible; its delay "
            f"counts as zero. If the clocks differ: --shift {-early:.2f}"
        ]
    return LogVerdict((), None if notes else case.delay, tuple(notes[:1]))


def tell_delay(delay: float, dt: float) -> str:
    """How long after its command the motion comes [s], and whether a model of period dt knows it.

    Examples
    --------
    >>> tell_delay(0.2, 0.1)
    'comes 0.20 s after its command'
    """
    told, known = f"comes {delay:.2f} s after its command", max(LONGEST, dt)
    if delay <= known:
        return told
    return (
        f"{told}: later than the {known:.3g} s that a model with a period of {dt:.3g} s can know, "
        f"so it predicts badly; where it is the clocks that differ, --shift {delay:.2f}"
    )


def refuse_late(name: str, delay: float, dt: float) -> None:
    """Refuse a log, by its name, whose motion comes later [s] than a model of period dt can know.

    A robot that is driven by such a model does not see what it does, and runs into what it sees.

    Raises DataError with the options that mend it.
    """
    if delay > TOO_LATE * max(LONGEST, dt):
        raise DataError(
            f"{name}: motion {tell_delay(delay, dt)}; where the robot is that late, --force learns "
            "all the same: do not drive by it"
        )


NEVER_MOVES = (
    "the poses never move though the commands do, so the log does not excite the model: expected "
    "x, y, theta of the driving robot"
)


def _find_aside(log: Log, motion: Motion) -> str | None:
    """What is wrong with an omni's two speeds where they fit otherwise, and only so."""

    def mended(column: str) -> str:
        return f"--units {log.unit(column, -1.0)}"

    asked, (here, _), (seen, _) = motion.asked[:, 0], motion.turned(1, 1.0), motion.turned(-1, 1.0)
    flat = match(motion, np.where(motion.whole, motion.steps, 0.0), asked)
    aside, mirrored = match(motion, here, asked.conj()), match(motion, seen, asked.conj())
    best = max(flat, aside, mirrored, key=lambda m: m.share)
    if not match(motion, here, asked).loses_to(best.share):
        return None
    if best is flat:
        return (
            "v and lateral are speeds along the map's x and y: expected those ahead of the robot "
            "and to its left, as commanded (--columns v=... lateral=... omega=...)"
        )
    quarter = round(abs(np.angle(best.factor)) / (0.5 * np.pi))
    if best is mirrored:
        way = (mended("y"), "--frame swapped", mended("x"))[quarter]
        return f"the path is seen in a mirror, though theta turns as it should: {way}"
    return (
        f"lateral > 0 drives to the right: {mended('lateral')}",
        "v and lateral are exchanged: --columns v=... lateral=...",
        f"v > 0 drives backwards: {mended('v')}",
    )[quarter]


def _find_still(log: Log) -> str | None:
    """Whether nothing moves or turns, or nothing is asked for."""
    asked = np.abs(log.commands.values).max(axis=0)
    if asked.max() == 0.0:
        return f"all commands are 0 ({log.commands.source}): expected v and omega of a drive"
    spans = np.ptp(log.poses.values, axis=0)
    still, meant = spans <= 1e-9, "another column or topic was meant (--columns, --topics)"
    if still.all():
        return NEVER_MOVES
    if still[:2].all() and asked[0] > 0.0:
        return f"x and y never change though v is asked for and theta changes: {meant}"
    if still[:2].any() and spans[2] > TURNED:
        name = "xy"[int(still[1])]
        return (
            f"{name} never changes though the robot drives and turns: another column was meant "
            f"for {name}, or the ground is another plane of a camera's frame (--columns)"
        )
    if still[2] and asked[1] > 0.0:
        return f"theta never changes though omega is asked for and the robot moves: {meant}"
    return None
