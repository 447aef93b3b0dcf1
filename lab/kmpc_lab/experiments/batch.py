"""A robot, its board, its pose, the gate and the loop on one clock that runs as fast as it can."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from firmware_bridge.drivers.roboclaw import RoboClawOptions
from firmware_bridge.messages import Controller
from firmware_bridge.recording.recorder import CsvRecorder
from firmware_bridge.runtime.controller_thread import Planner, Predict, unicycle_arc
from firmware_bridge.runtime.loop import ControlLoop
from firmware_bridge.safety.gate import SafetyGate
from firmware_bridge.safety.gate_settings import TICK, GateSettings
from firmware_bridge.safety.gate_table import GateState
from firmware_bridge.safety.limits import Limits
from kmpc_lab.emulator.mocap import Mocap, MocapOptions
from kmpc_lab.emulator.roboclaw import RoboClawEmulator
from kmpc_lab.emulator.twin import TwinBody
from kmpc_lab.experiments.wire import ManualClock, Network, WiredRoboClaw
from kmpc_lab.sim.twin import Twin
from kmpc_lab.sim.twin.vehicles import VEHICLES

GEOMETRY = replace(VEHICLES["differential"].geometry, max_wheel_speed=0.9)
"""What the maker publishes; nothing of how the robot slides."""
BOARD = RoboClawOptions(counts_per_turn=1440.0, watchdog=0.5)
SETTLE = 0.5
"""How long all must be good before the gate opens, at least [s]."""
STILL = 60.0
"""A gate that has not let anything pass for so long never will [s]."""


@dataclass(frozen=True)
class Setup:
    """Which robot, and how it is driven."""

    limits: Limits
    period: float = 0.1
    """Of the controller, and of the recorded rows [s]."""
    mocap: MocapOptions = field(default_factory=MocapOptions)
    network: Network = field(default_factory=Network)
    command_period: float = TICK
    watchdog: float = 0.25
    """Of the gate [s]."""
    robot: int = 0
    """Which robot: see `kmpc_lab.sim.twin.Twin`'s seed; 0 is the even one."""


class BatchDrive:
    """One drive on a clock of its own.

    Parameters
    ----------
    twin : Twin
        The robot.
    controller : callable
        State to VelocityCommand; it may read `clock`.
    setup : Setup
        See there.
    clock : ManualClock
        Turned on by `run`.
    seed : int
        Of pose noise and delays.
    record : Path, optional
        A new CSV file for `kmpc fit`.
    predict : callable
        How the planner carries an old pose on to now: with what is known of the robot.
    """

    def __init__(
        self,
        twin: Twin,
        controller: Controller,
        setup: Setup,
        clock: ManualClock,
        seed: int = 0,
        record: Path | None = None,
        predict: Predict = unicycle_arc,
    ) -> None:
        self.twin, self.clock = twin, clock
        self._board = RoboClawEmulator(GEOMETRY, BOARD, clock=clock)
        self._board.put_on(TwinBody(GEOMETRY, twin, clock()))
        self.driver = WiredRoboClaw(
            self._board, BOARD, Mocap(setup.mocap, seed, clock()), clock, setup.network, seed
        )
        self.planner = Planner(
            controller, self.driver.state, setup.period, predict=predict, clock=clock
        )
        # whole periods: the gate opens with a plan, and the first command that passes is held as
        # long as all others
        settle = max(SETTLE, setup.period) - TICK / 2.0
        self.gate = SafetyGate(
            GateSettings(limits=setup.limits, watchdog=setup.watchdog, settle=settle, pilot=False)
        )
        self._csv = None if record is None else CsvRecorder(record, setup.period)
        self.loop = ControlLoop(
            self.driver,
            self.gate,
            self.planner,
            command_period=setup.command_period,
            observers=() if self._csv is None else (self._csv,),
            clock=clock,
        )
        self._period = setup.period

    @property
    def driving(self) -> bool:
        """Whether the gate lets commands pass."""
        return self.gate.state is GateState.ACTIVE

    def run(self, finished: Callable[[], bool]) -> np.ndarray:
        """Drive until `finished`; gives the true poses (n, 3) at the gate's ticks.

        The first is that of the first command that the gate lets pass.
        """
        self.driver.connect(1.0)
        self.gate.enable()
        start, ticks, path, began = self.clock.now, 0, [], False
        plans = 0
        while not (began and finished()):
            self.driver.work()
            now = self.clock.now
            if now - start >= plans * self._period - 1e-9:
                self.planner.step(now)
                plans += 1
            self.loop.tick(now)
            began = began or self.driving
            if began:
                path.append(self.twin.pose)
            elif now - start > STILL:
                raise RuntimeError(
                    f"the gate lets nothing pass: {self.loop.statistics.reasons}, "
                    f"{self.planner.last_error}"
                )
            ticks += 1
            self.clock.now = start + ticks * TICK
        self.driver.stop()
        if self._csv is not None:
            self._csv.close()
        return np.array(path)

    def rest(self, seconds: float) -> tuple[float, float, float]:
        """Let time pass after the drive [s]; gives the true pose then."""
        self.clock.now += seconds
        return self._board.pose

    @property
    def rows(self) -> int:
        """Rows recorded."""
        return 0 if self._csv is None else self._csv.rows
