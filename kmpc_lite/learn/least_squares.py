"""Least squares from sums over the samples: free, non-negative, or symmetric in space.

Symmetric models: the robot moves alike wherever it stands and whichever way it faces. The
generator ``xdot = R(theta) [a; b] w, thetadot = g w`` is the paper's bilinear form under linear
constraints: with ``phi`` holding {1, cos, sin}, each input i has ``H[x, i, cos] = a_i, H[x, i, sin]
= -b_i, H[y, i, sin] = a_i, H[y, i, cos] = b_i, H[theta, i, 1] = g_i``, all else is zero. ``A = B =
0``: at zero command it stands still. The least squares under these constraints have a closed form
in the same Gram matrix, since averaging it over all headings does not move the minimiser.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.model.dictionary import Dictionary
from kmpc_lite.model.symmetric import Trigonometry, find_trigonometry
from kmpc_lite.types import STATES, Array

RANK_TOLERANCE = 1e-13
"""Eigenvalues of the scaled Gram matrix below this share of the largest count as zero."""


def least_squares(gram: Array, moments: Array, ridge: float) -> tuple[Array, int, float]:
    """Weights (q, p) of smallest norm, rank, and condition: G (p, p), moments (p, q)."""
    scale = np.sqrt(np.diag(gram))
    scale = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    kept = values > RANK_TOLERANCE * len(values) * values[-1]
    v = vectors[:, kept]
    weights = (v / (values[kept] + ridge)) @ (v.T @ (moments / scale[:, None])) / scale[:, None]
    return weights.T, int(kept.sum()), float(np.sqrt(values[-1] / values[kept][0]))


def nonnegative_least_squares(root: Array, moments: Array) -> Array:
    """Weights (p,), none of them negative: moments (p,), and a root (p, p) of the Gram matrix.

    ``root.T @ root`` is that matrix: a few rows take the place of many thousand.
    """
    from scipy.optimize import nnls  # here, for it takes time to import

    found: Array = nnls(root, np.linalg.solve(root.T, moments))[0]
    return found


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
        Sums of v and omega, and of their squares, (2, m).

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
    names = ("v", "omega") if len(spread) == 2 else ("v_x", "v_y", "omega")
    for i, name in enumerate(names):
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


class Solution(NamedTuple):
    """The rows that the symmetric fit has found, for each input."""

    along: Array
    """Forward speed, (nw,)."""
    across: Array
    """Speed to the left, (nw,)."""
    heading: Array
    """Turn rate, (nw,)."""
    rank: int
    """Inputs that the log tells apart, at most nw."""
    condition: float
    """Condition number of the inputs, as columns of length one."""


def require_trigonometry(dictionary: Dictionary) -> Trigonometry:
    """As `find_trigonometry`, or DataError."""
    found = find_trigonometry(dictionary)
    if found is None:
        raise DataError(
            "symmetric: expected a dictionary that holds 1, cos(theta) and sin(theta), got "
            f"({', '.join(dictionary.names[:8])}); choose another, or symmetric=False"
        )
    return found


def wants_symmetry(symmetric: bool | None, method: str, dictionary: Dictionary) -> bool:
    """What `symmetric` means: None is True for the integral fit of a dictionary that allows it.

    Raises
    ------
    DataError
        For True with a method or a dictionary that cannot be.
    """
    if symmetric is None:
        return method == "integral" and find_trigonometry(dictionary) is not None
    if symmetric and method != "integral":
        raise DataError(
            f"symmetric: goes with method 'integral'; {method!r} is the paper's free fit"
        )
    if symmetric:
        require_trigonometry(dictionary)
    return bool(symmetric)


def solve_symmetric(gram: Array, dictionary: Dictionary, ridge: float = 0.0) -> Solution:
    """Solve the least squares under the symmetry from the Gram matrix of the free fit.

    Parameters
    ----------
    gram : ndarray
        Second moments of ``[z; w (x) z; ...; xdot, ydot, thetadot]``, the targets last.
    dictionary : Dictionary
        Lifts to `z`, nz, and gives `w`, nw.
    ridge : float
        Share of the scaled Gram matrices' diagonals that is added to them.
    """
    place = require_trigonometry(dictionary)
    nz, nw = dictionary.size, dictionary.input_size
    first = nz + nz * np.arange(nw)
    one, cos, sin = first + place.one, first + place.cos, first + place.sin
    x, y, turn = range(len(gram) - STATES, len(gram))
    moved = gram[np.ix_(cos, cos)] + gram[np.ix_(sin, sin)]
    along = gram[cos, x] + gram[sin, y]
    across = gram[cos, y] - gram[sin, x]
    rows, rank, condition = least_squares(moved, np.stack([along, across], axis=1), ridge)
    turned, _, _ = least_squares(gram[np.ix_(one, one)], gram[one, turn][:, None], ridge)
    return Solution(rows[0], rows[1], turned[0], rank, condition)


def symmetric_generator(
    dictionary: Dictionary, along: Array, across: Array, heading: Array
) -> Array:
    """H (3, nw nz) of the paper's bilinear form for the three rows (nw,)."""
    place = require_trigonometry(dictionary)
    h = np.zeros((STATES, dictionary.input_size, dictionary.size))
    h[0, :, place.cos] = h[1, :, place.sin] = along
    h[0, :, place.sin] = -across
    h[1, :, place.cos] = across
    h[2, :, place.one] = heading
    return h.reshape(STATES, -1)
