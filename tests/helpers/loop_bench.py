"""The loop with planner, gate and a robot, on a clock that is turned by hand."""

from robots import Clock, FakeDriver, constant

from firmware_bridge.runtime.controller_thread import Planner
from firmware_bridge.runtime.loop import ControlLoop
from firmware_bridge.safety.gate import SafetyGate
from firmware_bridge.safety.gate_settings import GateSettings
from firmware_bridge.safety.gate_table import GateState

TICK = 0.02


class Bench:
    """Loop, planner, gate and fake robot on one clock; the planner is stepped every `period`."""

    def __init__(
        self,
        controller=None,
        period: float = 0.1,
        delay: float = 0.0,
        latency: float = 0.0,
        **options,
    ) -> None:
        self.clock = Clock()
        self.driver = FakeDriver(self.clock, delay, latency)
        self.controller = constant(self.clock) if controller is None else controller
        self.planner = Planner(
            lambda state: self.controller(state),
            self.driver.state,
            period,
            latency,
            clock=self.clock,
        )
        self.gate = SafetyGate(GateSettings())
        self.loop = ControlLoop(
            self.driver,
            self.gate,
            self.planner,
            clock=self.clock,
            sleep=self.clock.sleep,
            take=self.driver.take,
            confirm=self.driver.confirm,
            **options,
        )
        self.period, self.plan_at = period, self.clock()

    def run(self, seconds: float) -> GateState:
        for _ in range(round(seconds / TICK)):
            self.clock.now += TICK
            if self.clock() >= self.plan_at - 1e-9:
                self.planner.step(self.clock())
                self.plan_at += self.period
            output = self.loop.tick(self.clock())
        return output.state

    def drive(self) -> "Bench":
        self.gate.enable()
        assert self.run(2.0) is GateState.ACTIVE
        return self


class Desk:
    """An operator."""

    def __init__(self) -> None:
        self.requests: set[str] = set()
        self.told: list[GateState] = []

    def take(self):
        taken, self.requests = self.requests, set()
        return taken

    def tell(self, state, why=(), barred=""):
        self.told.append(state)
        self.why, self.barred = why, barred
