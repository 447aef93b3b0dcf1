"""A gate with good inputs at every tick, which a test then spoils."""

from dataclasses import replace

from firmware_bridge.messages import LinkStatus, State, VelocityCommand
from firmware_bridge.safety.gate import GateOutput, SafetyGate
from firmware_bridge.safety.gate_settings import GateSettings
from firmware_bridge.safety.gate_table import GateState

TICK = 0.02
SETTINGS = GateSettings(geofence=(-5.0, -5.0, 5.0, 5.0))


class World:
    """A gate with good inputs at every tick, which a test then spoils."""

    def __init__(self, pilot: bool = True) -> None:
        self.gate, self.now, self.command = (
            SafetyGate(replace(SETTINGS, pilot=pilot)),
            100.0,
            (0.3, 0.4),
        )
        self.ready, self.x, self.pose_ok, self.connected = True, 0.0, True, True
        self.frame_doubt = self.unmoved = ""
        self.restarted = False
        self.faults: tuple[str, ...] = ()
        self.silent: set[str] = set()
        self.stamps = dict.fromkeys(("command", "pose", "source", "heartbeat"), self.now)
        self.outputs: list[GateOutput] = []

    def step(self) -> GateOutput:
        self.now += TICK
        for name in self.stamps.keys() - self.silent:
            self.stamps[name] = self.now
        status = LinkStatus(
            self.connected,
            self.stamps["heartbeat"],
            self.stamps["source"],
            self.ready,
            self.pose_ok,
            faults=self.faults,
            frame_doubt=self.frame_doubt,
            restarted=self.restarted,
            unmoved=self.unmoved,
        )
        state = State(self.x, 0.0, 0.0, 0.0, 0.0, self.stamps["pose"])
        self.outputs.append(
            self.gate.step(
                self.now, VelocityCommand(*self.command, self.stamps["command"]), state, status
            )
        )
        return self.outputs[-1]

    def run(self, seconds: float) -> GateOutput:
        for _ in range(max(1, round(seconds / TICK))):
            output = self.step()
        return output

    def drive(self) -> "World":
        self.gate.enable()
        output = self.run(2.0)
        assert output.state is GateState.ACTIVE
        assert output.speeds == SETTINGS.limits.clip((*self.command, 0.0))
        return self


def into(state: GateState) -> World:
    """A world whose gate is in `state`."""
    world = World()
    if state is GateState.IDLE:
        world.run(1.0)
    elif state is GateState.WAITING:
        world.silent = {"pose"}
        world.run(0.5)
        world.gate.enable()
        world.run(1.0)
    elif state is GateState.ESTOP:
        world.drive().gate.estop()
        world.step()
    elif state is GateState.YIELDED:
        world.drive().ready = False
        world.step()
    else:
        world.drive()
        if state is not GateState.ACTIVE:
            world.silent = {"command"}
            while world.step().state is not state:
                assert world.now < 110.0
    assert world.gate.state is state
    return world
