"""What a fit costs: memory, and time against the bare Gram product of as many rows."""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, get_args

import numpy as np

from kmpc_lab.sim.plants.robots import DifferentialDrive, generate_dataset
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.fitting import fit
from kmpc_lite.learn.regression import Method

STEPS = 1000
"""Of each episode."""
COLUMNS = 20
"""Of the bare product: the paper's regressor."""
REPEATS = 5
"""Of everything, in turns; the shortest time counts: what the machine can do when nothing else asks
for it."""


@dataclass(frozen=True)
class FitCost:
    """What one method costs."""

    method: Method
    samples: int
    seconds: float
    """Shortest time of a fit, residual covariance included."""
    bare_seconds: float
    """Shortest time of the bare product of as many rows of `COLUMNS` numbers."""
    growth: float
    """Most memory that is held at once while fitting, beyond the data [MB]."""

    @property
    def ratio(self) -> float:
        """How many bare products a fit takes."""
        return self.seconds / self.bare_seconds

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {**asdict(self), "ratio": self.ratio}


def memory_growth(data: Dataset, method: Method) -> float:
    """Most memory held at once while fitting, beyond the data [MB], as tracemalloc counts it."""
    tracemalloc.start()
    try:
        fit(data, method=method)
        return tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()


def fit_costs(
    episodes: int = 1000, progress: Callable[[int, int], None] = lambda done, total: None
) -> list[FitCost]:
    """Time and memory of both methods on `episodes` drives of `STEPS` steps."""
    data = generate_dataset(DifferentialDrive(), episodes=episodes, steps=STEPS, dt=0.1, seed=0)
    rows = np.random.default_rng(8).normal(size=(data.steps, COLUMNS))
    methods: tuple[Method, ...] = get_args(Method)
    bare: list[float] = []
    spent: dict[Method, list[float]] = {method: [] for method in methods}
    total = REPEATS + len(methods)
    for done in range(REPEATS):
        bare.append(_seconds(lambda: rows.T @ rows))
        for method in methods:
            spent[method].append(_seconds(lambda m=method: fit(data, method=m)))  # type: ignore[misc]
        progress(done + 1, total)
    costs = []
    for done, method in enumerate(methods, REPEATS + 1):
        costs.append(
            FitCost(method, data.steps, min(spent[method]), min(bare), memory_growth(data, method))
        )
        progress(done, total)
    return costs


def format_fit_costs(costs: list[FitCost]) -> str:
    """Render a line per method."""
    lines = [
        f"fitting {costs[0].samples:,} samples; a bare Gram product of as many rows of {COLUMNS} "
        f"takes {costs[0].bare_seconds:.3f} s"
    ]
    lines += [
        f"  {c.method:<9} {c.seconds:7.3f} s, {c.ratio:5.1f} times that, "
        f"{c.growth:5.1f} MB beyond the data"
        for c in costs
    ]
    return "\n".join(lines)


def _seconds(job: Callable[[], Any]) -> float:
    start = time.perf_counter()
    job()
    return time.perf_counter() - start
