"""Dictionaries: how a pose is lifted, and which commands enter the bilinear model.

A dictionary gives the lifted state ``z = phi(x)`` (paper, eq. 3) and its Jacobian, both batched
over any leading axes. It also says which inputs ``w`` the model is bilinear in: the command itself
for most, delayed and past commands for `InputHistoryDictionary`.
"""

from __future__ import annotations

from itertools import product
from math import comb
from typing import Any, ClassVar, Protocol

import numpy as np

from kmpc_lite.errors import ModelError
from kmpc_lite.types import INPUTS, Array

MAX_SIZE = 10_000
"""Lifted coordinates of the largest dictionary: a Gram matrix of them still fits a big machine's
memory."""
MAX_LAG = 1000
"""Longest input history [periods]."""


class Dictionary(Protocol):
    """Lifting functions of a Koopman model; subclass it to write your own.

    Only `names`, `lift` and `jacobian` must be given: the defaults of the others say that the model
    is bilinear in the present command. `kind` and `config` are needed to save a model to a file.
    """

    kind: ClassVar[str] = "custom"

    @property
    def names(self) -> tuple[str, ...]:
        """One name for each lifted coordinate; ``"1"`` stands for the constant."""
        ...

    def lift(self, x: Array) -> Array:
        """Lift states (..., 3) to (..., nz)."""
        ...

    def jacobian(self, x: Array) -> Array:
        """Differentiate `lift` at states (..., 3): (..., nz, 3)."""
        ...

    def expand(self, x: Array) -> Array:
        """Give `lift` and `jacobian` side by side in one array (..., nz, 1 + 3)."""
        return np.concatenate([self.lift(x)[..., None], self.jacobian(x)], axis=-1)

    @property
    def size(self) -> int:
        """Number of lifted coordinates, nz."""
        return len(self.names)

    @property
    def history(self) -> int:
        """How many past commands the model needs, L."""
        return 0

    @property
    def input_size(self) -> int:
        """Number of inputs the model is bilinear in, nw."""
        return INPUTS

    def inputs(self, u: Array, history: Array | None = None) -> Array:
        """Give the bilinear inputs (..., nw) of commands (..., 2) and past ones (..., L, 2).

        `history` is in order of time: its last row is the command before `u`.
        """
        return u

    def inputs_jacobian(self, u: Array, history: Array | None = None) -> Array | None:
        """Differentiate `inputs`: (..., nw, 1 + L, 2), by present and past commands, newest first.

        None stands for the identity.
        """
        return None

    def config(self) -> dict[str, Any]:
        """Give the constructor arguments, as values that JSON can hold."""
        return {}


class UnicycleDictionary(Dictionary):
    """The paper's minimal dictionary, ``[1, x, y, theta, cos theta, sin theta]`` (sec. IV).

    Examples
    --------
    >>> UnicycleDictionary().lift(np.array([1.0, 2.0, 0.0]))
    array([1., 1., 2., 0., 1., 0.])
    """

    kind = "unicycle"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the six lifted coordinates."""
        return ("1", "x", "y", "theta", "cos", "sin")

    @property
    def size(self) -> int:
        """Six."""
        return 6

    def lift(self, x: Array) -> Array:
        """Lift states (..., 3) to (..., 6)."""
        # poses of whole numbers too must come out as floats; symbolic ones stay objects
        z = np.empty((*x.shape[:-1], 6), dtype=np.result_type(x, np.float64))
        z[..., 0] = 1.0
        z[..., 1:4] = x
        z[..., 4] = np.cos(x[..., 2])
        z[..., 5] = np.sin(x[..., 2])
        return z

    def jacobian(self, x: Array) -> Array:
        """Differentiate `lift`: (..., 6, 3)."""
        return self.expand(x)[..., 1:]

    def expand(self, x: Array) -> Array:
        """Give `lift` and `jacobian` side by side, (..., 6, 4)."""
        both = np.zeros((*x.shape[:-1], 6, 4))
        both[..., _ONES, _ONES] = 1.0
        both[..., 1:4, 0] = x
        cos, sin = np.cos(x[..., 2]), np.sin(x[..., 2])
        both[..., 4, 0] = both[..., 5, 3] = cos
        both[..., 5, 0] = sin
        both[..., 4, 3] = -sin
        return both


_ONES = np.arange(4)
"""Diagonal of `UnicycleDictionary.expand`: one wherever the robot is."""


class HermiteTrigDictionary(Dictionary):
    """Hermite polynomials of the pose times trigonometric functions of the heading (ACD-EDMD).

    All products ``He_i(x) He_j(y) He_k(theta) * {1, cos(m theta), sin(m theta)}`` with
    ``i + j + k <= order`` and ``m <= harmonics`` (Shi & Karydis 2021, probabilists' polynomials).
    Order 0 with one harmonic is ``[1, cos, sin]``: a model that does not depend on where the robot
    is, the right one for logs from a real floor.

    Parameters
    ----------
    order : int
        Highest total degree of the polynomials, >= 0.
    harmonics : int
        Highest multiple of the heading, >= 0.

    Examples
    --------
    >>> HermiteTrigDictionary(order=0).names
    ('1', 'cos(theta)', 'sin(theta)')
    >>> HermiteTrigDictionary(order=1).size
    12
    """

    kind = "hermite_trig"

    def __init__(self, order: int = 1, harmonics: int = 1) -> None:
        if not (
            0 <= order <= MAX_SIZE
            and 0 <= harmonics <= MAX_SIZE
            and order == int(order)
            and harmonics == int(harmonics)
        ):
            raise ModelError(
                f"HermiteTrigDictionary: order and harmonics must be integers >= 0, got {order}, "
                f"{harmonics}"
            )
        self.order, self.harmonics = int(order), int(harmonics)
        size = comb(self.order + 3, 3) * (2 * self.harmonics + 1)
        if size > MAX_SIZE:
            raise ModelError(
                f"HermiteTrigDictionary: order {order} and harmonics {harmonics} give {size:,} "
                f"coordinates, at most {MAX_SIZE:,}"
            )
        self._multiples = np.arange(1, self.harmonics + 1)
        degrees = [d for d in product(range(self.order + 1), repeat=3) if sum(d) <= self.order]
        self._degrees = np.array(sorted(degrees, key=lambda d: (sum(d), tuple(-i for i in d))))
        trig = ["1"] + [
            f"{f}({m if m > 1 else ''}theta)"
            for m in range(1, self.harmonics + 1)
            for f in ("cos", "sin")
        ]
        poly = [
            "*".join(f"He{i}({s})" for i, s in zip(d, ("x", "y", "theta"), strict=True) if i)
            for d in self._degrees
        ]
        self._names = tuple(
            "*".join(p for p in (a, b if b != "1" or not a else "") if p)
            for a in poly
            for b in trig
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the lifted coordinates."""
        return self._names

    def _trigonometric(self, x: Array) -> Array:
        """Give [1, cos theta, sin theta, cos 2 theta, ...] (..., 2 harmonics + 1)."""
        trig = np.ones((*x.shape[:-1], 2 * self.harmonics + 1), dtype=np.result_type(x, np.float64))
        for m in range(1, self.harmonics + 1):
            angle = x[..., 2] if m == 1 else m * x[..., 2]
            trig[..., 2 * m - 1] = np.cos(angle)
            trig[..., 2 * m] = np.sin(angle)
        return trig

    def _trigonometric_slope(self, trig: Array) -> Array:
        """Differentiate `_trigonometric` by the heading."""
        slope = np.zeros_like(trig)
        slope[..., 1::2] = -self._multiples * trig[..., 2::2]
        slope[..., 2::2] = self._multiples * trig[..., 1::2]
        return slope

    def _polynomials(self, x: Array) -> Array:
        """Give He_n of each coordinate, (..., 3, order + 1)."""
        he = np.ones((*x.shape, self.order + 1), dtype=np.result_type(x, np.float64))
        for n in range(1, self.order + 1):
            he[..., n] = x * he[..., n - 1] - ((n - 1) * he[..., n - 2] if n > 1 else 0.0)
        return he

    def lift(self, x: Array) -> Array:
        """Lift states (..., 3) to (..., nz)."""
        trig = self._trigonometric(x)
        if self.order == 0:
            return trig
        he, d = self._polynomials(x), self._degrees
        poly = he[..., 0, d[:, 0]] * he[..., 1, d[:, 1]] * he[..., 2, d[:, 2]]
        z: Array = (poly[..., :, None] * trig[..., None, :]).reshape(*x.shape[:-1], self.size)
        return z

    def jacobian(self, x: Array) -> Array:
        """Differentiate `lift`: (..., nz, 3), with ``He_n' = n He_(n-1)``."""
        return self.expand(x)[..., 1:]

    def expand(self, x: Array) -> Array:
        """Give `lift` and `jacobian` side by side, (..., nz, 4)."""
        trig = self._trigonometric(x)
        trig_slope = self._trigonometric_slope(trig)
        if self.order == 0:
            both = np.zeros((*trig.shape, 4))
            both[..., 0] = trig
            both[..., 3] = trig_slope
            return both
        he, d = self._polynomials(x), self._degrees
        slope = np.zeros_like(he)
        slope[..., 1:] = np.arange(1, self.order + 1) * he[..., :-1]
        value = [he[..., i, d[:, i]] for i in range(3)]
        gradient = [slope[..., i, d[:, i]] for i in range(3)]
        poly = value[0] * value[1] * value[2]
        by_pose = [
            poly,
            gradient[0] * value[1] * value[2],
            value[0] * gradient[1] * value[2],
            value[0] * value[1] * gradient[2],
        ]
        by_all: Array = np.stack(by_pose, axis=-1)[..., :, None, :] * trig[..., None, :, None]
        by_all[..., 3] += poly[..., :, None] * trig_slope[..., None, :]
        return by_all.reshape(*x.shape[:-1], self.size, 4)

    def config(self) -> dict[str, Any]:
        """Order and harmonics."""
        return {"order": self.order, "harmonics": self.harmonics}


class InputHistoryDictionary(Dictionary):
    """A dictionary whose model is driven by past commands too: motor lag and dead time.

    The model is bilinear in ``w = [u(k - j) for j in lags]``; ``lags=(0, 1, 2)`` learns a response
    of three periods, ``lags=(2,)`` is a pure delay of two.

    Parameters
    ----------
    base : Dictionary
        How the pose is lifted.
    lags : tuple of int
        Ages of the commands that act, in periods, 0 being the present one.
    product : bool
        Whether ``v * omega`` of each age joins `w`: the side slip of a skid-steer robot.

    Examples
    --------
    >>> slow = InputHistoryDictionary(UnicycleDictionary(), lags=(0, 1))
    >>> slow.inputs(np.array([0.3, 0.0]), np.array([[0.1, 0.2]]))
    array([0.3, 0. , 0.1, 0.2])
    """

    kind = "input_history"

    def __init__(
        self, base: Dictionary, lags: tuple[int, ...] = (0, 1, 2), product: bool = False
    ) -> None:
        ages = tuple(lags)
        if (
            not ages
            or len(set(ages)) != len(ages)
            or not all(0 <= j <= MAX_LAG and j == int(j) for j in ages)
        ):
            raise ModelError(
                f"InputHistoryDictionary: lags must be different integers from 0 to {MAX_LAG}, "
                f"got {lags}"
            )
        if base.history:
            raise ModelError(
                "InputHistoryDictionary: its base must not have an input history itself"
            )
        self.base, self.lags, self.product = base, tuple(int(j) for j in ages), bool(product)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the base's coordinates."""
        return self.base.names

    def lift(self, x: Array) -> Array:
        """As the base."""
        return self.base.lift(x)

    def jacobian(self, x: Array) -> Array:
        """As the base."""
        return self.base.jacobian(x)

    def expand(self, x: Array) -> Array:
        """As the base."""
        return self.base.expand(x)

    @property
    def history(self) -> int:
        """The longest lag."""
        return max(self.lags)

    @property
    def input_size(self) -> int:
        """Two, or three with the product, for every lag."""
        return (3 if self.product else 2) * len(self.lags)

    def _delayed(self, u: Array, history: Array | None) -> list[Array]:
        """Pick the command of each lag, (..., 2) each; commands before the first known are zero."""
        past = np.zeros((*u.shape[:-1], self.history, INPUTS)) if history is None else history
        return [u if j == 0 else past[..., -j, :] for j in self.lags]

    def inputs(self, u: Array, history: Array | None = None) -> Array:
        """Commands of each lag side by side, then their products: (..., nw)."""
        delayed = self._delayed(u, history)
        products = [c[..., :1] * c[..., 1:] for c in delayed] if self.product else []
        w: Array = np.concatenate([*delayed, *products], axis=-1)
        return w

    def inputs_jacobian(self, u: Array, history: Array | None = None) -> Array:
        """Differentiate `inputs`: (..., nw, 1 + L, 2), by the command of each age."""
        jac = np.zeros((*u.shape[:-1], self.input_size, 1 + self.history, INPUTS))
        for i, (lag, command) in enumerate(zip(self.lags, self._delayed(u, history), strict=True)):
            jac[..., 2 * i, lag, 0] = jac[..., 2 * i + 1, lag, 1] = 1.0
            if self.product:
                jac[..., 2 * len(self.lags) + i, lag, :] = command[..., ::-1]
        return jac

    def config(self) -> dict[str, Any]:
        """Give base, lags and product."""
        return {
            "base": dictionary_to_config(self.base),
            "lags": list(self.lags),
            "product": self.product,
        }


def dictionary_to_config(dictionary: Dictionary) -> dict[str, Any]:
    """Describe a dictionary as values that JSON can hold."""
    return {"kind": dictionary.kind, **dictionary.config()}


def dictionary_from_config(config: dict[str, Any]) -> Dictionary:
    """Build the dictionary that `dictionary_to_config` described.

    Raises
    ------
    ModelError
        For a kind that this version does not know, or arguments that it does not take.
    """
    if not isinstance(config, dict):
        raise ModelError(f"dictionary: expected its kind and arguments, got {config!r}")
    arguments = {key: value for key, value in config.items() if key != "kind"}
    try:
        match config.get("kind"):
            case "unicycle":
                return UnicycleDictionary(**arguments)
            case "hermite_trig":
                return HermiteTrigDictionary(**arguments)
            case "input_history":
                base = dictionary_from_config(arguments["base"])
                return InputHistoryDictionary(base, tuple(arguments["lags"]), arguments["product"])
            case "response":
                from kmpc_lite.model.response import ResponseDictionary

                return ResponseDictionary(
                    **{**arguments, "base": dictionary_from_config(arguments["base"])}
                )
    except (TypeError, KeyError, ValueError) as error:
        if isinstance(error, ModelError):
            raise
        raise ModelError(f"dictionary {config}: {error}") from error
    raise ModelError(
        f"unknown dictionary kind {config.get('kind')!r}; expected unicycle, "
        "hermite_trig, input_history or response"
    )
