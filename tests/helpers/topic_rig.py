"""An emulated robot and `kmpc ros2` in one process, with real topics and a clock of their own."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from free_port import free_port
from waiting import until

import kmpc_lite as kl
from firmware_bridge.ros2.drive import Enabler
from firmware_bridge.ros2.driver import Ros2Driver
from firmware_bridge.ros2.inputs import Goal
from firmware_bridge.ros2.navigator import GoalNavigator
from firmware_bridge.ros2.node import NodeOptions
from firmware_bridge.ros2.options import Ros2Options, read_topics
from firmware_bridge.runtime.controller_thread import Planner
from firmware_bridge.runtime.loop import ControlLoop
from firmware_bridge.safety.gate import SafetyGate
from firmware_bridge.safety.gate_settings import GateSettings
from firmware_bridge.safety.limits import Limits
from kmpc_lab.emulator.ros2.robot import STEP, EmulatedRobot, Ros2Emulator
from kmpc_lite.scenario.files import Scenario

PERIOD = 0.1
PATIENCE = 20.0
"""How long a message may take from one session to the other [s]."""


class TopicRig:
    """Steps robot, sensors, planner and gate by `STEP`; each message is waited for.

    Parameters
    ----------
    scenario : Scenario
        Start, obstacles and floor.
    robot : EmulatedRobot
        Its sensors; the driver subscribes to just these.
    options : dict
        Other fields of Ros2Options.
    """

    def __init__(
        self,
        scenario: Scenario,
        robot: EmulatedRobot,
        v_max: float = 0.6,
        resume: float = 30.0,
        **options: Any,
    ) -> None:
        self.now = 100.0
        self.scenario = scenario
        self.endpoint = f"tcp/127.0.0.1:{free_port()}"
        node = NodeOptions(name="sim", router=True, connect=(), listen=(self.endpoint,))
        clock = lambda: self.now  # noqa: E731
        self.emulator = Ros2Emulator(
            node, scenario, robot, clock=clock, stamps=lambda: 1.7e9 + self.now
        )
        self.emulator.open()
        left_out = [f"{name}=" for name in ("scan", "map") if name not in robot.sees]
        topics = read_topics(left_out, "/")
        given = {"stamped": robot.stamped, "simulated_time": robot.simulated_time, **options}
        self.driver = Ros2Driver(
            NodeOptions(connect=(self.endpoint,)),
            Ros2Options(topics=topics, **given),
            is_wanted=lambda: self.navigator.goal is not None,
            clock=clock,
        )
        self.driver.connect(PATIENCE, read=False)
        limits = Limits(v_max=v_max, v_reverse=v_max)
        settings = GateSettings(limits=limits, pilot=False, resume=resume)
        wheels = scenario.problem().wheels
        omni = wheels.inputs == 3
        fastest = np.array((v_max, v_max, 0.8) if omni else (v_max, 0.8))
        problem = kl.NavigationProblem(
            u_min=-fastest, u_max=fastest, robot_radius=scenario.radius, wheels=wheels
        )
        model = kl.nominal_omni(PERIOD) if omni else kl.nominal_unicycle(PERIOD)
        controller = kl.Controller(model, problem, adaptation=False)
        self.navigator = GoalNavigator(controller, self.driver.inputs, 0.2, clock)
        controller = lambda state: self.navigator(state, self.planner.held)  # noqa: E731
        self.planner = Planner(controller, self.driver.state, PERIOD, 0.1, clock=clock)
        self.gate = SafetyGate(settings, 1.3 * PERIOD)
        enabler = Enabler(self.driver.inputs, self.gate.enable)
        self.loop = ControlLoop(
            self.driver, self.gate, self.planner, observers=(enabler,), clock=clock
        )
        self.gate.enable()
        self.ticks = 0
        self.alive = True
        self.clearance = np.inf
        self._meet()

    def __enter__(self) -> TopicRig:
        return self

    def __exit__(self, *error: object) -> None:
        self.driver.close()
        self.emulator.close()

    def drive_to(self, goal: tuple[float, float, float]) -> None:
        """Give a goal as if its message had come."""
        self.driver.inputs.drive_to(Goal(*goal))

    def kill(self) -> None:
        """The robot, its sensors and the router are gone from one moment to the next."""
        self.emulator.close()
        self.alive = False

    def revive(self) -> None:
        """They come back where they were."""
        self.emulator.open()
        self.alive = True
        self._meet()

    def _meet(self) -> None:
        """Wait until the sessions know of each other's topics."""
        for there, node in ((self.emulator.node, "/kmpc"), (self.driver.node, "/sim")):
            topics = lambda: sum(s.node == node and s.topic != "" for s in there.seen())  # noqa: B023, E731
            assert until(lambda: topics() >= 4), f"{node} is not seen"  # noqa: B023

    def tick(self, count: int = 1) -> None:
        for _ in range(count):
            self._tick()

    def _tick(self) -> None:
        self.now += STEP
        self.ticks += 1
        if self.alive:
            received = self.driver.inputs.pose.filter.counters
            before = sum(received.values())
            self.emulator.advance()
            assert until(lambda: self._read() and sum(received.values()) > before), "no odometry"
            self.clearance = min(self.clearance, self.emulator.clearance)
        else:
            self._read()
        if self.ticks % round(PERIOD / STEP) == 0:
            self.planner.step(self.now)
        sent, heard = self.driver.published, self.emulator.commands
        self.loop.tick(self.now)
        if self.alive and self.driver.published > sent:
            assert until(lambda: self._heard(heard)), "no command came"

    def _heard(self, before: int) -> bool:
        self.emulator.listen()
        return self.emulator.commands > before

    def _read(self) -> bool:
        for reader in self.driver.readers:
            while reader.look():
                pass
        return True


def short_course(**changes: Any) -> Scenario:
    """Past a circle that stands in the way, within a metre."""
    scenario = Scenario.load("four_circles_1")
    changes = {
        "circles": (kl.Circle(0.35, 0.03, 0.06),),
        "radius": 0.1,
        "goal": (0.7, 0.0, 0.0),
        **changes,
    }
    return replace(scenario, **changes)
