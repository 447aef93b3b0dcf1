"""Gains on a learned model: their estimate from steps, its certainty, and the noise that remains.

A step's displacement is ``ahead`` times what the model drives ahead, ``aside`` times what it drives
sideways, and ``left`` times both, turned by a quarter; its turn is ``turn`` times the model's and
``pull`` times the way ahead. Both are weighed least squares, apart from each other, so that no
straight drive upsets turns. Lags that the model has wrong are estimated beside the gains, and left
out of them: what earlier commands explain is no gain.
"""

from __future__ import annotations

from dataclasses import replace
from math import hypot, sqrt
from typing import NamedTuple

import numpy as np

from kmpc_lite.adaptation.options import AdaptationOptions
from kmpc_lite.adaptation.steps import Gains
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.noise_model import NoiseModel
from kmpc_lite.model.symmetric import find_trigonometry
from kmpc_lite.scale import UNIT_RADIUS, Scale
from kmpc_lite.types import INPUTS, STATES, Array

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
ROWS = np.array([[2.0], [1.0]])  # numbers that a step tells of its displacement, and of its turn
LARGEST_DRIFT = 0.6
"""Sideways drift as a share of the speed, a crab angle of 31 degrees: a floor that slopes or slips
more makes the robot undrivable."""
LARGEST_PULL = 0.3  # turn to one side per radius driven [rad]: a flat tyre gives a tenth
STEERED_GAINS = (0.8, 1.25)  # gains of steered wheels beyond which a lag is taken for a gain


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

    terms: Array  # (2, 4 + J, 2, n) as of `STEP`, of J lags; 0 where a step does not tell
    tells: Array  # (2, n) 1 where the step tells of moving, and of turning

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


def adapted_model(
    base: KoopmanModel, gains: Gains, noise: NoiseModel, told: dict[str, int]
) -> KoopmanModel:
    """Apply gains to a learned model; its `info` tells of them, and what else is `told`."""
    mix = np.array(
        [[gains.ahead, -gains.left, 0.0], [gains.left, gains.ahead, 0.0], [0.0, 0.0, gains.turn]]
    )
    h, b = mix @ base.H, mix @ base.B
    # how much each bilinear input drives the robot ahead
    lifted = base.dictionary.lift(np.zeros(STATES))
    b[2] += gains.pull * (base.H.reshape(STATES, -1, len(lifted))[0] @ lifted + base.B[0])
    if drives_sideways(base):
        h += (gains.aside - gains.ahead) * _driven_sideways(base)
    info = {**base.info, "adaptation": {**gains._asdict(), **told}}
    return replace(base, A=mix @ base.A, H=h, B=b, noise_model=noise, info=info)


def drives_sideways(model: KoopmanModel) -> bool:
    """Whether a model's wheels drive sideways, and it tells what they do so from the rest."""
    return model.inputs > INPUTS and model.closed_form is not None


def _driven_sideways(model: KoopmanModel) -> Array:
    """Part of a symmetric model's H (3, nw nz) that leads to the robot's left."""
    place, dictionary = find_trigonometry(model.dictionary), model.dictionary
    assert place is not None and model.closed_form is not None
    out = np.zeros((STATES, dictionary.input_size, dictionary.size))
    left = model.closed_form.motion[:, 1] / model.dt
    out[0, :, place.sin], out[1, :, place.cos] = -left, left
    return out.reshape(STATES, -1)


def residual_covariance(steps: Array, gains: Gains, learned: Array, scale: Scale) -> Array:
    """Covariance (3, 3, 3), by the command, of what gains leave of steps (n,) of `STEP`.

    With few steps it stays near the learned one.
    """
    (ex, ey), (turned, _) = residuals(np.moveaxis(steps["measured"], 0, -1), gains)
    cosine, sine = steps["heading"].T
    errors = np.stack([cosine * ex + sine * ey, cosine * ey - sine * ex, turned], axis=1)
    terms = steps["speeds"]
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


def refuse(gains: Gains, options: AdaptationOptions, length: float) -> str:
    """Say why no floor can cause these gains; empty if one can.

    `length` is the robot's unit of length [m].
    """
    speed = hypot(gains.ahead, gains.left)
    if not (gains.ahead > 0.0 and options.least_gain < speed < options.largest_gain):
        return f"it comes {gains.ahead:.2g} times as far ahead as the model says"
    if not abs(gains.left) < LARGEST_DRIFT * speed:
        return f"it drifts sideways by {gains.left:.2g} of its speed"
    if not options.least_gain < gains.aside < options.largest_gain:
        return f"it comes {gains.aside:.2g} times as far sideways as the model says"
    if not options.least_gain < gains.turn < options.largest_gain:
        return f"it turns {gains.turn:.2g} times as far as the model says"
    if not abs(gains.pull) * UNIT_RADIUS * length < LARGEST_PULL:
        return f"it pulls to one side by {gains.pull:.2g} rad/m"
    return ""


def lag_taken_for_gain(gains: Gains) -> str:
    """Say why gains of steered wheels are a lag's; empty if they are not."""
    least, most = STEERED_GAINS
    for name, gain in (("ahead", gains.ahead), ("turn", gains.turn)):
        if not least <= gain <= most:
            return (
                f"adaptation ended: a gain {name} of {gain:.2f} of the learned one is beyond "
                f"{least:g} to {most:g}; steering or motor lag more than the model says"
            )
    return ""
