"""Logs in which something stands still that should move."""

from __future__ import annotations

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.lag import aligned, mean_delay
from kmpc_lite.learn.logs import Log

NEVER_MOVES = (
    "the poses never move though the commands do, so the log does not excite the model: expected "
    "x, y, theta of the driving robot"
)

TURNED = 1.0
"""Headings that a robot has taken whose x and y must both have changed [rad]."""


def find_still(log: Log) -> str | None:
    """Whether nothing moves or turns, or nothing is asked for."""
    poses, commands = log.poses.values, np.abs(log.commands.values)
    if commands.max() == 0.0:
        return f"all commands are 0 ({log.commands.source}): expected v and omega of a drive"
    spans = np.ptp(poses, axis=0)
    if spans.max() <= 1e-9:
        return NEVER_MOVES
    if spans[:2].max() <= 1e-9 and commands[:, 0].max() > 0.0:
        return (
            "x and y never change though v is asked for and theta changes: other columns or topics "
            "were meant (--columns, --topics)"
        )
    for name, span in zip("xy", spans, strict=False):
        if span <= 1e-9 and spans[2] > TURNED:
            return (
                f"{name} never changes though the robot drives and turns: another column was meant "
                f"for {name}, or the ground is another plane of a camera's frame (--columns)"
            )
    if spans[2] <= 1e-9 and commands[:, 1].max() > 0.0:
        return (
            "theta never changes though omega is asked for and the robot moves: another column or "
            "topic was meant (--columns, --topics)"
        )
    return None


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


SLOW, TURNING, SPOT, FEWEST, FOLLOWS = 0.1, 0.3, 1.0, 3, 0.2
"""Share of the largest speed below which a robot counts as standing; of the largest turn rate above
which it is commanded to turn; length of a stretch that shows a turn on the spot [s]; stretches that
are needed; share of its usual turn gain below which a robot does not turn on the spot."""


def refuse_car_like(dataset: Dataset) -> None:
    """Refuse a robot that is commanded to turn on the spot and does not, however late it answers.

    Raises
    ------
    DataError
        With what the log shows.
    """
    delay = mean_delay(dataset)
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
