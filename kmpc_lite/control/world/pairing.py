"""Which track was seen as which circle: the pairs of least cost."""

from __future__ import annotations

import numpy as np

from kmpc_lite.types import Array


def pairs(costs: Array) -> tuple[Array, Array]:
    """Rows (P,) and columns (P,) of the assignment of least total cost.

    Parameters
    ----------
    costs : ndarray
        (M, N), infinite for pairs that cannot be; as many pairs as possible are chosen.

    Examples
    --------
    >>> rows, columns = pairs(np.array([[1.0, 2.0], [1.5, np.inf]]))
    >>> rows.tolist(), columns.tolist()
    ([0, 1], [1, 0])
    """
    can = np.isfinite(costs)
    rows, columns = np.flatnonzero(can.any(axis=1)), np.flatnonzero(can.any(axis=0))
    left = costs[np.ix_(rows, columns)]
    if not left.size:
        return rows[:0], columns[:0]
    nearest = left.argmin(axis=1)
    if np.bincount(nearest).max() == 1:
        # each has a favourite of its own: nothing is cheaper
        return rows, columns[nearest]
    # here, for it takes time to import: `Follower` does so where it is made
    from scipy.optimize import linear_sum_assignment

    possible = np.isfinite(left)
    finite = left[possible]
    # what cannot be costs more than all the rest together
    refused = (float(np.ptp(finite)) + 1.0) * (len(left) + 1)
    first, second = linear_sum_assignment(np.where(possible, left - finite.min(), refused))
    chosen = possible[first, second]
    return rows[first[chosen]], columns[second[chosen]]
