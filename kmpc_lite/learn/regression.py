"""Least squares from a stream: the paper's discrete fit and the integral (weak) form.

Whatever the length of the log, only Gram matrices are kept. Two accumulators can be merged, so
chunks can be fitted apart, on other cores or on other days.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.files import SAME_DT
from kmpc_lite.learn.dataset import Dataset, check_time
from kmpc_lite.learn.least_squares import (
    check_excitation,
    least_squares,
    solve_symmetric,
    symmetric_generator,
    too_alike,
    wants_symmetry,
)
from kmpc_lite.model.dictionary import Dictionary, dictionary_to_config
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import STATES, Array

Method = Literal["integral", "edmdc"]


class Accumulator:
    """Streaming normal equations of one fit.

    ``edmdc`` regresses the next lifted state on ``[z; w (x) z; w]`` and the state on `z` (paper,
    eq. 8, with the blocks in the order in which they are stacked). ``integral`` regresses ``(x+ -
    x) / dt`` on the mean of ``[z; w (x) z; w]`` over the step by Simpson's rule; `w` is left out
    where the dictionary holds the constant, since it then stands in ``w (x) z`` already.

    Parameters
    ----------
    dictionary : Dictionary
        Lifts the pose.
    dt : float
        Sampling period [s].
    method : {"integral", "edmdc"}
        See above.
    midpoint : KoopmanModel, optional
        Continuous model of an earlier pass. Its derivatives bend the path between two samples
        (cubic Hermite midpoint); without it the midpoint is the mean, which is exact only to second
        order in dt.

    Raises
    ------
    DataError
        For another method or period, or a midpoint that is no continuous model of the same
        dictionary.

    Examples
    --------
    >>> from kmpc_lab import DifferentialDrive, generate_dataset
    >>> from kmpc_lite import UnicycleDictionary
    >>> data = generate_dataset(DifferentialDrive(), episodes=4, steps=50, dt=0.1, seed=0)
    >>> halves = [Accumulator(UnicycleDictionary(), 0.1), Accumulator(UnicycleDictionary(), 0.1)]
    >>> for half, part in zip(halves, data.split(0.5)):
    ...     half.add(part)
    >>> halves[0].merge(halves[1])
    >>> halves[0].count
    200
    """

    def __init__(
        self,
        dictionary: Dictionary,
        dt: float,
        method: Method = "integral",
        midpoint: KoopmanModel | None = None,
    ) -> None:
        if method not in ("integral", "edmdc"):
            raise DataError(f"method: expected 'integral' or 'edmdc', got {method!r}")
        if midpoint is not None and not (
            method == "integral" and midpoint.continuous and _same(midpoint.dictionary, dictionary)
        ):
            raise DataError(
                "midpoint: expected a continuous model of the same dictionary, "
                "for method 'integral'"
            )
        self.dictionary, self.dt, self.method, self.midpoint = (
            dictionary,
            check_time("dt", dt),
            method,
            midpoint,
        )
        nz, nw = dictionary.size, dictionary.input_size
        self._with_inputs = method == "edmdc" or "1" not in dictionary.names
        self._features = nz + nw * nz + (nw if self._with_inputs else 0)
        self._targets = nz + STATES if method == "edmdc" else STATES
        width = self._features + self._targets
        self._gram = np.zeros((width, width))
        self._input_moments = np.zeros((2, dictionary.commands))
        self._buffer = np.empty((0, width))
        self.count = 0

    def add(self, data: Dataset) -> None:
        """Take in every step of a dataset, chunk by chunk."""
        if abs(data.dt - self.dt) > SAME_DT * self.dt:
            raise DataError(
                f"the dataset's dt is {data.dt:g} s, the fit's {self.dt:g} s: resample it"
            )
        with np.errstate(
            over="ignore", invalid="ignore"
        ):  # `solve` tells of numbers that are too large
            for part in data.transitions(self.dictionary.history):
                self._add(part.x, part.u, part.x_next, part.history)

    def _add(self, x: Array, u: Array, x_next: Array, history: Array | None) -> None:
        w = self.dictionary.inputs(u, history)
        z, z_next = self.dictionary.lift(x), self.dictionary.lift(x_next)
        if len(self._buffer) < len(x):
            self._buffer = np.empty((len(x), self._buffer.shape[1]))
        rows = self._buffer[: len(x)]
        if self.method == "edmdc":
            self._fill(rows, z, w)
            rows[:, self._features : -STATES] = z_next
            rows[:, -STATES:] = x
        else:
            middle = 0.5 * (x + x_next)
            if self.midpoint is not None:
                middle += self.dt / 8 * _derivative_difference(self.midpoint, z, z_next, w)
            mean = self.dictionary.lift(middle)
            mean *= 4.0
            mean += z
            mean += z_next
            mean *= 1 / 6
            self._fill(rows, mean, w)
            np.subtract(x_next, x, out=rows[:, self._features :])
            rows[:, self._features :] *= 1 / self.dt
        self._gram += rows.T @ rows
        self._input_moments += [u.sum(axis=0), (u**2).sum(axis=0)]
        self.count += len(x)

    def _fill(self, rows: Array, z: Array, w: Array) -> None:
        """Write the regressor [z; w (x) z; w] into the first columns."""
        nz = z.shape[1]
        rows[:, :nz] = z
        for i in range(w.shape[1]):
            np.multiply(w[:, i : i + 1], z, out=rows[:, (1 + i) * nz : (2 + i) * nz])
        if self._with_inputs:
            rows[:, self._features - w.shape[1] : self._features] = w

    def merge(self, other: Accumulator) -> None:
        """Take in what another accumulator of the same fit has seen."""
        mine, theirs = self.midpoint, other.midpoint
        if (
            self.method != other.method
            or abs(self.dt - other.dt) > SAME_DT * self.dt
            or not _same(self.dictionary, other.dictionary)
            or (mine is None) != (theirs is None)
            or (
                mine is not None
                and theirs is not None
                and not (np.array_equal(mine.A, theirs.A) and np.array_equal(mine.H, theirs.H))
            )
        ):
            raise DataError(
                "cannot merge accumulators of different fits (method, dt, dictionary or midpoint)"
            )
        self._gram += other._gram
        self._input_moments += other._input_moments
        self.count += other.count

    def solve(self, ridge: float = 0.0, symmetric: bool | None = None) -> KoopmanModel:
        """Solve for the model.

        Parameters
        ----------
        ridge : float
            Added to the diagonal of the Gram matrix scaled to ones; 0 is the pseudoinverse.
        symmetric : bool, optional
            Whether the robot moves alike wherever it stands and whichever way it faces, and stands
            still at zero command (`learn.least_squares`). If not given: for method
            ``"integral"``, as far as the dictionary holds 1, cos(theta) and sin(theta).

        Raises
        ------
        DataError
            For too few samples, inputs that do not vary, numbers too large to square, or a
            dictionary that the method cannot use.
        """
        if not (np.isfinite(ridge) and ridge >= 0.0):
            raise DataError(f"ridge: expected a share >= 0, got {ridge}")
        symmetric = wants_symmetry(symmetric, self.method, self.dictionary)
        unknowns = 2 * self.dictionary.input_size if symmetric else self._features
        check_excitation(
            self.count, unknowns, self.dictionary.history, self._gram, self._input_moments
        )
        if symmetric:
            return self._solve_symmetric(ridge)
        p, nz, nw = self._features, self.dictionary.size, self.dictionary.input_size
        weights, rank, condition = least_squares(self._gram[:p, :p], self._gram[:p, p:], ridge)
        if rank < self._structural_rank():
            raise DataError(too_alike(rank, self._structural_rank(), self.count))
        rows = nz if self.method == "edmdc" else STATES
        a, h = weights[:rows, :nz], weights[:rows, nz : nz + nw * nz]
        b = weights[:rows, nz + nw * nz :] if self._with_inputs else np.zeros((rows, nw))
        c = self._state_reconstruction() if self.method == "edmdc" else np.eye(STATES)
        info: dict[str, Any] = {
            "method": self.method,
            "samples": self.count,
            "rank": rank,
            "features": p,
            "condition": condition,
        }
        return KoopmanModel(
            self.dictionary, self.dt, a, b, h, c, continuous=self.method == "integral", info=info
        )

    def _solve_symmetric(self, ridge: float) -> KoopmanModel:
        """Solve under the symmetry."""
        nz, nw = self.dictionary.size, self.dictionary.input_size
        if np.diag(self._gram)[-STATES:-1].sum() <= 0.0 or self._gram[-1, -1] <= 0.0:
            still = "theta" if self._gram[-1, -1] <= 0.0 else "the position"
            raise DataError(f"the log does not excite the model: {still} never changes")
        found = solve_symmetric(self._gram, self.dictionary, ridge)
        if found.rank < nw:
            raise DataError(too_alike(found.rank, nw, self.count))
        info = {
            "method": self.method,
            "symmetric": True,
            "samples": self.count,
            "rank": found.rank,
            "features": nw,
            "condition": found.condition,
        }
        h = symmetric_generator(self.dictionary, found.along, found.across, found.heading)
        a, b = np.zeros((STATES, nz)), np.zeros((STATES, nw))
        return KoopmanModel(self.dictionary, self.dt, a, b, h, np.eye(STATES), True, info=info)

    def _structural_rank(self) -> int:
        """Rank that ample data would have: the paper's regressor holds `w` twice."""
        redundant = self._with_inputs and "1" in self.dictionary.names
        return self._features - (self.dictionary.input_size if redundant else 0)

    def _state_reconstruction(self) -> Array:
        """Fit C = X Z^+ (paper, eq. 8) and make sure that the state does lie in the dictionary."""
        nz = self.dictionary.size
        c, _, _ = least_squares(self._gram[:nz, :nz], self._gram[:nz, -STATES:], 0.0)
        power = np.diag(self._gram)[-STATES:]
        missed = (
            power
            - 2 * np.sum(c * self._gram[:nz, -STATES:].T, axis=1)
            + np.sum((c @ self._gram[:nz, :nz]) * c, axis=1)
        )
        if (missed > 1e-6 * power).any():
            raise DataError(
                "method 'edmdc' needs x, y and theta in the span of the dictionary: "
                "choose the unicycle one, or the method 'integral'"
            )
        return c


def _same(one: Dictionary, other: Dictionary) -> bool:
    """Whether two dictionaries lift alike, as far as they tell."""
    return (
        type(one) is type(other)
        and one.names == other.names
        and dictionary_to_config(one) == dictionary_to_config(other)
    )


def _derivative_difference(model: KoopmanModel, z: Array, z_next: Array, w: Array) -> Array:
    """Give f(x) - f(x+) at one command, (n, 3), for the Hermite midpoint.

    The difference is linear in z, so one product serves both.
    """
    blocks = np.concatenate([model.A, model.H], axis=1).reshape(STATES, 1 + w.shape[1], z.shape[1])
    products = ((z - z_next) @ blocks.transpose(2, 1, 0).reshape(z.shape[1], -1)).reshape(
        len(z), -1, STATES
    )
    difference: Array = products[:, 0].copy()
    for i in range(w.shape[1]):
        difference += w[:, i : i + 1] * products[:, 1 + i]
    return difference
