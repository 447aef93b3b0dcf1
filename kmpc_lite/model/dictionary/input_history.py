"""A dictionary whose model is driven by past commands too."""

from __future__ import annotations

from typing import Any

import numpy as np

from kmpc_lite.errors import ModelError
from kmpc_lite.model.dictionary.base import MAX_LAG, Dictionary, LiftedAsBase, dictionary_to_config
from kmpc_lite.types import INPUTS, Array


class InputHistoryDictionary(LiftedAsBase):
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
    >>> from kmpc_lite import UnicycleDictionary
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
