"""The sketch's speed loop: a motor whose encoder is dead is not driven at full power."""

import subprocess
from pathlib import Path

import pytest
from compiled_sketch import compiled

HARNESS = Path(__file__).with_name("kmpc_sketch_harness.cpp")
TOP = 6000  # counts a second at full power


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """Drive the sketch: time of the fault [ms], largest power, powers at the end, faults."""
    program = tmp_path_factory.mktemp("loop") / "sketch"
    compiled(program, "g++", "-std=c++11", "-x", "c++", str(HARNESS))

    def driven(speed: int, dead: int, milliseconds: int) -> list[float]:
        words = [program, str(speed), str(dead), str(milliseconds)]
        return [float(word) for word in subprocess.check_output(words, text=True).split()]

    return driven


@pytest.mark.parametrize("speed", [TOP // 10, -TOP // 10, TOP // 2, TOP])
def test_a_dead_encoder_is_reported_within_300_ms_and_its_motor_stopped(drive, speed):
    """The I term drove that motor at full power, and no fault was reported."""
    told, largest, left, right, after = drive(speed, 1, 3000)
    assert 200 <= told <= 300
    assert largest <= 2.0 * abs(speed) / TOP + 0.2 or abs(speed) > TOP // 3
    assert left == right == 0.0
    assert after == 0.0, "let go, it may be tried again"


@pytest.mark.parametrize(("motors", "servo"), [(1, 1), (3, 0), (4, 0)])
def test_the_sketch_compiles_for_cars_and_omnis(tmp_path, motors, servo):
    stub = "struct Servo { int at; void attach(int pin) { at = pin; } "
    (tmp_path / "Servo.h").write_text(stub + "void writeMicroseconds(int us) { at = us; } };")
    made = f"-DKMPC_MOTORS={motors}", f"-DKMPC_SERVO={servo}", f"-I{tmp_path}"
    compiled(tmp_path / "sketch", "g++", "-std=c++11", "-c", *made, "-x", "c++", str(HARNESS))
