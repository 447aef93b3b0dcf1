"""The robot as a plant: wheel speeds in, motion and touches out."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Sequence
from ctypes.util import find_library
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lab.sim.twin.floors import Floor, Ground
from kmpc_lab.sim.twin.mjcf import LEFT, TOP_SPEED, TORQUE, TRACK, WHEEL_RADIUS, WHEELS, write_mjcf
from kmpc_lite.control.world.circles import Circle
from kmpc_lite.errors import KmpcError, ScenarioError
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.types import INPUTS, STATES, Array

SERVO_LAG = 0.04
"""First-order lag of the set-point in the motor board: its loop and its speed filter [s]."""
RESET_TIME = 0.08
"""Integral time of the motor board's speed loops [s]."""
FLOOR_PERIOD = 8
"""Steps between looks at what is under the wheels, and at the heading: 12 mm at 0.6 m/s."""
WARM_UP = 120
"""Steps in which a robot that was put down comes to rest."""
WEIGHT_SPREAD, TYRE_SPREAD = 0.01, 0.005
"""Standard deviations between robots: of where the weight lies [m], of the tyres' radii (share)."""
ENTIRE_ROOM = (-2.0, -2.0, 2.0, 2.0)


class TwinMissing(KmpcError):
    """MuJoCo is not installed."""


def load_mujoco() -> Any:
    """Import MuJoCo, or say how to install it.

    If there is no display, it renders with the off-screen library that the machine has.
    """
    if "mujoco" not in sys.modules and "DISPLAY" not in os.environ:
        # MuJoCo reads this once, when it is imported
        found = next((name for name in ("EGL", "OSMesa") if find_library(name)), None)
        os.environ.setdefault("MUJOCO_GL", "disable" if found is None else found.lower())
    try:
        import mujoco
    except ImportError as error:
        raise TwinMissing("the digital twin needs MuJoCo: pip install 'kmpc-lab[twin]'") from error
    return mujoco


class Twin:
    """A ROSbot 2 on a floor, among cylinders; a plant as `DifferentialDrive` is one, for one robot.

    Its wheel speeds follow set-points by a PI loop with a motor's torque and speed limits. What a
    command (v, omega) says to the wheels is the maker's kinematics with the geometric track: the
    robot turns by sliding, so it turns less. It keeps its own state: `trace` moves on from where it
    is, unless it is given another pose, where it is then put down, standing.

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
    bounds : tuple
        What the cameras see [m].
    goal : tuple, optional
        Where to draw a disk [m].

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
        bounds: tuple[float, float, float, float] = ENTIRE_ROOM,
        goal: tuple[float, float] | None = None,
    ) -> None:
        self._mujoco = load_mujoco()
        if any(c.vx or c.vy for c in circles):
            raise ScenarioError("twin: expected obstacles that stand still, got one that moves")
        self.ground = Ground() if ground is None else ground
        patches = [(p.x, p.y, p.radius) for p in self.ground.patches]
        self.model = self._mujoco.MjModel.from_xml_string(
            write_mjcf(circles, bounds, goal, patches)
        )
        self.data = self._mujoco.MjData(self.model)
        self._step = float(self.model.opt.timestep)
        self._vary(seed)
        self._wheel_q = np.array([self.model.joint(name).qposadr[0] for name in WHEELS])
        self._wheel_v = np.array([self.model.joint(name).dofadr[0] for name in WHEELS])
        self._wheel_geoms = np.array([self.model.geom(name).id for name in WHEELS])
        self._obstacles = {
            i for i in range(self.model.ngeom) if self.model.geom(i).name.startswith("obstacle")
        }
        self._left = np.array(LEFT)
        self.target: Array = np.zeros(len(WHEELS))
        """Wheel speeds asked for, front left, front right, rear left, rear right [rad/s]."""
        self.time = 0.0
        """Since the beginning [s]; a robot that is put down elsewhere does not turn it back."""
        self.touched: float | None = None
        """When the robot first touched an obstacle [s]; None if it has not."""
        self.place(*pose)

    @classmethod
    def of(cls, scenario: Scenario, seed: int = 0) -> Twin:
        """Build the twin of a scenario: its obstacles, its floor, its start."""
        ground = Ground.named(scenario.ground, scenario.ground_changes, scenario.ground_patches)
        return cls(
            scenario.circles, ground, seed, scenario.start, scenario.bounds, scenario.goal[:2]
        )

    def _vary(self, seed: int) -> None:
        """Make it one robot of many."""
        if not seed:
            return
        random = np.random.default_rng([seed, 7])
        body = self.model.body("robot").id
        self.model.body_ipos[body, :2] += WEIGHT_SPREAD * random.normal(size=2)
        for name in WHEELS:
            self.model.geom(name).size[[0, 2]] *= 1.0 + TYRE_SPREAD * float(
                np.clip(random.normal(), -3.0, 3.0)
            )

    def place(self, x: float, y: float, theta: float) -> None:
        """Put the robot down, standing: [m], [m], [rad]."""
        self._mujoco.mj_resetData(self.model, self.data)
        self._turns = 0.0
        self.data.qpos[:7] = x, y, WHEEL_RADIUS, math.cos(theta / 2), 0.0, 0.0, math.sin(theta / 2)
        self.target[:] = 0.0
        self._filtered = np.zeros(len(WHEELS))
        self._integral = np.zeros(len(WHEELS))
        self._floors: list[Floor | None] = [None] * len(WHEELS)
        self._count = 0
        self._heading = math.remainder(theta, math.tau)
        self._turns = theta - self._heading
        for _ in range(WARM_UP):
            self._advance_one()
        # settling must not move it
        self.data.qpos[:2] = x, y
        self.data.qpos[3:7] = math.cos(theta / 2), 0.0, 0.0, math.sin(theta / 2)
        self.data.qvel[:] = 0.0
        self._mujoco.mj_forward(self.model, self.data)
        self._last = self.pose

    def show(self, pose: tuple[float, float, float], rolled: float) -> None:
        """Put the robot at a pose for a picture, its wheels turned by so much [rad]."""
        x, y, theta = pose
        self.data.qpos[:3] = x, y, WHEEL_RADIUS
        self.data.qpos[3:7] = math.cos(theta / 2), 0.0, 0.0, math.sin(theta / 2)
        self.data.qpos[self._wheel_q] += rolled
        self._mujoco.mj_forward(self.model, self.data)

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
        """How far each wheel has turned since it was put down (4,) [rad]."""
        angles: Array = self.data.qpos[self._wheel_q].copy()
        return angles

    @property
    def wheel_speeds(self) -> Array:
        """Of each wheel (4,) [rad/s]."""
        speeds: Array = self.data.qvel[self._wheel_v].copy()
        return speeds

    def command(self, v: float, omega: float) -> None:
        """Ask the wheels for v [m/s] and omega [rad/s], as if they did not slip."""
        self.command_sides(
            (v - omega * TRACK / 2.0) / WHEEL_RADIUS, (v + omega * TRACK / 2.0) / WHEEL_RADIUS
        )

    def command_sides(self, left: float, right: float) -> None:
        """Ask for wheel speeds of both sides [rad/s]."""
        self.target[:] = np.clip(np.where(self._left, left, right), -TOP_SPEED, TOP_SPEED)

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
        end: Array = self.trace(x, u, dt, 1)[0]
        return end

    def trace(self, x: ArrayLike, u: ArrayLike, dt: float, substeps: int) -> Array:
        """Evenly spaced states during one period, without the first: (substeps, 3)."""
        state, command = np.asarray(x, dtype=float), np.asarray(u, dtype=float)
        if state.shape != (STATES,) or command.shape != (INPUTS,):
            raise ValueError(
                f"expected one state ({STATES},) and one command ({INPUTS},), "
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
        self._integral += free * (self._filtered - data.qvel[self._wheel_v]) * (h / RESET_TIME)
        data.ctrl[:] = self._filtered + self._integral
        self._mujoco.mj_step(self.model, data)

    def _look_down(self) -> None:
        """Give each wheel the friction of what is under it."""
        positions = self.data.geom_xpos[self._wheel_geoms, :2]
        for i, floor in enumerate(self.ground.under(positions, self.time)):
            if floor is not self._floors[i]:
                self._floors[i] = floor
                self.model.pair_friction[i, :3] = (
                    floor.sliding,
                    floor.sliding,
                    floor.sliding * floor.patch_radius,
                )
                self.model.dof_frictionloss[self._wheel_v[i]] = floor.rolling

    def _watch(self) -> None:
        """Notice the first touch of an obstacle."""
        if self.touched is not None or self.data.ncon <= len(WHEELS) or not self._obstacles:
            return
        pairs = self.data.contact.geom
        if any(a in self._obstacles or b in self._obstacles for a, b in pairs.tolist()):
            self.touched = self.time

    def _unwrapped(self) -> float:
        w, x, y, z = self.data.qpos[3:7].tolist()
        heading = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        turn = heading - self._heading
        self._turns -= math.tau * round(turn / math.tau)
        self._heading = heading
        return heading + self._turns
