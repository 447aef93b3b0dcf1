"""What every serial board must do, over real descriptors."""

import math
import os
import random
import signal
import socket
import struct
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import pytest
from boards import DRIVERS, EMULATORS, TABLES, Rig, distance, with_board
from waiting import until

from firmware_bridge.drivers.arduino import line
from firmware_bridge.link import Faults, open_transport
from firmware_bridge.link.framing import odrive_line, roboclaw_packet, vesc_packet
from firmware_bridge.link.loopback import named_wire
from firmware_bridge.messages import ConfigError, LinkError

BOARDS = list(TABLES)


@pytest.fixture(params=BOARDS)
def name(request):
    return request.param


@pytest.fixture
def rig(name, tmp_path):
    rig = Rig(name, f"pty:{tmp_path}/port")
    yield rig
    rig.close()


@pytest.fixture(params=["pty", "tcp"])
def url(request, tmp_path):
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return (
            f"pty:{tmp_path}/port"
            if request.param == "pty"
            else f"tcp:127.0.0.1:{probe.getsockname()[1]}"
        )


def test_drives_and_reads_back(name, url):
    rig = Rig(name, url).connect()
    try:
        assert rig.driver.health().ready and rig.driver.health().faults == ()

        def as_told():
            rig.driver.send(0.4, 0.5)
            state = rig.driver.state()
            return abs(state.v - 0.4) < 0.02 and abs(state.omega - 0.5) < 0.1

        assert until(as_told)
        rig.drive(0.4, 0.5, 0.3)
        now = time.monotonic()
        assert until(lambda: rig.driver.state().stamp > now)
        rig.drive(-0.3, -1.0, 0.2)
        rig.driver.send(0.0, 0.0)
        assert until(lambda: abs(rig.driver.state().v) < 1e-3)
        assert until(
            lambda: all(
                a < b for a, b in zip(distance(rig.driver, rig.emulator), (0.01, 0.03), strict=True)
            )
        ), distance(rig.driver, rig.emulator)
        assert math.hypot(*rig.emulator.pose[:2]) > 0.05
        counters = rig.counters
        assert counters["frames"] > 10
        assert counters["driver_errors"] == 0
        # an answer that a busy machine gave too late is one that nobody waits for any more, whole
        # or in parts
        assert counters["bad_bytes"] == 0 or counters["timeouts"]
        assert counters["unexpected_replies"] <= counters["timeouts"]
    finally:
        rig.close()


def test_slip_and_turn_gain_part_truth_from_odometry(name, tmp_path):
    rig = Rig(name, f"pty:{tmp_path}/port", slip=0.1, turn_gain=0.5, seed=1).connect()
    try:
        rig.drive(0.4, 1.0, 0.3)
        rig.come_to_rest()
        turned = rig.emulator.pose[2]
        assert 0.4 < turned / rig.driver.state().theta < 0.8
    finally:
        rig.close()


@pytest.mark.parametrize("command", [(math.nan, 0.0), (0.1, math.inf), (-math.inf, math.nan)])
def test_non_finite_commands_never_reach_the_wire(rig, command):
    rig.connect()
    rig.driver.send(0.0, 0.0)
    assert until(lambda: not rig.driver._held.pending)
    rig.driver._held.zeros = 0
    with pytest.raises(ValueError, match="finite"):
        rig.driver.send(*command)
    held = rig.driver._held
    assert not held.pending and held.value == (0.0, 0.0) and rig.emulator.stopped


def test_commands_are_scaled_to_the_wheel_limit(rig):
    rig.connect()
    rig.drive(50.0, 40.0, 0.2)
    rig.starts(50.0, 40.0)
    left, right = rig.emulator.wheel_command
    rim = 0.0425 * max(abs(left), abs(right))
    assert rim == pytest.approx(0.9, rel=1e-3)
    v, omega = 0.0425 * (left + right) / 2, 0.0425 * (right - left) / 0.27
    assert omega / v == pytest.approx(40.0 / 50.0, rel=1e-2)


def test_stop_releases_and_only_zero_takes_back(rig):
    rig.connect()
    rig.drive(0.3, 0.0, 0.1)
    rig.driver.stop()
    assert until(lambda: rig.emulator.stopped) and not rig.driver.health().ready
    rig.driver.send(0.3, 0.0)
    time.sleep(0.1)
    assert rig.emulator.stopped and rig.counters["refused_commands"] >= 1
    rig.is_ready()
    rig.starts(0.3, 0.0)


def test_an_old_command_is_replaced_by_zero_while_the_driver_lives(name, tmp_path):
    rig = Rig(name, f"pty:{tmp_path}/port", with_board(name, command_timeout=0.15)).connect()
    try:
        rig.driver.send(0.3, 0.0)
        assert until(lambda: not rig.emulator.stopped) and until(lambda: rig.emulator.stopped)
        assert rig.counters["stale_commands"] == 1 and rig.driver.health().ready
    finally:
        rig.close()


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
    tests = Path(__file__).parents[2]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(tests / "helpers"), str(tests.parent)]),
    }
    boards = {name: EMULATORS[name].from_options(TABLES[name]) for name in BOARDS}
    urls = {name: f"pty:{tmp_path}/{name}" for name in BOARDS}
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
            # nobody else is there to do it
            assert until(lambda board=boards[name]: board.stopped)
        for name in BOARDS:  # the next process finds boards that it can use
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


def test_a_mute_board_is_told_to_stop_all_the_same(rig):
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
    assert until(lambda: rig.counters["frames"] > frames + 10) and rig.driver.health().ready


def test_a_silent_board_is_told_in_words(name, tmp_path):
    rig = Rig(name, f"pty:{tmp_path}/port")
    rig.emulator.mute = True
    with pytest.raises(LinkError, match="no answer within 0.3 s: is it powered, wired TX to RX"):
        rig.driver.connect(0.3)
    assert threading.active_count() < 10
    rig.close()


def test_wrong_baud_is_told_in_words(name, tmp_path):
    floor = {"baud": 115200}
    emulator = EMULATORS[name].from_options(TABLES[name], **floor)
    emulator.start(f"pty:{tmp_path}/port")
    driver = DRIVERS[name].from_options(
        open_transport(f"serial:{tmp_path}/port?baud=57600"), TABLES[name]
    )
    with pytest.raises(LinkError, match="baud rate"):
        driver.connect(0.3)
    right = DRIVERS[name].from_options(
        open_transport(f"serial:{tmp_path}/port?baud=115200"), TABLES[name]
    )
    right.connect(20.0)
    assert right.health().ready
    right.close()
    emulator.close()


def test_nobody_at_the_port(name, tmp_path):
    driver = DRIVERS[name].from_options(open_transport(f"pty:{tmp_path}/none"), TABLES[name])
    with pytest.raises(LinkError, match="no such port"):
        driver.connect(1.0)
    driver.close()


def test_second_driver_on_the_port_is_refused(rig):
    rig.connect()
    second = DRIVERS[rig.name].from_options(open_transport(rig.url), TABLES[rig.name])
    with pytest.raises(LinkError, match="in use"):
        second.connect(1.0)
    rig.is_ready()


def test_boot_text_and_noise_are_skipped(rig):
    rig.connect()
    rig.emulator.say(b"\r\n*** booting ***\r\n\x02\x03\xff\x80" * 3)
    rig.drive(0.2, 0.0, 0.2)
    rig.is_ready()
    assert rig.counters["bad_bytes"] + rig.counters["unexpected_replies"] > 0
    assert rig.counters["odometry_jumps"] == 0


def test_replies_that_nobody_asked_for_are_told(name, tmp_path):
    """As a second master on the line would cause."""
    rig = Rig(name, f"pty:{tmp_path}/port", with_board(name, poll_hz=5.0)).connect()
    answer = {
        "roboclaw": bytes(10),
        "odrive": odrive_line("1.0 2.0", True),
        "vesc": vesc_packet(b"\x04"),
        "roboteq": b"C=1:2\r",
        "arduino": line("S 77 1 2 3 4 5 0"),
    }[name]
    for _ in range(20):
        rig.emulator.say(answer)
        time.sleep(0.01)
    assert rig.counters["unexpected_replies"] >= 5
    assert any(
        "does another program talk to the board" in fault for fault in rig.driver.health().faults
    )
    rig.close()


def test_a_board_that_restarts_is_set_up_again(rig):
    rig.connect()
    rig.drive(0.8, 0.0, 0.8)  # farther than it could be believed to come back meanwhile
    rig.driver.send(0.0, 0.0)
    assert until(lambda: abs(rig.driver.state().v) < 1e-3)
    x = rig.driver.state().x
    rig.emulator.reboot()
    rig.drive(0.0, 0.0, 0.6)  # a change of the watchdog is noticed within half a second
    rig.is_ready()
    assert rig.driver.state().x == pytest.approx(x, abs=0.06)
    rig.starts(0.3, 0.0)


def test_wire_shows_only_speeds_within_the_limit_under_faults(name):
    """Drop, duplicate, corrupt, reorder, split, cut.

    What the driver writes is decoded here by other means.
    """
    wire = named_wire(f"storm-{name}", Faults(), seed=7)
    rig = Rig(name, f"loopback:storm-{name}").connect()
    storm = Faults(
        drop=0.05,
        duplicate=0.05,
        corrupt=0.05,
        reorder=0.05,
        split=0.2,
        cut=0.005,
        cut_for=0.05,
        delay=0.002,
    )

    def rims() -> list[float]:
        return [speed for frame in rig.wire.frames for speed in rim_speeds(name, frame)]

    def seen() -> bool:
        faults = wire.bridge.counters["faults"] + wire.board.counters["faults"]
        return len(rims()) > 50 and faults > 20 and rig.counters["timeouts"] > 5

    wire.faults = storm
    rig.drive(0.4, 0.6, 1.2, period=0.01)
    for _ in range(20):  # a busy machine sends less in a second
        if not seen():
            rig.drive(0.4, 0.6, 1.0, period=0.01)
    wire.faults = Faults()
    rig.is_ready()
    counters = rig.counters
    assert counters["driver_errors"] == counters["errors"] == 0
    assert seen() and max(map(abs, rims())) <= 0.9 * 1.001
    rig.starts(0.3, 0.0)
    rig.close()


def rim_speeds(name, frame):
    """Rim speeds [m/s] in a frame of the driver, by decoders that share nothing with the
    bridge's.
    """
    per_metre = 20.0 / (2 * math.pi * 0.0425)
    if name == "roboclaw":
        return (
            []
            if frame[1] != 37
            else [count / 1440 / per_metre for count in struct.unpack(">ii", frame[2:10])]
        )
    if name == "odrive":
        return [
            float(line.split()[2].split(b"*")[0]) / per_metre
            for line in frame.splitlines()
            if line.startswith(b"v ")
        ]
    if name == "roboteq":
        words = [word for word in frame.split(b"\r") if word.startswith(b"!S ")]
        return [int(word.split()[2]) / 60.0 / per_metre for word in words]
    if name == "arduino":
        words = frame.split(b"*")[0].split()[2:4] if frame.startswith(b"V") else []
        return [int(word) / 1440 / per_metre for word in words]
    found, at = [], 0
    while at < len(frame):
        payload = frame[at + 2 : at + 2 + frame[at + 1]]
        at += frame[at + 1] + 5
        payload = payload[2:] if payload[0] == 34 else payload
        found += (
            [struct.unpack(">i", payload[1:5])[0] / 60.0 / 7 / per_metre] if payload[0] == 8 else []
        )
    return found


def test_a_bug_in_the_driver_is_told_and_the_motors_are_stopped(rig, monkeypatch):
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


def test_noise_makes_no_exception_at_either_end(name):
    now = [100.0]
    board = EMULATORS[name].from_options(TABLES[name], clock=lambda: now[0])
    driver = DRIVERS[name].from_options(open_transport("loopback:unused"), TABLES[name])
    rng = random.Random(8)
    alphabets = {
        "odrive": b"vfruwsc 01.-einaf*\n\r",
        "roboteq": b"!?^~SGCFMRWDECHO 012-=:+\r",
        "arduino": b"HVPRS 0123456789-*ABCDEF\n",
    }
    alphabet = alphabets.get(name, bytes(range(256)))
    for _ in range(3000):
        noise = bytes(rng.choices(alphabet, k=rng.randint(1, 100)))
        if name == "vesc":
            noise = vesc_packet(
                bytes((rng.choice((0, 4, 6, 7, 8, 30, 34, 50)), *noise))
            )  # whole frames of nonsense
        elif name == "arduino":
            noise += b"\n" + line(noise.decode().replace("*", " ").replace("\n", " "))
        elif name == "roboclaw":
            noise += roboclaw_packet(0x80, rng.choice((14, 34, 35, 36, 37, 40)), noise[:12])
        now[0] += 0.02
        board.handle(noise)
        driver._feed(noise, now[0])
    assert all(map(math.isfinite, board.pose)) and all(map(math.isfinite, board.wheel_command))
    driver.close()


def test_close_twice_and_before_connect(name, tmp_path):
    driver = DRIVERS[name].from_options(open_transport(f"pty:{tmp_path}/none"), TABLES[name])
    driver.close()
    driver.close()
    assert driver.state() is None and not driver.health().connected and not driver.health().ready


@pytest.mark.parametrize(
    ("section", "change", "message"),
    [
        ("board", {"baud": 1}, "board.baud: unknown key"),
        ("board", {"poll_hz": "fast"}, "board.poll_hz: expected float"),
        ("board", {"poll_hz": 0}, "board.poll_hz: expected 5 to 200 Hz"),
        ("board", {"command_timeout": -1}, "board.command_timeout: expected 0.05"),
        ("geometry", {"track": 0}, "geometry.track: expected 0.01 to 100 m, got 0"),
    ],
)
def test_bad_robot_files_name_the_key(name, section, change, message):
    table = {**TABLES[name], section: {**TABLES[name][section], **change}}
    with pytest.raises(ConfigError) as caught:
        DRIVERS[name].from_options(open_transport("loopback:unused"), table)
    assert str(caught.value).startswith(message)
