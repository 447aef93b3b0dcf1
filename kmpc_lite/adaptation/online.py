"""Learning while driving: a learned model follows a floor that changes.

The paper calls it "real-time learning" and leaves it as future work.

What changes under a robot changes few numbers: how far it comes per command, how it drifts
sideways, how much of a turn happens, and whether it pulls to one side. So four gains on the learned
model are adapted, not its 18 coefficients. In the robot's frame the first two have one and the same
information, so that no straight drive can upset the turns. An omni has a fifth, of speeds sideways.

It has a folder of its own because the controller runs it, and `control` must not import `learn`.
"""

from __future__ import annotations

import logging
from math import sqrt

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.adaptation.gains import (
    Evidence,
    adapted_model,
    drives_sideways,
    estimate,
    lag_taken_for_gain,
    refuse,
    residual_covariance,
)
from kmpc_lite.adaptation.options import AdaptationOptions
from kmpc_lite.adaptation.steps import STEP, AdaptationCounts, AdaptationState, Gains, Steps
from kmpc_lite.errors import ModelError
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.model.noise_model import NoiseModel
from kmpc_lite.scale import Scale
from kmpc_lite.types import STATES

LOG = logging.getLogger("kmpc_lite.adaptation")
FEWEST_STEPS = 8
"""Least number of steps since a change from which a model is given. Steps, not seconds: how surely
gains are known hangs on how many tell of them."""
LOOKS = 5  # how often a window is looked at while it passes
CONFIRMATION = 20.0
"""Squared distance, with the noise of the newest steps alone, that an alarm must exceed, too: a few
slow steps would count too much if poses are noisier than in the log."""
WORSE = 1.1
"""The learned model returns if the adapted one's squared errors are this many times its own."""
REFUSALS = 2  # times in a row that gains which no floor can cause make the model another robot's


class OnlineAdaptation:
    """Least squares over the newest steps, with guards.

    A model is given only where the steps of a window, or all that are remembered, with exponential
    forgetting, contradict the gains in use significantly: what was before the likeliest change is
    left, and the model is given again each time that the number of steps since has doubled, until
    the memory is full. Standing still, steps within the noise, and broken measurements change
    nothing, however long they last.

    Where the adapted model predicts the newest drive worse than the learned one, that returns.
    Gains that no floor can cause are refused; if fresh steps lead to them again, the model must be
    another robot's, and `wrong_model` says why. The covariance of the residuals is measured anew
    with every model given, so that margins grow on a floor that slips more.

    `model`: learned with ``method="integral"``; its noise model, if any, weighs the steps.
    `options`: what can be tuned. `scale`: the robot's units; those of a robot of 0.15 m and 0.6 m/s
    if not given. `steered`: whether wheels are steered: gains beyond 0.8 to 1.25 then end the
    adaptation, the learned model returns, and `ended` says why. `predictor`: predicts as the model
    does, in less time. Raises ModelError for a discrete model.

    Examples
    --------
    >>> from kmpc_lab import DifferentialDrive
    >>> from kmpc_lite import nominal_unicycle
    >>> robot, x, random = DifferentialDrive(turn_gain=0.6), np.zeros(3), np.random.default_rng(0)
    >>> adaptation = OnlineAdaptation(nominal_unicycle(0.1))
    >>> for _ in range(50):
    ...     u = random.uniform(-0.6, 0.6, 2)
    ...     x_next = robot.step(x, u, 0.1)
    ...     better = adaptation.update(x, u, x_next)  # a model now and then, else None
    ...     x = x_next
    >>> round(adaptation.gains.turn, 3)
    0.6
    """

    def __init__(
        self,
        model: KoopmanModel,
        options: AdaptationOptions | None = None,
        scale: Scale | None = None,
        steered: bool = False,
        predictor: MotionModel | None = None,
    ) -> None:
        if not model.continuous:
            raise ModelError(
                'online adaptation needs a continuous model: fit with method="integral"'
            )
        self.base, self.steered = model, steered
        self.options = AdaptationOptions() if options is None else options
        self.scale = Scale() if scale is None else scale
        period = model.dt / self.scale.time
        self._window = max(FEWEST_STEPS, round(self.options.window / period))
        self._memory = max(2 * self._window, round(self.options.memory / period))
        self._weights = (1.0 - 1.0 / self._memory) ** np.arange(self._memory)
        noise = model.noise_model
        self._noise = np.zeros((3, STATES, STATES)) if noise is None else noise.coefficients
        sideways, predicts = drives_sideways(model), model if predictor is None else predictor
        self._no_history = np.zeros((model.history, model.inputs))
        self._steps = Steps(predicts, self._noise, self.scale, sideways)
        self.reset()

    def reset(self) -> None:
        """Forget all steps and go back to the learned model."""
        steps = np.zeros(self._memory, STEP)
        self.model, self.state = self.base, AdaptationState(steps, self._noise)

    def restore(self, state: AdaptationState, model: KoopmanModel) -> None:
        """Go on from what was remembered, and the model that was made of it."""
        self.state, self.model = state, model

    @property
    def gains(self) -> Gains:
        """The gains in use."""
        return self.state.gains

    @property
    def counts(self) -> AdaptationCounts:
        """How many steps were used, left out and rejected."""
        return self.state.counts

    @property
    def wrong_model(self) -> str:
        """Why the model counts as another robot's, in words; empty while it does not."""
        return self.state.wrong_model

    @property
    def ended(self) -> str:
        """Why nothing is learned any more, in words; empty while something is."""
        return self.state.ended

    def update(
        self, x: ArrayLike, u: ArrayLike, x_next: ArrayLike, history: ArrayLike | None = None
    ) -> KoopmanModel | None:
        """Take in one period.

        `x`, `u`, `x_next`: pose before (3,) [m, m, rad], command held (m,) [m/s, ..., rad/s], pose
        after (3,); any multiple of 2 pi in the headings. `history`: the L commands before `u`,
        oldest first, (L, m), for a model with input history; zeros if not given. Returns a better
        model than the one in use, to be used from now on; None as long as there is none. Raises
        ValueError for wrong shapes, and for nothing else.
        """
        wheels, state = self.base.inputs, self.state
        past = history if self.base.history and history is not None else self._no_history
        period = [np.asarray(value, dtype=float) for value in (x, u, x_next, past)]
        expected = [(STATES,), (wheels,), (STATES,), (self.base.history, wheels)]
        if (got := [value.shape for value in period]) != expected:
            raise ValueError(f"expected x, u, x_next, history of shapes {expected}, got {got}")
        if state.ended or not self._steps.take_in(state, *period):
            return None
        # some times a window is soon enough, and not both in one step
        every = max(1, self._window // LOOKS)
        if state.count % every == 0 and state.since >= self._window:
            if self._contradicts(self._evidence(self._window), self.options.window_alarm):
                return self._give_since_change()
        if state.next_model and self._weights[: state.since].sum() >= state.next_model:
            following = 2 * state.next_model
            state.next_model = following if following < 0.9 * self._memory else 0
            return self._give(self._estimate(self._evidence(self._memory))[0])
        if state.count % (2 * every) == every // 2 and state.since > 2 * self._window:
            steps = self._evidence(self._memory)
            if self._is_worse(steps):
                return self._return_to_base()
            if self._contradicts(steps, self.options.memory_alarm):
                return self._give_since_change()
        return None

    def _evidence(self, most: int) -> Evidence:
        """Weighed steps since the change, at most so many."""
        state = self.state
        return Evidence.of(state.newest(most), state.noise, self._steps.white, self.scale.length)

    def _estimate(self, steps: Evidence) -> tuple[Gains, float]:
        """Estimate gains from steps, older ones by a fading weight, and how far they are off."""
        sums = steps.sums(self._weights[: steps.tells.shape[1]])
        gains, distance = estimate(sums, self.state.gains, self.scale.length)
        return Gains(*gains.tolist()), float(distance)

    def _contradicts(self, steps: Evidence, alarm: float) -> bool:
        """Whether steps contradict the gains in use significantly, by their own scatter, too."""
        gains, distance = self._estimate(steps)
        return distance > alarm and steps.contradiction(self.gains, gains) > CONFIRMATION

    def _give_since_change(self) -> KoopmanModel | None:
        """Leave what was before a change, and give a model of what came after.

        The change is where the steps after it gain most from gains of their own (the likeliest
        one); it is waited for until there are enough of them.
        """
        state, steps = self.state, self._evidence(self._memory)
        sums = steps.running_sums()
        likely = estimate(sums, state.gains, self.scale.length, scaled=False)[1]
        best = int(likely.argmax()) + 1
        if best < FEWEST_STEPS:
            return None
        state.since, state.next_model = best, 2 * best
        return self._give(self._estimate(self._evidence(self._memory))[0])

    def _is_worse(self, steps: Evidence) -> bool:
        """Whether the adapted model has predicted the newest drive worse than the learned one."""
        state = self.state
        if state.gains == Gains() or state.judged < 2 * self._window:
            return False
        weights = self._weights[: steps.tells.shape[1]].copy()
        weights[state.judged :] = 0.0
        learned, adapted = (steps.error(g, weights) for g in (Gains(), state.gains))
        return adapted > WORSE * learned

    def _return_to_base(self) -> KoopmanModel:
        """Give the learned model again, and begin anew."""
        state = self.state
        state.forget()
        state.gains, state.noise = Gains(), self._noise
        state.counts.models += 1
        self.model = self.base
        return self.base

    def _give(self, gains: Gains) -> KoopmanModel | None:
        """Put gains into use, if a floor can cause them."""
        if refusal := refuse(gains, self.options, self.scale.length):
            self._refuse(gains, refusal)
            return None
        state = self.state
        if self.steered and (lag := lag_taken_for_gain(gains)):
            state.ended = lag
            LOG.warning("%s", state.ended)
            return self._return_to_base()
        state.gains, state.refusals, state.judged = gains, 0, 0
        state.counts.models += 1
        steps = state.newest(self._memory)
        coefficients = residual_covariance(steps, gains, self._noise, self.scale)
        if state.since >= self._window:
            # with the old weights, the tails of a larger noise would look like changes
            state.noise = coefficients
        # few steps tell the noise poorly: two standard errors of a variance on top, so that margins
        # are not too narrow
        noise = NoiseModel(coefficients * (1.0 + 2.0 * sqrt(2.0 / len(steps))))
        told = {"steps": state.count, "since_change": state.since}
        self.model = adapted_model(self.base, gains, noise, told)
        return self.model

    def _refuse(self, gains: Gains, refusal: str) -> None:
        """Forget the steps that led to impossible gains, and count those that explain the drive."""
        state = self.state
        steps = self._evidence(self._memory)
        weights = np.ones(steps.tells.shape[1])
        explains = steps.error(gains, weights) < 0.5 * steps.error(Gains(), weights)
        # whatever that was, it was no floor: what comes after it must not be mixed with it
        state.forget()
        if not explains:
            return  # nor was it a robot of another kind: those gains explain nothing
        state.refusals += 1
        if state.refusals >= REFUSALS:
            state.wrong_model = f"the model is not of this robot: {refusal}"
