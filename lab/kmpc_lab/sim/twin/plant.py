"""The robot as a plant: wheel speeds in, motion and touches out.

Under its wheels are tile, carpet, a wet patch; that may change on the way.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lab.sim.twin.mjcf import CORNERS, TOP_SPEED, TORQUE, WHEELS, write_mjcf
from kmpc_lite.control.world.shapes import Circle
from kmpc_lite.errors import KmpcError, ScenarioError
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.types import INPUTS, STATES, Array

SERVO_LAG = 0.04
"""First-order lag of the set-point in the motor board: its loop and its speed filter [s]."""
RESET_TIME = 0.08  # integral time of the motor board's speed loops [s]
FLOOR_PERIOD = 8
"""Steps between looks at what is under the wheels, and at the heading: 12 mm at 0.6 m/s."""
WARM_UP = 120  # steps in which a robot that was put down comes to rest
WEIGHT_SPREAD, TYRE_SPREAD = 0.01, 0.005
"""Standard deviations between robots: of where the weight lies [m], of the tyres' radii (share)."""
SIDES = np.array((0, 1, 0, 1))  # which side of the robot each motor turns


@dataclass(frozen=True)
class Floor:
    """How a floor holds a tyre, and how it brakes it.

    A skid-steer robot turns by sliding: with wheels at (+-a, +-b) and tyres of contact radius p the
    sliding forces balance at a share of the turn that the wheels say, b^2 / (a^2 + b^2) = 0.77 for
    p = 0 and less the larger p is.
    """

    sliding: float  # coefficient of friction
    patch_radius: float
    """Of the tyre's contact: the moment that resists spinning on the spot is sliding * patch_radius
    * load [m]."""
    rolling: float  # moment that brakes each wheel, from its axle and from the carpet's pile [N m]

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name in ("sliding", "patch_radius", "rolling"):
            value = getattr(self, name)
            if not (np.isfinite(value) and 0.0 <= value <= 10.0):
                raise ScenarioError(f"floor: {name}: expected a number from 0 to 10, got {value!r}")


FLOORS: Mapping[str, Floor] = {
    # the robot makes 0.60 to 0.74 of a turn, less the faster; the maker's 1/1.36 to 1/1.45 on an
    # office floor (diff_drive_controller.yaml)
    "tile": Floor(sliding=0.7, patch_radius=0.006, rolling=0.002),
    # tyres sink in: they slide less, stand on a larger patch, and roll against the pile; 0.44 to
    # 0.54 of a turn
    "carpet": Floor(sliding=1.0, patch_radius=0.025, rolling=0.02),
    # water on tile: 0.76 of a turn, wheels spin, and the robot drifts outwards in curves
    "wet": Floor(sliding=0.2, patch_radius=0.006, rolling=0.002),
}
"""The floors that scenarios name; ours, chosen before any controller drove on them."""


@dataclass(frozen=True)
class Patch:
    """A round piece of another floor: centre and radius [m]."""

    floor: Floor
    x: float
    y: float
    radius: float


@dataclass(frozen=True)
class Ground:
    """The floor at each place and time."""

    floor: Floor = FLOORS["tile"]
    changes: tuple[tuple[float, Floor], ...] = ()
    """From these times on [s since the plant began] the whole floor is another one."""
    patches: tuple[Patch, ...] = field(default=())  # lie on top, whatever the floor

    def __post_init__(self) -> None:
        """Check the order of the changes."""
        times = [time for time, _ in self.changes]
        if times != sorted(set(times)):
            raise ScenarioError(f"floor changes: expected rising times, got {times}")

    @classmethod
    def named(
        cls,
        floor: str,
        changes: tuple[tuple[float, str], ...] = (),
        patches: tuple[tuple[str, float, float, float], ...] = (),
    ) -> Ground:
        """Build it from the words of a scenario; ScenarioError for a floor that nobody knows."""
        return cls(
            find_floor(floor),
            tuple((t, find_floor(n)) for t, n in changes),
            tuple(Patch(find_floor(n), x, y, r) for n, x, y, r in patches),
        )

    def base(self, time: float) -> Floor:
        """Floor without the patches at a time [s]."""
        return next(
            (floor for start, floor in reversed(self.changes) if time >= start - 1e-9), self.floor
        )

    def under(self, positions: Array, time: float) -> list[Floor]:
        """Floor under each of the positions (n, 2) [m]."""
        base = self.base(time)
        found = [base] * len(positions)
        for patch in self.patches:
            inside = np.hypot(positions[:, 0] - patch.x, positions[:, 1] - patch.y) <= patch.radius
            found = [
                patch.floor if hit else floor for hit, floor in zip(inside, found, strict=True)
            ]
        return found


def find_floor(name: str) -> Floor:
    """Give a floor by its name."""
    if name not in FLOORS:
        raise ScenarioError(f"floor: expected one of {', '.join(FLOORS)}, got {name!r}")
    return FLOORS[name]


class TwinMissing(KmpcError):
    """MuJoCo is not installed."""


def load_mujoco() -> Any:
    """Import MuJoCo, or say how to install it."""
    try:
        import mujoco
    except ImportError as error:
        raise TwinMissing("the digital twin needs MuJoCo: pip install 'kmpc-lab[twin]'") from error
    return mujoco


class Twin:
    """A robot on a floor, among cylinders; a plant as `DifferentialDrive` is one, for one robot.

    Its wheel speeds follow set-points by a PI loop with a motor's torque and speed limits. What a
    command (v, omega) says to the wheels is the maker's kinematics with the geometric track: a
    skid-steered robot turns by sliding, so it turns less. It keeps its own state: `trace` moves on
    from where it is, unless it is given another pose, where it is then put down, standing.

    Parameters
    ----------
    circles : sequence of Circle
        Obstacles; standing still.
    ground : Ground
        What is under the wheels, where and when.
    seed : int
        Of the robot: a seed is one robot, with its own weight distribution and tyres; 0 is the even
        one.
    pose : tuple
        Where it stands [m, m, rad].

    Raises
    ------
    TwinMissing
        Without MuJoCo.
    ScenarioError
        For obstacles that move.
    """

    def __init__(
        self,
        circles: Sequence[Circle] = (),
        ground: Ground | None = None,
        seed: int = 0,
        pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:
        self._mujoco = load_mujoco()
        if any(c.vx or c.vy for c in circles):
            raise ScenarioError("twin: expected obstacles that stand still, got one that moves")
        self.ground = Ground() if ground is None else ground
        self.model = self._mujoco.MjModel.from_xml_string(write_mjcf(circles))
        self.data = self._mujoco.MjData(self.model)
        self._step = float(self.model.opt.timestep)
        self._vary(seed)
        names = [name for name, _, _ in CORNERS]
        axles = [self.model.joint(name) for name in names]
        self._axle_q = np.array([axle.qposadr[0] for axle in axles])
        self._axle_v = np.array([axle.dofadr[0] for axle in axles])
        self._tyres = np.array([self.model.geom(name).id for name in names])
        self._obstacles = [self.model.geom(f"obstacle{i}").id for i in range(len(circles))]
        self.target: Array = np.zeros(len(names))
        """Asked of the motors [rad/s]: front left, front right, rear left, rear right."""
        self.time = 0.0
        """Since the beginning [s]; a robot that is put down elsewhere does not turn it back."""
        self.touched: float | None = None
        """When the robot first touched an obstacle [s]; None if it has not."""
        self.place(*pose)

    @classmethod
    def of(cls, scenario: Scenario, seed: int = 0) -> Twin:
        """Build the twin of a scenario: its obstacles, its floor, its start."""
        ground = Ground.named(scenario.ground, scenario.ground_changes, scenario.ground_patches)
        return cls(scenario.circles, ground, seed, scenario.start)

    def _vary(self, seed: int) -> None:
        """Make it one robot of many."""
        if not seed:
            return
        random = np.random.default_rng([seed, 7])
        body = self.model.body("robot").id
        self.model.body_ipos[body, :2] += WEIGHT_SPREAD * random.normal(size=2)
        for name, _, _ in CORNERS:
            drawn = min(max(random.normal(), -3.0), 3.0)
            self.model.geom(name).size[[0, 2]] *= 1.0 + TYRE_SPREAD * drawn

    def place(self, x: float, y: float, theta: float) -> None:
        """Put the robot down, standing: [m], [m], [rad]."""
        self._mujoco.mj_resetData(self.model, self.data)
        radius = WHEELS.wheel_radius
        self.data.qpos[:7] = x, y, radius, math.cos(theta / 2), 0.0, 0.0, math.sin(theta / 2)
        self.target[:] = 0.0
        self._filtered, self._integral = np.zeros((2, len(self.target)))
        self._floors: list[Floor | None] = [None] * len(self._tyres)
        self._count, self._heading = 0, math.remainder(theta, math.tau)
        self._turns = theta - self._heading
        for _ in range(WARM_UP):
            self._advance_one()
        # settling must not move it
        self.data.qpos[:2] = x, y
        self.data.qpos[3:7] = math.cos(theta / 2), 0.0, 0.0, math.sin(theta / 2)
        self.data.qvel[:] = 0.0
        self._mujoco.mj_forward(self.model, self.data)
        self._last = self.pose

    @property
    def pose(self) -> tuple[float, float, float]:
        """x, y [m] and theta [rad], not wrapped."""
        return float(self.data.qpos[0]), float(self.data.qpos[1]), self._unwrapped()

    @property
    def velocity(self) -> tuple[float, float, float]:
        """Velocity in the world's frame, x and y [m/s], and the turn rate [rad/s]."""
        return float(self.data.qvel[0]), float(self.data.qvel[1]), float(self.data.qvel[5])

    @property
    def wheel_angles(self) -> Array:
        """How far the wheels of each side have turned since it was put down, in the mean [rad]."""
        return self._of_sides(self.data.qpos[self._axle_q])

    @property
    def wheel_speeds(self) -> Array:
        """Of the wheels of each side, in the mean [rad/s]."""
        return self._of_sides(self.data.qvel[self._axle_v])

    def _of_sides(self, wheels: Array) -> Array:
        return np.asarray(0.5 * np.bincount(SIDES, wheels))

    def command(self, v: float, omega: float) -> None:
        """Ask for v and omega [m/s, rad/s], as if its wheels did not slip."""
        self.turn_wheels(*WHEELS.wheels(v, omega))

    def turn_wheels(self, left: float, right: float) -> None:
        """Ask for speeds of both sides [rad/s]."""
        self.target[:] = np.clip(np.array((left, right))[SIDES], -TOP_SPEED, TOP_SPEED)

    def advance(self, seconds: float) -> None:
        """Let time pass; to the nearest step."""
        end = self.time + seconds
        first, last = round(self.time / self._step), round(end / self._step)
        for k in range(first, last):
            self.time = k * self._step
            self._advance_one()
            self._watch()
        self.time = end

    def step(self, x: ArrayLike, u: ArrayLike, dt: float) -> Array:
        """State (3,) after a period of dt [s] with the command u (2,)."""
        return np.asarray(self.trace(x, u, dt, 1)[0])

    def trace(self, x: ArrayLike, u: ArrayLike, dt: float, substeps: int) -> Array:
        """Evenly spaced states during one period, without the first: (substeps, 3)."""
        state, command = np.asarray(x, dtype=float), np.asarray(u, dtype=float)
        shapes = (STATES,), (INPUTS,)
        if (state.shape, command.shape) != shapes:
            raise ValueError(
                f"expected one state {shapes[0]} and one command {shapes[1]}, "
                f"got {state.shape} and {command.shape}"
            )
        if not np.allclose(state, self._last, rtol=0.0, atol=1e-9):
            self.place(*state.tolist())
        self.command(*command.tolist())
        path = np.empty((substeps, STATES))
        for i in range(substeps):
            self.advance(dt / substeps)
            path[i] = self.pose
        self._last = self.pose
        return path

    def _advance_one(self) -> None:
        """One step of physics, with the motor boards' loops."""
        if self._count % FLOOR_PERIOD == 0:
            self._look_down()
            self._unwrapped()
        self._count += 1
        h, data = self._step, self.data
        self._filtered += (self.target - self._filtered) * (h / (SERVO_LAG + h))
        # the proportional part is the actuator's own, which MuJoCo integrates implicitly; no
        # wind-up at the motor's limit
        free = np.abs(data.actuator_force) < TORQUE * (1.0 - 1e-9)
        behind = self._filtered - data.qvel[self._axle_v]
        self._integral += free * behind * (h / RESET_TIME)
        data.ctrl[:] = self._filtered + self._integral
        self._mujoco.mj_step(self.model, data)

    def _look_down(self) -> None:
        """Give each wheel the friction of what is under it."""
        positions = self.data.geom_xpos[self._tyres, :2]
        for i, floor in enumerate(self.ground.under(positions, self.time)):
            if floor is not self._floors[i]:
                self._floors[i] = floor
                self.model.pair_friction[i, :2] = floor.sliding
                self.model.pair_friction[i, 2] = floor.sliding * floor.patch_radius
                self.model.dof_frictionloss[self._axle_v[i]] = floor.rolling

    def _watch(self) -> None:
        """Notice the first touch of an obstacle."""
        if self.touched is not None or not self._obstacles:
            return
        pairs = self.data.contact.geom
        first, last = self._obstacles[0], self._obstacles[-1]
        if ((pairs >= first) & (pairs <= last)).any():
            self.touched = self.time

    def _unwrapped(self) -> float:
        w, x, y, z = self.data.qpos[3:7].tolist()
        heading = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        turn = heading - self._heading
        self._turns -= math.tau * round(turn / math.tau)
        self._heading = heading
        return heading + self._turns
