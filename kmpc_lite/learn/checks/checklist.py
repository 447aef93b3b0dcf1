"""What is suspect in a log, before anything is learned from it: the one list of checks.

Each check takes what the log shows and gives a line with the reason and the option that mends it,
or None. They rest on how a wheeled robot moves, never on how large or fast it is. Drives that no
model can be made of are refused however they were read.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.checks.evidence import examine
from kmpc_lite.learn.checks.motion import gather
from kmpc_lite.learn.checks.readings import (
    Case,
    counted_rows,
    length_unit,
    make_case,
    mirrored,
    rotated,
    theta_in_degrees,
    time_unit,
    turn_unit,
    turns_the_other_way,
)
from kmpc_lite.learn.checks.relations import clocks_differ, unrelated, wheel_speeds
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.logs import Log
from kmpc_lite.learn.stopping import aligned, unmodelled_delay

NEVER_MOVES = (
    "the poses never move though the commands do, so the log does not excite the model: expected "
    "x, y, theta of the driving robot"
)


# by what a robot counts as car-like
SLOW = 0.1
"""Share of the largest speed below which a robot counts as standing."""
TURNING = 0.3
"""Share of the largest turn rate above which a robot is commanded to turn."""
SPOT = 1.0
"""Length of a stretch that shows a turn on the spot [s]."""
FEWEST = 3
"""Such stretches that are needed."""
FOLLOWS = 0.2
"""Share of its usual turn gain below which a robot does not turn on the spot."""


def refuse_frozen(dataset: Dataset) -> None:
    """Refuse a log whose poses never move though commands are given.

    Raises
    ------
    DataError
        Says so.
    """
    moved = max(float(np.abs(np.diff(e.states, axis=0)).max(initial=0.0)) for e in dataset.episodes)
    asked = max(float(np.abs(e.inputs).max(initial=0.0)) for e in dataset.episodes)
    if moved <= 1e-9 < asked:
        raise DataError(NEVER_MOVES)


def refuse_car_like(dataset: Dataset) -> None:
    """Refuse a robot that is commanded to turn on the spot and does not, however late it answers.

    Raises
    ------
    DataError
        With what the log shows.
    """
    delay = unmodelled_delay(dataset)
    answered = aligned(dataset, delay) if delay else dataset
    length = max(1, round(SPOT / dataset.dt))
    states, _, inputs = answered.every_piece(length, stride=length)
    asked, turned = inputs[..., -1].sum(axis=1) * dataset.dt, states[:, -1, 2] - states[:, 0, 2]
    speeds = np.abs(inputs[..., 0]).max(axis=1)
    v_max, omega_max = np.abs(speeds).max(initial=0.0), np.abs(asked).max(initial=0.0)
    turning = np.abs(asked) > TURNING * omega_max
    on_the_spot = turning & (speeds < SLOW * v_max)
    driving = turning & (speeds > 3.0 * SLOW * v_max)
    if on_the_spot.sum() < FEWEST or driving.sum() < FEWEST:
        return
    spot, usual = (
        float(asked[rows] @ turned[rows] / (asked[rows] @ asked[rows]))
        for rows in (on_the_spot, driving)
    )
    if abs(usual) > 0.05 and abs(spot) < FOLLOWS * abs(usual):
        raise DataError(
            "this robot does not turn on the spot: commanded to, it turns by "
            f"{spot:.2f} of the command while it stands, {usual:.2f} while it drives. It is a "
            "car: its log needs the steering angle (column steering) instead of a turn rate"
        )


CHECKS: dict[str, Callable[[Case], str | None]] = {
    "time": time_unit,
    "rows": counted_rows,
    "degrees": theta_in_degrees,
    "wheels": wheel_speeds,
    "unrelated": unrelated,
    "frame": mirrored,
    "rotation": rotated,
    "turn direction": turns_the_other_way,
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
    still = find_still(log)
    if still:
        return LogVerdict((Suspect("still", still),), None)
    motion = gather(log)
    if motion is None:
        return LogVerdict(
            (), None
        )  # too short, or without overlap: cutting it into episodes says so
    case = make_case(log, examine(motion))
    found = [(name, check(case)) for name, check in CHECKS.items()]
    suspects = tuple(Suspect(name, reason) for name, reason in found if reason)
    return LogVerdict(suspects, case.evidence.delay)


TURNED = 1.0
"""Headings that a robot has taken whose x and y must both have changed [rad]."""


def find_still(log: Log) -> str | None:
    """Whether nothing moves or turns, or nothing is asked for."""
    moved = float(np.ptp(log.poses.values, axis=0).max())
    asked = float(np.abs(log.commands.values).max())
    if asked == 0.0:
        return f"all commands are 0 ({log.commands.source}): expected v and omega of a drive"
    if moved <= 1e-9:
        return NEVER_MOVES
    if (
        np.ptp(log.poses.values[:, :2], axis=0).max() <= 1e-9
        and np.abs(log.commands.values[:, 0]).max() > 0.0
    ):
        return (
            "x and y never change though v is asked for and theta changes: other columns or topics "
            "were meant (--columns, --topics)"
        )
    turned = float(np.ptp(log.poses.values[:, 2]))
    for k, name in enumerate("xy"):
        if np.ptp(log.poses.values[:, k]) <= 1e-9 and turned > TURNED:
            return (
                f"{name} never changes though the robot drives and turns: another column was meant "
                f"for {name}, or the ground is another plane of a camera's frame (--columns)"
            )
    if turned <= 1e-9 and np.abs(log.commands.values[:, 1]).max() > 0.0:
        return (
            "theta never changes though omega is asked for and the robot moves: another column or "
            "topic was meant (--columns, --topics)"
        )
    return None
