"""The controller in a thread of its own: the gate goes on where it crashes or hangs."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from statistics import median

from firmware_bridge.messages import Controller, Speeds, State, VelocityCommand
from firmware_bridge.runtime.timing import Deadlines, Histogram

Predict = Callable[[State, float, float, float, float], State]
"""State after holding v [m/s] and omega [rad/s] for dt [s], and an omni's vy [m/s]."""
RECENT = 21  # number of recent steps from which the time of the next one is estimated
OLDEST_POSE = 0.5  # oldest pose that a controller is asked to plan from [s]


def unicycle_arc(state: State, v: float, omega: float, dt: float, vy: float = 0.0) -> State:
    """Drive a robot without slip: the exact arc.

    Examples
    --------
    >>> end = unicycle_arc(State(0.0, 0.0, 0.0, 0.0, 0.0, 1.0), 1.0, math.pi, 0.5)
    >>> round(end.x, 3), round(end.y, 3), end.stamp
    (0.318, 0.318, 1.5)
    """
    turn = omega * dt
    # the chord, along the mean heading
    chord = dt * (math.sin(turn / 2) / (turn / 2) if abs(turn) > 1e-6 else 1.0)
    cos, sin = math.cos(state.theta + turn / 2), math.sin(state.theta + turn / 2)
    return State(
        state.x + chord * (v * cos - vy * sin),
        state.y + chord * (v * sin + vy * cos),
        state.theta + turn,
        v,
        omega,
        state.stamp + dt,
        vy,
    )


class SentCommands:
    """The last commands on the wire, for the delay compensation."""

    def __init__(self, length: int = 128) -> None:
        self._commands: deque[tuple[float, Speeds]] = deque(maxlen=length)

    def add(self, now: float, v: float, omega: float, vy: float = 0.0) -> None:
        """Remember what was sent at `now` [s]."""
        self._commands.append((now, (v, omega, vy)))

    def carry(
        self, state: State, until: float, latency: float = 0.0, predict: Predict = unicycle_arc
    ) -> State:
        """Predict a state forward to `until` [s], with the commands that act from its stamp on.

        A command acts `latency` [s] after it was sent.

        Before the first command that is remembered, the state's own speeds hold.
        """
        v, omega, vy = state.v, state.omega, state.vy
        # a copy, since another thread adds
        for sent, following in tuple(self._commands):
            start = sent + latency
            if start >= until:
                break
            if start > state.stamp:
                state = predict(state, v, omega, start - state.stamp, vy)
            v, omega, vy = following
        return predict(state, v, omega, until - state.stamp, vy) if until > state.stamp else state

    def mean(self, begin: float, end: float) -> Speeds | None:
        """Mean command on the wire between two moments [s], zero before the first; None if lost."""
        v = omega = vy = 0.0
        until = end
        for sent, (next_v, next_omega, next_vy) in reversed(tuple(self._commands)):
            if sent >= until:
                continue
            share = (until - max(sent, begin)) / (end - begin)
            v, omega, vy = v + share * next_v, omega + share * next_omega, vy + share * next_vy
            until = sent
            if sent <= begin:
                return v, omega, vy
        return None if len(self._commands) == self._commands.maxlen else (v, omega, vy)


class Planner:
    """Asks the controller once per period for a command, from the pose as it is now.

    `controller`: state to VelocityCommand. `poses`: gives the newest State, or None: the driver's
    `state`. `period`: [s]. `latency`: from a command on the wire to the wheels [s]: what is planned
    starts from the pose as it will be then. `predict`: see `Predict`. `clock`: [s]. `after`: called
    once a command is there, in the same thread: what it takes delays no command.
    """

    def __init__(
        self,
        controller: Controller,
        poses: Callable[[], State | None],
        period: float,
        latency: float = 0.0,
        predict: Predict = unicycle_arc,
        clock: Callable[[], float] = time.monotonic,
        after: Callable[[], None] | None = None,
    ) -> None:
        self._after = after
        self._controller = controller
        self._poses = poses
        self.period = period
        self._latency = latency
        self._predict, self._clock = predict, clock
        self._quit = threading.Event()
        self._thread: threading.Thread | None = None
        self.sent = SentCommands()
        """Commands on the wire; whoever sends adds them."""
        self.latest: tuple[VelocityCommand, float] | None = None
        """Newest command, stamped with the beginning of its computation, and the stamp of the pose
        behind it [s]."""
        self.held: Speeds | None = None
        """Mean command on the wire since the controller's last step, for a controller that uses
        it; None if it is not known."""
        self._asked = -math.inf
        self.errors = 0
        """How often the controller raised."""
        self.last_error = ""
        self.skipped = 0
        """Periods that went by while the controller was still busy."""
        self._took: deque[float] = deque(maxlen=RECENT)
        self.pose_age = Histogram()
        self.step_time = Histogram()

    def step(self, now: float) -> None:
        """Ask the controller once.

        An exception is counted and reported; the last command then ages until the gate stops.
        """
        try:
            state = self._poses()
            if state is None or not _usable(state, now):
                return
            self.pose_age.add(now - state.stamp)
            # a period that was left out has not been planned for
            self.held = (
                self.sent.mean(self._asked, now)
                if 0.5 * self.period < now - self._asked < 1.5 * self.period
                else None
            )
            self._asked = now
            # the plan is for the moment at which it can act: when it is computed, and has travelled
            until = now + self.lead + self._latency
            command = self._controller(self.sent.carry(state, until, self._latency, self._predict))
            took = self._clock() - now
            self.step_time.add(took)
            self._took.append(took)
            # the age of an output counts from the beginning of its computation, for its pose is
            # that old
            self.latest = replace(command, stamp=min(command.stamp, now)), state.stamp
            if self._after is not None:
                self._after()
        except Exception as error:  # whatever a controller raises, the gate must go on
            self.errors += 1
            self.last_error = f"{type(error).__name__}: {error}"

    @property
    def lead(self) -> float:
        """How long a step is expected to take [s]: the median of the last ones, at most a period.

        A model's learned lag does not contain it: the commands of a log have the times at which
        they were on the wire.
        """
        return min(median(self._took), self.period) if self._took else 0.0

    def start(self) -> None:
        """Begin to ask the controller, in a daemon thread."""
        self._thread = threading.Thread(target=self._run, name="bridge-planner", daemon=True)
        self._thread.start()

    def stop(self, timeout: float = 0.5) -> bool:
        """Stop asking; False if the controller still hangs after `timeout` [s]."""
        self._quit.set()
        if self._thread is not None:
            self._thread.join(timeout)
        return self._thread is None or not self._thread.is_alive()

    def _run(self) -> None:
        deadlines = Deadlines(self.period, self._clock())
        while not self._quit.wait(max(0.0, deadlines.next - self._clock())):
            self.step(self._clock())
            deadlines.advance(self._clock())
            self.skipped = deadlines.skipped


def _usable(state: State, now: float) -> bool:
    """Whether a pose is finite and young enough to be carried on to now."""
    numbers = state.x, state.y, state.theta, state.v, state.omega, state.vy, state.stamp
    return now - state.stamp <= OLDEST_POSE and all(map(math.isfinite, numbers))
