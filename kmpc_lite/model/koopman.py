"""The bilinear Koopman model: predict, roll out, linearise, save, load."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.errors import ModelError
from kmpc_lite.files import real_array
from kmpc_lite.model.dictionary import Dictionary, UnicycleDictionary
from kmpc_lite.model.noise_sources import NoiseSources
from kmpc_lite.types import INPUTS, STATES, Array

TABLEAUX = {
    "rk4": ((0.0, 1 / 6), (0.5, 1 / 3), (0.5, 1 / 3), (1.0, 1 / 6)),
    "midpoint": ((0.0, 0.0), (0.5, 1.0)),
}
"""Explicit Runge-Kutta methods whose stages depend on the stage before only: node and weight of
each."""


LARGEST = 1e12
"""Values of a model beyond this [SI units] are damage: products of them overflow."""
_DIAGONAL = np.arange(STATES)


class Linearization(NamedTuple):
    """First-order expansion of the model at n points.

    ``x+ = value + A dx + B du + sum_j B_past[j] dpast[j]``.
    """

    value: Array
    """Predicted states, (..., 3)."""
    A: Array
    """Derivative by the state, (..., 3, 3)."""
    B: Array
    """Derivative by the present command, (..., 3, 2)."""
    B_past: Array
    """Derivative by past commands, newest first, (..., L, 3, 2)."""


@dataclass(frozen=True)
class NoiseModel:
    """Covariance of the one-step residual in the robot's frame, as a function of the command.

    ``cov(u) = S[0] + S[1] v^2 + S[2] omega^2`` for (forward [m], left [m], heading [rad]), each S
    symmetric and positive semidefinite, (3, 3).
    """

    coefficients: Array
    sources: NoiseSources | None = None
    """What the covariance comes from, where a log was long enough to tell."""

    def check(self) -> None:
        """Raise ModelError unless the coefficients are three covariances."""
        s = real_array(self.coefficients, "model noise", ModelError)
        if s.shape != (3, STATES, STATES) or not (np.abs(s) <= LARGEST).all():
            raise ModelError(
                f"model noise: expected finite values of shape (3, 3, 3), got {s.shape}"
            )
        tolerance = 1e-9 * np.abs(s).max()
        if (
            np.abs(s - s.transpose(0, 2, 1)).max() > tolerance
            or np.linalg.eigvalsh(s).min() < -tolerance
        ):
            raise ModelError("model noise: expected symmetric positive semidefinite matrices")
        if self.sources is not None:
            self.sources.check()

    def covariance(self, u: Array) -> Array:
        """Covariances (..., 3, 3) for commands (..., 2)."""
        terms = np.stack([np.ones(u.shape[:-1]), u[..., 0] ** 2, u[..., 1] ** 2], axis=-1)
        covariance: Array = np.tensordot(terms, self.coefficients, axes=(-1, 0))
        return covariance


@dataclass(frozen=True, eq=False)
class KoopmanModel:
    """A learned robot: bilinear in the lifted state and the command (paper, eq. 4 to 6 and 12).

    With ``z = phi(x)`` and the bilinear inputs ``w`` (the command, unless the dictionary delays
    it), ``f(x, u) = C (A z + B w + H (w (x) z))`` is the next state of a discrete model (``edmdc``,
    the paper), and the derivative of the state for a continuous one (``integral``), which is then
    integrated over `dt` by the classical Runge-Kutta method with the command held (see
    `integrator`).

    Parameters
    ----------
    dictionary : Dictionary
        Lifts the pose, nz coordinates; nw bilinear inputs.
    dt : float
        Sampling period [s].
    A, B, H, C : ndarray
        (nr, nz), (nr, nw), (nr, nw nz), (3, nr). Discrete models have nr = nz lifted rows;
        continuous ones only the nr = 3 rows of the state, with C the identity.
    continuous : bool
        Whether `f` is a derivative.
    noise_model : NoiseModel or None
        Covariance of what the model cannot explain.
    info : dict
        What the fit wants remembered: method, samples, rank, condition. Values that JSON can hold.
    integrator : {"rk4", "midpoint"}
        How a continuous model is integrated over a period. The midpoint rule takes half the time of
        the classical Runge-Kutta method; at 0.6 m/s, pi/4 rad/s and 0.1 s it differs by 0.015 mm
        per period.

    Raises
    ------
    ModelError
        For shapes that do not fit together or values that are not finite.
    """

    dictionary: Dictionary
    dt: float
    A: Array
    B: Array
    H: Array
    C: Array
    continuous: bool
    noise_model: NoiseModel | None = None
    info: Mapping[str, Any] = field(default_factory=dict)
    integrator: str = "rk4"

    def __post_init__(self) -> None:
        """Check the matrices and fold them into the form that `advance` uses."""
        nz, nw = self.dictionary.size, self.dictionary.input_size
        rows = len(real_array(self.A, "model matrix A", ModelError))
        for name, expected in (
            ("A", (rows, nz)),
            ("B", (rows, nw)),
            ("H", (rows, nw * nz)),
            ("C", (STATES, rows)),
        ):
            matrix = real_array(getattr(self, name), f"model matrix {name}", ModelError)
            if matrix.shape != expected:
                raise ModelError(
                    f"model matrix {name}: expected shape {expected} for {nz} lifted coordinates, "
                    f"got {matrix.shape}"
                )
            if not np.isfinite(matrix).all():
                raise ModelError(f"model matrix {name} holds NaN or infinity")
            if not (np.abs(matrix) <= LARGEST).all():
                raise ModelError(f"model matrix {name}: expected values of at most {LARGEST:g}")
            object.__setattr__(self, name, matrix)
        dt = real_array(self.dt, "model dt", ModelError)
        if dt.size != 1 or not (np.isfinite(dt).all() and (dt > 0.0).all()):
            raise ModelError(f"model dt: expected a time > 0 s, got {self.dt}")
        object.__setattr__(self, "dt", float(dt.item()))
        if self.integrator not in TABLEAUX:
            raise ModelError(
                f"model integrator: expected {' or '.join(TABLEAUX)}, got {self.integrator!r}"
            )
        if self.noise_model is not None:
            self.noise_model.check()
        # C is folded into the other matrices once. H is kept in two layouts: by input, to form the
        # state-dependent matrix M(w), and by lifted coordinate, to form the derivative by w.
        h_blocks = (self.C @ self.H).reshape(STATES, nw, nz)
        object.__setattr__(self, "_A", np.ascontiguousarray(self.C @ self.A))
        object.__setattr__(self, "_B", np.ascontiguousarray(self.C @ self.B))
        object.__setattr__(self, "_has_B", bool(self.B.any()))
        object.__setattr__(
            self,
            "_H_by_input",
            np.ascontiguousarray(h_blocks.transpose(1, 0, 2).reshape(nw, STATES * nz)),
        )
        object.__setattr__(
            self,
            "_H_by_lift",
            np.ascontiguousarray(h_blocks.transpose(2, 0, 1).reshape(nz, STATES * nw)),
        )

    _A: Array = field(init=False, repr=False)
    _B: Array = field(init=False, repr=False)
    _has_B: bool = field(init=False, repr=False)
    _H_by_input: Array = field(init=False, repr=False)
    _H_by_lift: Array = field(init=False, repr=False)

    @property
    def history(self) -> int:
        """How many past commands the model needs, L."""
        return self.dictionary.history

    def predict(self, x: ArrayLike, u: ArrayLike, history: ArrayLike | None = None) -> Array:
        """Predict the state one `dt` ahead (paper, eq. 12).

        Parameters
        ----------
        x, u : array_like
            States (..., 3) [m, m, rad] and commands (..., 2) [m/s, rad/s].
        history : array_like, optional
            The L commands before `u`, oldest first, (..., L, 2); zeros where not given.

        Returns
        -------
        ndarray
            States (..., 3).

        Raises
        ------
        ValueError
            For wrong shapes.
        """
        x, u, past = self._check(x, u, history)
        return self.advance(x, self.dictionary.inputs(u, past))

    def advance(self, x: Array, w: Array) -> Array:
        """Next states (..., 3) for bilinear inputs (..., nw) of any dtype, symbols included."""
        matrix, offset = self._input_terms(w)

        def f(state: Array) -> Array:
            derivative: Array = (matrix @ self.dictionary.lift(state)[..., None])[..., 0]
            return derivative if offset is None else derivative + offset

        if not self.continuous:
            return f(x)
        total, slope = x, x
        for node, weight in TABLEAUX[self.integrator]:
            slope = f(x + (node * self.dt) * slope if node else x)
            if weight:
                total = total + (weight * self.dt) * slope
        return total

    def _input_terms(self, w: Array) -> tuple[Array, Array | None]:
        """Matrix and offset that inputs make of the model: ``M(w) phi(x) + offset``.

        There is no offset where B is zero.
        """
        matrix = (w @ self._H_by_input).reshape(*w.shape[:-1], *self._A.shape) + self._A
        return matrix, w @ self._B.T if self._has_B else None

    def rollout(self, x0: ArrayLike, inputs: ArrayLike, history: ArrayLike | None = None) -> Array:
        """Predict a whole path.

        Parameters
        ----------
        x0, inputs : array_like
            First state (..., 3) and commands (T, 2), or (..., T, 2) for many paths at once.
        history : array_like, optional
            The L commands before the first, (..., L, 2); zeros where not given.

        Returns
        -------
        ndarray
            States (..., T + 1, 3), the first being `x0`.

        Raises
        ------
        ValueError
            For wrong shapes.
        """
        commands = np.asarray(inputs, dtype=float)
        if commands.ndim < 2 or commands.shape[-1] != INPUTS:
            raise ValueError(f"inputs: expected shape (T, {INPUTS}), got {commands.shape}")
        x, _, past = self._check(x0, np.zeros((*commands.shape[:-2], INPUTS)), history)
        steps, length = commands.shape[-2], self.history
        commands = np.broadcast_to(commands, (*x.shape[:-1], steps, INPUTS))
        before = np.zeros((*x.shape[:-1], length, INPUTS)) if past is None else past
        all_commands = np.concatenate([before, commands], axis=-2)
        states = np.empty((*x.shape[:-1], steps + 1, STATES))
        states[..., 0, :] = x
        for k in range(steps):
            w = self.dictionary.inputs(commands[..., k, :], all_commands[..., k : k + length, :])
            states[..., k + 1, :] = x = self.advance(x, w)
        return states

    def linearize(
        self, x: ArrayLike, u: ArrayLike, history: ArrayLike | None = None
    ) -> Linearization:
        """Predictions and their Jacobians at many points at once.

        Parameters
        ----------
        x, u, history : array_like
            As in `predict`.

        Returns
        -------
        Linearization
            value (..., 3), A (..., 3, 3), B (..., 3, 2), B_past (..., L, 3, 2).

        Raises
        ------
        ValueError
            For wrong shapes.
        """
        x, u, past = self._check(x, u, history)
        w = self.dictionary.inputs(u, past)
        lead = w.shape[:-1]
        by_all = self._derivatives(x, w)
        value, by_x, by_w = by_all[..., 0], by_all[..., 1 : 1 + STATES], by_all[..., 1 + STATES :]
        jacobian = self.dictionary.inputs_jacobian(u, past)
        if jacobian is None:
            return Linearization(value, by_x, by_w, np.empty((*lead, 0, STATES, INPUTS)))
        by_age = np.einsum("...iw,...wau->...aiu", by_w, jacobian)
        return Linearization(value, by_x, by_age[..., 0, :, :], by_age[..., 1:, :, :])

    def _derivatives(self, x: Array, w: Array) -> Array:
        """Prediction, its derivative by x and by w side by side in one array, (..., 3, 1 + 3 + nw).

        All three travel through the Runge-Kutta stages together: few, large array operations.
        """
        matrix, offset = self._input_terms(w)
        start = np.zeros((*w.shape[:-1], STATES, 1 + STATES + w.shape[-1]))
        start[..., 0] = x
        start[..., _DIAGONAL, 1 + _DIAGONAL] = 1.0

        def f(stage: Array) -> Array:
            expanded = self.dictionary.expand(stage[..., 0])
            product = matrix @ expanded
            slope = np.empty_like(start)
            slope[..., 0] = product[..., 0]
            if offset is not None:
                slope[..., 0] += offset
            by_w = (expanded[..., 0] @ self._H_by_lift).reshape(*w.shape[:-1], *self._B.shape)
            if self._has_B:
                by_w += self._B
            if stage is start:
                # whose derivatives are one and zero
                slope[..., 1 : 1 + STATES], slope[..., 1 + STATES :] = product[..., 1:], by_w
                return slope
            np.matmul(product[..., 1:], stage[..., 1:], out=slope[..., 1:])
            slope[..., 1 + STATES :] += by_w
            return slope

        if not self.continuous:
            return f(start)
        total, slope = start, start
        for node, weight in TABLEAUX[self.integrator]:
            slope = f(start + (node * self.dt) * slope if node else start)
            if weight:
                total = total + (weight * self.dt) * slope
        return total

    def noise(self, u: ArrayLike) -> Array:
        """Covariance (..., 3, 3) of the one-step residual in the robot's frame, by command.

        Order: forward [m], left [m], heading [rad]. Zeros where the model has no noise model.
        """
        commands = np.asarray(u, dtype=float)
        if commands.shape[-1:] != (INPUTS,):
            raise ValueError(f"expected commands (..., {INPUTS}), got {commands.shape}")
        if self.noise_model is None:
            return np.zeros((*commands.shape[:-1], STATES, STATES))
        return self.noise_model.covariance(commands)

    def with_dt(self, dt: float) -> KoopmanModel:
        """Return the same model for another sampling period [s].

        Only a continuous model without input history has one.

        The noise model is left out: it was measured per period.
        """
        if not self.continuous or self.history:
            raise ModelError(
                f"model dt {self.dt} s cannot become {dt} s: only an integral fit without input "
                "history can change its period; "
                "fit the log again with the new dt"
            )
        return replace(self, dt=dt, noise_model=None)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the model to an npz file, whole or not at all; numbers and JSON only, no pickle.

        Raises
        ------
        ModelError
            Where the file cannot be written, or `info` or the dictionary's configuration is not
            JSON.
        """
        from kmpc_lite.model.npz import save_model

        save_model(self, path)

    @classmethod
    def load(
        cls, path: str | os.PathLike[str], dictionary: Dictionary | None = None
    ) -> KoopmanModel:
        """Read a model that `save` wrote.

        Parameters
        ----------
        path : path
            The npz file.
        dictionary : Dictionary, optional
            Needed for a dictionary class of your own.

        Raises
        ------
        ModelError
            For a file that is missing, damaged, not a model, or from a newer version.
        """
        from kmpc_lite.model.npz import load_model

        return load_model(path, dictionary)

    def _check(
        self, x: ArrayLike, u: ArrayLike, history: ArrayLike | None
    ) -> tuple[Array, Array, Array | None]:
        """Arrays of the right shapes, or ValueError."""
        states, commands = np.asarray(x, dtype=float), np.asarray(u, dtype=float)
        if states.shape[-1:] != (STATES,) or commands.shape[-1:] != (INPUTS,):
            raise ValueError(
                f"expected states (..., {STATES}) and commands (..., {INPUTS}), "
                f"got {states.shape} and {commands.shape}"
            )
        past = None
        if history is not None and self.history:
            past = np.asarray(history, dtype=float)
            if past.shape[-2:] != (self.history, INPUTS):
                raise ValueError(
                    f"history: expected shape (..., {self.history}, {INPUTS}), got {past.shape}"
                )
        lead = states.shape[:-1]
        if lead != commands.shape[:-1] or (past is not None and lead != past.shape[:-2]):
            lead = np.broadcast_shapes(
                lead, commands.shape[:-1], () if past is None else past.shape[:-2]
            )
            states, commands = (
                np.broadcast_to(states, (*lead, STATES)),
                np.broadcast_to(commands, (*lead, INPUTS)),
            )
            past = None if past is None else np.broadcast_to(past, (*lead, self.history, INPUTS))
        return states, commands, past


def nominal_unicycle(dt: float) -> KoopmanModel:
    """Give the robot that obeys its commands exactly, as a model.

    It moves by ``x' = v cos, y' = v sin, theta' = omega``.

    The unicycle's generator lies in the paper's dictionary, so no learning is needed.

    Examples
    --------
    >>> nominal_unicycle(0.1).predict([0.0, 0.0, 0.0], [0.5, 0.0]).round(3)
    array([0.05, 0.  , 0.  ])
    """
    dictionary = UnicycleDictionary()
    h = np.zeros((STATES, INPUTS, dictionary.size))
    h[0, 0, dictionary.names.index("cos")] = 1.0
    h[1, 0, dictionary.names.index("sin")] = 1.0
    h[2, 1, dictionary.names.index("1")] = 1.0
    return KoopmanModel(
        dictionary,
        dt,
        A=np.zeros((STATES, dictionary.size)),
        B=np.zeros((STATES, INPUTS)),
        H=h.reshape(STATES, -1),
        C=np.eye(STATES),
        continuous=True,
        info={"method": "nominal unicycle"},
    )
