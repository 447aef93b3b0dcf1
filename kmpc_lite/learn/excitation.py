"""Whether a log excites a model: enough steps, commands that vary, poses that differ."""

from __future__ import annotations

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.types import Array


def check_excitation(
    count: int, unknowns: int, history: int, gram: Array, input_moments: Array
) -> None:
    """Refuse data that cannot determine a model, in terms of the log.

    Parameters
    ----------
    count, unknowns, history : int
        Steps, unknowns per state, and periods of input history.
    gram : ndarray
        Gram matrix of the fit, (p, p).
    input_moments : ndarray
        Sums of v and omega, and of their squares, (2, 2).

    Raises
    ------
    DataError
        Names what is missing.
    """
    if count < unknowns:
        past = f" with an input history of {history}" if history else ""
        raise DataError(f"too few samples: {count} steps{past} for {unknowns} unknowns per state")
    if not np.isfinite(gram).all():
        raise DataError(
            "the log's numbers are too large for this dictionary: "
            "put the origin near the drive, or choose a smaller one"
        )
    mean, square = input_moments / count
    spread = np.sqrt(np.maximum(square - mean**2, 0.0))
    for i, name in enumerate(("v", "omega")):
        if spread[i] <= 1e-6 * max(1e-3, abs(mean[i])):
            raise DataError(
                f"column {name} is constant ({mean[i]:g}) over {count} samples: "
                "the fit needs it to vary"
            )


def too_alike(rank: int, full: int, samples: int) -> str:
    """Message for inputs or poses that the log does not tell apart."""
    return (
        f"the log does not excite the model: rank {rank} of {full} from {samples} samples; "
        "drive with varied speeds, turns and headings, not far from the origin, "
        "or choose a smaller dictionary"
    )
