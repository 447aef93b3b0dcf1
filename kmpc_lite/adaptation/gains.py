"""Gains on a learned model: their estimate, its certainty, and the noise that remains.

`state` says what is kept of a step, and which sums over steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from kmpc_lite.adaptation.state import AS_MEASURED, HEADING, MOTION, SPEEDS, WEIGHTS, Gains
from kmpc_lite.scale import Scale
from kmpc_lite.types import STATES, Array

ONE = Scale()

QUIETEST = 0.4
"""Least variance of the residuals that a test assumes, as a share of the expected one: a few steps
may be quiet by chance."""
FEWEST = 6
"""Least number of steps with a weight that gains are estimated from: a robot that turns on the spot
leaves fewer, and from those any gain may come out by chance."""
PRIOR = (0.3, 0.3, 0.1)
"""Prior standard deviations of the velocity's gains, the turn gain and the pull [rad per unit of
length]: a gain that a drive does not show stays as it was."""
NO_PRIOR = 1e-9
"""Weight of a prior, as a share of what steps tell, that decides nothing."""

USUAL = (0.3, 0.4)
"""Speeds at which the noise of poses is compared with that of the floor, in the robot's units:
0.3 m/s and 0.4 rad/s of a robot of 0.15 m and 0.6 m/s."""
RESTLESS = 0.1
"""Least noise that a floor is assumed to have, as a share of a step (standard deviation): the more,
the sooner an old pose is forgotten."""


class Estimate(NamedTuple):
    """Gains from a set of steps, and how far they are from those in use."""

    gains: Gains
    distance: float
    """Squared, in standard errors over the gains."""


def estimate(
    sums: Sequence[float], now: Gains, scaled: bool = True, length: float = 1.0
) -> Estimate:
    """Estimate the gains from sums, and their distance to those in use in standard errors, squared.

    The variance of the residuals is measured; or taken from the noise model alone (`scaled` false),
    so that sets of steps compare. `length` is the robot's unit of length [m].
    """
    pull_information = (length / PRIOR[2]) ** 2
    pp, _, _, _, hh, hg, gg, ht, gt, tt, moves, turns, *_ = sums
    # a prior around the gains in use holds what the drive does not show
    scale = 1.0
    if scaled and pp > 0.0:
        _, explained = _steps_of(sums, Gains(0.0, 0.0, 0.0, 0.0, 0.0), NO_PRIOR * pp)
        scale = max(QUIETEST, (sums[3] - explained) / max(2.0 * moves - 2.0, 1.0))
    (ahead, left, aside), distance = _steps_of(sums, now, scale / PRIOR[0] ** 2)
    if moves < FEWEST:
        ahead = left = aside = distance = 0.0
    distance /= scale
    # the turn gain and the pull share their information
    excess = ht - now.turn * hh - now.pull * hg, gt - now.turn * hg - now.pull * gg
    scale = 1.0
    for _ in range(2 if scaled else 1):
        first, second = hh + scale / PRIOR[1] ** 2, gg + scale * pull_information
        determinant = first * second - hg * hg
        turn_step = (second * excess[0] - hg * excess[1]) / determinant
        pull_step = (first * excess[1] - hg * excess[0]) / determinant
        if turns < FEWEST:
            turn_step = pull_step = 0.0
        turn, pull = now.turn + turn_step, now.pull + pull_step
        if scaled:
            left_over = (
                tt
                - 2.0 * (turn * ht + pull * gt)
                + turn * turn * hh
                + 2.0 * turn * pull * hg
                + pull * pull * gg
            )
            scale = max(QUIETEST, left_over / max(turns - 2.0, 1.0))
    distance += (turn_step * excess[0] + pull_step * excess[1]) / scale
    found = Gains(now.ahead + ahead, now.left + left, turn, pull, now.aside + aside)
    return Estimate(found, distance)


def _steps_of(
    sums: Sequence[float], now: Gains, prior: float
) -> tuple[tuple[float, float, float], float]:
    """Steps of the gains ahead, left and aside, and how much of the squared errors they explain.

    The displacement is ahead times what is not driven sideways, aside times what is, and left times
    both, turned by a quarter: three equations, symmetric, which are solved one after the other.
    """
    pp, pd, pl, *_ = sums
    ps, cross, ss, sd = sums[-4:]
    qs = ps - ss
    qq = pp - ps - qs
    first = pd - sd - now.ahead * qq + now.left * cross - now.aside * qs
    second = pl + now.ahead * cross - now.left * pp - now.aside * cross
    third = sd - now.ahead * qs - now.left * cross - now.aside * ss
    if not qq + prior > 0.0:
        return (0.0, 0.0, 0.0), 0.0
    by_left, by_aside = -cross / (qq + prior), qs / (qq + prior)
    left_information = pp + prior + by_left * cross
    shared = cross + by_aside * cross
    left_excess = second - by_left * first
    by_left_aside = shared / left_information
    aside_information = ss + prior - by_aside * qs - by_left_aside * shared
    aside = (third - by_aside * first - by_left_aside * left_excess) / aside_information
    left = left_excess / left_information - by_left_aside * aside
    ahead = first / (qq + prior) - by_left * left - by_aside * aside
    return (ahead, left, aside), ahead * first + left * second + aside * third


def whitening(
    noise: Array, dt: float, scale: Scale = ONE
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Make the noise of steps between noisy poses independent.

    To each step a share of the fading sum of those before is added.

    The innovations of a pose that is measured with noise while the floor moves it at random
    (steady-state Kalman filter). Without noise of the poses nothing is carried on.

    Parameters
    ----------
    noise : ndarray
        Learned covariance of a step's residuals by the command, (3, 3, 3).
    dt : float
        Period [s].
    scale : Scale
        The robot's units.

    Returns
    -------
    carried, white : tuple of float
        For position and heading: the share that is carried on, and the variance of what is new as a
        share of a single step's.
    """
    carried, white = [], []
    usual = (USUAL[0] * scale.speed, USUAL[1] / scale.time)
    for axis, speed in ((0, usual[0]), (2, usual[1])):
        # at rest, the noise of two poses makes the residual
        pose = max(0.5 * float(noise[0, axis, axis]), 1e-12 * float(scale.state[axis]) ** 2)
        floor = (
            float(noise[1, axis, axis]) * usual[0] ** 2
            + float(noise[2, axis, axis]) * usual[1] ** 2
            + (RESTLESS * speed * dt) ** 2
        )
        ratio = floor / pose
        gain = 2.0 / (1.0 + sqrt(1.0 + 4.0 / ratio))
        carried.append(1.0 - gain)
        white.append((ratio / gain + 1.0) / (ratio + 2.0))
    return (carried[0], carried[1]), (white[0], white[1])


def residual_covariance(steps: Array, gains: Gains, learned: Array, scale: Scale = ONE) -> Array:
    """Covariance of the residuals since the change, (3, 3, 3) by the command.

    With few steps it stays near the learned one.
    """
    count = steps.shape[1]
    cosine, sine = steps[HEADING]
    ex, ey, turned = residuals(steps[AS_MEASURED], gains)
    errors = np.stack([cosine * ex + sine * ey, cosine * ey - sine * ex, turned], axis=1)
    v2, omega2 = steps[SPEEDS]
    terms = np.stack([v2, omega2], axis=1)
    expected = np.tensordot(terms, learned[1:], axes=(1, 0)) + learned[0]
    surplus = errors[:, :, None] * errors[:, None, :] - expected
    powers = scale.command[[0, -1]] ** 2
    terms /= powers
    gram = terms.T @ terms
    gram += np.eye(2) * (0.1 * np.trace(gram) / max(sqrt(count), 1.0) + 1e-12)
    change = np.linalg.solve(gram, terms.T @ surplus.reshape(count, -1)).reshape(2, STATES, STATES)
    change /= powers[:, None, None]
    coefficients = np.concatenate([learned[:1], learned[1:] + change])
    # in the robot's units, for metres and radians have no common measure
    between = scale.state * scale.state[:, None]
    values, vectors = np.linalg.eigh(coefficients / between)
    projected: Array = (vectors * np.maximum(values, 0.0)[:, None, :]) @ vectors.transpose(0, 2, 1)
    projected *= between
    return projected


def residuals(steps: Array, gains: Gains) -> tuple[Array, Array, Array]:
    """Residuals of motions (9, n) under gains: x [m], y [m], heading [rad], (n,) each."""
    px, py, dx, dy, h, g, turned, sx, sy = steps
    more = gains.aside - gains.ahead
    return (
        dx - gains.ahead * px + gains.left * py - more * sx,
        dy - gains.ahead * py - gains.left * px - more * sy,
        turned - gains.turn * h - gains.pull * g,
    )


def weighed_squares(steps: Array, gains: Gains) -> Array:
    """Squared residuals of one step (24,) or of many (24, n) under gains, by their weights."""
    ex, ey, turned = residuals(steps[MOTION], gains)
    a, b = steps[WEIGHTS]
    squares: Array = a * (ex * ex + ey * ey) + b * turned * turned
    return squares


def went_back_and_forth(steps: Array, share: float, turning: bool) -> bool:
    """Whether the commands of steps (24, n) took back most of what they had driven, or turned.

    Where the net is less than a share of the whole, a robot whose motors are later than its model
    knows has come as far as if it were another one.
    """
    px, py, _, _, h, *_ = steps[AS_MEASURED]
    cosine, sine = steps[HEADING]
    moved = h if turning else cosine * px + sine * py
    return abs(float(moved.sum())) < share * float(np.abs(moved).sum())


def scores(steps: Array, gains: Gains) -> Array:
    """Scores (5, n): by how much each step asks for a larger value of each gain."""
    px, py, _, _, h, g, _, sx, sy = steps[MOTION]
    a, b = steps[WEIGHTS]
    ex, ey, turned = residuals(steps[MOTION], gains)
    ahead, aside = (px - sx) * ex + (py - sy) * ey, sx * ex + sy * ey
    left, turns = px * ey - py * ex, (b * h * turned, b * g * turned)
    return np.stack([a * ahead, a * left, *turns, a * aside])


def sums_of(motion: Any, a: Any, b: Any) -> list[Any]:
    """What motions (9,) or (9, n) of weights a and b add to each of the sums."""
    px, py, dx, dy, h, g, turned, sx, sy = motion
    position = a * (px * px + py * py), a * (px * dx + py * dy), a * (px * dy - py * dx)
    turns = b * h * h, b * h * g, b * g * g, b * h * turned, b * g * turned
    rest = b * turned * turned, a > 0.0, b > 0.0
    shared = a * (px * sx + py * sy), a * (px * sy - py * sx)
    aside = a * (sx * sx + sy * sy), a * (sx * dx + sy * dy)
    return [*position, a * (dx * dx + dy * dy), *turns, *rest, *shared, *aside]


def reweighed_sums(
    steps: Array, noise: Array, floors: Array, white: Array, even: float
) -> tuple[Array, tuple[float, float]]:
    """Sums of steps with weights computed anew from the present noise estimate.

    Parameters
    ----------
    steps : ndarray
        (n, 24) as kept; their weights are overwritten.
    noise : ndarray
        (2, 3) variances of position and turn by 1, v^2, omega^2.
    floors, white : ndarray
        (2,) least variances, and what whitening leaves of them, of position and turn.
    even : float
        Share of the usual variance that every step has on top of its own.

    Returns
    -------
    sums, usual
        (n, 16), and the mean variance of position and of turns.
    """
    a, b = steps[:, WEIGHTS].T
    v2, omega2 = steps[:, SPEEDS].T
    own = noise @ np.stack([np.ones(len(steps)), v2, omega2]) + floors[:, None]
    usual = own.mean(axis=1)
    weights = 1.0 / (own + even * usual[:, None]) / white[:, None]
    a, b = np.where(a > 0.0, weights[0], 0.0), np.where(b > 0.0, weights[1], 0.0)
    steps[:, WEIGHTS] = np.stack([a, b], axis=1)
    sums = np.stack(sums_of(steps[:, MOTION].T, a, b), axis=1)
    return sums, (float(usual[0]), float(usual[1]))


def contradiction(steps: Array, now: Gains, new: Gains) -> float:
    """Squared distance of the gains in use from new ones, by the steps' own scatter around these.

    It is in standard errors, over the gains that enough of the steps depend on.
    """
    pulls = scores(steps, now).sum(axis=1)
    own = scores(steps, new)
    scatter = (own**2).sum(axis=1)
    enough = np.count_nonzero(own, axis=1) >= FEWEST
    return float((pulls**2 / np.maximum(scatter, 1e-12))[enough].sum())
