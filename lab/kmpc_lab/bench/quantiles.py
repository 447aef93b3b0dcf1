"""Times of many steps as a table tells them: median, tails and maximum, in milliseconds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

QUANTILES = {"p50": 0.5, "p99": 0.99, "p99.9": 0.999}
"""By their names in tables and in JSON; beside them stands ``max``."""
HEAD = "".join(f"{name:>9}" for name in (*QUANTILES, "max")) + " [ms]"
"""Head of `format_times`."""


def in_ms(seconds: Sequence[float]) -> dict[str, float]:
    """Quantiles and maximum of times [s], in ms."""
    ms = 1e3 * np.asarray(seconds)
    return {**{p: float(np.quantile(ms, q)) for p, q in QUANTILES.items()}, "max": float(ms.max())}


def format_times(ms: Mapping[str, float]) -> str:
    """Columns below `HEAD`."""
    return "".join(f"{ms[name]:9.3f}" for name in (*QUANTILES, "max"))
