"""Whether heading, commands and motion belong together, and their clocks agree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.checks.evidence import LAGS, NOTHING, Evidence, examine, headings
from kmpc_lite.learn.checks.readings import Case, is_seen, percent, time_unit, varies
from kmpc_lite.learn.cross_validation import SelectionOptions
from kmpc_lite.types import Array

AHEAD, BEHIND = 0.5, 2.5
"""How far a motion may come before its command, and after it [s]."""

WHEELS = 0.7
"""Share of the turns that omega explains where it is one, and a wheel's speed does not."""


def wheel_speeds(case: Case) -> str | None:
    """Sum and difference of the commands explain what the commands do not: those of two wheels."""
    motion = case.evidence.motion
    if np.iscomplexobj(motion.asked) or (case.turns.sure and case.turns.share > WHEELS):
        return None
    left, right = motion.asked.T
    other = examine(replace(motion, asked=np.column_stack([left + right, right - left])))
    moves, turns = other.moves[case.reading], other.turns[case.degrees]
    if not (moves.sure and turns.sure and turns.share > WHEELS and moves.share > case.moves.share):
        return None
    if _with_exchanged(case).turns[case.degrees].share > turns.share:
        return None
    return (
        "the robot drives by the sum of v and omega and turns by their difference: they are the "
        "speeds of two wheels; --columns left=NAME right=NAME --track M"
    )


def unrelated(case: Case) -> str | None:
    """Neither displacements nor turns follow the commands."""
    seen = [e for e in (case.moves, case.turns) if e is not NOTHING]
    if not seen or not all(e.absent for e in seen):
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
    shares = f"{percent(case.moves)} of the displacements and {percent(case.turns)} of the turns"
    return (
        "the motion does not follow the commands, in no usual unit and at no delay: poses and "
        "commands of different drives, or other columns or topics than meant (--columns, "
        f"--topics); {case.log.commands.source} explains {shares}"
    )


def _exchanged(case: Case) -> bool:
    """Whether the first command is the turn and the second the speed."""
    other = _with_exchanged(case)
    return other.moves[1, False].sure and other.turns[False].sure


def _with_exchanged(case: Case) -> Evidence:
    """What the motion shows where the first command is the turn and the second the speed."""
    motion = case.evidence.motion
    return examine(replace(motion, asked=motion.asked[:, ::-1]))


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


def other_source(case: Case) -> str | None:
    """One of the two fits, the other does not though it would be seen."""
    if case.moves.sure and case.turns.absent and is_seen(case, 1) and varies(case, 1):
        return (
            f"the heading does not follow omega ({percent(case.turns)} of the turns are "
            "explained), though the positions follow v: another column or topic was meant for "
            "theta or omega (--columns, --topics)"
        )
    if case.turns.sure and case.moves.absent and is_seen(case, 0) and varies(case, 0):
        return (
            "the positions move neither along the heading nor across it "
            f"({percent(case.moves)} explained), though theta follows omega: x, y and theta are "
            "not of one frame, or v is not the speed (--columns, --topics, --units)"
        )
    return None


def clocks_differ(case: Case) -> str | None:
    """The motion comes before its command, or long after it."""
    delay = case.evidence.delay
    if delay is None or time_unit(case):
        return None
    early = delay < -AHEAD and delay < -2.0 * case.evidence.motion.period
    if not early and delay < BEHIND:
        return None
    when = "before" if early else "after"
    return (
        f"the motion comes {abs(delay):.2f} s {when} its command: their clocks differ; "
        f"--shift {delay:.2f}"
    )


TOO_LATE = 1.2
"""A motion that comes later than this many times what a model can know is refused."""


def is_early(delay: float, dt: float) -> bool:
    """Whether a motion comes before its command by more than a period [s]."""
    return delay < -dt


def tell_delay(delay: float, dt: float) -> str:
    """How long after its command the motion comes [s], and whether a model can know that.

    Parameters
    ----------
    delay : float
        As the log shows it [s].
    dt : float
        The model's period [s].
    """
    if is_early(delay, dt):
        return (
            f"precedes its command by {-delay:.2f} s, which is impossible; delay set to zero. If "
            f"the clocks differ: --shift {delay:.2f}"
        )
    told = f"comes {delay:.2f} s after its command"
    known = SelectionOptions().longest_history(dt) * dt
    if delay <= known:
        return told
    return (
        f"{told}: later than the {known:.3g} s that a model with a period of {dt:.3g} s can know, "
        f"so it predicts badly; where it is the clocks that differ, --shift {delay:.2f}"
    )


def refuse_late(name: str, delay: float, dt: float) -> None:
    """Refuse a log whose motion comes later than any model can know.

    A robot that is driven by such a model does not see what it does, and runs into what it sees.

    Parameters
    ----------
    name : str
        Of the log.
    delay : float
        As the log shows it [s].
    dt : float
        The model's period [s].

    Raises
    ------
    DataError
        With the options that mend it.
    """
    options = SelectionOptions()
    if delay > TOO_LATE * max(options.longest, options.longest_history(dt) * dt):
        raise DataError(
            f"{name}: motion {tell_delay(delay, dt)}; where the robot is that late, --force learns "
            "all the same: do not drive by it"
        )
