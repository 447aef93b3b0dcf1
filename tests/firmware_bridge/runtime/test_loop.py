"""The loop: whatever fails or is asked for, it ends in a stop on the wire."""

import json
import math
import threading
import time

import pytest
from loop_bench import TICK, Bench, Desk
from robots import FakeDriver
from waiting import until

from firmware_bridge.messages import VelocityCommand
from firmware_bridge.runtime.controller_thread import Planner
from firmware_bridge.runtime.loop import ControlLoop
from firmware_bridge.runtime.timing import Suspension
from firmware_bridge.safety.gate import SafetyGate
from firmware_bridge.safety.gate_settings import GateSettings
from firmware_bridge.safety.gate_table import GateState, Reason


def test_a_controller_that_raises_stops_the_robot_and_may_recover():
    def controller(state):
        if bench.clock() > broken[0] and bench.clock() < broken[1]:
            raise ZeroDivisionError("no plan")
        return VelocityCommand(0.3, 0.0, bench.clock())

    broken = [math.inf, math.inf]
    bench = Bench(controller)
    bench.drive()
    broken[:] = [bench.clock(), bench.clock() + 0.8]
    bench.run(0.3)
    assert bench.driver.sent[-1][1] < 0.3 and bench.gate.state is GateState.STOPPING
    bench.run(0.4)
    assert bench.driver.sent[-1][1:] == (0.0, 0.0)
    assert bench.planner.errors >= 5 and bench.planner.last_error == "ZeroDivisionError: no plan"
    assert bench.run(2.0) is GateState.ACTIVE


@pytest.mark.parametrize("answer", [None, (0.1, 0.2), "fast", VelocityCommand(0.1, 0.1, "soon")])
def test_a_controller_that_answers_nonsense_is_a_controller_that_fails(answer):
    bench = Bench().drive()
    bench.controller = lambda state: answer
    assert bench.run(0.4) is GateState.STOPPING and bench.planner.errors > 0


@pytest.mark.parametrize("values", [(math.nan, 0.0), (0.1, math.inf), (-math.inf, math.nan)])
def test_what_is_not_finite_never_reaches_the_driver(values):
    bench = Bench().drive()
    bench.controller = lambda state: VelocityCommand(*values, bench.clock())
    assert bench.run(0.12) is GateState.STOPPING
    bench.run(3.0)
    assert all(math.isfinite(v) and math.isfinite(w) for _, v, w in bench.driver.sent)


@pytest.mark.parametrize("call", ["state", "health", "send", "stop"])
def test_a_driver_that_raises_is_a_link_that_is_down(call):
    bench = Bench().drive()
    bench.driver.fails = {call}
    bench.loop.request_stop("test")
    bench.gate.stop()
    bench.run(5.0)
    assert (
        bench.loop.statistics.driver_errors > 0
        and f"{call} fails" in bench.loop.statistics.last_error
    )
    assert bench.loop.report()["errors"] == bench.loop.statistics.driver_errors


def test_operator_stop_reset_enable():
    desk = Desk()
    bench = Bench(operator=desk).drive()
    desk.requests = {"stop"}
    bench.run(TICK)
    assert bench.gate.state is GateState.ESTOP and len(bench.driver.stops) == 1
    desk.requests = {"enable"}
    bench.run(1.0)
    assert bench.gate.state is GateState.ESTOP and bench.driver.taken == 0
    desk.requests = {"reset"}
    bench.run(0.1)
    desk.requests = {"enable"}
    assert bench.run(1.0) is GateState.ACTIVE and bench.driver.taken == 1
    assert desk.told[-1] is GateState.ACTIVE and GateState.ESTOP in desk.told


def test_after_a_restart_of_the_board_nothing_moves_until_the_frame_is_confirmed():
    desk = Desk()
    bench = Bench(operator=desk)
    bench.drive()
    bench.driver.frame_doubt = "the autopilot was restarted"
    bench.run(3.0)
    assert bench.gate.state is GateState.RELEASED
    bench.driver.ready = True
    sent = len(bench.driver.sent)
    desk.requests = {"enable"}
    bench.run(2.0)
    assert bench.gate.state is GateState.RELEASED and bench.driver.taken == 0
    assert all(command[1:] == (0.0, 0.0) for command in bench.driver.sent[sent:])
    assert "the autopilot was restarted" in desk.barred and "--confirm-frame" in desk.barred
    assert "the autopilot was restarted" in desk.why
    desk.requests = {"confirm"}
    bench.run(2.0)
    assert bench.gate.state is GateState.RELEASED, "confirming is not enabling"
    desk.requests = {"enable"}
    assert bench.run(1.0) is GateState.ACTIVE
    assert desk.barred == ""


def test_run_ends_with_a_stop_on_the_wire_when_finished():
    bench = Bench()
    bench.planner.start = lambda: None
    ticks = []

    def finished():
        ticks.append(bench.clock())
        bench.planner.step(bench.clock())
        return len(ticks) > 150

    bench.gate.enable()
    bench.loop.run(finished)
    assert bench.gate.state is GateState.RELEASED
    assert bench.driver.stops and bench.driver.stops[-1] >= bench.driver.sent[-1][0]
    zeros = [t for t, v, w in bench.driver.sent if t > ticks[-1] + 0.4 and (v, w) == (0.0, 0.0)]
    assert len(zeros) >= 44
    json.dumps(bench.loop.report())
    assert bench.loop.stop_reason == "finished"
    assert [c["to"] for c in bench.loop.report()["changes"]] == [
        "WAITING",
        "ACTIVE",
        "STOPPING",
        "HOLDING",
        "RELEASED",
    ]


def test_run_gives_up_on_a_board_that_never_obeys():
    bench = Bench()
    bench.planner.start = lambda: None
    bench.gate.enable()
    bench.driver.go_silent()
    bench.loop.request_stop("test")
    start = bench.clock()
    bench.loop.run()
    assert 2.0 < bench.clock() - start < 5.0 and bench.driver.stops


def test_asked_twice_it_stops_at_once():
    bench = Bench().drive()
    bench.planner.start = lambda: None
    bench.loop.request_stop("first")
    bench.loop.request_stop("second")
    start = bench.clock()
    bench.loop.run()
    assert bench.clock() - start <= 2 * TICK and bench.driver.stops


def test_a_bug_in_what_calls_the_loop_still_ends_in_a_stop():
    bench = Bench().drive()
    bench.planner.start = lambda: None
    with pytest.raises(KeyError):
        bench.loop.run(lambda: {}["bug"])
    assert bench.driver.stops


def test_a_controller_that_hangs_stops_the_robot_and_does_not_keep_the_loop():
    hang, free = threading.Event(), threading.Event()

    def controller(state):
        if hang.is_set():
            free.wait()
        return VelocityCommand(0.3, 0.0, time.monotonic())

    driver = FakeDriver(time.monotonic)  # type: ignore[arg-type]
    gate = SafetyGate(GateSettings(hold=0.2, settle=0.2))
    loop = ControlLoop(driver, gate, Planner(controller, driver.state, 0.05))
    gate.enable()
    thread = threading.Thread(target=loop.run)
    thread.start()
    try:
        assert until(lambda: gate.state is GateState.ACTIVE and driver.sent[-1][1] == 0.3)
        hang.set()
        assert until(lambda: driver.sent[-1][1:] == (0.0, 0.0))
        assert until(lambda: gate.state is GateState.RELEASED)
        assert driver.stops
    finally:
        loop.request_stop("test")
        thread.join(10.0)
        free.set()
    assert not thread.is_alive()


def test_a_robot_whose_computer_slept_is_given_back():
    desk, slept = Desk(), [0.0]
    bench = Bench(operator=desk).drive()
    bench.loop._suspension = Suspension(lambda: slept[0])
    slept[0] = 30.0
    assert bench.run(TICK) is GateState.STOPPING
    assert bench.loop.changes[-1].why == (Reason.STALLED.value,)
    assert bench.run(5.0) is GateState.RELEASED
    desk.requests = {"enable"}
    assert bench.run(1.0) is GateState.ACTIVE
