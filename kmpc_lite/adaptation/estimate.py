"""Gains by weighed least squares from steps, and how surely a drive contradicts those in use.

A step's displacement is ``ahead`` times what the model drives ahead, ``aside`` times what it drives
sideways, and ``left`` times both, turned by a quarter; its turn is ``turn`` times the model's and
``pull`` times the way ahead. The two are estimated apart, so that no straight drive upsets turns.
Lags that the model has wrong are estimated beside the gains, and left out of them: what earlier
commands explain is no gain.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kmpc_lite.adaptation.state import Gains
from kmpc_lite.scale import UNIT_RADIUS
from kmpc_lite.types import Array

QUIETEST = 0.4
"""Least variance of the residuals that a test assumes, as a share of the expected one: a few steps
may be quiet by chance."""
FEWEST = 6
"""Least number of steps with a weight that gains are estimated from: a robot that turns on the spot
leaves fewer, and from those any gain may come out by chance."""
PRIOR, PULL_PRIOR = 0.3, 0.1
"""Prior standard deviations of gains, and of the pull [rad per unit of length]: a gain that a drive
does not show stays as it was."""
EVEN_NOISE = 0.3
"""Share of the usual noise that is added to every step's own: without it, the few slowest steps
would outweigh all others where poses are noisy."""
NOISE_FLOOR, TURN_NOISE_FLOOR = 1 / 300, 5e-4
"""Smallest noise that a step [radii] and its turn [rad] have: what poses are measured to."""
ROWS = np.array([[2.0], [1.0]])
"""Numbers that a step tells of its displacement, and of its turn."""


def residuals(terms: Array, gains: Gains) -> Array:
    """What gains leave (2, 2, n) of displacements and turns by their terms (2, 4 or more, 2, n)."""
    left: Array = terms[:, 3]
    for term, used in enumerate(_by_block(gains).T):
        left = left - used[:, None, None] * terms[:, term]
    return left


def _by_block(gains: Gains) -> Array:
    """Gains (2, 3) of displacements and turns."""
    return np.array(((gains.ahead, gains.left, gains.aside), (gains.turn, gains.pull, 0.0)))


class Evidence(NamedTuple):
    """Weighed steps, the newest first."""

    terms: Array
    """(2, 4 + J, 2, n) as of `STEP`, of J lags; 0 where a step does not tell."""
    tells: Array
    """(2, n) 1 where the step tells of moving, and of turning."""

    @classmethod
    def of(cls, steps: Array, noise: Array, white: Array, length: float) -> Evidence:
        """Weigh steps (n,) of `STEP` by their noise.

        `noise`: (3, 3, 3) covariance of residuals by 1, v^2, omega^2. `white`: (2,) what whitening
        leaves of position and heading. `length`: the robot's unit of length [m].
        """
        floors = np.array(((NOISE_FLOOR * UNIT_RADIUS * length) ** 2, TURN_NOISE_FLOOR**2))
        by_command = np.array((0.5 * (noise[:, 0, 0] + noise[:, 1, 1]), noise[:, 2, 2]))
        own = (by_command[:, 0] + floors)[:, None] + by_command[:, 1:] @ steps["speeds"].T
        usual = own.mean(axis=1, keepdims=True)
        tells = steps["tells"].T
        weights = np.sqrt(tells / ((own + EVEN_NOISE * usual) * white[:, None]))
        terms = np.ascontiguousarray(np.moveaxis(steps["terms"], 0, -1))
        return cls(terms * weights[:, None, None], tells)

    def sums(self, weights: Array) -> tuple[Array, Array]:
        """Normal equations (2, 4 + J, 4 + J), and how many steps tell (2,), by weights (n,)."""
        of_block = *self.terms.shape[:2], -1
        weighed = (self.terms * weights).reshape(of_block)
        return weighed @ self.terms.reshape(of_block).transpose(0, 2, 1), self.tells @ weights

    def running_sums(self) -> tuple[Array, Array]:
        """Return (n, ...) the same of the newest step, the newest two, and so on; but for lags."""
        terms = self.terms[:, :4]
        squares = np.einsum("bikn,bjkn->nbij", terms, terms)
        return np.cumsum(squares, axis=0), np.cumsum(self.tells, axis=1).T

    def error(self, gains: Gains, weights: Array) -> float:
        """Sum of squared residuals of steps that count by weights (n,)."""
        left = residuals(self.terms, gains)
        return float(((left * left) @ weights).sum())

    def contradiction(self, now: Gains, new: Gains) -> float:
        """Squared distance of the gains in use from new ones, by the steps' scatter around these.

        It is in standard errors, over the gains that enough of the steps depend on.
        """
        # by how much each step asks for a larger value of each gain
        pulls, scores = (
            (self.terms[:, :3] * residuals(self.terms, gains)[:, None]).sum(axis=2)
            for gains in (now, new)
        )
        scatter = np.maximum((scores**2).sum(axis=-1), 1e-12)
        enough = np.count_nonzero(scores, axis=-1) >= FEWEST
        return float((pulls.sum(axis=-1) ** 2 / scatter)[enough].sum())


def estimate(
    sums: tuple[Array, Array], now: Gains, length: float, scaled: bool = True
) -> tuple[Array, Array]:
    """Estimate gains (..., 5), and their squared distance (...) to those in use in standard errors.

    `sums`: as of `Evidence`, (..., 2, 4 + J, 4 + J) and (..., 2). `now`: those in use, which a
    prior keeps where a drive does not show them. `length`: the robot's unit of length [m].
    `scaled`: whether the variance of the residuals is measured; else it is the noise model's, so
    that sets of steps compare.
    """
    equations, counts = sums[0], sums[1][..., None]
    size = equations.shape[-1]
    prior = np.full((2, size), PRIOR)
    prior[1, 1], prior[:, 3] = PULL_PRIOR / length, 1.0
    used = _by_block(now) / prior[:, :3]
    # in units of the prior
    equations = equations * (prior[:, None] * prior[..., None])
    scale: Array | float = np.ones((*counts.shape, 1))
    if scaled:
        others = [k for k in range(size) if k != 3]
        tell, told = equations[..., others, :][..., others], equations[..., others, 3:4]
        # what rounding leaves of a direction that nothing tells explains nothing
        least = np.finfo(float).eps * np.maximum(np.trace(tell, axis1=-2, axis2=-1), 1.0)
        free = np.linalg.solve(tell + least[..., None, None] * np.eye(len(others)), told)
        left = equations[..., 3:4, 3:4] - told.swapaxes(-2, -1) @ free
        scale = np.maximum(left / np.maximum(ROWS * counts - 2.0, 1.0)[..., None], QUIETEST)
    # what lags explain, no gain needs to
    shared = equations[..., 4:, :4]
    known = np.linalg.solve(equations[..., 4:, 4:] + scale * np.eye(size - 4), shared)
    reduced = equations[..., :3, :4] - shared[..., :3].swapaxes(-2, -1) @ known
    tell = reduced[..., :3]
    excess = reduced[..., 3:] - tell @ used[..., None]
    step = np.linalg.solve(tell + scale * np.eye(3), excess) * (counts >= FEWEST)[..., None]
    distance = (step * excess / scale).sum(axis=(-3, -2, -1))
    gains = (used + step[..., 0]) * prior[:, :3]
    return gains.reshape(*distance.shape, -1)[..., [0, 1, 3, 4, 2]], distance
