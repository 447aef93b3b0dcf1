"""What a terminal shows, and what a file or a broken terminal gets."""

import io

from robots import Clock, FakeDriver, constant

from firmware_bridge.live.terminal import View, render
from firmware_bridge.runtime.controller_thread import Planner
from firmware_bridge.runtime.loop import ControlLoop
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


def test_a_terminal_that_has_gone_stops_only_the_view():
    class Gone(io.StringIO):
        def write(self, text):
            raise BrokenPipeError

    loop, *_ = driven()
    view = View(loop, "a", Gone(), True)
    view.start()
    view.stop()
    assert not view._thread.is_alive()
