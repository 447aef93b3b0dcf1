"""Random faults of link, board and controller: what the wire may carry meanwhile, and what must
come back after.
"""

import math
import resource

import pytest
from faulty_world import OUTAGES, World
from loopback import Faults

from firmware_bridge.safety.gate_table import GateState


def suffer(world: World) -> None:
    """One stretch of faults, and what must hold after it."""
    draw, before = world.random.uniform, world.gate.state
    assert before is GateState.ACTIVE
    level = world.random.choice((0.05, 0.2, 0.5))
    world.wire.faults = Faults(
        drop=draw(0, level),
        duplicate=draw(0, level),
        corrupt=draw(0, level),
        reorder=draw(0, level),
        split=draw(0, level),
        cut=draw(0, 0.1 * level),
        cut_for=draw(0.02, 0.4),
        delay=draw(0, 0.1) if world.random.random() < 0.5 else 0.0,
    )
    world.outage = world.random.choice(OUTAGES)
    world.counts[world.outage] += 1
    world.counts["outages"] += world.outage != "none"
    if world.outage == "cut":
        world.wire.cut(draw(0.05, 3.0))
    elif world.outage == "ekf":
        world.rover.lose_position()
    elif world.outage == "pilot":
        world.rover.pilot_mode(world.random.choice((0, 4)))
    elif world.outage == "disarmed":
        world.rover.pilot_arm(False)
    elif world.outage == "estop":
        world.desk.requests.add("stop")
    world.run(draw(0.1, 4.0))
    world.rover.lose_position(False)
    world.outage, world.wire.faults = "none", Faults()
    world.wire.heal()
    world.run(2.5)
    state = world.gate.state
    world.counts[f"then {state.name}"] += 1
    if state in (GateState.ESTOP, GateState.YIELDED, GateState.RELEASED, GateState.IDLE):
        world.desk.requests.add("reset")
        world.run(0.1)
        world.desk.requests.add("enable")
        world.run(6.0)
    assert world.gate.state is GateState.ACTIVE, (
        f"does not drive again after {state}: {world.loop.snapshot}"
    )
    assert world.rover.armed and world.rover.mode == "GUIDED"


def endure(seed: int, faults: int) -> World:
    """Suffer so many faults."""
    world = World(seed)
    world.connect()
    while world.faults < faults:
        suffer(world)
    world.gate.stop()
    world.run(4.0)
    assert world.gate.done and world.rover.stopped and world.rover.mode == "HOLD"
    assert world.loop.statistics.driver_errors == 0, world.loop.statistics.last_error
    assert world.rover.counters["aborts"] == 0
    assert world.counts["moving"] > faults / 20
    return world


def test_faults_of_all_kinds_never_let_a_bad_command_onto_the_wire():
    world = endure(1, 600)
    assert {GateState.YIELDED, GateState.ACTIVE} <= {
        GateState[name[5:]] for name in world.counts if name.startswith("then ")
    }


@pytest.mark.long
def test_a_hundred_thousand_faults():
    world = endure(3, 100_000)
    assert world.faults >= 100_000
    assert (
        set(OUTAGES) <= set(world.counts)
        and world.counts["then ACTIVE"] > 100
        and world.counts["then RELEASED"] > 10
    )


HOURS = 10.0  # of the soak, on the clock of the test


@pytest.mark.long
def test_ten_hours_leak_nothing_drift_nowhere_and_miss_no_stop():
    """Drive for a minute, stop, stand, enable: for ten hours."""
    world = World(11)
    world.connect()
    began, stops, sizes = world.clock(), 0, []
    while world.clock() - began < HOURS * 3600.0:
        world.run(55.0)
        assert world.gate.state is GateState.ACTIVE, world.loop.snapshot
        world.desk.requests.add("stop")
        world.run(2.0)
        assert world.rover.stopped and world.gate.state is GateState.ESTOP
        stops += 1
        world.desk.requests.add("reset")
        world.run(0.1)
        world.desk.requests.add("enable")
        world.run(2.9)
        state, (x, y, theta) = world.core.state, world.rover.pose
        assert math.hypot(state.x - x, state.y - y) < 0.1
        assert abs(math.remainder(state.theta - theta, math.tau)) < 0.05
        assert world.core.frame.doubt == ""
        sizes.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0)
    assert stops >= 590
    assert sizes[-1] - sizes[len(sizes) // 10] < 5.0, "MB"
    assert world.loop.statistics.driver_errors == 0, world.loop.statistics.last_error
