"""One end is lost while the robot drives: the process, the plug, the answers, the driver itself."""

import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

from boards import DRIVERS, EMULATORS, TABLES
from waiting import until

from firmware_bridge.link import open_transport

CHILD = """
    import sys, time
    from boards import DRIVERS, TABLES
    from firmware_bridge.link import open_transport
    driver = DRIVERS[sys.argv[1]].from_options(open_transport(sys.argv[2]), TABLES[sys.argv[1]])
    driver.connect(5.0)
    print("up", flush=True)
    while True:
        driver.send(0.4, 0.2)
        time.sleep(0.02)
"""


def test_kill_9_of_the_process_stops_each_board_by_its_own_watchdog(tmp_path):
    tests = Path(__file__).parents[3]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(tests / "helpers"), str(tests.parent)]),
    }
    boards = {name: EMULATORS[name].from_options(TABLES[name]) for name in TABLES}
    urls = {name: f"pty:{tmp_path}/{name}" for name in TABLES}
    children = {}
    try:
        for name, board in boards.items():
            board.start(urls[name])
            command = [sys.executable, "-c", textwrap.dedent(CHILD), name, urls[name]]
            children[name] = subprocess.Popen(command, stdout=subprocess.PIPE, env=environment)
        for name, child in children.items():
            assert child.stdout.readline() == b"up\n"
            assert until(lambda board=boards[name]: not board.stopped)
        time.sleep(0.4)
        for name, child in children.items():
            assert until(lambda board=boards[name]: not board.stopped)
            child.send_signal(signal.SIGKILL)
            child.wait()
            # no other process is there to do it
            assert until(lambda board=boards[name]: board.stopped)
        for name in TABLES:  # the next process finds boards that it can use
            driver = DRIVERS[name].from_options(open_transport(urls[name]), TABLES[name])
            driver.connect(20.0)
            assert driver.health().ready
            driver.close()
    finally:
        for child in children.values():
            child.kill()
            child.wait()
            child.stdout.close()
        for board in boards.values():
            board.close()


def test_unplugged_while_driving_and_plugged_in_again(rig):
    rig.connect()
    rig.drive(0.3, 0.0, 0.2)
    rig.emulator.close()
    assert until(lambda: not rig.driver.health().connected)
    rig.driver.send(0.3, 0.0)
    health = rig.driver.health()
    assert not health.ready and any(
        "unplugged" in fault or "no such port" in fault for fault in health.faults
    )
    rig.emulator.start(rig.url)
    rig.drive(0.0, 0.0, 0.2)
    rig.is_ready()
    assert rig.counters["reconnects"] == 1 and rig.counters["setups"] == 2 and rig.emulator.stopped
    rig.starts(0.3, 0.0)


def test_a_mute_board_is_commanded_to_stop_all_the_same(rig):
    """The wire from the board is broken, the one to it is not.

    Zeros must go out, and nothing else.
    """
    rig.connect()
    rig.drive(0.3, 0.0, 0.1)
    rig.emulator.mute = True
    assert until(lambda: not rig.driver.health().ready)
    rig.driver.send(0.0, 0.0)
    assert until(lambda: rig.emulator.stopped)
    rig.drive(0.3, 0.0, 0.2)
    assert (
        rig.emulator.stopped
        and rig.counters["timeouts"] > 0
        and rig.counters["refused_commands"] > 0
    )
    rig.emulator.mute = False
    rig.is_ready()


def test_lost_replies_are_counted_and_overcome(rig):
    rig.connect()
    rig.emulator.lose_replies = 3
    assert until(lambda: rig.counters["timeouts"] >= 3 and rig.emulator.lose_replies == 0)
    frames = rig.counters["frames"]
    assert until(lambda: rig.counters["frames"] > frames + 10 and rig.driver.health().ready)


def test_a_bug_in_the_driver_is_reported_and_the_motors_are_stopped(rig, monkeypatch):
    rig.connect()
    rig.drive(0.3, 0.0, 0.1)

    def bug(cycle):
        raise RuntimeError("bug in a driver")

    monkeypatch.setattr(rig.driver, "_poll", bug)
    assert until(lambda: rig.counters["driver_errors"] > 1)
    assert (
        not rig.driver.health().ready
        and "RuntimeError: bug in a driver" in rig.driver.health().faults
    )
    assert until(lambda: rig.emulator.stopped), "the last command has become old"
    monkeypatch.undo()
    assert (
        until(lambda: rig.driver.send(0.0, 0.0) or rig.driver.health().ready)
        and rig.driver.health().faults == ()
    )
