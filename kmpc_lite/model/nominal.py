"""The robot that obeys its commands exactly, as a model."""

from __future__ import annotations

import numpy as np

from kmpc_lite.model.dictionary import UnicycleDictionary
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import INPUTS, STATES


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
