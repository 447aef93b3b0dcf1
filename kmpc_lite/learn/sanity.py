"""What a log can show, and what it cannot: told before anyone trusts what was learned from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kmpc_lite.learn.dataset import Dataset


@dataclass(frozen=True)
class SanityOptions:
    """Thresholds above which a line is written."""

    slow: float = 0.1
    """Share of the largest speed below which a robot counts as standing."""
    turning: float = 0.3
    """Share of the largest turn rate above which a robot is told to turn."""
    rare: float = 0.02
    """Share of the log below which something was not driven."""
    spread: float = 0.15
    """Relative spread below which all speeds of a log count as one."""
    held: float = 0.3
    """Share of unchanged rows from which on the inputs are commands."""
    short: float = 60.0
    """Duration below which a log is short [s]."""


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
        Thresholds above which a line is written.
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
