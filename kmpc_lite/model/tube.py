"""How the errors of a learned model spread along a plan that is steered back at every step.

Shared by calibration, which measures such errors on held-out drives, and by tightening, which keeps
room for them. In zero-order robust optimisation (Zanelli et al. 2021, zoRO) the spread is computed
at the last plan and stays outside the QP.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from kmpc_lite.model.arguments import speeds
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.motion import MotionModel, unmodelled_delay
from kmpc_lite.model.noise_model import NoiseModel
from kmpc_lite.types import INPUTS, STATES, Array

MEMORY = 8
"""Steps of noise that a stage still feels, a power of two. The feedback has forgotten the older
ones: after 8 steps the spread is within 1 % of its limit at 0.3 m/s and more, and when slower there
is little noise to add up. Steps, not seconds: the controller corrects once in each, and quantiles
in model files are calibrated so."""
FORWARD, LATERAL, TURN = 0.5, 0.2, 0.5
"""What the assumed feedback takes away in one step: shares of the forward and of the heading error,
and the gain by which a lateral error turns the robot back, as the share of itself that it is then
reduced by per step at speed."""
STILL = 0.03
"""Below this displacement per step [m] the lateral feedback fades: a robot that stands cannot move
sideways."""
HALF_EFFECT = 0.5  # share of a command's effect from which on it takes errors back
FLOOR = 1e-4
"""Standard deviation [m, rad] that is added to every noise: a model that fits to rounding has no
smaller one."""


def closed_loop(by_state: Array, cos: Array, sin: Array) -> Array:
    """Jacobians of one step under feedback, for deviations from the plan.

    `by_state`: the model's derivative by the state, (..., 3, 3). `cos`, `sin`: of the planned
    heading, (...). Returns (..., 3, 3).
    """
    out: Array = by_state.copy()
    # how far sideways a unit of heading error leads, and from it the gain by which a lateral error
    # is steered back
    drift = cos * out[..., 1, 2] - sin * out[..., 0, 2]
    gain = LATERAL * drift / (drift * drift + STILL * STILL)
    ahead = np.empty((*cos.shape, 2))
    ahead[..., 0], ahead[..., 1] = cos, sin
    out[..., :2, :2] -= (FORWARD * ahead)[..., None] * ahead[..., None, :]
    out[..., 2, 0] += gain * sin
    out[..., 2, 1] -= gain * cos
    out[..., 2, 2] -= TURN
    return out


def feedback_delay(model: MotionModel) -> int:
    """Periods for which nothing takes an error back: until a command has had half of its effect.

    A model with input history knows what earlier commands still do, so that its feedback acts late
    but on what will be left then.
    """
    if not model.history:
        return round(unmodelled_delay(model) / model.dt)
    return max(answers_late(model))


def answers_late(model: MotionModel) -> tuple[int, int]:
    """Periods until a speed, and a turn rate, has had half of its effect by a model's history."""
    if not model.history:
        return 0, 0
    rest = np.zeros((model.history, model.inputs))
    lin = model.linearize(np.zeros(STATES), np.zeros(model.inputs), rest)
    by_age = np.concatenate([lin.B[None], lin.B_past])
    speed, turn = (np.cumsum(effect) for effect in (by_age[:, 0, 0], by_age[:, 2, -1]))
    half_speed, half_turn = (sums >= HALF_EFFECT * sums[-1] for sums in (speed, turn))
    return int(np.argmax(half_speed)), int(np.argmax(half_turn))


def tube_memory(model: MotionModel) -> int:
    """Periods whose noise a stage feels: until feedback acts, and until it has forgotten them."""
    return MEMORY + feedback_delay(model)


def rotations(cos: Array, sin: Array) -> Array:
    """Matrices (..., 3, 3) from the robot's frame to the map's."""
    out = np.zeros((*cos.shape, 3, 3))
    out[..., 0, 0] = out[..., 1, 1] = cos
    out[..., 1, 0] = sin
    out[..., 0, 1] = -sin
    out[..., 2, 2] = 1.0
    return out


@dataclass(frozen=True, slots=True)
class TubeNoise:
    """What widens a tube, as covariances in the robot's frame."""

    pose: Array  # what the measured pose at which a plan begins adds to every stage, (3, 3)
    pose_by_speed: Array  # the same for a robot that moves, to be multiplied by v^2, (3, 3)
    poses: float  # how many such poses one residual holds: 2 where `pose` is that of a single one
    white: Array
    """Of one period, to be multiplied by v^2 and omega^2, (2, 3, 3): independent of the others'."""
    lasting: Array
    """The same of errors that are alike in all periods of a plan, (2, 3, 3): they add up."""

    @property
    def pose_deviation(self) -> tuple[float, float]:
        """Standard deviations of a pose at which a plan begins: of each coordinate, of heading."""
        x, y, heading = (0.5 * self.poses * self.pose.diagonal()).tolist()
        return math.sqrt(0.5 * (x + y)), math.sqrt(heading)


def tube_noise(noise: NoiseModel | None, dt: float) -> TubeNoise:
    """Part what a model says of its errors into what the pose's measurement and the floor add.

    Noise sources tell it (`kmpc_lite.model.noise_model`). Without them the covariance of single
    residuals does: a robot that stands does not move, so what residuals have left at zero command
    comes from the measured poses at both ends, and what grows with the commands is taken for white.

    `noise`: of the model. `dt`: its period [s].
    """
    floor, none = FLOOR**2 * np.eye(STATES), np.zeros((INPUTS, STATES, STATES))
    if noise is None:
        return TubeNoise(floor, none[0], 1.0, none, none)
    if noise.sources is None:
        return TubeNoise(noise.coefficients[0] + floor, none[0], 1.0, noise.coefficients[1:], none)
    found = noise.sources
    return TubeNoise(
        np.diag(found.pose) + floor,
        np.diag(found.pose_by_speed),
        2.0,
        np.array([np.diag(row) for row in found.white]),
        np.array([np.diag(row) for row in found.lasting]) * dt**2,
    )


def window_deviations(
    model: KoopmanModel, x: Array, u: Array, x_next: Array, history: Array | None
) -> tuple[Array, Array]:
    """Deviations of measured drives from plans under feedback, and their expected covariances.

    `model`: predicts. `x`, `u`, `x_next`: windows of consecutive steps: (n, S, 3), (n, S, 2), (n,
    S, 3). `history`: commands before each step, (n, S, L, 2). Returns `deviations`, `covariances`:
    of the position after 1 to S steps, in the map's frame: (n, S, 2) and (n, S, 2, 2).
    """
    lin = model.linearize(x, u, history)
    noise = tube_noise(model.noise_model, model.dt)
    cos, sin = np.cos(x[..., 2]), np.sin(x[..., 2])
    turned = rotations(cos, sin)

    def in_map(covariances: Array) -> Array:
        return turned @ covariances @ turned.swapaxes(-1, -2)

    u = speeds(u)
    squares = u * u
    still = noise.pose + squares[..., 0, None, None] * noise.pose_by_speed
    measured = noise.poses * in_map(still)
    # what is alike in all periods adds up as the residuals do: one column for each of its causes
    lasting = turned[..., None, :, :] * u[..., None, None]
    lasting = lasting @ np.sqrt(noise.lasting)
    columns = np.concatenate(
        [(x_next - lin.value)[..., None], *np.moveaxis(lasting, -3, 0)], axis=-1
    )
    errors = Carried(lin.A, closed_loop(lin.A, cos, sin), feedback_delay(model), columns, False)
    white = in_map(np.tensordot(squares, noise.white, axes=(-1, 0)))
    spreads = Carried(errors.free, errors.steered, errors.delay, white, True)
    deviations, covariances = np.empty((*x.shape[:2], 2)), np.empty((*x.shape[:2], 2, 2))
    for k in range(x.shape[1]):
        error, spread = errors.after(k), spreads.after(k)
        deviations[:, k] = error[:, :2, 0]
        led = error[:, :2, 1:]
        covariances[:, k] = led @ led.swapaxes(-1, -2) + (spread + measured[:, k])[:, :2, :2]
    return deviations, covariances


class Carried:
    """Carries what each period adds on through the later ones: feedback takes back what is old.

    `free`, `steered`: jacobians of the periods without and with feedback, (n, S, 3, 3). `delay`:
    periods until the feedback acts on what a period has added. `added`: by each period: columns (n,
    S, 3, c), or covariances (n, S, 3, 3). `squared`: whether they are covariances.
    """

    def __init__(
        self, free: Array, steered: Array, delay: int, added: Array, squared: bool
    ) -> None:
        self.free, self.steered, self.delay = free, steered, delay
        self._added, self._squared = added, squared
        self._old = np.zeros_like(added[:, 0])
        self._fresh: list[Array] = []

    def after(self, k: int) -> Array:
        """Sum at the end of period k; periods are asked for in turn."""
        self._old = self._on(self.steered[:, k], self._old)
        self._fresh = [self._on(self.free[:, k], part) for part in self._fresh]
        self._fresh.append(self._added[:, k])
        if len(self._fresh) > self.delay:
            self._old = self._old + self._fresh.pop(0)
        return self._old + sum(self._fresh) if self._fresh else self._old

    def _on(self, step: Array, part: Array) -> Array:
        moved: Array = step @ part
        return moved @ step.swapaxes(-1, -2) if self._squared else moved
