"""Studies ``anyrobot`` and ``scales``: whether it drives a robot nobody has tuned it for.

Size, speed, period, lag, slip, turning centre, noise and, of one in three, a footprint that is no
circle are drawn at random from a seed.
It is learned from its own log as the documentation says, and driven on a random map of its size.
`robot_drives` judges by the truth. The plant shares no code with the controller.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from kmpc_lite.control import Footprint, NavigationProblem
from kmpc_lite.learn import Dataset, Episode, fit, with_quantiles
from kmpc_lite.learn.ramps import find_ramps, let_through, with_ramps
from kmpc_lite.model.koopman import KoopmanModel, nominal_unicycle
from kmpc_lite.scale import UNIT_RADIUS, UNIT_SPEED
from kmpc_lite.scenario.touch import LOOKS
from kmpc_lite.types import Array

UNIT_TURN = math.pi / 4  # fastest turn of the robot that is its own unit [rad/s]: the paper's


@dataclass(frozen=True)
class Robot:
    """A robot as it is drawn or described."""

    name: str
    radius: float = UNIT_RADIUS  # radius [m]
    speed: float = UNIT_SPEED  # largest speed [m/s]
    turn_rate: float = UNIT_TURN  # largest turn rate [rad/s]
    dt: float = 0.1  # control period [s]
    lag: float = 0.0  # time constant of the motors [s]
    dead_time: float = 0.0  # time from a command to the motors' first reaction [s]
    ramps: tuple[float, float] = (0.0, 0.0)
    """Least time from rest to full speed, and from full speed to rest [s]."""
    turn_ramp: float | None = None  # the same of both for the turn rate; as `ramps` if not given
    slip: float = 0.0  # mean of the slip ratios
    turn_gain: float = 1.0  # share of a commanded turn that happens
    turning_point: tuple[float, float] = (0.0, 0.0)
    """Turning centre, ahead and to the left of the tracked pose [m]."""
    noise: tuple[float, float] = (0.0, 0.0)  # standard deviation of a measured pose [m, rad]
    reverse: bool = True  # whether it may drive backwards
    learned: bool = True
    """Whether it drives with a model learned from its log, or with the nominal one."""
    seconds: float = 90.0  # how long its log is [s]
    footprint: Footprint | None = None
    """What it covers, where that is no circle of its radius; that is then the size of its map."""
    horizon: int = 20  # periods that are planned ahead

    def ideal(self, start: Array, goal: Array) -> float:
        """Time of the straight line at full speed, and of the turns at both ends [s]."""
        away = goal[:2] - start[:2]
        along = math.atan2(away[1], away[0])
        turns = min(
            abs(math.remainder(along + back - start[2], math.tau))
            + abs(math.remainder(goal[2] - along - back, math.tau))
            for back in ((0.0, math.pi) if self.reverse else (0.0,))
        )
        return math.hypot(*away) / self.speed + turns / (self.turn_rate * self.turn_gain)

    def problem(self, side: float) -> NavigationProblem:
        """Its navigation problem in a square area of a side [m]."""
        half = 0.5 * side
        backwards = -self.speed if self.reverse else 0.0
        return NavigationProblem(
            horizon=self.horizon,
            dt=self.dt,
            u_min=(backwards, -self.turn_rate),
            u_max=(self.speed, self.turn_rate),
            x_min=(-half, -half, -np.inf),
            x_max=(half, half, np.inf),
            robot_radius=self.radius if self.footprint is None else self.footprint.radius,
            footprint=self.footprint,
        )


def random_robot(seed: int, shapes: bool = True) -> Robot:
    """Draw a robot: from a desk's toy to a farm's machine.

    `seed`: of the draw. `shapes`: whether one in three is no circle; all else is drawn alike.
    """
    random = np.random.default_rng([seed, 11])
    radius = float(np.exp(random.uniform(np.log(0.04), np.log(1.0))))
    speed = radius * float(np.exp(random.uniform(np.log(1.5), np.log(5.0))))
    lags = random.random() < 0.6
    centre = radius * random.uniform(-0.3, 0.3, 2) * (random.random() < 0.4)
    noisy = random.random() < 0.6
    return Robot(
        f"robot {seed}",
        radius,
        speed,
        float(random.uniform(0.5, 2.5)),
        float(random.choice((0.05, 0.1, 0.1, 0.2))),
        lag=float(random.uniform(0.05, 0.3)) if lags else 0.0,
        dead_time=float(random.uniform(0.0, 0.12)) if lags else 0.0,
        slip=float(random.uniform(0.0, 0.1)),
        turn_gain=float(random.uniform(0.5, 1.0)),
        turning_point=(float(centre[0]), float(centre[1])),
        noise=(0.03 * radius, 0.01) if noisy else (0.0, 0.0),
        footprint=random_footprint(seed, radius) if shapes else None,
    )


def random_footprint(seed: int, radius: float) -> Footprint | None:
    """Draw a rectangle about a pose that is not its middle; none for two robots of three.

    It is narrower than a circle of the radius [m], and up to half as far again from end to end:
    maps that have a passage for that circle leave it room to turn at start and goal.
    """
    random = np.random.default_rng([seed, 13])
    if random.random() >= 1.0 / 3.0:
        return None
    side = radius * random.uniform(0.5, 0.9)
    front = math.sqrt((radius * random.uniform(1.0, 1.5)) ** 2 - side**2)
    back = front * random.uniform(0.5, 1.0)
    ends = (-back, front) if random.random() < 0.5 else (-front, back)
    ahead = -0.5 * (ends[0] + ends[1])
    return Footprint.rectangle(ends[1] - ends[0], 2.0 * side, ahead)


STANDARD = Robot("standard", slip=0.05, learned=False)
SCALES = (0.1, 0.25, 1.0, 4.0, 10.0, 30.0)
KNOWN = (
    Robot("Husky-like", 0.5, 1.0, 1.0, slip=0.05, learned=False),
    Robot("Warthog-like", 0.9, 4.0, 2.0, slip=0.05, learned=False),
    Robot("micro", 0.04, 0.2, dt=0.05, slip=0.05, learned=False),
    Robot("forward only", slip=0.05, reverse=False, learned=False),
    Robot("slow turner", turn_rate=0.25, slip=0.05, learned=False),
    Robot("fast", speed=3.0, turn_rate=2.0, slip=0.05, learned=False),
)
"""Robots of known kinds, driven with the nominal model on a slipping floor."""
ODD = (
    Robot("one-minute log", noise=(0.02, math.radians(3.0)), slip=0.05, seconds=60.0),
    *(
        Robot(f"ramps {up:g}, {down:g} s", ramps=(up, down), lag=0.1, dead_time=0.1, slip=0.05)
        for up, down in ((1.0, 1.0), (2.0, 1.0), (1.0, 2.0))
    ),
    *(
        Robot(f"1 s, N {n}", dt=1.0, horizon=n, slip=0.05, learned=False, turn_rate=UNIT_TURN)
        for n in (10, 20, 40)
    ),
)
"""A short log of badly measured poses, motors that follow by ramps, and the paper's period at three
horizons."""


def scaled(robot: Robot, by: float) -> Robot:
    """The same robot with all lengths and speeds times a factor; seconds are kept."""
    return replace(
        robot,
        name=f"x{by:g}",
        radius=by * robot.radius,
        speed=by * robot.speed,
        turning_point=(by * robot.turning_point[0], by * robot.turning_point[1]),
        noise=(by * robot.noise[0], robot.noise[1]),
        footprint=None if robot.footprint is None else robot.footprint.scaled(1.0 / by),
    )


class RobotPlant:
    """The robot as it is: motors that lag, by ramps, behind a dead time; wheels that slip.

    `LaggingDrive` moves such a robot, too, by the arcs that the controller reckons with. This one
    shares no code with either and holds speeds between two looks, so that what is wrong with them
    shows.

    `robot`: what it is like. `seed`: of its slip.
    """

    def __init__(self, robot: Robot, seed: int) -> None:
        self._robot, self._random = robot, np.random.default_rng([seed, 3])
        self._speeds, self._delayed = np.zeros(2), [np.zeros(2)]
        self._asked = np.zeros(2)

    def drive(self, pose: Array, command: Array) -> Array:
        """Poses (LOOKS, 3) during one period from a pose (3,)."""
        robot, poses = self._robot, np.empty((LOOKS, 3))
        h = robot.dt / LOOKS
        waiting = max(round(robot.dead_time / h), 0)
        self._delayed += [command] * LOOKS
        ratios = self._random.exponential(robot.slip, 3) if robot.slip else np.zeros(3)
        x, y, heading = pose.tolist()
        for k in range(LOOKS):
            asked = self._delayed[-1 - min(waiting + LOOKS - 1 - k, len(self._delayed) - 1)]
            asked = self._ramped(asked, h)
            share = 1.0 - math.exp(-h / robot.lag) if robot.lag else 1.0
            self._speeds = self._speeds + share * (asked - self._speeds)
            v, omega = self._speeds.tolist()
            turn = omega * robot.turn_gain * (1.0 + ratios[2]) * h
            forward, left = v * (1.0 + ratios[0]) * h, -v * ratios[1] * h
            forward += turn * robot.turning_point[1]
            left -= turn * robot.turning_point[0]
            middle = heading + 0.5 * turn
            x += forward * math.cos(middle) - left * math.sin(middle)
            y += forward * math.sin(middle) + left * math.cos(middle)
            heading += turn
            poses[k] = x, y, heading
        del self._delayed[: max(len(self._delayed) - waiting - LOOKS, 0)]
        return poses

    def _ramped(self, asked: Array, h: float) -> Array:
        """What the motors are asked for when the ramps have let it through, a time [s] later."""
        robot, now = self._robot, self._asked
        slows = (np.abs(asked) < np.abs(now)) | (asked * now < 0.0)
        turns = robot.ramps if robot.turn_ramp is None else (robot.turn_ramp,) * 2
        times = np.where(slows, (robot.ramps[1], turns[1]), (robot.ramps[0], turns[0]))
        full = np.array((robot.speed, robot.turn_rate))
        most = np.where(times > 0.0, full * h / np.maximum(times, 1e-9), np.inf)
        self._asked = now + np.clip(asked - now, -most, most)
        return self._asked


def record(robot: Robot, seed: int) -> Dataset:
    """A log of random driving, poses with noise.

    Commands are held for half a second, or as long as its ramps need for most of them.
    """
    random = np.random.default_rng([seed, 5])
    plant, pose = RobotPlant(robot, seed + 1), np.zeros(3)
    count = round(robot.seconds / robot.dt)
    longest = max(0.5, 0.7 * max(*robot.ramps, robot.turn_ramp or 0.0))
    hold = max(round(longest / robot.dt), 1)
    least = -1.0 if robot.reverse else 0.0
    bounds = np.array((robot.speed, robot.turn_rate))
    drawn = random.uniform((least, -1.0), 1.0, (count // hold + 1, 2)) * bounds
    commands = np.repeat(drawn, hold, axis=0)[:count]
    spread = np.array((robot.noise[0], robot.noise[0], robot.noise[1]))
    seen = [pose + spread * random.normal(size=3)]
    for command in commands:
        pose = plant.drive(pose, command)[-1]
        seen.append(pose + spread * random.normal(size=3))
    return Dataset([Episode(np.array(seen), commands, robot.dt)])


def learn(robot: Robot, seed: int) -> KoopmanModel:
    """Learn as ``kmpc fit`` does.

    The model has a lag where the log shows one, and its margins come from held-out driving.
    """
    if not robot.learned:
        return nominal_unicycle(robot.dt)
    log = record(robot, seed)
    seen = let_through(log, ramps := find_ramps(log))
    train, held = seen.windows(10.0).split(0.5, seed=0)
    model = with_quantiles(fit(train, lags="auto", ramps=False, whole=seen), held)
    return with_ramps(model, log, ramps)
