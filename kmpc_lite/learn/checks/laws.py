"""What is suspect in a log, before anything is learned from it: the one list of checks.

Each check takes what the log shows and gives a line with the reason and the option that mends it,
or None. They rest on how a wheeled robot moves, never on how large or fast it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import degrees, log10
from typing import NamedTuple

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.checks.evidence import (
    LAGS,
    NOTHING,
    Evidence,
    Explained,
    examine,
    heading_offset,
    headings,
)
from kmpc_lite.learn.checks.motion import gather
from kmpc_lite.learn.logs import Log
from kmpc_lite.types import Array

BETTER = 0.6
"""A reading of theta that explains less than this share of what another explains is wrong."""
FITS = 0.3
"""Share that the better reading has to explain."""
OFFSET = 25.0
"""Direction of the motion off the heading from which on it is told [degrees]."""
SURE = 4.0
"""Standard errors that make a direction sure."""
GRIP = 30.0
"""Acceleration that no wheel can give, three times gravity [m/s^2]."""
AHEAD, BEHIND = 0.3, 2.5
"""How far a motion may come before its command, and after it [s]."""
NOISE = 3.0
"""An expected motion is seen where a tenth of it is this many times its measurement's noise."""
PLAUSIBLE_PERIODS = (2e-4, 20.0)
"""Between the rows of a log [s]."""


class Suspect(NamedTuple):
    """Something in a log that cannot be meant."""

    name: str
    """Of the check."""
    reason: str
    """What is wrong and which option mends it, in a line."""


class Case(NamedTuple):
    """What the checks look at."""

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


def find_suspects(log: Log) -> list[Suspect]:
    """Look at a log with every check, in the order of `CHECKS`.

    Parameters
    ----------
    log : Log
        As it was read, with what the user said of units and frames.
    """
    still = find_still(log)
    if still:
        return [Suspect("still", still)]
    motion = gather(log)
    if motion is None:
        return []  # too short, or without overlap: cutting it into episodes says so
    case = _case(log, examine(motion))
    found = [(name, check(case)) for name, check in CHECKS.items()]
    return [Suspect(name, reason) for name, reason in found if reason]


def refuse_suspects(log: Log) -> None:
    """Refuse a log in which something is suspect.

    Raises
    ------
    DataError
        In one line, with the option that mends it.
    """
    found = find_suspects(log)
    if found:
        more = f" ({len(found) - 1} more: kmpc inspect)" if len(found) > 1 else ""
        raise DataError(f"{log.name}: {found[0].reason}{more}; --force learns from it as it is")


def find_still(log: Log) -> str | None:
    """Whether nothing moves or turns, or nothing is asked for."""
    moved = float(np.ptp(log.poses.values, axis=0).max())
    asked = float(np.abs(log.commands.values).max())
    if asked == 0.0:
        return f"all commands are 0 ({log.commands.source}): expected v and omega of a drive"
    if moved <= 1e-9:
        return (
            "the poses never move though the commands do, so the log does not excite the model: "
            "expected x, y, theta of the driving robot"
        )
    turned = float(np.ptp(log.poses.values[:, 2]))
    if turned <= 1e-9 and np.abs(log.commands.values[:, 1]).max() > 0.0:
        return (
            "theta never changes though omega is asked for and the robot moves: another column or "
            "topic was meant (--columns, --topics)"
        )
    return None


def _case(log: Log, evidence: Evidence) -> Case:
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
    elif turns[False].sure and 1.15 < _power(turns[False]) < 2.4 and not best.sure:
        as_degrees = True
    return Case(log, evidence, moves[sign, as_degrees], turns[as_degrees], sign, as_degrees)


def _power(explained: Explained) -> float:
    """Power of ten of a factor."""
    return log10(max(abs(explained.factor), 1e-30))


def _unrelated(case: Case) -> str | None:
    """Neither displacements nor turns follow the commands."""
    seen = [e for e in (case.moves, case.turns) if e is not NOTHING]
    if not seen or any(e.sure for e in seen):
        return None
    if _exchanged(case):
        return (
            "the motion follows the commands only with v and omega exchanged: --columns v=NAME "
            "omega=NAME says which is which"
        )
    shift = _find_shift(case)
    if shift is not None:
        return (
            f"the motion fits the commands only if those are moved by {shift:+.2f} s: their clocks "
            f"differ; --shift {shift:.2f}"
        )
    return (
        "the motion does not follow the commands, in no unit and at no delay: poses and commands "
        f"of different drives, or other columns or topics than meant (--columns, --topics); "
        f"{case.log.commands.source} explains {_percent(case.moves)} of the displacements and "
        f"{_percent(case.turns)} of the turns"
    )


def _exchanged(case: Case) -> bool:
    """Whether the first command is the turn and the second the speed."""
    motion = case.evidence.motion
    other = examine(replace(motion, asked=motion.asked[:, ::-1]))
    return other.moves[1, False].sure and other.turns[False].sure


def _percent(explained: Explained) -> str:
    """A share in words."""
    return f"{100.0 * max(explained.share, 0.0):.0f} %"


def _seen(case: Case, channel: int, length: int = 32) -> bool:
    """Whether a tenth of what is asked in a channel would be seen above the poses' noise."""
    motion = case.evidence.motion
    asked = motion.asked[:, channel]
    moved = motion.position if channel == 0 else headings(motion, case.degrees)
    if len(asked) < 4 * length:
        return False
    expected = 0.1 * np.sqrt(np.mean((asked[length:] - asked[:-length]) ** 2))
    bends = moved[2:] - 2.0 * moved[1:-1] + moved[:-2]
    noise = np.median(np.abs(bends)) / 1.65  # of a pose; its share of a bend is sqrt(6)
    return bool(expected > NOISE * noise)


def _heading_is_other(case: Case) -> str | None:
    """One of the two fits, the other does not though it would be seen."""
    if case.moves.sure and not case.turns.sure and _seen(case, 1) and _varies(case, 1):
        return (
            f"the heading does not follow omega ({_percent(case.turns)} of the turns are "
            "explained), though the positions follow v: another column or topic was meant for "
            "theta or omega (--columns, --topics)"
        )
    if case.turns.sure and not case.moves.sure and _seen(case, 0) and _varies(case, 0):
        return (
            "the positions move neither along the heading nor across it "
            f"({_percent(case.moves)} explained), though theta follows omega: x, y and theta are "
            "not of one frame, or v is not the speed (--columns, --topics, --units)"
        )
    return None


def _varies(case: Case, channel: int) -> bool:
    """Whether a command is given for a good part of the log, and is not always the same."""
    values = np.abs(case.log.commands.values[:, channel])
    largest = values.max()
    return bool((values > 0.1 * largest).mean() > 0.1 and values.std() > 0.05 * largest)


def _theta_is_in_degrees(case: Case) -> str | None:
    """Headings that make sense as degrees only."""
    if not case.degrees:
        return None
    return (
        "theta is in degrees: the robot moves along it, and turns as told, only if read so; "
        f"--units theta={_theta_unit(case)}"
    )


def _theta_unit(case: Case) -> str:
    """What --units theta= is to be."""
    offset, _ = heading_offset(case.evidence) if case.moves.sure else (0.0, 0.0)
    turned = case.sign < 0 and not _positions_mirrored(case)
    unit = ("-" if turned else "") + ("deg" if case.degrees else "rad")
    if abs(degrees(offset)) < OFFSET or not turned and case.sign < 0:
        return unit
    near = 90.0 * round(degrees(offset) / 90.0)
    angle = near if abs(degrees(offset) - near) < 20.0 else degrees(offset)
    return unit + (f"{angle:+.0f}" if case.degrees else f"{np.radians(angle):+.4f}")


def _positions_mirrored(case: Case) -> bool:
    """Whether theta turns as told, so that x and y are what is mirrored."""
    return case.turns.sure and case.turns.factor.real > 0.0


def _is_mirrored(case: Case) -> str | None:
    """The path is that of the mirrored heading."""
    if case.sign > 0:
        return None
    offset = degrees(heading_offset(case.evidence)[0])
    if not _positions_mirrored(case):
        compass = ": a compass's, clockwise from north" if 60.0 < offset < 120.0 else ""
        return (
            f"theta turns the other way than the path: it is clockwise{compass}; "
            f"--units theta={_theta_unit(case)}"
        )
    quarter = round(offset / 90.0) % 4
    option = {0: "--units y=-m", 2: "--units x=-m"}.get(quarter, "--frame swapped")
    what = {0: "y has the other sign", 2: "x has the other sign"}.get(
        quarter, "x and y are exchanged"
    )
    return f"the path is seen in a mirror, though theta turns as told: {what}; {option}"


def _turns_the_other_way(case: Case) -> str | None:
    """Positive omega lowers theta, and the path agrees with theta."""
    if case.sign < 0 or not case.turns.sure or case.turns.factor.real > 0.0:
        return None
    return (
        "omega > 0 lowers theta: either the poses are x north, y east, theta clockwise "
        "(--frame ned), or omega is clockwise (--units omega=-rad/s)"
    )


def _is_rotated(case: Case) -> str | None:
    """The motion goes aside of the heading by a fixed angle."""
    if case.sign < 0 or not case.moves.sure or case.degrees:
        return None
    offset, error = heading_offset(case.evidence)
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
        f"direction of its nose; --units theta={_theta_unit(case)}"
    )


def _time_unit(case: Case) -> str | None:
    """Displacements and turns are both a thousandth, or less, of what speed times time gives."""
    powers = [_power(e) for e in (case.moves, case.turns) if e.sure]
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
    return None


LENGTHS = (
    (2.4, 4.0, "x=mm y=mm", "the path is a thousand times as long as v says: x and y are in mm"),
    (1.5, 2.4, "x=cm y=cm", "the path is a hundred times as long as v says: x and y are in cm"),
    (-2.4, -1.5, "v=cm/s", "the path is a hundredth of what v says: v is in cm/s"),
    (-4.0, -2.4, "v=mm/s", "the path is a thousandth of what v says: v is in mm/s, or x, y in km"),
)
"""Powers of ten between which a factor of the speed lies, the option, and the reason."""


def _length_unit(case: Case) -> str | None:
    """Displacements are a power of ten of what v gives, turns are not."""
    if not case.moves.sure or _time_unit(case):
        return None
    power = _power(case.moves)
    for low, high, option, reason in LENGTHS:
        if low <= power < high:
            return f"{reason} (factor {abs(case.moves.factor):.3g}); --units {option}"
    if abs(power) >= 4.0:
        return (
            f"the path is {abs(case.moves.factor):.3g} times as long as v says: expected m and "
            "m/s; --units x=... y=... v=..."
        )
    return None


def _turn_unit(case: Case) -> str | None:
    """Turns are 57 times, or a 57th of, what omega gives."""
    if not case.turns.sure or _time_unit(case):
        return None
    power, factor = _power(case.turns), abs(case.turns.factor)
    if -2.7 < power < -1.3:
        return (
            f"turns come out at {factor:.2g} of omega, about pi / 180: omega is in degrees a "
            "second; --units omega=deg/s"
        )
    if power >= 1.15 and not case.degrees:
        return (
            f"turns are {factor:.3g} times what omega says, about 180 / pi: theta is in degrees; "
            "--units theta=deg"
        )
    if power <= -2.7:
        return f"turns come out at {factor:.2g} of omega: expected rad/s; --units omega=..."
    return None


def _grip(case: Case) -> str | None:
    """Both lengths and speeds are in mm: nothing on wheels takes such turns."""
    if not (case.moves.sure and case.turns.sure) or _time_unit(case):
        return None
    motion, n = case.evidence.motion, max(case.moves.length, case.turns.length)
    seconds = motion.time[n:] - motion.time[:-n]
    good = seconds > 0.0
    if _length_unit(case) or not good.any():
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


def _clocks(case: Case) -> str | None:
    """The motion comes before its command, or long after it."""
    delay = delay_of(case.evidence)
    if delay is None or _time_unit(case):
        return None
    early = delay < -AHEAD and delay < -2.0 * case.evidence.motion.period
    if not early and delay < BEHIND:
        return None
    when = "before" if early else "after"
    return (
        f"the motion comes {abs(delay):.2f} s {when} its command: their clocks differ; "
        f"--shift {delay:.2f}"
    )


def delay_of(evidence: Evidence) -> float | None:
    """How long after its command the motion comes [s], where the log's time is in s."""
    return evidence.delay


def _find_shift(case: Case) -> float | None:
    """Seconds by which the commands are to be moved to fit the motion, or None."""
    motion = case.evidence.motion
    seen = [
        _peak(np.abs(np.diff(motion.position)), np.abs(np.diff(motion.asked[:, 0]))),
        _peak(np.diff(headings(motion, case.degrees)), np.diff(motion.asked[:, 1])),
    ]
    height, rows = max(seen)
    return rows * motion.period if height > 0.6 and abs(rows) > LAGS[-1] // 2 else None


def _peak(moved: Array, asked: Array) -> tuple[float, int]:
    """Largest correlation of two series (n,), and the rows by which the second comes earlier."""
    a, b = moved - moved.mean(), asked - asked.mean()
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    if size <= 0.0:
        return 0.0, 0
    alike = np.fft.irfft(np.fft.rfft(a, 2 * len(a)) * np.conj(np.fft.rfft(b, 2 * len(b))))
    at = int(np.argmax(alike))
    return float(alike[at]) / size, at if at < len(a) else at - 2 * len(a)


CHECKS: dict[str, Callable[[Case], str | None]] = {
    "time": _time_unit,
    "degrees": _theta_is_in_degrees,
    "unrelated": _unrelated,
    "frame": _is_mirrored,
    "rotation": _is_rotated,
    "turn direction": _turns_the_other_way,
    "length": _length_unit,
    "turn rate": _turn_unit,
    "other source": _heading_is_other,
    "grip": _grip,
    "clocks": _clocks,
}
"""By name, in the order in which they are told."""
