"""How many standard deviations a risk asks for: by the model's calibration, or without one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from kmpc_lite.errors import ProblemError


def default_quantile(risk: float) -> float:
    """Quantile for noise that was never calibrated.

    It is the larger of two quantiles: of a normal distribution in the plane, and of one with
    exponential tails.
    """
    return float(max(np.sqrt(-2.0 * np.log(risk)), np.log(2.0 / risk) - 1.0))


def model_quantile(info: Mapping[str, Any], risk: float) -> float:
    """Look a risk up in the table that calibration left in a model.

    Between its rows, and beyond them, the quantile is linear in ``log(1 / risk)``.
    A risk smaller than the held-out drives can vouch for follows the slope of the last rows: an
    exponential tail.

    Raises
    ------
    ProblemError
        For a damaged table.
    """
    table = info.get("noise_quantiles")
    if table is None:
        return default_quantile(risk)
    try:
        depth = -np.log(np.array(table["risks"], dtype=float))
        values = np.array(table["quantiles"], dtype=float)
        is_table = (
            depth.shape == values.shape
            and len(depth) >= 2
            and (np.diff(depth) > 0).all()
            and np.isfinite(values).all()
        )
    except (TypeError, KeyError, ValueError):
        is_table = False
    if not is_table:
        raise ProblemError("the model's table noise_quantiles is damaged: calibrate it anew")
    wanted = -np.log(risk)
    if wanted <= depth[-1]:
        return float(np.interp(wanted, depth, values))
    first = max(0, len(depth) - 4)
    slope = (values[-1] - values[first]) / (depth[-1] - depth[first])
    return float(values[-1] + max(slope, 0.0) * (wanted - depth[-1]))
