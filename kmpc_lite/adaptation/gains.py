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
NO_PRIOR = 1e-9
"""Weight of a prior, as a share of what steps tell, that decides nothing."""
EVEN_NOISE = 0.3
"""Share of the usual noise that is added to every step's own: without it, the few slowest steps
would outweigh all others where poses are noisy."""
NOISE_FLOOR, TURN_NOISE_FLOOR = 1 / 300, 5e-4
"""Smallest noise that a step [radii] and its turn [rad] have: what poses are measured to."""
PLACE, TURNS = [0, 1, 4], [2, 3]
"""Which gains the displacement tells, and the turn."""


class Evidence(NamedTuple):
    """Weighed rows of steps, the newest first: what each would add to the normal equations."""

    place: Array
    """(n, 2, 4) by the gains ahead, left and aside, and as measured."""
    turns: Array
    """(n, 1, 3) by turn and pull, and as measured."""
    tells: Array
    """(n, 2) whether it tells of moving, and of turning."""

    @property
    def squares(self) -> tuple[Array, Array]:
        """Normal equations (n, 4, 4) and (n, 3, 3) of each step."""
        place, turns = self.place, self.turns
        return place.transpose(0, 2, 1) @ place, turns.transpose(0, 2, 1) @ turns

    def residuals(self, gains: Array) -> tuple[Array, Array]:
        """Weighed residuals (n, 2) and (n, 1) under gains (5,)."""
        return (
            self.place[..., -1] - self.place[..., :-1] @ gains[PLACE],
            self.turns[..., -1] - self.turns[..., :-1] @ gains[TURNS],
        )

    def error(self, gains: Gains, fading: float = 1.0) -> float:
        """Sum of weighed squared residuals under gains, those of older steps by a fading weight."""
        place, turns = self.residuals(np.array(gains))
        squares = (place * place).sum(axis=1) + (turns * turns).sum(axis=1)
        return float(squares @ fading ** np.arange(len(squares)))


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
    px, py, dx, dy, h, g, turned, sx, sy = steps[:, WHITE].T
    at_rest, by_speed, by_turn = (np.array((0.5 * (c[0, 0] + c[1, 1]), c[2, 2])) for c in noise)
    at_rest += ((NOISE_FLOOR * UNIT_RADIUS * length) ** 2, TURN_NOISE_FLOOR**2)
    by_command = np.stack([by_speed, by_turn])
    own = at_rest + steps[:, SPEEDS] @ by_command
    weights = np.sqrt(steps[:, TELLS] / (own + EVEN_NOISE * own.mean(axis=0)) / white)
    place = np.array(((px - sx, -py, sx, dx), (py - sy, px, sy, dy)))
    turns = np.array(((h, g, turned),))
    return Evidence(
        (weights[:, 0] * place).transpose(2, 0, 1),
        (weights[:, 1] * turns).transpose(2, 0, 1),
        steps[:, TELLS] > 0.0,
    )


def estimate(
    found: tuple[Array, Array], tells: Array, now: Gains, length: float, scaled: bool = True
) -> tuple[Array, Array]:
    """Estimate gains (..., 5), and their squared distance (...) to those in use in standard errors.

    Parameters
    ----------
    found : tuple of ndarray
        Normal equations (..., 4, 4) and (..., 3, 3), summed over steps.
    tells : ndarray
        (..., 2) how many of the steps tell of moving, and of turning.
    now : Gains
        Those in use, which a prior keeps where a drive does not show them.
    length : float
        The robot's unit of length [m].
    scaled : bool
        Whether the variance of the residuals is measured; else it is the noise model's, so that
        sets of steps compare.
    """
    used = np.array(now)
    gains, distance = np.empty((*tells.shape[:-1], len(used))), np.zeros(tells.shape[:-1])
    priors = np.full(3, PRIOR), np.array((PRIOR, PULL_PRIOR / length))
    for k, (which, rows) in enumerate(((PLACE, 2.0), (TURNS, 1.0))):
        equations, prior, one = found[k], priors[k], np.eye(len(which))
        # in units of the prior
        shares = equations[..., :-1, :-1] * (prior * prior[:, None])
        told = equations[..., :-1, -1:] * prior[:, None]
        scale = np.ones((*distance.shape, 1, 1))
        if scaled:
            weight = NO_PRIOR * np.maximum(np.trace(shares, axis1=-2, axis2=-1), 1.0)
            free = shares + weight[..., None, None] * one
            explained = told.swapaxes(-2, -1) @ np.linalg.solve(free, told)
            freedom = np.maximum(rows * tells[..., k] - 2.0, 1.0)[..., None, None]
            scale = np.maximum((equations[..., -1:, -1:] - explained) / freedom, QUIETEST)
        excess = told - shares @ (used[which] / prior)[:, None]
        step = np.linalg.solve(shares + scale * one, excess)
        step *= (tells[..., k] >= FEWEST)[..., None, None]
        distance += ((step.swapaxes(-2, -1) @ excess) / scale)[..., 0, 0]
        gains[..., which] = used[which] + step[..., 0] * prior
    return gains, distance


def contradiction(steps: Evidence, now: Gains, new: Gains) -> float:
    """Squared distance of the gains in use from new ones, by the steps' own scatter around these.

    It is in standard errors, over the gains that enough of the steps depend on.
    """
    out = 0.0
    rows = steps.place[..., :-1], steps.turns[..., :-1]
    both = (steps.residuals(np.array(gains)) for gains in (now, new))
    for row, used, own in zip(rows, *both, strict=True):
        # by how much each step asks for a larger value of each gain
        pulls, scores = ((row * left[..., None]).sum(axis=1) for left in (used, own))
        scatter = np.maximum((scores**2).sum(axis=0), 1e-12)
        enough = np.count_nonzero(scores, axis=0) >= FEWEST
        out += float((pulls.sum(axis=0) ** 2 / scatter)[enough].sum())
    return out


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
