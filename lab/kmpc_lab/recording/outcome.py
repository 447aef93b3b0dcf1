"""How a recorded drive ended, as its file tells it."""

from __future__ import annotations

import math
from typing import Any

from kmpc_lab.sim.closed_loop import Run


def outcome_of(run: Run) -> dict[str, Any]:
    """Outcome of a run: what JSON can hold."""
    return {
        "outcome": run.outcome.value,
        "duration": run.duration,
        "clearance": run.clearance if math.isfinite(run.clearance) else None,
    }
