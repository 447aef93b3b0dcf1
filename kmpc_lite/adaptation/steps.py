"""One period as a step of the regression: the motion that the model gives, and the measured one.

The model's displacement is its prediction, turned by half of what the robot turned otherwise: as if
it had driven along the measured headings, so that a wrong turn is no drift to one side.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.adaptation.state import LATE, LATER, NO_STEPS, STEP_SIZE, AdaptationState
from kmpc_lite.geometry import rotate
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.scale import UNIT_RADIUS, Scale
from kmpc_lite.types import STATES, Array

LEAST_STEP, LEAST_TURN = 1 / 75, 2e-3
"""A step that should move the robot less [radii], or turn it less [rad], tells nothing of them."""
JUMP_FACTOR, JUMP, JUMP_TURN = 3.0, 1 / 3, 0.15
"""A pose that moved more than this many times what was commanded, and this much more [radii, rad],
is a broken measurement, not a floor."""
HELD, HELD_TURN, HELD_SHARE = 2 / 15, 0.03, 0.1
"""A robot that should move by more [radii, rad] and does next to nothing, this share of it, is
held: by brakes, a wall, a pilot."""
USUAL = (0.3, 0.4)
"""Speeds at which the noise of poses is compared with that of the floor, in the robot's units:
0.3 m/s and 0.4 rad/s of a robot of 0.15 m and 0.6 m/s."""
RESTLESS = 0.1
"""Least noise that a floor is assumed to have, as a share of a step (standard deviation): the more,
the sooner an old pose is forgotten."""


class Steps:
    """Makes steps of periods, and leaves out those without information.

    `model`: predicts as the learned one. `noise`: (3, 3, 3) covariance of its residuals by the
    command, as `NoiseModel` has it. `scale`: the robot's units. `sideways`: whether its wheels
    drive sideways.

    Attributes: `white`: (2,) the variance of a whitened position and heading, as a share of a
    single step's.
    """

    def __init__(self, model: MotionModel, noise: Array, scale: Scale, sideways: bool) -> None:
        self._model, self._drives_sideways = model, sideways
        radius = scale.length * UNIT_RADIUS
        self._least_step, self._jump, self._held = LEAST_STEP * radius, JUMP * radius, HELD * radius
        carried, self.white = whitening(noise, model.dt, scale)
        self._carried = carried[[0, 0, 0, 0, 1, 1, 1, 0, 0] + [0, 0, 1] * LATE]
        # 0, which explains nothing, where a period is more than twice as long
        self._late = [round(time * scale.time / model.dt) for time in LATER]

    def step(
        self,
        state: AdaptationState,
        before: Array,
        command: Array,
        after: Array,
        past: Array | None,
    ) -> Array | None:
        """What a period tells, (STEP_SIZE,); None if nothing."""
        was_after, state.after = state.after, tuple(after.tolist())
        x, y, heading = before.tolist()
        if (x, y, heading) != was_after:
            state.carried, state.given = NO_STEPS, []
        predicted, numbers = [math.nan], (x, y, heading, *state.after, *command.tolist())
        if math.isfinite(sum(numbers)):
            # within one turn: a model may have learned something of the heading itself
            heading = math.remainder(heading, math.tau)
            predicted = self._model.predict(np.array((x, y, heading)), command, past).tolist()
        if not math.isfinite(sum(predicted)):
            _leave_out(state, rejected=True)
            return None
        turned, h = math.remainder(state.after[2] - heading, math.tau), predicted[2] - heading
        dx, dy = state.after[0] - x, state.after[1] - y
        px, py = rotate(predicted[0] - x, predicted[1] - y, 0.5 * (turned - h))
        moved, drove = math.hypot(px, py), math.hypot(dx, dy)
        if self._is_held(moved, h, drove, turned) or self._jumped(moved, h, drove, turned):
            _leave_out(state, rejected=True)
            return None
        middle = heading + 0.5 * turned
        ahead, left = rotate(px, py, -middle)
        state.given = [(ahead, h), *state.given[: max(self._late)]]
        moves, turns = moved >= self._least_step, abs(h) >= LEAST_TURN
        if not (moves or turns):
            _leave_out(state, rejected=False)
            return None
        aside = rotate(0.0, left, middle) if self._drives_sideways else (0.0, 0.0)
        own = [px, py, dx, dy, h, ahead, turned, *aside]
        for periods in self._late:
            was_ahead, was_turn = state.given[min(periods, len(state.given) - 1)]
            own += [*rotate(was_ahead - ahead, 0.0, middle), was_turn - h]
        # noise of a pose makes one step longer and the next one shorter: the fading sums take that
        # back
        state.carried = white = own + self._carried * state.carried
        tells = moves, turns or abs(ahead) >= self._least_step
        *moving, turning = command.tolist()
        speeds = sum(v * v for v in moving), turning * turning
        out = np.empty(STEP_SIZE)
        out[:] = *white, *own[:9], *tells, math.cos(heading), math.sin(heading), *speeds
        return out

    def _is_held(self, moved: float, h: float, drove: float, turned: float) -> bool:
        """Whether the robot should have moved and did next to nothing."""
        share = HELD_SHARE
        return (
            (moved > self._held or abs(h) > HELD_TURN)
            and drove < share * moved + self._held * share
            and abs(turned) < share * abs(h) + HELD_TURN * share
        )

    def _jumped(self, moved: float, h: float, drove: float, turned: float) -> bool:
        """Whether the pose moved farther than any floor lets it."""
        factor = JUMP_FACTOR
        return drove > factor * moved + self._jump or abs(turned) > factor * abs(h) + JUMP_TURN


def _leave_out(state: AdaptationState, rejected: bool) -> None:
    """Count a period that tells nothing; the next step shares no noise with those before."""
    state.counts.rejected += rejected
    state.counts.still += not rejected
    state.carried = NO_STEPS


def whitening(noise: Array, dt: float, scale: Scale) -> tuple[Array, Array]:
    """Make the noise of steps between noisy poses independent.

    To each step a share of the fading sum of those before is added: the innovations of a pose that
    is measured with noise while the floor moves it at random (steady-state Kalman filter). Without
    noise of the poses nothing is carried on.

    `noise`: learned covariance of a step's residuals by the command, (3, 3, 3). `dt`: period [s].
    `scale`: the robot's units. Returns `carried`, `white`: for position and heading, (2,): the
    share that is carried on, and the variance of what is new as a share of a single step's.
    """
    usual = np.array((USUAL[0] * scale.speed, USUAL[1] / scale.time))
    at_rest, by_speed, by_turn_rate = noise[:, [0, 2], [0, 2]]
    # at rest, the noise of two poses makes the residual
    pose = np.maximum(0.5 * at_rest, 1e-12 * scale.state[[0, 2]] ** 2)
    floor = by_speed * usual[0] ** 2 + by_turn_rate * usual[1] ** 2 + (RESTLESS * usual * dt) ** 2
    ratio = floor / pose
    gain = 2.0 / (1.0 + np.sqrt(1.0 + 4.0 / ratio))
    return 1.0 - gain, (ratio / gain + 1.0) / (ratio + 2.0)


def one_period(
    x: ArrayLike, u: ArrayLike, x_next: ArrayLike, history: ArrayLike | None, model: KoopmanModel
) -> tuple[Array, Array, Array, Array | None]:
    """Pose before, command, pose after and the commands before that a model needs, as arrays.

    Raises ValueError for wrong shapes.
    """
    before, command, after = (np.asarray(value, dtype=float) for value in (x, u, x_next))
    if before.shape != (STATES,) or command.shape != (model.inputs,) or after.shape != (STATES,):
        raise ValueError(
            f"expected x ({STATES},), u ({model.inputs},), x_next ({STATES},), "
            f"got {before.shape}, {command.shape}, {after.shape}"
        )
    if history is None or not model.history:
        return before, command, after, None
    past = np.asarray(history, dtype=float)
    if past.shape != (model.history, model.inputs):
        expected = (model.history, model.inputs)
        raise ValueError(f"history: expected shape {expected}, got {past.shape}")
    return before, command, after, past
