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
