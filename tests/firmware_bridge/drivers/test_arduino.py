"""The line protocol: its words, and the sketch's own parser against the emulator, byte for byte."""

import random
import struct
import subprocess
from pathlib import Path

import fastcrc
import pytest
from boards import Rig
from compiled_sketch import compiled
from robots import Clock
from waiting import until

from firmware_bridge.drivers.arduino import ENCODER, FAULT, STOPPED, ArduinoOptions
from firmware_bridge.kinematics import CarGeometry, OmniGeometry, WheelGeometry
from kmpc_lab.emulator.arduino import ArduinoEmulator

HARNESS = Path(__file__).with_name("kmpc_wheels_harness.c")
SIZES = {"wheel_radius": 0.05, "max_wheel_speed": 2.0}
ROBOT = WheelGeometry(**SIZES, track=0.3)
KINDS = {
    "two": (ROBOT, 2, 0),
    "car": (CarGeometry(**SIZES, wheelbase=0.3, steering_angle=0.5), 1, 1),
    "three": (OmniGeometry(**SIZES, arm=0.2), 3, 0),
    "mecanum": (OmniGeometry(**SIZES, track=0.3, wheelbase=0.3), 4, 0),
}
"""Geometry, KMPC_MOTORS, KMPC_SERVO."""
OPTIONS = ArduinoOptions(counts_per_turn=2000)


def line(text):
    return f"{text}*{fastcrc.crc16.xmodem(text.encode()):04X}\n".encode()


@pytest.fixture
def board(clock):
    return ArduinoEmulator(ROBOT, OPTIONS, clock=clock)


def test_words_of_the_protocol(board, clock):
    assert board.handle(line("H 1")) == line("H 1 2 2 0")
    assert board.handle(line("V 2 2000 -1000 300")) == line("S 2 0 0 0 0 0 1")
    clock.now += 0.25
    (_, sequence, uptime, first, second, speed1, speed2, flags) = (
        board.handle(line("P 3")).split(b"*")[0].split()
    )
    assert (sequence, uptime, flags) == (b"3", b"250", b"1")
    assert int(first) == pytest.approx(400, abs=40)
    assert (int(speed1), int(speed2)) == (pytest.approx(2000, abs=30), pytest.approx(-1000, abs=15))
    assert int(second) < 0
    clock.now += 0.06
    assert board.handle(line("P 4")).split(b"*")[0].endswith(b" 2"), "the watchdog has let go"
    assert board.stopped


def test_faults_and_restarts_are_reported(tmp_path):
    rig = Rig("arduino", f"pty:{tmp_path}/port").connect()
    for fault, word in (
        (STOPPED, "stop input pressed"),
        (FAULT, "the sketch reports a fault"),
        (ENCODER, "encoder fault"),
    ):
        rig.drive(0.3, 0.0, 0.1)
        rig.emulator.faults = fault
        assert until(lambda word=word: word in rig.driver.health().faults)
        assert rig.emulator.stopped
        assert not rig.driver.health().ready
        assert rig.driver.health().pose_ok == (fault != ENCODER)
        rig.emulator.faults = 0
        assert until(lambda: rig.driver.send(0.0, 0.0) or rig.driver.health().ready)
    rig.emulator.reboot()
    assert until(lambda: rig.counters["board_restarts"] == 1)
    rig.close()


def sketch(program, motors, servo):
    """The sketch's parser, compiled with every warning an error, and with sanitizers."""
    made = f"-DKMPC_MOTORS={motors}", f"-DKMPC_SERVO={servo}"
    return compiled(program, "gcc", "-std=c99", "-Wconversion", *made, str(HARNESS))


class AtOnce:
    """The emulator's motors do at once what they are commanded, as those of the harness."""

    def __init__(self, clock, geometry):
        self.board = ArduinoEmulator(geometry, OPTIONS, clock=clock)
        self.board._booted = 0.0
        self.board._turns = lambda channel: 0.0

    def take(self, data, now):
        self.board._watchdog(now)
        body = self.board._body
        reply = self.board._answer(data, now)
        for i in range(len(body.speeds)):
            body.speeds[i] = body.command[i] if body.driven[i] else 0.0
        return reply


def requests(draw, motors, servo):
    """Bytes as a spoilt wire brings them: good lines, nearly good ones, halves, noise."""
    kind = draw.choice(("V", "V", "P", "R", "H", "X"))
    numbers = [draw.choice((0, 1, 255, 256, draw.randint(-1, 300)))]
    if kind == "V":
        numbers += [
            draw.choice((0, draw.randint(-9000, 9000), 2**31 - 1, -(2**31), 2**31))
            for _ in range(motors)
        ]
        numbers += [draw.choice((1500, draw.randint(490, 2510))) for _ in range(servo)]
        numbers += [draw.choice((100, 300, 60000, 60001, 0, -5))]
    if draw.random() < 0.05:
        numbers.append(7)
    text = " ".join((kind, *map(str, numbers)))
    data = bytearray(line(text if draw.random() > 0.05 else text + " " * draw.randint(1, 60)))
    fate = draw.random()
    if fate < 0.15:
        data[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
    elif fate < 0.25:
        del data[draw.randrange(len(data)) :]
    elif fate < 0.35:
        data = bytearray(draw.randbytes(draw.randint(0, 80)))
    elif fate < 0.4:
        data = data.replace(b"\n", b"\r\n")
    return bytes(data)


@pytest.mark.parametrize("kind", KINDS)
def test_the_sketch_and_the_emulator_answer_every_byte_alike(kind, tmp_path):
    geometry, motors, servo = KINDS[kind]
    program = sketch(tmp_path / "kmpc_wheels", motors, servo)
    draw, clock = random.Random(4), Clock()
    twin, now, records, expected = AtOnce(clock, geometry), 0, b"", b""
    for _ in range(10_000):
        now += draw.choice((1, 5, 20, 299, 301))
        data = requests(draw, motors, servo)
        records += struct.pack("<IH", now, len(data)) + data
        expected += twin.take(data, now / 1000.0)
    answer = subprocess.run([program], input=records, capture_output=True, check=True).stdout
    assert expected.count(b"\n") > 1900
    assert answer == expected
