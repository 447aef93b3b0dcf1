"""What a terminal shows, and what a file or a broken terminal gets."""

import io
import json

from robots import Clock, FakeDriver, constant

from firmware_bridge.live.terminal import View, render
from firmware_bridge.messages import State
from firmware_bridge.runtime.controller_thread import Planner
from firmware_bridge.runtime.loop import ControlLoop
from firmware_bridge.runtime.navigator import Moment, Navigator, Planned, Task
from firmware_bridge.safety.gate import SafetyGate
from firmware_bridge.safety.gate_settings import GateSettings


def driven(seconds: float = 2.0):
    clock = Clock()
    driver = FakeDriver(clock)
    planner = Planner(constant(clock), driver.state, 0.1, clock=clock)
    loop = ControlLoop(driver, SafetyGate(GateSettings()), planner, clock=clock)
    loop.gate.enable()
    run(loop, planner, clock, seconds)
    return loop, driver, planner, clock


def run(loop, planner, clock, seconds: float) -> None:
    for k in range(round(seconds / 0.02)):
        clock.now += 0.02
        if k % 5 == 0:
            planner.step(clock())
        loop.tick(clock())


def test_the_picture_has_pose_command_step_time_and_link_health():
    loop, driver, planner, clock = driven()
    text = "\n".join(render("mavlink tcp:x:1", loop.snapshot, loop))
    for words in (
        "mavlink tcp:x:1",
        "ACTIVE",
        "pose",
        "x    0.",
        "v   0.300 m/s",
        "|##########]",
        "controller",
        "median",
        "pose to wire",
        "up, heard",
        "nothing",
    ):
        assert words in text
    driver.go_silent()
    driver.faults = ("over-temperature",)
    run(loop, planner, clock, 0.6)
    text = "\n".join(render("a", loop.snapshot, loop))
    assert "board not heard" in text and "over-temperature" in text and "HOLDING" in text


def test_the_picture_before_the_first_pose():
    loop, driver, _, clock = driven(0.0)
    driver.path.clear()
    driver.fails = {"state"}
    loop.tick(clock())
    text = "\n".join(render("a", loop.snapshot, loop))
    assert (
        "none yet" in text
        and "DOWN" in text
        and "heard never ago" in text
        and "no step yet" in text
    )


def test_a_terminal_is_drawn_over_and_a_file_gets_the_changes_once():
    loop, driver, planner, clock = driven()
    screen, file = io.StringIO(), io.StringIO()
    live, plain = (
        View(loop, "a", screen, True),
        View(loop, "a", file, False, lambda: ["disk full: logging has ended"]),
    )
    for _ in range(3):
        live.draw()
        plain.draw()
    assert (
        screen.getvalue().count("IDLE -> WAITING") == 1 and screen.getvalue().count("\x1b[7F") == 2
    )
    assert file.getvalue().splitlines() == [
        line for line in file.getvalue().splitlines() if "\x1b" not in line
    ]
    assert (
        file.getvalue().count("WAITING -> ACTIVE") == 1 and file.getvalue().count("disk full") == 1
    )
    driver.go_silent()
    run(loop, planner, clock, 3.0)
    plain.draw()
    told = next(line for line in file.getvalue().splitlines() if "ACTIVE -> STOPPING: " in line)
    assert "no pose, or too old" in told or "board not heard" in told


def test_a_terminal_that_has_gone_stops_only_the_view():
    class Gone(io.StringIO):
        def write(self, text):
            raise BrokenPipeError

    loop, *_ = driven()
    view = View(loop, "a", Gone(), True)
    view.start()
    view.stop()
    assert not view._thread.is_alive()


DRIVES = Moment(driving=True)


def navigator(seconds: float = 10.0):
    clock = Clock()
    task = Task((1.0, 0.0, 0.0), 0.05, 0.1, 0.2, lambda t: [[0.5, 1.0 - 0.1 * t, 0.3]])
    creep = Planned(0.04, 0.0, "SOLVED")  # so slow that the robot counts as standing
    made = Navigator(lambda pose, circles, moment: creep, task, 0.5, seconds, clock)
    return made, clock


def state(x, y=0.0, theta=0.0):
    return State(x, y, theta, 0.0, 0.0, 0.0)


def test_the_goal_must_be_held_and_time_counts_from_the_first_command_that_passes():
    made, clock = navigator()
    for _ in range(50):
        clock.now += 0.1
        assert made(state(0.0), Moment()).v == 0.04
    assert (
        made.elapsed(clock()) == 0.0
        and not made.finished()
        and made.report()["position_error_m"] is None
    )
    made(state(0.0), DRIVES)
    for x, finished in (
        (0.96, False),
        (0.96, False),
        (0.90, False),
        (0.96, False),
        (0.97, False),
        (1.0, False),
        (1.0, False),
        (1.0, False),
        (1.0, True),
    ):
        clock.now += 0.1
        made(state(x), DRIVES)
        assert made.finished() is finished, x
    report = made.report()
    assert (
        report["arrived"] and report["arrived_after_s"] == 0.4 and report["position_error_m"] == 0.0
    )
    json.dumps(report)


def test_a_heading_that_is_off_is_no_arrival_and_time_runs_out():
    made, clock = navigator(2.0)
    for _ in range(19):
        made(state(1.0, 0.0, 0.2 + 6.283185307179586), DRIVES)
        clock.now += 0.1
        assert not made.finished()
    clock.now += 0.2
    assert (
        made.finished()
        and not made.report()["arrived"]
        and made.report()["heading_error_rad"] == 0.2
    )


def test_the_clearance_is_to_where_moving_obstacles_are():
    made, clock = navigator()
    for _ in range(3):
        made(state(0.5), DRIVES)
        clock.now += 1.0
    assert made.report()["clearance_m"] == round(0.8 - 0.3 - 0.2, 4) and made.statuses == {
        "SOLVED": 3
    }
