"""One period as a step of the regression: the motion that the model gives, and the measured one.

The model's displacement is its prediction, turned by half of what the robot turned otherwise: as if
it had driven along the measured headings, so that a wrong turn is no drift to one side.

These are all that adaptation remembers: data that copies and pickles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from kmpc_lite.geometry import rotate
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.scale import UNIT_RADIUS, Scale
from kmpc_lite.types import Array

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
        self._carried = carried[:, None, None]
        # 0, which explains nothing, where a period is more than twice as long
        self._late = [round(time * scale.time / model.dt) for time in LATER]

    def take_in(
        self, state: AdaptationState, x: Array, u: Array, x_next: Array, past: Array | None
    ) -> bool:
        """Keep what a period tells; whether it tells anything."""
        was_after, state.after = state.after, tuple(x_next.tolist())
        px, py, heading = before = tuple(x.tolist())
        if before != was_after:
            state.carried, state.given = 0.0, []
        predicted = [math.nan]
        if math.isfinite(sum((*before, *state.after, *u.tolist()))):
            # within one turn: a model may have learned something of the heading itself
            heading = math.remainder(heading, math.tau)
            predicted = self._model.predict(np.array((px, py, heading)), u, past).tolist()
        if not math.isfinite(sum(predicted)):
            return _leave_out(state, rejected=True)
        turned, h = math.remainder(state.after[2] - heading, math.tau), predicted[2] - heading
        dx, dy = state.after[0] - px, state.after[1] - py
        px, py = rotate(predicted[0] - px, predicted[1] - py, 0.5 * (turned - h))
        moved, drove = math.hypot(px, py), math.hypot(dx, dy)
        if self._is_held(moved, h, drove, turned) or self._jumped(moved, h, drove, turned):
            return _leave_out(state, rejected=True)
        middle = heading + 0.5 * turned
        ahead, left = rotate(px, py, -middle)
        state.given = [(ahead, h), *state.given[: max(self._late)]]
        moves, turns = moved >= self._least_step, abs(h) >= LEAST_TURN
        if not (moves or turns):
            return _leave_out(state, rejected=False)
        sx, sy = rotate(0.0, left, middle) if self._drives_sideways else (0.0, 0.0)
        moving = [(px - sx, py - sy), (-py, px), (sx, sy), (dx, dy)]
        turning = [(h, 0.0), (ahead, 0.0), (0.0, 0.0), (turned, 0.0)]
        for periods in self._late:
            was_ahead, was_turn = state.given[min(periods, len(state.given) - 1)]
            moving.append(rotate(was_ahead - ahead, 0.0, middle))
            turning.append((was_turn - h, 0.0))
        terms = np.array((moving, turning))
        # noise of a pose makes one step longer and the next one shorter: the fading sums take that
        # back
        state.carried = terms + self._carried * state.carried
        *speeds, turn_rate = u.tolist()
        state.steps[state.count % len(state.steps)] = (
            state.carried,
            terms[:, :4],
            (moves, turns or abs(ahead) >= self._least_step),
            (math.cos(heading), math.sin(heading)),
            (sum(v * v for v in speeds), turn_rate * turn_rate),
        )
        state.count, state.since, state.judged = state.count + 1, state.since + 1, state.judged + 1
        state.counts.used += 1
        return True

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


def _leave_out(state: AdaptationState, rejected: bool) -> bool:
    """Count a period that tells nothing; the next step shares no noise with those before."""
    state.counts.rejected += rejected
    state.counts.still += not rejected
    state.carried = 0.0
    return False


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


LATER = 0.1, 0.2, 0.4
"""How much later than its model knows a robot may answer [s in its units]: what earlier commands
explain is no gain."""
STEP = np.dtype(
    [
        ("terms", float, (2, 4 + len(LATER), 2)),
        ("measured", float, (2, 4, 2)),
        ("tells", float, 2),
        ("heading", float, 2),
        ("speeds", float, 2),
    ]
)
"""What is kept of a step.

`terms`: of the displacement in the map's frame [m, m], and of the turn [rad, 0]: its gains' terms
(ahead, left, aside; turn, pull, none), what was measured, and by how much more the commands earlier
by `LATER` would have driven; whitened: what the noise of a pose shares with the steps before is
taken back. `measured`: the first four as they were. `tells`: 1 where it tells of moving, and of
turning. `heading`: its cos and sin, before the step. `speeds`: v^2 and omega^2 of the command."""


class Gains(NamedTuple):
    """Correction of a learned model: of velocities, of the turn rate, and turn per metre."""

    ahead: float = 1.0  # factor of the learned velocity
    left: float = 0.0  # drift to the left, as a share of the learned velocity
    turn: float = 1.0  # factor of the learned turn rate
    pull: float = 0.0  # turn to the left per metre driven [rad/m]
    aside: float = 1.0
    """Factor of the learned speed sideways of an omni; that of other wheels is `ahead`."""


@dataclass
class AdaptationCounts:
    """Steps that gains are estimated from, and others; corrected models that were given."""

    used: int = 0
    still: int = 0  # left out since the robot hardly moved
    rejected: int = 0  # left out as broken measurements
    models: int = 0


@dataclass
class AdaptationState:
    """The newest steps, and what has been made of them."""

    steps: Array  # (memory,) of `STEP`, a ring
    noise: Array
    """(3, 3, 3) covariance of a step's residuals by 1, v^2, omega^2, by which steps are weighed."""
    next_model: int = 0  # steps since the change at which the model is given again; 0: not any more
    count: int = 0  # steps taken in since the last change that was no floor
    since: int = 0  # steps since the change: gains are estimated from these
    judged: int = 0  # steps since gains were given
    carried: Array | float = 0.0  # fading sum of the terms before, which whitens the next ones
    given: list[tuple[float, float]] = field(default_factory=list)
    """Way ahead and turn that the model gave for the periods before, the newest first."""
    after: tuple[float, ...] = ()
    """Pose at which the step before ended: one that begins elsewhere shares no noise with it."""
    gains: Gains = Gains()  # the gains in use
    refusals: int = 0  # how many times in a row gains were found that no floor can cause
    wrong_model: str = ""  # why the model counts as another robot's; empty while it does not
    ended: str = ""  # why nothing is learned any more; empty while something is
    counts: AdaptationCounts = field(default_factory=AdaptationCounts)  # what became of the steps

    def forget(self) -> None:
        """Forget the steps, not the gains."""
        self.next_model = self.count = self.since = self.judged = 0
        self.carried, self.given = 0.0, []

    def newest(self, most: int) -> Array:
        """Return the newest steps since the change, the newest first."""
        memory = len(self.steps)
        kept = (self.count - 1 - np.arange(min(most, self.since, memory))) % memory
        out: Array = self.steps[kept]
        return out
