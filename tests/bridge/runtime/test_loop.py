"""The loop and the planner, on a clock turned by hand and in real threads."""

import json
import math
import threading
import time

import pytest
from robots import Clock, FakeDriver, constant

from firmware_bridge.messages import State, VelocityCommand
from firmware_bridge.runtime.controller_thread import Planner, SentCommands, unicycle_arc
from firmware_bridge.runtime.loop import ControlLoop
from firmware_bridge.runtime.timing import Deadlines, Histogram, table
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


@pytest.mark.parametrize("command_period", [0.02, 0.1])
def test_observers_learn_when_a_plan_goes_out_for_the_first_time(command_period):
    seen = []

    class Watch:
        def on_tick(self, now, state, output, sent, fresh):
            seen.append((round(now, 3), output.state, sent, fresh))

    bench = Bench(observers=(Watch(),), command_period=command_period).drive()
    planned = bench.plan_at
    bench.run(1.0)
    fresh = [now for now, _, _, first in seen if first]
    active = [now for now, state, _, _ in seen if state is GateState.ACTIVE]
    # each plan once, in the tick after it was made; the plan that was there before the gate opened
    # is not new
    assert [round(math.remainder(now - planned, 0.1), 6) for now in fresh] == [0.0] * len(fresh)
    assert len(fresh) >= 20 and all(
        b - a == pytest.approx(0.1) for a, b in zip(fresh, fresh[1:], strict=False)
    )
    assert active[0] <= fresh[0] <= active[0] + 0.1 and all(
        sent for _, _, sent, first in seen if first
    )


def test_unicycle_arc_is_the_limit_of_small_steps():
    state = State(0.3, -0.2, 0.7, 0.0, 0.0, 5.0)
    for v, omega in ((0.5, 0.0), (0.5, 1e-9), (0.5, 2.0), (-0.4, -1.3), (0.0, 3.0)):
        end, x, y, theta = unicycle_arc(state, v, omega, 0.8), state.x, state.y, state.theta
        n = 20_000
        for _ in range(n):
            middle = theta + 0.4 * omega / n
            x, y, theta = (
                x + 0.8 * v / n * math.cos(middle),
                y + 0.8 * v / n * math.sin(middle),
                theta + 0.8 * omega / n,
            )
        assert (end.x, end.y, end.theta, end.stamp) == pytest.approx((x, y, theta, 5.8), abs=1e-8)


def test_a_state_is_carried_along_what_was_sent_since():
    sent = SentCommands()
    state = State(1.0, 2.0, 0.5, 0.1, 0.0, 10.0)
    assert sent.carry(state, 9.0) == state and sent.carry(state, 10.0) == state
    assert sent.carry(state, 10.5) == unicycle_arc(state, 0.1, 0.0, 0.5)
    for command in ((9.5, 0.2, 0.3), (10.1, 0.4, -0.3), (10.3, 0.5, 0.1)):
        sent.add(*command)
    by_hand = unicycle_arc(
        unicycle_arc(unicycle_arc(state, 0.2, 0.3, 0.1), 0.4, -0.3, 0.2), 0.5, 0.1, 0.1
    )
    carried = sent.carry(state, 10.4)
    assert (carried.x, carried.y, carried.theta) == pytest.approx(
        (by_hand.x, by_hand.y, by_hand.theta), abs=1e-12
    )


@pytest.mark.parametrize("delay", [0.0, 0.04, 0.1, 0.2])
def test_the_controller_gets_the_pose_as_it_is_now_however_late_it_came(delay):
    seen = []

    def controller(state):
        truth = bench.driver.move()
        seen.append(
            math.hypot(state.x - truth.x, state.y - truth.y) + abs(state.theta - truth.theta)
        )
        assert state.stamp == pytest.approx(bench.clock())
        return VelocityCommand(
            0.3 * math.sin(bench.clock()), 0.5 * math.cos(2 * bench.clock()), bench.clock()
        )

    bench = Bench(controller, delay=delay)
    bench.drive()
    bench.run(5.0)
    assert len(seen) > 50 and max(seen) < 1e-9
    assert bench.planner.pose_age.quantile(0.5) == pytest.approx(delay, rel=0.02, abs=1e-5)


@pytest.mark.parametrize("latency", [0.04, 0.13, 0.3])
def test_dead_time_is_planned_for_from_the_pose_at_its_end(latency):
    expected = []

    def controller(state):
        assert state.stamp == pytest.approx(bench.clock() + latency)
        expected.append(state)
        return VelocityCommand(
            0.3 * math.sin(bench.clock()), 0.5 * math.cos(2 * bench.clock()), bench.clock()
        )

    bench = Bench(controller, delay=0.06, latency=latency)
    bench.drive()
    bench.run(5.0)
    by_stamp = {round(s.stamp, 6): s for s in bench.driver.path}
    errors = [
        math.hypot(truth.x - s.x, truth.y - s.y) + abs(truth.theta - s.theta)
        for s in expected[5:]
        if (truth := by_stamp.get(round(s.stamp, 6))) is not None
    ]
    assert len(errors) > 40 and max(errors) < 1e-9


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


def test_the_age_of_an_output_counts_from_the_beginning_of_its_computation():
    def slow(state):
        bench.clock.now += 0.24
        return VelocityCommand(0.3, 0.0, bench.clock())

    bench = Bench(slow)
    start = bench.clock()
    bench.planner.step(start)
    assert bench.planner.latest[0].stamp == start


def test_the_controller_is_not_asked_without_a_usable_pose():
    bench = Bench().drive()
    asked = []
    bench.controller = lambda state: asked.append(state) or VelocityCommand(0.0, 0.0, bench.clock())
    bench.driver.go_silent()
    bench.run(2.0)
    assert len(asked) <= 6
    assert all(s.stamp - bench.driver.silent_since <= 0.51 for s in asked)


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


def test_an_observer_that_raises_does_not_stop_the_robot():
    class Broken:
        def on_tick(self, *args):
            raise OSError("disk full")

    bench = Bench(observers=(Broken(),)).drive()
    assert bench.loop.statistics.last_error == "OSError: disk full"


def test_a_new_plan_goes_out_in_the_next_tick_even_where_commands_are_as_rare_as_plans():
    bench = Bench(command_period=0.1).drive()
    bench.run(0.05)  # so that plans and the commands' period are out of step
    planned = bench.planner.latest
    count = len(bench.driver.sent)
    while bench.planner.latest is planned:
        bench.run(TICK)
    assert (
        len(bench.driver.sent) == count + 1
        and bench.driver.sent[-1][0] - bench.planner.latest[0].stamp <= TICK
    )
    bench.controller = None  # fails from now on: the last command is repeated until it is too old
    bench.run(0.2)
    assert len(bench.driver.sent) == count + 2


def test_commands_go_out_at_their_own_period_and_stops_at_every_tick():
    bench = Bench(command_period=0.1).drive()
    count = len(bench.driver.sent)
    bench.run(2.0)
    times = [t for t, _, _ in bench.driver.sent[count:]]
    assert len(times) == 20 and all(
        b - a == pytest.approx(0.1) for a, b in zip(times, times[1:], strict=False)
    )
    bench.driver.go_silent()
    bench.run(1.0)
    stopping = [c for c in bench.driver.sent if c[0] > bench.driver.silent_since + 0.26]
    assert all(
        b[0] - a[0] == pytest.approx(TICK) for a, b in zip(stopping, stopping[1:], strict=False)
    )
    assert stopping[0][0] - bench.driver.silent_since <= 0.3 and stopping[0][1] < 0.3


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


def test_after_a_stall_ticks_are_skipped_and_do_not_burst():
    bench = Bench()
    bench.planner.start = lambda: None
    times, plain = [], bench.loop.tick

    def tick(now):
        times.append(now)
        if len(times) == 50:
            bench.clock.now += 1.005
        if len(times) == 100:
            bench.loop.request_stop("test")
        return plain(now)

    bench.loop.tick = tick
    bench.gate.enable()
    bench.loop.run()
    gaps = [b - a for a, b in zip(times, times[1:], strict=False)]
    assert sum(g > 1.0 for g in gaps) == 1
    assert all(g >= TICK - 1e-6 or g == pytest.approx(0.015) for g in gaps)
    assert bench.loop.statistics.skipped == 50
    assert all(
        (t - times[0]) / TICK == pytest.approx(round((t - times[0]) / TICK), abs=1e-6)
        for t in times
    )


def test_deadlines_neither_drift_nor_burst():
    deadlines = Deadlines(0.1, 5.0)
    assert deadlines.next == 5.0
    deadlines.advance(5.03)
    assert deadlines.next == pytest.approx(5.1)
    deadlines.advance(5.45)
    assert deadlines.next == pytest.approx(5.5) and deadlines.skipped == 3
    deadlines.advance(5.2)  # woken early: still one step on
    assert deadlines.next == pytest.approx(5.6) and deadlines.skipped == 3


def test_quantiles_are_right_to_a_percent_and_memory_does_not_grow():
    times = Histogram()
    size = len(times._bins)
    for k in range(1, 100_001):
        times.add(k * 1e-5)
    for share in (0.5, 0.99, 0.999):
        assert times.quantile(share) == pytest.approx(share, rel=0.01)
    assert times.maximum == 1.0 and times.count == 100_000 and len(times._bins) == size
    times.add(math.nan)
    assert times.count == 100_000
    for extreme in (0.0, 1e-9, 1e9):
        times.add(extreme)
    assert times.quantile(0.0) <= 1e-6 and times.maximum == 1e9
    assert Histogram().summary()["p50"] is None and "-" in table({"none": Histogram()})


def wait_for(condition, seconds: float = 10.0) -> bool:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if condition():
            return True
        time.sleep(0.005)
    return False


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
        assert wait_for(lambda: gate.state is GateState.ACTIVE and driver.sent[-1][1] == 0.3)
        hang.set()
        assert wait_for(lambda: driver.sent[-1][1:] == (0.0, 0.0))
        assert wait_for(lambda: gate.state is GateState.RELEASED)
        assert driver.stops
    finally:
        loop.request_stop("test")
        thread.join(10.0)
        free.set()
    assert not thread.is_alive()
