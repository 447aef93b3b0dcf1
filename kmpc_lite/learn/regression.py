"""Least squares from a stream: the paper's discrete fit, and the integral form, also symmetric.

Whatever the length of the log, only Gram matrices are kept.

A symmetric model moves alike wherever it stands and whichever way it faces. Its generator ``xdot =
R(theta) [a; b] w, thetadot = g w`` is the paper's bilinear form under linear constraints: with
``phi`` holding {1, cos, sin}, each input i has ``H[x, i, cos] = a_i, H[x, i, sin] = -b_i, H[y, i,
sin] = a_i, H[y, i, cos] = b_i, H[theta, i, 1] = g_i``, all else is zero. ``A = B = 0``: at zero
command it stands still. The least squares under these constraints have a closed form in the same
Gram matrix, since averaging it over all headings does not move the minimiser.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.files import SAME_DT
from kmpc_lite.learn.dataset import Dataset, check_time
from kmpc_lite.model.dictionary import Dictionary, dictionary_to_config
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.symmetric import Trigonometry, find_trigonometry
from kmpc_lite.types import STATES, Array

Method = Literal["integral", "edmdc"]
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


def _trigonometry(dictionary: Dictionary) -> Trigonometry:
    """As `find_trigonometry`, or DataError."""
    if (found := find_trigonometry(dictionary)) is None:
        raise DataError(
            "symmetric: expected a dictionary that holds 1, cos(theta) and sin(theta), got "
            f"({', '.join(dictionary.names[:8])}); choose another, or symmetric=False"
        )
    return found


def wants_symmetry(symmetric: bool | None, method: str, dictionary: Dictionary) -> bool:
    """What `symmetric` means: None is True for the integral fit of a dictionary that allows it.

    Raises DataError for True with a method or a dictionary that cannot be.
    """
    if symmetric is None:
        return method == "integral" and find_trigonometry(dictionary) is not None
    if symmetric and method != "integral":
        raise DataError(
            f"symmetric: goes with method 'integral'; {method!r} is the paper's free fit"
        )
    if symmetric:
        _trigonometry(dictionary)
    return bool(symmetric)


def symmetric_generator(
    dictionary: Dictionary, along: Array, across: Array, heading: Array
) -> Array:
    """H (3, nw nz) of the paper's bilinear form for the three rows (nw,)."""
    place = _trigonometry(dictionary)
    h = np.zeros((STATES, dictionary.input_size, dictionary.size))
    h[0, :, place.cos] = h[1, :, place.sin] = along
    h[0, :, place.sin] = -across
    h[1, :, place.cos] = across
    h[2, :, place.one] = heading
    return h.reshape(STATES, -1)


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
    >>> seen = Accumulator(UnicycleDictionary(), 0.1)
    >>> for half in data.split(0.5):
    ...     seen.add(half)
    >>> seen.count
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
        fits = method == "integral" and midpoint is not None and midpoint.continuous
        if midpoint is not None and not (fits and _same(midpoint.dictionary, dictionary)):
            raise DataError(
                "midpoint: expected a continuous model of the same dictionary, "
                "for method 'integral'"
            )
        self.dictionary, self.dt = dictionary, check_time("dt", dt)
        self.method, self.midpoint = method, midpoint
        nz, nw = dictionary.size, dictionary.input_size
        self._with_inputs = method == "edmdc" or "1" not in dictionary.names
        self._features = nz + nw * nz + (nw if self._with_inputs else 0)
        width = self._features + STATES + (nz if method == "edmdc" else 0)
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
        # `solve` tells of numbers that are too large
        with np.errstate(over="ignore", invalid="ignore"):
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

    def solve(self, ridge: float = 0.0, symmetric: bool | None = None) -> KoopmanModel:
        """Solve for the model.

        Parameters
        ----------
        ridge : float
            Added to the diagonal of the Gram matrix scaled to ones; 0 is the pseudoinverse.
        symmetric : bool, optional
            Whether the robot moves alike wherever it stands and whichever way it faces, and stands
            still at zero command. If not given: for method ``"integral"``, as far as the dictionary
            holds 1, cos(theta) and sin(theta).

        Raises
        ------
        DataError
            For too few samples, inputs that do not vary, numbers too large to square, or a
            dictionary that the method cannot use.
        """
        if not (np.isfinite(ridge) and ridge >= 0.0):
            raise DataError(f"ridge: expected a share >= 0, got {ridge}")
        nz, nw = self.dictionary.size, self.dictionary.input_size
        symmetric = wants_symmetry(symmetric, self.method, self.dictionary)
        self._check_excitation(2 * nw if symmetric else self._features)
        info: dict[str, Any] = {"method": self.method, "samples": self.count}
        continuous, c = self.method == "integral", np.eye(STATES)
        if symmetric:
            h, rank, condition = self._solve_symmetric(ridge)
            full, features, a, b = nw, nw, np.zeros((STATES, nz)), np.zeros((STATES, nw))
            info["symmetric"] = True
        else:
            p, rows = self._features, STATES if continuous else nz
            weights, rank, condition = least_squares(self._gram[:p, :p], self._gram[:p, p:], ridge)
            # the paper's regressor holds `w` twice
            full = p - (nw if self._with_inputs and "1" in self.dictionary.names else 0)
            features, a, h = p, weights[:rows, :nz], weights[:rows, nz : nz + nw * nz]
            b = weights[:rows, nz + nw * nz :] if self._with_inputs else np.zeros((rows, nw))
        if rank < full:
            raise DataError(
                f"the log does not excite the model: rank {rank} of {full} from {self.count} "
                "samples; drive with varied speeds, turns and headings, not far from the origin, "
                "or choose a smaller dictionary"
            )
        if not continuous:
            c = self._state_reconstruction()
        info |= {"rank": rank, "features": features, "condition": condition}
        return KoopmanModel(self.dictionary, self.dt, a, b, h, c, continuous=continuous, info=info)

    def _check_excitation(self, unknowns: int) -> None:
        """Refuse data that cannot determine a model, in terms of the log."""
        if self.count < unknowns:
            history = self.dictionary.history
            past = f" with an input history of {history}" if history else ""
            raise DataError(
                f"too few samples: {self.count} steps{past} for {unknowns} unknowns per state"
            )
        if not np.isfinite(self._gram).all():
            raise DataError(
                "the log's numbers are too large for this dictionary: "
                "put the origin near the drive, or choose a smaller one"
            )
        mean, square = self._input_moments / self.count
        spread = np.sqrt(np.maximum(square - mean**2, 0.0))
        names = ("v", "omega") if len(spread) == 2 else ("v_x", "v_y", "omega")
        for name, middle, varies in zip(names, mean.tolist(), spread.tolist(), strict=True):
            if varies <= 1e-6 * max(1e-3, abs(middle)):
                raise DataError(
                    f"column {name} is constant ({middle:g}) over {self.count} samples: "
                    "the fit needs it to vary"
                )

    def _solve_symmetric(self, ridge: float) -> tuple[Array, int, float]:
        """Solve under the symmetry, from the Gram matrix of the free fit: H, rank, condition."""
        gram = self._gram
        if np.diag(gram)[-STATES:-1].sum() <= 0.0 or gram[-1, -1] <= 0.0:
            still = "theta" if gram[-1, -1] <= 0.0 else "the position"
            raise DataError(f"the log does not excite the model: {still} never changes")
        place, nz = _trigonometry(self.dictionary), self.dictionary.size
        first = nz + nz * np.arange(self.dictionary.input_size)
        one, cos, sin = first + place.one, first + place.cos, first + place.sin
        x, y, turn = range(len(gram) - STATES, len(gram))
        moved = gram[np.ix_(cos, cos)] + gram[np.ix_(sin, sin)]
        moments = [gram[cos, x] + gram[sin, y], gram[cos, y] - gram[sin, x]]
        rows, rank, condition = least_squares(moved, np.stack(moments, axis=1), ridge)
        turned, _, _ = least_squares(gram[np.ix_(one, one)], gram[one, turn][:, None], ridge)
        h = symmetric_generator(self.dictionary, rows[0], rows[1], turned[0])
        return h, rank, condition

    def _state_reconstruction(self) -> Array:
        """Fit C = X Z^+ (paper, eq. 8) and make sure that the state does lie in the dictionary."""
        nz = self.dictionary.size
        lifted, crossed = self._gram[:nz, :nz], self._gram[:nz, -STATES:]
        c, _, _ = least_squares(lifted, crossed, 0.0)
        power = np.diag(self._gram)[-STATES:]
        missed = power - 2 * np.sum(c * crossed.T, axis=1) + np.sum((c @ lifted) * c, axis=1)
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
    products = (z - z_next) @ blocks.transpose(2, 1, 0).reshape(z.shape[1], -1)
    products = products.reshape(len(z), -1, STATES)
    difference: Array = products[:, 0].copy()
    for i in range(w.shape[1]):
        difference += w[:, i : i + 1] * products[:, 1 + i]
    return difference
