"""How wrong a model is about a floor, against how wrong it takes itself to be: what tells of a change before adaptation does.

Adaptation needs seconds to tell a new floor from chance. Until then the errors themselves say how
much room they need.
"""

from __future__ import annotations

import math

import numpy as np

from kmpc_lite.types import Array

ATTACK, RELEASE = 0.2, 0.1
"""How fast errors larger, and smaller, than before count, as shares per step: a floor that suddenly
slips ten times as much widens the margins 4-fold after one step and 8-fold after five, and a calm
one narrows them again within two seconds."""
CALM = 2.5
"""Mean square error, against the expected one, that leaves margins as they are: heavy-tailed slip
passes it in one step of ten."""
LARGEST_INNOVATION = 400.0
"""Largest square error that counts, against the expected one: what is larger is a broken
measurement."""
QUIET = (5e-3, 1e-3, 0.02)
"""Steps that should move the robot less than the first [m] are not judged; no step by less than the
second [m], and the third as a share of the way: even a model without noise is allowed to be so
wrong."""
QUIET_TURN = (5e-3, 0.05)
"""The same of turns: no step is judged by less than the first [rad], and the second as a share of
the turn."""
USUAL_SPEED = 0.4
"""At which errors that are too large were made, where only their size is known [m/s]."""
DRIFT, FADING = 6.0, 0.8
"""Square of the fading sum of errors, against the expected one, beyond which a robot does not know
its floor either, and what the sum keeps per step: where poses are noisy no single error tells much,
but a floor pushes to the same side again and again."""
NO_PUSH = (0.0,) * 5
"""Fading sums of nothing: of errors ahead and to the left, and of their expected squares."""


class DriftDetector:
    """Fading means of the errors of past periods.

    Parameters
    ----------
    dt : float
        Period [s].
    """

    def __init__(self, dt: float) -> None:
        self._dt, self._expected = dt, 0.0
        self.reset()

    def reset(self) -> None:
        """Forget what was seen."""
        self._level, self._pushed, self.drifts = 1.0, NO_PUSH, False

    @property
    def inflation(self) -> float:
        """By how much the noise's standard deviation is to be scaled, at least 1."""
        return float(max(1.0, self._level - CALM + 1.0) ** 0.5)

    def expect(self, measured: Array, moved: Array, late: bool) -> None:
        """Judge by the noise of another model from now on.

        Parameters
        ----------
        measured, moved : ndarray
            (3, 3) and (2, 3, 3), as `tube.split_noise` gives them.
        late : bool
            Whether the robot lags: its errors last, so that their sum tells nothing.
        """
        self._late = late
        self._squares = [
            [float(part[i, j]) for part in (measured, *moved)]
            for i, j in ((0, 0), (1, 1), (0, 1), (2, 2))
        ]
        # errors are judged against what is allowed at rest too, but what is too much of them comes
        # from driving
        self.allowed = np.zeros((2, 9))
        """By v^2 and omega^2: what every model may be wrong by."""
        self.allowed[0, [0, 4]] = (QUIET[2] * self._dt) ** 2 + (
            QUIET[1] ** 2 + measured.diagonal()[:2]
        ) / USUAL_SPEED**2
        self.allowed[1, 8] = (QUIET_TURN[1] * self._dt) ** 2
        # what was a surprise to the old model is less of one to a model that expects more
        before, self._expected = (
            self._expected,
            float(moved[0, 0, 0] + moved[0, 1, 1]) + 2.0 * (QUIET[2] * self._dt) ** 2,
        )
        self._level = max(1.0, self._level * before / self._expected)
        self._pushed, self.drifts = NO_PUSH, False

    def see(self, error: Array, heading: float, command: Array) -> bool:
        """Compare a period with what was expected of it; tell whether `drifts` has changed.

        Parameters
        ----------
        error, heading, command
            As `Tightening.observe` gets them.
        """
        # also for NaN and infinity
        if not (abs(command[0]) * self._dt >= QUIET[0] and error @ error < np.inf):
            return False
        # three numbers each: plain floats are ten times as fast as arrays
        cos, sin = math.cos(heading), math.sin(heading)
        ex, ey, turned = error.tolist()
        ahead, left = cos * ex + sin * ey, cos * ey - sin * ex
        v, omega = command.tolist()
        least = QUIET[1] ** 2 + (QUIET[2] * self._dt * v) ** 2
        xx, yy, xy, hh = (m + v * v * a + omega * omega * b for m, a, b in self._squares)
        xx, yy = xx + least, yy + least
        square = (
            0.5
            * (ahead * ahead * yy - 2.0 * ahead * left * xy + left * left * xx)
            / (xx * yy - xy * xy)
        )
        turned = math.remainder(turned, 2.0 * math.pi)
        hh += QUIET_TURN[0] ** 2 + (QUIET_TURN[1] * self._dt * omega) ** 2
        square = max(square, turned * turned / hh)
        change = min(float(square), LARGEST_INNOVATION) - self._level
        self._level += (ATTACK if change > 0.0 else RELEASE) * change
        if self._late:
            return False
        # backwards, a floor pushes the other way
        sign, sums = math.copysign(1.0, v), self._pushed
        ahead, left = FADING * sums[0] + sign * ahead, FADING * sums[1] + sign * left
        (mx, _, _), (my, _, _), (mc, _, _), _ = self._squares
        xx, yy, xy = (
            FADING**2 * old + new
            for old, new in zip(sums[2:], (xx - mx, yy - my, xy - mc), strict=True)
        )
        self._pushed = ahead, left, xx, yy, xy
        # noise of the poses does not add up: what it adds to one step, it takes from the next
        xx, yy, xy = xx + mx / (1.0 + FADING), yy + my / (1.0 + FADING), xy + mc / (1.0 + FADING)
        drift = (
            0.5
            * (ahead * ahead * yy - 2.0 * ahead * left * xy + left * left * xx)
            / (xx * yy - xy * xy)
        )
        before, self.drifts = self.drifts, drift > DRIFT
        return self.drifts != before
