"""The bilinear Koopman model: predict, roll out, linearise, save, load."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.errors import ModelError
from kmpc_lite.files import real_array
from kmpc_lite.model.arguments import broadcast, windows
from kmpc_lite.model.bilinear import TABLEAUX, BilinearForm, Linearization, integrate
from kmpc_lite.model.dictionary import Dictionary, UnicycleDictionary
from kmpc_lite.model.noise_model import LARGEST, NoiseModel
from kmpc_lite.model.symmetric import SymmetricForm
from kmpc_lite.types import INPUTS, STATES, Array

OF_THE_NOISE = ("noise_quantiles", "held_out")
"""What a model's `info` says of its noise and its errors, period by period."""


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
        object.__setattr__(self, "inputs", self.dictionary.commands)
        object.__setattr__(self, "history", self.dictionary.history)
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
        form = BilinearForm.fold(self.dictionary, self.A, self.B, self.H, self.C)
        object.__setattr__(self, "_form", form)
        tableau = TABLEAUX[self.integrator]
        closed = SymmetricForm.fold(form, self.dt, tableau) if self.continuous else None
        object.__setattr__(self, "closed_form", closed)

    _form: BilinearForm = field(init=False, repr=False)
    inputs: int = field(init=False, repr=False)
    """Numbers of a command, m."""
    history: int = field(init=False, repr=False)
    """How many past commands the model needs, L."""
    closed_form: SymmetricForm | None = field(init=False, repr=False)
    """Of a symmetric model; None for any other."""

    def __repr__(self) -> str:
        made = self.info.get("method", "made by hand")
        looks = f", looks back on {self.history} commands" if self.history else ""
        return f"<KoopmanModel: {made}, {len(self.A)} lifted, dt {self.dt:g} s{looks}>"

    def predict(self, x: ArrayLike, u: ArrayLike, history: ArrayLike | None = None) -> Array:
        """Predict the state one `dt` ahead (paper, eq. 12).

        Parameters
        ----------
        x, u : array_like
            States (..., 3) [m, m, rad] and commands (..., m) [m/s, rad/s], m = 2 as a rule.
        history : array_like, optional
            The L commands before `u`, oldest first, (..., L, 2); zeros if not given.

        Returns
        -------
        ndarray
            States (..., 3).

        Raises
        ------
        ValueError
            For wrong shapes.
        """
        x, u, past = broadcast(x, u, history, self.history, self.inputs)
        w = self.dictionary.inputs(u, past)
        return self.advance(x, w) if self.closed_form is None else self.closed_form.advance(x, w)

    def advance(self, x: Array, w: Array) -> Array:
        """Next states (..., 3) for bilinear inputs (..., nw) of any dtype, symbols included."""
        return self._integrate(self._form.slope(w), x)

    def _integrate(self, f: Callable[[Array], Array], start: Array) -> Array:
        """One period from a start of any shape: `f` itself, or its integral."""
        if not self.continuous:
            return f(start)
        return integrate(f, start, self.dt, self.integrator)

    def rollout(self, x0: ArrayLike, inputs: ArrayLike, history: ArrayLike | None = None) -> Array:
        """Predict a whole path.

        Parameters
        ----------
        x0, inputs : array_like
            First state (..., 3) and commands (T, 2), or (..., T, 2) for many paths at once.
        history : array_like, optional
            The L commands before the first, (..., L, 2); zeros if not given.

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
        if commands.ndim < 2 or commands.shape[-1] != self.inputs:
            raise ValueError(f"inputs: expected shape (T, {self.inputs}), got {commands.shape}")
        if isinstance(x0, np.ndarray) and x0.shape == (STATES,) and not self.history:
            if self.closed_form is not None:
                return self.closed_form.rollout(x0, self.dictionary.inputs(commands, None))
        now = np.zeros((*commands.shape[:-2], self.inputs))
        x, _, past = broadcast(x0, now, history, self.history, self.inputs)
        steps, length = commands.shape[-2], self.history
        commands = np.broadcast_to(commands, (*x.shape[:-1], steps, self.inputs))
        before = np.zeros((*x.shape[:-1], length, self.inputs)) if past is None else past
        all_commands = np.concatenate([before, commands], axis=-2)
        w = self.dictionary.inputs(commands, windows(all_commands, length))
        if self.closed_form is not None:
            return self.closed_form.rollout(x, w)
        states = np.empty((*x.shape[:-1], steps + 1, STATES))
        states[..., 0, :] = x
        for k in range(steps):
            states[..., k + 1, :] = x = self.advance(x, w[..., k, :])
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
        x, u, past = broadcast(x, u, history, self.history, self.inputs)
        w = self.dictionary.inputs(u, past)
        lead = w.shape[:-1]
        if self.closed_form is not None:
            value, by_x, by_w = self.closed_form.linearize(x, w)
        else:
            start = self._form.start(x, w)
            by_all = self._integrate(self._form.slope_and_derivatives(w, start), start)
            value, by_x = by_all[..., 0], by_all[..., 1 : 1 + STATES]
            by_w = by_all[..., 1 + STATES :]
        jacobian = self.dictionary.inputs_jacobian(u, past)
        if jacobian is None:
            return Linearization(value, by_x, by_w, np.empty((*lead, 0, STATES, self.inputs)))
        by_age = np.einsum("...iw,...wau->...aiu", by_w, jacobian)
        return Linearization(value, by_x, by_age[..., 0, :, :], by_age[..., 1:, :, :])

    def noise(self, u: ArrayLike) -> Array:
        """Covariance (..., 3, 3) of the one-step residual in the robot's frame, by command.

        Order: forward [m], left [m], heading [rad]. Zeros where the model has no noise model.
        """
        commands = np.asarray(u, dtype=float)
        if commands.shape[-1:] != (self.inputs,):
            raise ValueError(f"expected commands (..., {self.inputs}), got {commands.shape}")
        if self.noise_model is None:
            return np.zeros((*commands.shape[:-1], STATES, STATES))
        return self.noise_model.covariance(commands)

    def with_dt(self, dt: float) -> KoopmanModel:
        """Return the same model for another sampling period [s].

        Only a continuous model without input history has one. Its noise model, which was measured
        per period, is left out, and the quantiles that were calibrated with it.
        """
        if not self.continuous or self.history:
            raise ModelError(
                f"model dt {self.dt} s cannot become {dt} s: only an integral fit without input "
                "history can change its period; fit the log again with the new dt"
            )
        info = {k: v for k, v in self.info.items() if k not in OF_THE_NOISE}
        return replace(self, dt=dt, noise_model=None, info=info)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the model to an npz file, whole or not at all; numbers and JSON only, no pickle.

        Raises
        ------
        ModelError
            If the file cannot be written, or `info` or the dictionary's configuration is not
            JSON.
        """
        from kmpc_lite.model.file import save_model

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
        from kmpc_lite.model.file import load_model

        return load_model(path, dictionary)


def nominal_unicycle(dt: float) -> KoopmanModel:
    """Give the robot that obeys its commands exactly, as a model.

    It moves by ``x' = v cos, y' = v sin, theta' = omega``.

    The unicycle's generator lies in the paper's dictionary, so no learning is needed.

    Examples
    --------
    >>> nominal_unicycle(0.1).predict([0.0, 0.0, 0.0], [0.5, 0.0]).round(3)
    array([0.05, 0.  , 0.  ])
    """
    return _obedient(UnicycleDictionary(), dt, "nominal unicycle")


def nominal_omni(dt: float) -> KoopmanModel:
    """Give the robot that drives sideways, too, and obeys (v_x, v_y, omega) exactly, as a model.

    Examples
    --------
    >>> nominal_omni(0.1).predict([0.0, 0.0, 0.0], [0.5, 0.2, 0.0]).round(3)
    array([0.05, 0.02, 0.  ])
    """
    return _obedient(UnicycleDictionary(commands=3), dt, "nominal omni")


def nominal_like(model: KoopmanModel) -> KoopmanModel:
    """Give the robot that obeys exactly, with the commands and the period of a model."""
    return (nominal_omni if model.inputs > INPUTS else nominal_unicycle)(model.dt)


def _obedient(dictionary: UnicycleDictionary, dt: float, method: str) -> KoopmanModel:
    h = np.zeros((STATES, dictionary.commands, dictionary.size))
    one, cos, sin = (dictionary.names.index(name) for name in ("1", "cos", "sin"))
    h[0, 0, cos] = h[1, 0, sin] = h[2, -1, one] = 1.0
    if dictionary.commands > INPUTS:
        h[0, 1, sin], h[1, 1, cos] = -1.0, 1.0
    return KoopmanModel(
        dictionary,
        dt,
        A=np.zeros((STATES, dictionary.size)),
        B=np.zeros((STATES, dictionary.commands)),
        H=h.reshape(STATES, -1),
        C=np.eye(STATES),
        continuous=True,
        info={"method": method},
    )
