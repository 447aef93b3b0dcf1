"""What a log's input columns are: commands, or speeds that were measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kmpc_lite.learn.dataset import Dataset


@dataclass(frozen=True)
class InputColumnOptions:
    """Thresholds above which a line is written."""

    held: float = 0.3
    """Share of unchanged rows from which on the inputs are commands."""


def tell_inputs(dataset: Dataset, delay: float, options: InputColumnOptions | None = None) -> str:
    """What the input columns are: commands that are held, or speeds that were measured.

    Parameters
    ----------
    dataset : Dataset
        The log.
    delay : float
        How far the poses lag behind the inputs [s].
    options : InputColumnOptions, optional
        Thresholds above which a line is written.
    """
    options = InputColumnOptions() if options is None else options
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
