"""Whether heading, commands and motion belong together, and their clocks agree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.checks.evidence import NOTHING, Evidence, examine
from kmpc_lite.learn.checks.readings import Case, percent, time_unit
from kmpc_lite.learn.cross_validation import SelectionOptions

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
    shares = f"{percent(case.moves)} of the displacements and {percent(case.turns)} of the turns"
    return (
        "the motion does not follow the commands, in no usual unit and at no delay: poses and "
        "commands of different drives, or other columns or topics than meant (--columns, "
        f"--topics); {case.log.commands.source} explains {shares}"
    )


def _with_exchanged(case: Case) -> Evidence:
    """What the motion shows where the first command is the turn and the second the speed."""
    motion = case.evidence.motion
    return examine(replace(motion, asked=motion.asked[:, ::-1]))


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
