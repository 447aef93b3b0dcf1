"""The bilinear Koopman model: predict, roll out, linearise, save, load."""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.dictionary import (
    INPUTS,
    STATES,
    Array,
    Dictionary,
    UnicycleDictionary,
    dictionary_from_config,
    dictionary_to_config,
)
from kmpc_lite.errors import ModelError

FORMAT = "kmpc_lite.model"
VERSION = 1

RK4_NODES = (0.0, 0.5, 0.5, 1.0)
RK4_WEIGHTS = (1 / 6, 1 / 3, 1 / 3, 1 / 6)


class Linearization(NamedTuple):
    """First-order expansion of the model at n points, ``x+ = value + A dx + B du + sum_j B_past[j] dpast[j]``."""

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

    def covariance(self, u: Array) -> Array:
        """Covariances (..., 3, 3) for commands (..., 2)."""
        terms = np.stack([np.ones(u.shape[:-1]), u[..., 0] ** 2, u[..., 1] ** 2], axis=-1)
        covariance: Array = np.tensordot(terms, self.coefficients, axes=(-1, 0))
        return covariance


@dataclass(frozen=True, eq=False)
class KoopmanModel:
    """A learned robot: bilinear in the lifted state and the command (paper, eq. 4 to 6 and 12).

    With ``z = phi(x)`` and the bilinear inputs ``w`` (the command, unless the dictionary delays it),
    ``f(x, u) = C (A z + B w + H (w (x) z))`` is the next state of a discrete model (``edmdc``, the paper),
    and the derivative of the state for a continuous one (``integral``), which is then integrated over
    `dt` by the classical Runge-Kutta method with the command held.

    Parameters
    ----------
    dictionary : Dictionary
        Lifts the pose, nz coordinates; nw bilinear inputs.
    dt : float
        Sampling period [s].
    A, B, H, C : ndarray
        (nr, nz), (nr, nw), (nr, nw nz), (3, nr). Discrete models have nr = nz lifted rows; continuous
        ones only the nr = 3 rows of the state, with C the identity.
    continuous : bool
        Whether `f` is a derivative.
    noise_model : NoiseModel or None
        Covariance of what the model cannot explain.
    info : dict
        What the fit wants remembered: method, samples, rank, condition. Values that JSON can hold.

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

    def __post_init__(self) -> None:
        nz, nw = self.dictionary.size, self.dictionary.input_size
        for name, columns in (("A", nz), ("B", nw), ("H", nw * nz), ("C", None)):
            matrix = np.ascontiguousarray(getattr(self, name), dtype=float)
            rows = STATES if name == "C" else len(self.A)
            expected = (rows, len(self.A) if columns is None else columns)
            if matrix.shape != expected:
                raise ModelError(f"model matrix {name}: expected shape {expected} for {nz} lifted coordinates, got {matrix.shape}")
            if not np.isfinite(matrix).all():
                raise ModelError(f"model matrix {name} holds NaN or infinity")
            object.__setattr__(self, name, matrix)
        if not (np.isfinite(self.dt) and self.dt > 0.0):
            raise ModelError(f"model dt: expected a time > 0 s, got {self.dt}")
        if self.noise_model is not None and (
            self.noise_model.coefficients.shape != (3, STATES, STATES) or not np.isfinite(self.noise_model.coefficients).all()
        ):
            raise ModelError(f"model noise: expected finite values of shape (3, 3, 3), got {self.noise_model.coefficients.shape}")
        # C is folded into the other matrices once. H is kept in two layouts: by input, to form the
        # state-dependent matrix M(w), and by lifted coordinate, to form the derivative by w.
        h_blocks = (self.C @ self.H).reshape(STATES, nw, nz)
        object.__setattr__(self, "_A", np.ascontiguousarray(self.C @ self.A))
        object.__setattr__(self, "_B", np.ascontiguousarray(self.C @ self.B))
        object.__setattr__(self, "_H_by_input", np.ascontiguousarray(h_blocks.transpose(1, 0, 2).reshape(nw, STATES * nz)))
        object.__setattr__(self, "_H_by_lift", np.ascontiguousarray(h_blocks.transpose(2, 0, 1).reshape(nz, STATES * nw)))

    _A: Array = field(init=False, repr=False)
    _B: Array = field(init=False, repr=False)
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
        """Next states (..., 3) for bilinear inputs (..., nw); any NumPy dtype, symbolic objects too."""
        matrix = (w @ self._H_by_input).reshape(*w.shape[:-1], STATES, -1) + self._A
        offset = w @ self._B.T

        def f(state: Array) -> Array:
            derivative: Array = (matrix @ self.dictionary.lift(state)[..., None])[..., 0] + offset
            return derivative

        if not self.continuous:
            return f(x)
        total, slope = x, x
        for node, weight in zip(RK4_NODES, RK4_WEIGHTS, strict=True):
            slope = f(x + (node * self.dt) * slope if node else x)
            total = total + (weight * self.dt) * slope
        return total

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
        if commands.ndim < 2:
            raise ValueError(f"inputs: expected shape (T, {INPUTS}), got {commands.shape}")
        x, _, past = self._check(x0, np.zeros((*commands.shape[:-2], INPUTS)), history)
        steps, length = commands.shape[-2], self.history
        before = np.zeros((*commands.shape[:-2], length, INPUTS)) if past is None else past
        all_commands = np.concatenate([before, commands], axis=-2)
        states = np.empty((*x.shape[:-1], steps + 1, STATES))
        states[..., 0, :] = x
        for k in range(steps):
            w = self.dictionary.inputs(commands[..., k, :], all_commands[..., k : k + length, :])
            states[..., k + 1, :] = x = self.advance(x, w)
        return states

    def linearize(self, x: ArrayLike, u: ArrayLike, history: ArrayLike | None = None) -> Linearization:
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
        lead, nw = w.shape[:-1], w.shape[-1]
        matrix = (w @ self._H_by_input).reshape(*lead, STATES, -1) + self._A
        offset = w @ self._B.T

        def f(state: Array) -> tuple[Array, Array, Array]:
            z = self.dictionary.lift(state)
            by_w = (z @ self._H_by_lift).reshape(*lead, STATES, nw) + self._B
            value = (matrix @ z[..., None])[..., 0] + offset
            return value, matrix @ self.dictionary.jacobian(state), by_w

        if not self.continuous:
            value, by_x, by_w = f(x)
        else:
            value, by_x, by_w = self._runge_kutta_derivatives(f, x, nw)
        jacobian = self.dictionary.inputs_jacobian(u, past)
        if jacobian is None:
            return Linearization(value, by_x, by_w, np.empty((*lead, 0, STATES, INPUTS)))
        by_age = np.einsum("...iw,...wau->...aiu", by_w, jacobian)
        return Linearization(value, by_x, by_age[..., 0, :, :], by_age[..., 1:, :, :])

    def _runge_kutta_derivatives(self, f: Any, x: Array, nw: int) -> tuple[Array, Array, Array]:
        """Chain rule through the stages; the sensitivities by x and w travel side by side in one array."""
        identity = np.zeros((*x.shape[:-1], STATES, STATES + nw))
        identity[..., :STATES] = np.eye(STATES)
        value, sensitivity = x, identity
        slope, slope_sensitivity = x, identity
        for node, weight in zip(RK4_NODES, RK4_WEIGHTS, strict=True):
            if node:
                slope, by_x, by_w = f(x + (node * self.dt) * slope)
                slope_sensitivity = by_x @ (identity + (node * self.dt) * slope_sensitivity)
            else:
                slope, by_x, by_w = f(x)
                slope_sensitivity = by_x @ identity
            slope_sensitivity[..., STATES:] += by_w
            value = value + (weight * self.dt) * slope
            sensitivity = sensitivity + (weight * self.dt) * slope_sensitivity
        return value, sensitivity[..., :STATES], sensitivity[..., STATES:]

    def noise(self, u: ArrayLike) -> Array:
        """Covariance of the one-step residual in the robot's frame, (..., 3, 3), for commands (..., 2).

        Order: forward [m], left [m], heading [rad]. Zeros where the model has no noise model.
        """
        commands = np.asarray(u, dtype=float)
        if self.noise_model is None:
            return np.zeros((*commands.shape[:-1], STATES, STATES))
        return self.noise_model.covariance(commands)

    def with_dt(self, dt: float) -> KoopmanModel:
        """Return the same model for another sampling period [s]; only a continuous one without history has one.

        The noise model is left out: it was measured per period.
        """
        if not self.continuous or self.history:
            raise ModelError(
                f"model dt {self.dt} s cannot become {dt} s: only an integral fit without input history can change its period; "
                "fit the log again with the new dt"
            )
        return replace(self, dt=dt, noise_model=None)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the model to an npz file, whole or not at all; numbers and JSON only, no pickle."""
        target = Path(path)
        header = {
            "format": FORMAT,
            "version": VERSION,
            "dictionary": dictionary_to_config(self.dictionary),
            "dt": self.dt,
            "continuous": self.continuous,
            "info": dict(self.info),
        }
        noise = np.empty((0,)) if self.noise_model is None else self.noise_model.coefficients
        temporary = target.with_name(target.name + ".part")
        try:
            with open(temporary, "wb") as file:
                np.savez(
                    file, allow_pickle=False, header=np.array(json.dumps(header)), A=self.A, B=self.B, H=self.H, C=self.C, noise=noise
                )
            os.replace(temporary, target)
        except OSError as error:
            raise ModelError(f"{target}: cannot write the model: {error.strerror or error}") from error
        finally:
            temporary.unlink(missing_ok=True)

    @classmethod
    def load(cls, path: str | os.PathLike[str], dictionary: Dictionary | None = None) -> KoopmanModel:
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
        try:
            with np.load(path, allow_pickle=False) as archive:
                if "header" not in archive:
                    raise ModelError(f"{path}: an npz file, but not a kmpc_lite model (it has {', '.join(archive.files) or 'nothing'})")
                header = json.loads(str(archive["header"]))
                arrays = {key: archive[key] for key in ("A", "B", "H", "C", "noise")}
        except OSError as error:
            raise ModelError(f"{path}: cannot read the model: {error.strerror or error}") from error
        except (ValueError, KeyError, EOFError, zipfile.BadZipFile, AttributeError, NotImplementedError) as error:
            if isinstance(error, ModelError):
                raise
            raise ModelError(f"{path}: not a kmpc_lite model, or damaged: {error}") from error
        if not isinstance(header, dict) or header.get("format") != FORMAT:
            raise ModelError(f"{path}: not a kmpc_lite model")
        if header.get("version") != VERSION:
            raise ModelError(
                f"{path}: model format version {header.get('version')}, this kmpc_lite reads version {VERSION}: update kmpc_lite"
            )
        try:
            noise = arrays.pop("noise")
            return cls(
                dictionary=dictionary or dictionary_from_config(header["dictionary"]),
                dt=float(header["dt"]),
                continuous=bool(header["continuous"]),
                noise_model=NoiseModel(noise) if noise.size else None,
                info=header["info"],
                **arrays,
            )
        except (KeyError, TypeError, ValueError) as error:
            raise ModelError(f"{path}: damaged model: {error}") from error

    def _check(self, x: ArrayLike, u: ArrayLike, history: ArrayLike | None) -> tuple[Array, Array, Array | None]:
        """Arrays of the right shapes, or ValueError."""
        states, commands = np.asarray(x, dtype=float), np.asarray(u, dtype=float)
        if states.shape[-1:] != (STATES,) or commands.shape[-1:] != (INPUTS,):
            raise ValueError(f"expected states (..., {STATES}) and commands (..., {INPUTS}), got {states.shape} and {commands.shape}")
        if states.shape[:-1] != commands.shape[:-1]:
            lead = np.broadcast_shapes(states.shape[:-1], commands.shape[:-1])
            states, commands = np.broadcast_to(states, (*lead, STATES)), np.broadcast_to(commands, (*lead, INPUTS))
        if history is None or not self.history:
            return states, commands, None
        past = np.asarray(history, dtype=float)
        if past.shape[-2:] != (self.history, INPUTS):
            raise ValueError(f"history: expected shape (..., {self.history}, {INPUTS}), got {past.shape}")
        return states, commands, np.broadcast_to(past, (*commands.shape[:-1], self.history, INPUTS))


def nominal_unicycle(dt: float) -> KoopmanModel:
    """Give the robot that obeys its commands exactly, as a model: ``x' = v cos, y' = v sin, theta' = omega``.

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
