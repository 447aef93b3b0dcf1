"""How fast a robot changes its speeds, if that is slower than commanded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from kmpc_lite.types import Array

FREE = np.inf
"""Limit of a robot that follows at once."""


class Ramps(NamedTuple):
    """Largest changes of each number of a command, (m,) each [m/s^2, rad/s^2].

    Of a car the second one is that of its curvature [1/m per second].
    """

    faster: Array
    """Away from zero; infinite if no ramp is known."""
    slower: Array
    """Towards zero."""

    @property
    def limit(self) -> bool:
        """Whether they limit anything."""
        return bool(np.isfinite(self).any())

    def within(self, other: Ramps) -> Ramps:
        """The slower of two ramps in each direction."""
        return Ramps(*np.minimum(self, other))

    def as_dict(self) -> dict[str, Any]:
        """Plain values for a model's `info`; None if nothing is limited."""
        return {
            name: [float(v) if np.isfinite(v) else None for v in values]
            for name, values in self._asdict().items()
        }

    @classmethod
    def of(cls, info: Mapping[str, Any], name: str = "ramps") -> Ramps:
        """Read them from a model's `info`; those of a robot without any where it tells none."""
        told = info.get(name) or dict.fromkeys(cls._fields, [None])  # of any m
        faster, slower = (
            np.array([FREE if v is None else float(v) for v in told[side]]) for side in cls._fields
        )
        return cls(faster, slower)
