"""Random driving to learn from: the paper's four sign scenarios, turned back before a fence."""

from __future__ import annotations

import math
import random
from collections import deque
from collections.abc import Callable

from firmware_bridge.messages import STILL, ConfigError, Speeds, State, VelocityCommand
from firmware_bridge.recording.ways import WAYS, Fastest, Place
from firmware_bridge.safety.limits import Limits
from firmware_bridge.wheels import TWO_SIDES, Wheels

SIGNS = ((1, 1), (1, -1), (-1, 1), (-1, -1))
"""Of v and omega, one scenario after the other (paper, sec. V.B)."""
FIRST_DELAY = 0.4
"""How late the robot is taken to answer until that is measured [s] ..."""
CAUTION = 2.0
"""... and by how much the measured delay is multiplied where the robot turns back."""
SHORTEST_DELAY = 0.15
"""Shortest delay that is reckoned with [s]: pose delay, control period, link."""
TURN_GAIN = 2.0
"""Turn rate towards the middle per heading error [1/s] ..."""
TURN_SHARE = 0.5
"""... and largest product of it and the delay."""
DASH = 0.6
"""Share of a scenario after which the dash begins, if it has not by then."""
SHORTEST = 15.0
"""Length of a scenario [s], at least ..."""
HOLDS = 30.0
"""... and in holds ..."""
ROUNDS = 1.5
"""... unless all scenarios would not come so often within the recording."""
SLOWEST = 0.25
"""Share of the limits below which a fence is too small for the robot."""
SPARE = 1.2
"""Room that is kept for turning back, as a multiple of what is needed."""


class Excitation:
    """A controller that drives at random: state -> command.

    Commands are uniform within one scenario's signs and held for a while. Once a scenario there is
    a dash at full speed, a stop, and a turn on the spot. Near the fence the robot turns towards
    the middle, in the direction of travel of the scenario, and goes on at random once it is well
    inside again. In a small fence it drives more slowly.

    `fence`: xmin, ymin, xmax, ymax [m]; free of obstacles. `limits`: commands stay within. `hold`:
    how long a random command is held [s]; if not given, as long as the robot takes to answer and to
    change its speed, now longer, now shorter. `seconds`: length of the recording [s]: all scenarios
    come within it. `seed`: of the commands. `delay`: how late the robot answers, as far as it was
    measured [s]. `manoeuvres`: whether there are dashes, stops and turns on the spot; without them
    all is the paper's. `wheels`: of the robot: a car keeps to curves that it can be steered to, an
    omni drives sideways, too. Raises ConfigError if the fence is too small for the robot.
    """

    def __init__(
        self,
        fence: tuple[float, float, float, float],
        limits: Limits,
        hold: float | None = None,
        seconds: float = 300.0,
        seed: int = 0,
        delay: Callable[[], float | None] = lambda: None,
        manoeuvres: bool = True,
        wheels: Wheels = TWO_SIDES,
    ) -> None:
        self._limits, self._given_hold, self._delay = limits, hold, delay
        self._ways = WAYS[wheels.kind](wheels)
        self._middle = ((fence[0] + fence[2]) / 2.0, (fence[1] + fence[3]) / 2.0)
        self._size = fence[2] - fence[0], fence[3] - fence[1]
        self._signs = SIGNS if limits.v_reverse > 0.0 else SIGNS[:2]
        self._longest = seconds / (ROUNDS * len(self._signs))
        self._manoeuvres = manoeuvres
        self._random = random.Random(seed)
        self._scenario = -1
        self._scenario_ends = self._dash_at = self._until = -math.inf
        self._queue: deque[tuple[Speeds, float]] = deque()
        self._command = STILL
        self._left: tuple[float, float] | None = None
        self.returning = False
        """Whether it is on its way back to the middle."""
        self.trouble = ""
        """Why the robot must be stopped, in words; empty while it turns back as commanded."""
        self._refuse_small()

    @property
    def reaction(self) -> float:
        """How long the robot goes on before it turns back, with room to spare [s]."""
        measured = self._delay()
        delay = FIRST_DELAY if measured is None else measured
        return CAUTION * max(delay, SHORTEST_DELAY)

    @property
    def largest(self) -> Fastest:
        """Speeds that this fence allows."""
        limits, room = self._limits, min(self._size) / (4.0 * SPARE)
        room = max(0.0, room - self._ways.room)
        reaction, braking = self.reaction, limits.deceleration
        most = braking * (math.sqrt(reaction**2 + 2.0 * room / braking) - reaction)
        most = min(most, room / (reaction + 0.5 * self._turn_ramp))
        forward, back, aside = limits.v_max, limits.v_reverse, limits.sideways
        return Fastest(min(forward, most), min(back, most), limits.omega_max, min(aside, most))

    @property
    def hold(self) -> float:
        """How long a random command is held in the mean [s]."""
        if self._given_hold is not None:
            return self._given_hold
        return self.reaction / CAUTION + 0.5 * self._ramp

    @property
    def _ramp(self) -> float:
        """How long it takes to change from standing to the largest speeds [s]."""
        limits, (forward, back, turn, _) = self._limits, self.largest
        return max(max(forward, back) / limits.acceleration, turn / limits.angular_acceleration)

    def _margin(self) -> float:
        """Where it turns back: so far before the fence [m]."""
        fastest = max(self.largest[:2])
        ramp = max(fastest / self._limits.deceleration, self._turn_ramp)
        return SPARE * (fastest * (self.reaction + 0.5 * ramp) + self._ways.room)

    @property
    def _turn_ramp(self) -> float:
        """How long it takes to turn the other way [s]: both speeds change together."""
        limits = self._limits
        return limits.omega_max * (
            1.0 / limits.angular_deceleration + 1.0 / limits.angular_acceleration
        )

    def _refuse_small(self) -> None:
        limits, allowed = self._limits, max(self.largest[:2])
        fastest = max(limits.v_max, limits.v_reverse)
        if allowed < SLOWEST * fastest:
            width, height = self._size
            raise ConfigError(
                f"geofence: {width:g} m x {height:g} m is too small to drive in at random at "
                f"{fastest:g} m/s: at most {allowed:.2g} m/s would be possible; expected a larger "
                "fence, or lower limits.v_max and v_reverse"
            )

    @property
    def note(self) -> str:
        """What a user should know before it drives: that it drives more slowly than allowed."""
        fastest, allowed = max(self._limits.v_max, self._limits.v_reverse), max(self.largest[:2])
        if allowed > 0.99 * fastest:
            return ""
        return (
            f"the geofence has room for {allowed:.2g} m/s of the {fastest:g} m/s that are allowed: "
            "what is learned holds up to that speed"
        )

    def __call__(self, state: State) -> VelocityCommand:
        """Give the command for now."""
        now = state.stamp
        if now >= self._scenario_ends:
            self._scenario = (self._scenario + 1) % len(self._signs)
            length = max(SHORTEST, HOLDS * self.hold)
            length = min(length, self._longest)
            self._scenario_ends = now + length
            self._dash_at = now + DASH * length if self._manoeuvres else math.inf
        signs = self._signs[self._scenario]
        x, y = state.x - self._middle[0], state.y - self._middle[1]
        margin = self._margin()
        half = self._size[0] / 2.0 - margin, self._size[1] / 2.0 - margin
        was, out = self.returning, max(abs(x) / half[0], abs(y) / half[1])
        self.returning = out > (0.6 if was else 1.0)
        beyond = max(abs(x) - half[0], abs(y) - half[1])
        self._look_for_escape(now, beyond)
        if self.returning:
            self._until = -math.inf
            self._queue.clear()
            place = Place(x, y, state.theta, half)
            gain = min(TURN_GAIN, TURN_SHARE * CAUTION / self.reaction)
            v, omega, vy = self._ways.back(place, signs[0], self.largest, gain, not was)
            return VelocityCommand(v, omega, now, vy)
        if self._dash_at < math.inf and (was or now >= self._dash_at):
            self._dash(signs)
        if now >= self._until or (self._queue and was):
            self._command, held = self._queue.popleft() if self._queue else self._at_random(signs)
            self._until = now + held
        v, omega, vy = self._command
        return VelocityCommand(v, omega, now, vy)

    def _at_random(self, signs: tuple[int, int]) -> tuple[Speeds, float]:
        """Uniform speeds of a scenario's signs, and how long they are held."""
        speeds, given = self._ways.draw(self._random, signs, self.largest), self._given_hold
        return speeds, self.hold * self._random.uniform(0.5, 1.5) if given is None else given

    def _dash(self, signs: tuple[int, int]) -> None:
        """Full speed, a stop, and what else random commands hardly ever hold."""
        self._dash_at, fastest = math.inf, self.largest
        delay, ramp = self.reaction / CAUTION, self._ramp
        rest = ramp + 2.0 * delay + 0.5
        shown = self._ways.shown(self._random, signs, fastest)
        self._queue.append(((signs[0] * fastest.to(signs[0]), 0.0, 0.0), ramp + 2.0 * delay))
        self._queue.append((STILL, rest))
        self._queue.extend((speeds, ramp + delay + 1.0) for speeds in shown)

    def _look_for_escape(self, now: float, beyond: float) -> None:
        """Find a robot that goes on towards the fence although commanded to turn back."""
        if not self.returning or beyond <= 0.0:
            self._left = None
            return
        since, least = (now, beyond) if self._left is None else self._left
        fastest = max(self.largest[:2])
        ramp = max(fastest / self._limits.deceleration, self._turn_ramp)
        ramp += 2.0 * self._ways.room / fastest
        if now - since <= self.reaction + ramp:
            self._left = since, beyond if self._left is None else max(least, beyond)
        elif beyond > least + 0.15 * self._margin():
            self.trouble = (
                f"it goes on towards the fence although commanded to turn back "
                f"{now - since:.1f} s ago"
            )
