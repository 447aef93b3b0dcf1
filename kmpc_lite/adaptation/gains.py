"""Gains on a learned model: their estimate from steps, its certainty, and the noise that remains.

A step's displacement is ``ahead`` times what the model drives ahead, ``aside`` times what it drives
sideways, and ``left`` times both, turned by a quarter; its turn is ``turn`` times the model's and
``pull`` times the way ahead. Both are weighed least squares, apart from each other, so that no
straight drive upsets turns.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from kmpc_lite.adaptation.state import HEADING, MEASURED, SPEEDS, TELLS, WHITE, Gains
from kmpc_lite.scale import UNIT_RADIUS, Scale
from kmpc_lite.types import STATES, Array

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


class Evidence(NamedTuple):
    """Weighed steps, the newest first."""

    columns: Array
    """(2, 4, 2, n) displacements and turns by three gains each, and as measured; 0 where there is
    none: a turn is one number, by two gains."""
    tells: Array
    """(2, n) 1 where a step tells of moving, and of turning."""

    def sums(self, weights: Array) -> tuple[Array, Array]:
        """Normal equations (2, 4, 4), and how many steps tell (2,), by weights of steps (n,)."""
        columns = self.columns.reshape(2, 4, -1)
        weighed = (self.columns * weights).reshape(2, 4, -1)
        return weighed @ columns.transpose(0, 2, 1), self.tells @ weights

    def running_sums(self) -> tuple[Array, Array]:
        """Return the same (n, ...) of the newest step, of the newest two, and so on."""
        squares = np.einsum("bikn,bjkn->nbij", self.columns, self.columns)
        return np.cumsum(squares, axis=0), np.cumsum(self.tells, axis=1).T

    def residuals(self, gains: Gains) -> Array:
        """Weighed residuals (2, 2, n)."""
        columns = self.columns
        left: Array = columns[:, 3] - (_by_block(gains)[..., None, None] * columns[:, :3]).sum(
            axis=1
        )
        return left

    def error(self, gains: Gains, weights: Array) -> float:
        """Sum of squared residuals of steps that count by weights (n,)."""
        left = self.residuals(gains)
        return float(((left * left) @ weights).sum())


def _by_block(gains: Gains) -> Array:
    """Gains (2, 3) of displacements and turns."""
    return np.array(((gains.ahead, gains.left, gains.aside), (gains.turn, gains.pull, 0.0)))


def evidence(steps: Array, noise: Array, white: Array, length: float) -> Evidence:
    """Weigh steps (n, STEP_SIZE) by their noise.

    Parameters
    ----------
    steps : ndarray
        The newest first.
    noise : ndarray
        (3, 3, 3) covariance of residuals by 1, v^2, omega^2.
    white : ndarray
        (2,) what whitening leaves of position and heading.
    length : float
        The robot's unit of length [m].
    """
    columns = steps.T
    px, py, dx, dy, h, g, turned, sx, sy = columns[WHITE]
    floors = np.array(((NOISE_FLOOR * UNIT_RADIUS * length) ** 2, TURN_NOISE_FLOOR**2))
    by_command = np.array((0.5 * (noise[:, 0, 0] + noise[:, 1, 1]), noise[:, 2, 2]))
    own = (by_command[:, 0] + floors)[:, None] + by_command[:, 1:] @ columns[SPEEDS]
    usual = np.add.reduce(own, axis=1, keepdims=True) / len(steps)
    weights = np.sqrt(columns[TELLS] / ((own + EVEN_NOISE * usual) * white[:, None]))
    out = np.zeros((2, 4, 2, len(steps)))
    out[0] = (px - sx, py - sy), (-py, px), (sx, sy), (dx, dy)
    out[1, [0, 1, 3], 0] = h, g, turned
    out *= weights[:, None, None]
    return Evidence(out, columns[TELLS])


def estimate(
    sums: tuple[Array, Array], now: Gains, length: float, scaled: bool = True
) -> tuple[Array, Array]:
    """Estimate gains (..., 5), and their squared distance (...) to those in use in standard errors.

    Parameters
    ----------
    sums : tuple of ndarray
        Normal equations (..., 2, 4, 4), and how many steps tell of moving, and of turning (..., 2).
    now : Gains
        Those in use, which a prior keeps where a drive does not show them.
    length : float
        The robot's unit of length [m].
    scaled : bool
        Whether the variance of the residuals is measured; else it is the noise model's, so that
        sets of steps compare.
    """
    equations, counts = sums[0], sums[1][..., None]
    prior = np.array(((PRIOR,) * 3, (PRIOR, PULL_PRIOR / length, PRIOR)))
    used = _by_block(now)
    # in units of the prior, along the directions that tell independently of each other
    tell, along = np.linalg.eigh(equations[..., :3, :3] * (prior[:, None] * prior[..., None]))
    tell, across = np.maximum(tell, 0.0), along.swapaxes(-2, -1)
    told = (across @ (equations[..., :3, 3:] * prior[..., None]))[..., 0]
    scale: Array | float = 1.0
    if scaled:
        # what rounding leaves of a direction that nothing tells explains nothing
        least = np.finfo(float).eps * np.maximum(tell[..., -1:], 1.0)
        explained = (told * told / (tell + least)).sum(axis=-1, keepdims=True)
        freedom = np.maximum(ROWS * counts - 2.0, 1.0)
        scale = np.maximum((equations[..., 3, 3:] - explained) / freedom, QUIETEST)
    excess = told - tell * (across @ (used / prior)[..., None])[..., 0]
    step = excess / (tell + scale) * (counts >= FEWEST)
    distance = (step * excess / scale).sum(axis=(-2, -1))
    gains = used + (along @ step[..., None])[..., 0] * prior
    return gains.reshape(*distance.shape, -1)[..., [0, 1, 3, 4, 2]], distance


def contradiction(steps: Evidence, now: Gains, new: Gains) -> float:
    """Squared distance of the gains in use from new ones, by the steps' own scatter around these.

    It is in standard errors, over the gains that enough of the steps depend on.
    """
    # by how much each step asks for a larger value of each gain
    pulls, scores = (
        (steps.columns[:, :3] * steps.residuals(gains)[:, None]).sum(axis=2) for gains in (now, new)
    )
    scatter = np.maximum((scores**2).sum(axis=-1), 1e-12)
    enough = np.count_nonzero(scores, axis=-1) >= FEWEST
    return float((pulls.sum(axis=-1) ** 2 / scatter)[enough].sum())


def residual_covariance(steps: Array, gains: Gains, learned: Array, scale: Scale) -> Array:
    """Covariance of the residuals of steps (n, STEP_SIZE) under gains, (3, 3, 3) by the command.

    With few steps it stays near the learned one.
    """
    px, py, dx, dy, h, g, turned, sx, sy = steps[:, MEASURED].T
    more = gains.aside - gains.ahead
    ex = dx - gains.ahead * px + gains.left * py - more * sx
    ey = dy - gains.ahead * py - gains.left * px - more * sy
    left = turned - gains.turn * h - gains.pull * g
    cosine, sine = steps[:, HEADING].T
    errors = np.stack([cosine * ex + sine * ey, cosine * ey - sine * ex, left], axis=1)
    terms = steps[:, SPEEDS]
    expected = np.tensordot(terms, learned[1:], axes=(1, 0)) + learned[0]
    surplus = (errors[:, :, None] * errors[:, None, :] - expected).reshape(len(steps), -1)
    powers = scale.command[[0, -1]] ** 2
    terms = terms / powers
    gram = terms.T @ terms
    gram += np.eye(2) * (0.1 * np.trace(gram) / max(sqrt(len(steps)), 1.0) + 1e-12)
    change = np.linalg.solve(gram, terms.T @ surplus).reshape(2, STATES, STATES)
    coefficients = np.concatenate([learned[:1], learned[1:] + change / powers[:, None, None]])
    # in the robot's units, for metres and radians have no common measure
    between = scale.state * scale.state[:, None]
    values, vectors = np.linalg.eigh(coefficients / between)
    projected = (vectors * np.maximum(values, 0.0)[:, None, :]) @ vectors.transpose(0, 2, 1)
    out: Array = projected * between
    return out


def went_back_and_forth(steps: Array, share: float, turning: bool) -> bool:
    """Whether the commands of steps (n, STEP_SIZE) took back most of what they drove, or turned.

    Where the net is less than a share of the whole, a robot whose motors are later than its model
    knows has come as far as if it were another one.
    """
    _, _, _, _, turns, ahead, *_ = steps[:, MEASURED].T
    moved = turns if turning else ahead
    return abs(float(moved.sum())) < share * float(np.abs(moved).sum())
