"""Learning while driving: the model follows a floor that changes.

The paper calls this "real-time learning".

What changes under a robot changes few numbers: how far it comes per command, how it drifts
sideways, how much of a turn happens, and whether it pulls to one side. So four gains on the learned
model are adapted, not its 18 coefficients. In the robot's frame the first two have one and the same
information, so that no drive along a straight line can upset the turns. After a slip of 0.2 and a
turn gain of 0.6, 20 steps of them predict within 1.09 times a fresh fit's error (median; worst of
12 drives 1.35); all coefficients, fitted to the same steps, need 400 for 1.23 (1.94).

It stands beside model and tube because the controller runs it: learning and control do not know
each other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, hypot, isfinite, pi, remainder, sin, sqrt

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.adaptation.gains import (
    FEWEST,
    Gains,
    estimate,
    residual_covariance,
    scores,
    whitening,
)
from kmpc_lite.errors import ModelError
from kmpc_lite.model.koopman import KoopmanModel, NoiseModel
from kmpc_lite.types import INPUTS, STATES, Array

SIMPSON = np.array([1.0, 4.0, 1.0]) / 6.0
WINDOW = 20
"""Newest steps that a change is looked for in: at 1 s of prediction, their mean is good enough to
drive by."""
MEMORY = 300
"""Steps that the slow estimate remembers; longer than any window, short enough to follow a floor
that wears."""
ALARM = (40.0, 30.0)
"""Squared distances between an estimate (of the window, of the memory) and the model in use, in
standard errors over four gains, that count as a change. Chance alone gives 4; the window needs
more, for its few steps are heavy-tailed."""
CONFIRM = 20.0
"""The same distance with the noise taken from the very steps, gain by gain, that an alarm must pass
too: where poses are noisier than the log's, few steps at low speed would otherwise count for more
than they know."""
SHORTEST = 8
"""Fewest steps since a change that are worth a model."""
EVEN = 0.3
"""Share of the usual noise that every step is taken to have on top of its own: else the few
slowest, which a model of slip takes for the quietest, would outweigh all others where the poses are
noisy."""
NOISE_FLOOR = 5e-4
"""Smallest noise that a step is taken to have [m, rad]: errors below it do not count, the dead
zone."""
STILL = (2e-3, 2e-3)
"""A step that should move the robot less [m, rad] tells nothing and is left out."""
JUMP = (3.0, 0.05, 0.15)
"""A pose that moved more than this factor of what was commanded, plus this [m, rad], is a broken
measurement, not a floor."""
HELD = (0.02, 0.03)
"""A robot that should move by more than this [m], or turn by more [rad], and does next to nothing,
is held: by brakes, a wall, a pilot."""
NOTHING = (0.0,) * 7
"""Fading sums where the steps before are unknown."""
GAINS = (0.1, 3.0)
"""Limits of the gains: beyond them the model is not what has changed."""


@dataclass
class AdaptationCounts:
    """What became of the steps."""

    used: int = 0
    """Steps that told something."""
    still: int = 0
    """Steps left out since the robot hardly moved."""
    rejected: int = 0
    """Steps left out as broken measurements."""
    models: int = 0
    """Corrected models given."""


class OnlineAdaptation:
    """Recursive least squares on the integral form, with guards.

    Every step regresses the measured displacement on the one that the learned model gives between
    the two measured poses (Simpson's rule, as in the fit). Two sets of sums are kept: the newest
    `window` steps, and all with exponential forgetting. A model is given only where one of them
    contradicts the gains in use significantly (`ALARM`); the window then replaces the older sums,
    and the model is given again each time that the number of steps since the change has doubled,
    until the memory is full. Standing still, steps within the noise, and broken measurements change
    nothing, however long they last. Where the log's poses were noisy, steps are whitened first
    (`gains.whitening`): noise of a pose shows in two steps, with opposite signs.

    The covariance of the residuals is measured anew with every model given, so that margins grow on
    a floor that slips more.

    Parameters
    ----------
    model : KoopmanModel
        Learned with ``method="integral"``. Its noise model, if any, weighs the steps.
    window, memory : int
        See above [steps].

    Raises
    ------
    ModelError
        For a discrete model, or a memory shorter than the window.

    Examples
    --------
    >>> from kmpc_lite import DifferentialDrive, nominal_unicycle
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

    def __init__(self, model: KoopmanModel, *, window: int = WINDOW, memory: int = MEMORY) -> None:
        if not model.continuous:
            raise ModelError(
                'online adaptation needs a continuous model: fit with method="integral"'
            )
        if not 8 <= window < memory:
            raise ModelError(
                f"online adaptation: expected 8 <= window < memory, got {window} and {memory}"
            )
        self.base, self._window, self._memory = model, int(window), int(memory)
        nz, nw = model.dictionary.size, model.dictionary.input_size
        terms = np.concatenate([model.A[None], model.H.reshape(STATES, nw, nz).transpose(1, 0, 2)])
        # how much each bilinear input drives the robot ahead
        self._responses = (terms[1:] @ model.dictionary.lift(np.zeros(STATES)) + model.B.T)[:, 0]
        # by (1, inputs): four rows, of the pose's three velocities and the way ahead, that act on
        # the lifted state and a one
        rates = np.zeros((1 + nw, STATES + 1, nz + 1))
        rates[:, :STATES, :nz] = terms
        rates[1:, :STATES, nz], rates[1:, STATES, nz] = model.B.T, self._responses
        self._rates = rates.reshape(1 + nw, -1)
        self._weights, self._lifted = np.ones(1 + nw), np.ones(nz + 1)
        coefficients = (
            np.zeros((3, STATES, STATES))
            if model.noise_model is None
            else model.noise_model.coefficients
        )
        self._learned_noise = coefficients
        self._carried, self._white = whitening(coefficients, model.dt)
        self._points = np.empty((3, STATES))
        self.reset()

    def reset(self) -> None:
        """Forget all steps and go back to the learned model."""
        self.model, self.gains, self.counts = self.base, Gains(), AdaptationCounts()
        self._forget()
        self._set_noise(self._learned_noise)

    def _forget(self) -> None:
        """Forget the steps, not the gains."""
        self._recent = np.zeros((self._window, 12))
        self._slow = np.zeros(12)
        self._slow_count, self._next = 0.0, 0
        self._count, self._since = 0, 0
        self._usual = 0.0, 0.0
        self._raw = np.zeros((self._memory, 20))
        self._earlier = NOTHING

    def update(
        self, x: ArrayLike, u: ArrayLike, x_next: ArrayLike, history: ArrayLike | None = None
    ) -> KoopmanModel | None:
        """Take in one period.

        Parameters
        ----------
        x, u, x_next : array_like
            Pose before (3,) [m, m, rad], command held (2,) [m/s, rad/s], pose after (3,); any
            multiple of 2 pi in the headings.
        history : array_like, optional
            The L commands before `u`, oldest first, (L, 2), for a model with input history; zeros
            where not given.

        Returns
        -------
        KoopmanModel or None
            A better model than the one in use, to be used from now on; None as long as there is
            none.

        Raises
        ------
        ValueError
            For wrong shapes, and for nothing else.
        """
        before, command, after = (
            np.asarray(x, dtype=float),
            np.asarray(u, dtype=float),
            np.asarray(x_next, dtype=float),
        )
        if before.shape != (STATES,) or command.shape != (INPUTS,) or after.shape != (STATES,):
            raise ValueError(
                f"expected x ({STATES},), u ({INPUTS},), x_next ({STATES},), got {before.shape}, "
                f"{command.shape}, {after.shape}"
            )
        past = (
            None if history is None or not self.base.history else np.asarray(history, dtype=float)
        )
        if past is not None and past.shape != (self.base.history, INPUTS):
            raise ValueError(
                f"history: expected shape ({self.base.history}, {INPUTS}), got {past.shape}"
            )
        sums = self._sums(before, command, after, past)
        if sums is None:
            return None
        row = self._recent[self._count % self._window]
        row[:] = sums
        self._count += 1
        self._since += 1
        self._slow *= 1.0 - 1.0 / self._memory
        self._slow += row
        self._slow_count = self._slow_count * (1.0 - 1.0 / self._memory) + 1.0
        # every other step is soon enough
        if self._since >= self._window and self._count % 2 == 0:
            newest = estimate(self._recent.sum(axis=0).tolist(), self.gains)
            if newest.distance > ALARM[0] and self._confirmed(newest.gains, self._window):
                return self._change()
        if self._slow_count >= self._next > 0:
            self._next = 2 * self._next if 2 * self._next < 0.9 * self._memory else 0
            return self._give(estimate(self._slow.tolist(), self.gains).gains)
        # what the window is too short to see; it cannot come suddenly, so it need not be looked for
        # at every step
        if self._count % 8 == 0 and self._since > 2 * self._window:
            slow = estimate(self._slow.tolist(), self.gains)
            if slow.distance > ALARM[1] and self._confirmed(
                slow.gains, min(self._since, self._memory)
            ):
                return self._give(slow.gains)
        return None

    def _change(self) -> KoopmanModel | None:
        """Forget what was before a change, and give a model of what came after.

        The change is where the steps after it gain most from gains of their own (the likeliest
        one); it is waited for until there are enough of them.
        """
        order = (self._count - 1 - np.arange(self._window)) % self._window
        sums = np.cumsum(self._recent[order], axis=0)
        lengths = range(1, self._window + 1)
        best = max(
            lengths, key=lambda n: estimate(sums[n - 1].tolist(), self.gains, scaled=False).distance
        )
        if best < SHORTEST:
            return None
        self._recent[order[best:]] = 0.0
        self._slow[:] = sums[best - 1]
        self._slow_count, self._since, self._next = float(best), best, 2 * best
        return self._give(estimate(self._slow.tolist(), self.gains).gains)

    def _kept(self, count: int) -> Array:
        """Where the newest steps stand, newest first."""
        kept: Array = (self._count - 1 - np.arange(count)) % self._memory
        return kept

    def _confirmed(self, gains: Gains, count: int) -> bool:
        """Whether the newest steps contradict the gains by more than their own scatter."""
        steps = self._raw[self._kept(count)].T
        pulls = scores(steps, self.gains).sum(axis=1)
        own = scores(steps, gains)
        scatter = (own**2).sum(axis=1)
        enough = np.count_nonzero(own, axis=1) >= FEWEST
        return float((pulls**2 / np.maximum(scatter, 1e-12))[enough].sum()) > CONFIRM

    def _sums(
        self, before: Array, command: Array, after: Array, past: Array | None
    ) -> list[float] | None:
        """What one step adds to the normal equations; None where the step tells nothing.

        The raw step is kept for the estimate of the noise.
        """
        x0, y0, h0 = before.tolist()
        x1, y1, h1 = after.tolist()
        v, omega = command.tolist()
        if not isfinite(x0 + y0 + h0 + x1 + y1 + h1 + v + omega) or (
            past is not None and not np.isfinite(past).all()
        ):
            self.counts.rejected += 1
            self._earlier = NOTHING
            return None
        dx, dy, turned = x1 - x0, y1 - y0, remainder(h1 - h0, 2 * pi)
        # as the controller does: a model may have learned something of the heading itself, within
        # one turn
        h0 = remainder(h0, 2 * pi)
        points = self._points
        points[0] = x0, y0, h0
        points[2] = x1, y1, h0 + turned
        points[1] = x0 + 0.5 * dx, y0 + 0.5 * dy, h0 + 0.5 * turned
        z = self.base.dictionary.lift(points)
        np.matmul(SIMPSON, z, out=self._lifted[:-1])
        self._weights[1:] = self.base.dictionary.inputs(command, past)
        px, py, h, g = (
            ((self._weights @ self._rates).reshape(STATES + 1, -1) @ self._lifted) * self.base.dt
        ).tolist()
        moved = hypot(px, py)
        if moved < STILL[0] and abs(h) < STILL[1]:
            self.counts.still += 1
            self._earlier = NOTHING
            return None
        held = (
            (moved > HELD[0] or abs(h) > HELD[1])
            and hypot(dx, dy) < GAINS[0] * moved + HELD[0] * GAINS[0]
            and abs(turned) < GAINS[0] * abs(h) + HELD[1] * GAINS[0]
        )
        if (
            held
            or hypot(dx, dy) > JUMP[0] * moved + JUMP[1]
            or abs(turned) > JUMP[0] * abs(h) + JUMP[2]
        ):
            self.counts.rejected += 1
            self._earlier = NOTHING
            return None
        self.counts.used += 1
        squares = (v * v, omega * omega)
        p, q = self._position_noise, self._heading_noise
        a = p[0] + p[1] * squares[0] + p[2] * squares[1] + NOISE_FLOOR**2
        b = q[0] + q[1] * squares[0] + q[2] * squares[1] + NOISE_FLOOR**2
        share = 1.0 / min(self._count + 1, self._memory)
        self._usual = (
            self._usual[0] + share * (a - self._usual[0]),
            self._usual[1] + share * (b - self._usual[1]),
        )
        # what hardly moves, or turns, tells nothing of that
        a = 1.0 / (a + EVEN * self._usual[0]) if moved >= STILL[0] else 0.0
        b = 1.0 / (b + EVEN * self._usual[1]) if abs(h) >= STILL[1] or abs(g) >= STILL[0] else 0.0
        # noise of a pose makes one step longer and the next one shorter: sums that fade take that
        # back
        own, earlier, (c, d) = (px, py, dx, dy, h, g, turned), self._earlier, self._carried
        px, py, dx, dy = (
            px + c * earlier[0],
            py + c * earlier[1],
            dx + c * earlier[2],
            dy + c * earlier[3],
        )
        h, g, turned = h + d * earlier[4], g + d * earlier[5], turned + d * earlier[6]
        self._earlier = px, py, dx, dy, h, g, turned
        a, b = a / self._white[0], b / self._white[1]
        self._raw[self._count % self._memory] = (
            px,
            py,
            dx,
            dy,
            h,
            g,
            turned,
            a,
            b,
            cos(h0),
            sin(h0),
            *squares,
            *own,
        )
        return [
            a * (px * px + py * py),
            a * (px * dx + py * dy),
            a * (px * dy - py * dx),
            a * (dx * dx + dy * dy),
            b * h * h,
            b * h * g,
            b * g * g,
            b * h * turned,
            b * g * turned,
            b * turned * turned,
            float(a > 0.0),
            float(b > 0.0),
        ]

    def _give(self, gains: Gains) -> KoopmanModel | None:
        """Put gains into use, if they are any that a floor could cause."""
        low, high = GAINS
        speed = hypot(gains.ahead, gains.left)
        if not (
            low < speed < high
            and gains.ahead > 0.0
            and low < gains.turn < high
            and abs(gains.pull) < high
        ):
            # whatever that was, it was no floor: what comes after it must not be mixed with it
            self._forget()
            return None
        self.gains = gains
        self.counts.models += 1
        base, count = self.base, min(self._since, self._memory)
        coefficients = residual_covariance(
            self._raw[self._kept(count)].T, gains, self._learned_noise
        )
        if self._since >= self._window:
            self._reweigh(coefficients)
        # few steps tell the noise poorly: two standard errors of a variance on top, so that margins
        # are not too narrow
        noise = NoiseModel(coefficients * (1.0 + 2.0 * sqrt(2.0 / count)))
        mix = np.array(
            [
                [gains.ahead, -gains.left, 0.0],
                [gains.left, gains.ahead, 0.0],
                [0.0, 0.0, gains.turn],
            ]
        )
        b = mix @ base.B
        b[2] += gains.pull * self._responses
        info = {
            **base.info,
            "adaptation": {**gains._asdict(), "steps": self._count, "since_change": self._since},
        }
        self.model = replace(
            base, A=mix @ base.A, H=mix @ base.H, B=b, noise_model=noise, info=info
        )
        return self.model

    def _set_noise(self, coefficients: Array) -> None:
        """Weigh steps by a covariance from now on."""
        self._position_noise = [float(c[0, 0] + c[1, 1]) / 2 for c in coefficients]
        self._heading_noise = [float(c[2, 2]) for c in coefficients]

    def _reweigh(self, coefficients: Array) -> None:
        """Weigh the steps since the change by what is now known of their noise.

        With other weights the tails of the noise would look like changes of the floor.
        """
        self._set_noise(coefficients)
        count = min(self._since, self._memory)
        kept = self._kept(count)
        px, py, dx, dy, h, g, turned, a, b, _, _, v2, omega2 = self._raw[kept, :13].T
        terms = np.stack([np.ones(count), v2, omega2])
        own = np.array([self._position_noise, self._heading_noise]) @ terms + NOISE_FLOOR**2
        self._usual = float(own[0].mean()), float(own[1].mean())
        weights = (
            1.0 / (own + EVEN * np.array(self._usual)[:, None]) / np.array(self._white)[:, None]
        )
        a, b = np.where(a > 0.0, weights[0], 0.0), np.where(b > 0.0, weights[1], 0.0)
        self._raw[kept, 7], self._raw[kept, 8] = a, b
        position = (px * px + py * py, px * dx + py * dy, px * dy - py * dx, dx * dx + dy * dy)
        heading = (h * h, h * g, g * g, h * turned, g * turned, turned * turned)
        sums = np.stack(
            [*(a * term for term in position), *(b * term for term in heading), a > 0.0, b > 0.0],
            axis=1,
        )
        recent = min(count, self._window)
        self._recent[(self._count - 1 - np.arange(recent)) % self._window] = sums[:recent]
        fading = (1.0 - 1.0 / self._memory) ** np.arange(count)
        self._slow, self._slow_count = fading @ sums, float(fading.sum())
