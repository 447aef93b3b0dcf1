"""A robot that drives past a recorder, tick by tick."""

import random

from robots import Clock, FakeDriver

from firmware_bridge.safety.gate import GateOutput
from firmware_bridge.safety.gate_table import Action, GateState

TICK = 0.02


def drive(
    recorder,
    seconds=20.0,
    delay=0.05,
    pose_every=0.025,
    command_every=0.1,
    silent=(),
    states=None,
    seed=0,
):
    """A robot that obeys random commands at once; poses late and uneven. Returns the path."""
    random_, clock = random.Random(seed), Clock(50.0)
    robot = FakeDriver(clock, delay)
    command, due, state, pose_due = (0.0, 0.0), 0.0, None, 0.0
    for k in range(round(seconds / TICK)):
        clock.now = 50.0 + k * TICK + random_.uniform(0.0, 0.002)
        since = clock.now - 50.0
        quiet = any(a <= since < b for a, b in silent)
        if since >= pose_due and not quiet:
            state, pose_due = robot.state(), since + pose_every * random_.uniform(0.7, 1.3)
        gate = GateState.ACTIVE if states is None else states(since)
        sent = gate is GateState.ACTIVE
        fresh = sent and since >= due
        if fresh:
            command, due = (
                (random_.uniform(-0.3, 0.3), random_.uniform(-0.8, 0.8)),
                due + command_every,
            )
        if sent:
            robot.send(*command)
        recorder.on_tick(
            clock.now,
            state,
            GateOutput(*command, Action.SEND if sent else Action.NOTHING, gate, ()),
            sent,
            fresh,
        )
    return robot.path
