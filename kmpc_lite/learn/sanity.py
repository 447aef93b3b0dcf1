"""What a log can show, and what it cannot: told before anyone trusts what was learned from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.types import Array


@dataclass(frozen=True)
class SanityOptions:
    """From when on something is told."""

    slow: float = 0.1
    """Share of the largest speed below which a robot counts as standing."""
    turning: float = 0.3
    """Share of the largest turn rate above which a robot is told to turn."""
    spot: float = 1.0
    """Length of a stretch that shows a turn on the spot [s]."""
    fewest: int = 3
    """Such stretches that are needed."""
    follows: float = 0.2
    """Share of its usual turn gain below which a robot does not turn on the spot."""
    rare: float = 0.02
    """Share of the log below which something was not driven."""
    spread: float = 0.15
    """Relative spread of speeds below which there is only one."""
    held: float = 0.3
    """Share of unchanged rows from which on the inputs are commands."""
    short: float = 60.0
    """Seconds below which a log is short [s]."""


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
        raise DataError(
            "the poses never move though the commands do, so the log does not excite the model: "
            "expected x, y, theta of the driving robot"
        )


def refuse_car_like(dataset: Dataset, options: SanityOptions | None = None) -> None:
    """Refuse a robot that is told to turn on the spot and does not.

    Raises
    ------
    DataError
        With what the log shows.
    """
    options = SanityOptions() if options is None else options
    asked, turned, speeds = _windows(dataset, max(1, round(options.spot / dataset.dt)))
    v_max, omega_max = np.abs(speeds).max(initial=0.0), np.abs(asked).max(initial=0.0)
    turning = np.abs(asked) > options.turning * omega_max
    on_the_spot = turning & (speeds < options.slow * v_max)
    driving = turning & (speeds > 3.0 * options.slow * v_max)
    if on_the_spot.sum() < options.fewest or driving.sum() < options.fewest:
        return
    spot, usual = (
        float(asked[rows] @ turned[rows] / (asked[rows] @ asked[rows]))
        for rows in (on_the_spot, driving)
    )
    if abs(usual) > 0.05 and abs(spot) < options.follows * abs(usual):
        raise DataError(
            "this robot does not turn on the spot: told to, it turns by "
            f"{spot:.2f} of the command while it stands, {usual:.2f} while it drives. Car-like "
            "robots are not supported; plans here turn on the spot"
        )


def _windows(dataset: Dataset, length: int) -> tuple[Array, Array, Array]:
    """Asked turns [rad], turns [rad] and largest |v| [m/s] of stretches that do not overlap."""
    asked, turned, speeds = [], [], []
    for episode in dataset.episodes:
        for k in range(0, len(episode) - length + 1, length):
            inputs = episode.inputs[k : k + length]
            asked.append(inputs[:, 1].sum() * dataset.dt)
            turned.append(episode.states[k + length, 2] - episode.states[k, 2])
            speeds.append(np.abs(inputs[:, 0]).max())
    return np.array(asked), np.array(turned), np.array(speeds)


def find_gaps(dataset: Dataset, options: SanityOptions | None = None) -> list[str]:
    """What a log does not show, one line each."""
    options = SanityOptions() if options is None else options
    inputs = np.concatenate([e.inputs for e in dataset.episodes])
    v, omega = inputs.T
    v_max, omega_max = max(np.abs(v).max(), 1e-9), max(np.abs(omega).max(), 1e-9)
    fast, turning = np.abs(v) > options.slow * v_max, np.abs(omega) > options.slow * omega_max
    told = []
    if dataset.steps * dataset.dt < options.short:
        told.append(f"only {dataset.steps * dataset.dt:.0f} s are learned from: drive for minutes")
    for sign, word in ((-1, "reverses"), (1, "drives forward")):
        if (sign * v[fast] > 0).mean() < options.rare if fast.any() else True:
            told.append(f"the log never {word}: what was learned of it is a guess")
    for sign, word in ((1, "left"), (-1, "right")):
        if (sign * omega[turning] > 0).mean() < options.rare if turning.any() else True:
            told.append(f"the log never turns {word}: what was learned of it is a guess")
    size = np.abs(v[fast])
    if len(size) and size.std() < options.spread * size.mean():
        told.append(f"the log knows one speed only, {size.mean():.2g} m/s")
    spot = ~fast & (np.abs(omega) > options.turning * omega_max)
    if spot.mean() < options.rare:
        told.append("the log never turns on the spot: whether this robot can is not known")
    return told


def tell_inputs(dataset: Dataset, delay: float, options: SanityOptions | None = None) -> str:
    """What the input columns are: commands that are held, or speeds that were measured.

    Parameters
    ----------
    dataset : Dataset
        The log.
    delay : float
        How far the poses lag behind the inputs [s].
    options : SanityOptions, optional
        From when on what is told.
    """
    options = SanityOptions() if options is None else options
    steps = [np.diff(e.inputs, axis=0) for e in dataset.episodes if len(e) > 1]
    moving = [np.abs(e.inputs[1:]).sum(axis=1) > 1e-9 for e in dataset.episodes if len(e) > 1]
    if not steps or not np.concatenate(moving).any():
        return "unknown"
    changes = np.abs(np.concatenate(steps)[np.concatenate(moving)])
    held = float((changes.max(axis=1) < 1e-9).mean())
    lead = f"poses follow {delay:.2f} s later"
    if held >= options.held:
        return f"commands ({100 * held:.0f} % of the rows repeat the one before; {lead})"
    jitter = np.median(changes, axis=0)
    return (
        f"measured speeds, of encoders or so (they change from row to row, in the median by "
        f"{jitter[0]:.2g} m/s and {jitter[1]:.2g} rad/s; {lead}): the motors' lag is not in them"
    )
