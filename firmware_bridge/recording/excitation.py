"""Random driving to learn from: the paper's four sign scenarios, turned back before a fence.

Each kind of wheels is driven, and turned back, in its own way.
"""

from __future__ import annotations

import math
import random
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from firmware_bridge.messages import STILL, ConfigError, Speeds, State, VelocityCommand
from firmware_bridge.safety.gate_settings import Limits
from firmware_bridge.wheels import TWO_SIDES, Wheels

LEAST = 0.3  # share of its speed at which a car at least drives while it turns towards the middle
OTHER_END = 2.0
"""A car drives on with the end that it began with until that points this far from the middle [rad].
"""
TIGHT = (0.5, 1.0)
"""Shares of its speed at which a car shows its tightest turn: `kmpc run` turns no faster."""
SIGNS = ((1, 1), (1, -1), (-1, 1), (-1, -1))
"""Of v and omega, one scenario after the other (paper, sec. V.B)."""
FIRST_DELAY = 0.4  # how late the robot is taken to answer until that is measured [s] ...
CAUTION = 2.0  # ... and by how much the measured delay is multiplied where the robot turns back.
SHORTEST_DELAY = 0.15  # shortest delay that is reckoned with [s]: pose delay, control period, link
TURN_GAIN = 2.0  # turn rate towards the middle per heading error [1/s] ...
TURN_SHARE = 0.5  # ... and largest product of it and the delay.
DASH = 0.6  # share of a scenario after which the dash begins, if it has not by then
SHORTEST = 15.0  # length of a scenario [s], at least ...
HOLDS = 30.0  # ... and in holds ...
ROUNDS = 1.5  # ... unless all scenarios would not come so often within the recording.
SLOWEST = 0.25  # share of the limits below which a fence is too small for the robot
SPARE = 1.2  # room that is kept for turning back, as a multiple of what is needed


class Fastest(NamedTuple):
    """Largest speeds [m/s, rad/s]."""

    forward: float
    back: float
    turn: float
    aside: float

    def to(self, sign: float) -> float:
        """Forward or back."""
        return self.forward if sign > 0 else self.back


class Place(NamedTuple):
    """Where a robot is, seen from the middle."""

    x: float  # [m]
    y: float
    theta: float  # [rad]
    half: tuple[float, float]  # how far from the middle it turns back [m]

    def off(self, leading: float) -> float:
        """Angle from a direction to that of the middle [rad]."""
        return math.remainder(math.atan2(-self.y, -self.x) - leading, math.tau)

    def goes_out(self, leading: float) -> bool:
        """Whether that direction leads farther out, where it is out already."""
        ways = zip((self.x, self.y), self.half, (math.cos(leading), math.sin(leading)), strict=True)
        return any(abs(p) > h and p * way > 0.0 for p, h, way in ways)


class Ways:
    """Wheels on either side: each speed by itself.

    `wheels`: of the robot.
    """

    room = 0.0  # what turning back takes beside braking [m]

    def __init__(self, wheels: Wheels) -> None:
        self._radius = wheels.radius

    def draw(self, draw: random.Random, signs: tuple[int, int], fastest: Fastest) -> Speeds:
        """Speeds at random, of a scenario's signs."""
        v = signs[0] * draw.uniform(0.0, fastest.to(signs[0]))
        return v, signs[1] * draw.uniform(0.0, fastest.turn), 0.0

    def shown(
        self, draw: random.Random, signs: tuple[int, int], fastest: Fastest
    ) -> tuple[Speeds, ...]:
        """What random speeds hardly ever hold: a turn on the spot."""
        return ((0.0, signs[1] * fastest.turn * draw.uniform(0.6, 1.0), 0.0),)

    def back(self, place: Place, sign: int, fastest: Fastest, gain: float, begins: bool) -> Speeds:
        """Turn the end that leads towards the middle, and drive as far as it points there."""
        leading = place.theta if sign > 0 else place.theta + math.pi
        off = place.off(leading)
        omega = max(-fastest.turn, min(fastest.turn, gain * off))
        v = 0.0 if place.goes_out(leading) else sign * fastest.to(sign) * max(0.0, math.cos(off))
        return v, omega, 0.0


class CarWays(Ways):
    """A car: it turns while it drives, and goes back with the end that points to the middle."""

    def __init__(self, wheels: Wheels) -> None:
        super().__init__(wheels)
        self._end = 1
        self.room = 0.0 if wheels.reverse else 2.0 * wheels.radius

    def _sharpest(self, v: float, fastest: Fastest) -> float:
        return min(fastest.turn, abs(v) / self._radius)

    def draw(self, draw: random.Random, signs: tuple[int, int], fastest: Fastest) -> Speeds:
        """Speeds at random, of a scenario's signs, in a curve that the wheels can be steered to."""
        v = signs[0] * draw.uniform(0.0, fastest.to(signs[0]))
        return v, signs[1] * draw.uniform(0.0, self._sharpest(v, fastest)), 0.0

    def shown(
        self, draw: random.Random, signs: tuple[int, int], fastest: Fastest
    ) -> tuple[Speeds, ...]:
        """What random speeds hardly ever hold: the tightest turn, slowly and fast."""
        speeds = [signs[0] * share * fastest.to(signs[0]) for share in TIGHT]
        return tuple((v, signs[1] * self._sharpest(v, fastest), 0.0) for v in speeds)

    def back(self, place: Place, sign: int, fastest: Fastest, gain: float, begins: bool) -> Speeds:
        """Steer towards the middle, in the gear in which it lies ahead."""
        off = place.off(place.theta)
        ahead = off if self._end > 0 else math.remainder(off + math.pi, math.tau)
        if fastest.back == 0.0:
            self._end = 1
        elif begins or abs(ahead) > OTHER_END:
            self._end = 1 if abs(off) <= 0.5 * math.pi else -1
        off = off if self._end > 0 else math.remainder(off + math.pi, math.tau)
        v = self._end * fastest.to(self._end) * max(LEAST, math.cos(off))
        most = self._sharpest(v, fastest)
        return v, max(-most, min(most, gain * off)), 0.0


class OmniWays(Ways):
    """An omni: three speeds, and straight back to the middle however it stands."""

    def draw(self, draw: random.Random, signs: tuple[int, int], fastest: Fastest) -> Speeds:
        """Speeds at random, of a scenario's signs; sideways to either side."""
        v, omega, _ = super().draw(draw, signs, fastest)
        return v, omega, draw.uniform(-fastest.aside, fastest.aside)

    def shown(
        self, draw: random.Random, signs: tuple[int, int], fastest: Fastest
    ) -> tuple[Speeds, ...]:
        """What random speeds hardly ever hold: a turn on the spot, and a dash to the side."""
        aside = 0.0, 0.0, signs[1] * fastest.aside
        return (*super().shown(draw, signs, fastest), STILL, aside, STILL)

    def back(self, place: Place, sign: int, fastest: Fastest, gain: float, begins: bool) -> Speeds:
        """Drive to the middle."""
        off = place.off(place.theta)
        v, vy = math.cos(off), math.sin(off)
        most = min(fastest.to(v) / max(abs(v), 1e-9), fastest.aside / max(abs(vy), 1e-9))
        return most * v, 0.0, most * vy


WAYS = {"differential": Ways, "car": CarWays, "omni": OmniWays}  # by kind of wheels


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
        self.returning = False  # whether it is on its way back to the middle
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
