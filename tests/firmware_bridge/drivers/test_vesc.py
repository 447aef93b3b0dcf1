"""VESC: the emulator against raw frames, and what only this driver does."""

import struct

import fastcrc
import pytest
from boards import GEOMETRY, Rig, distance, with_board
from waiting import until

from firmware_bridge.drivers.vesc import ALIVE, FAULTS, VescDriver, VescOptions
from firmware_bridge.kinematics import WheelGeometry
from firmware_bridge.link import open_transport
from firmware_bridge.link.framing import vesc_packet
from firmware_bridge.messages import ConfigError, LinkError
from kmpc_lab.emulator.vesc import VescEmulator

ROBOT = WheelGeometry(wheel_radius=0.05, track=0.3, max_wheel_speed=2.0)
OPTIONS = VescOptions(can_id=5, pole_pairs=7)
RPM_60 = 7 * 60  # ERPM of one motor turn per second


def framed(payload):
    return (
        bytes((2, len(payload)))
        + payload
        + struct.pack(">H", fastcrc.crc16.xmodem(payload))
        + b"\x03"
    )


def opened(frame):
    """Take the payload out of one short frame, with nothing of the bridge."""
    assert frame[0] == 2 and len(frame) == frame[1] + 5 and frame[-1] == 3
    payload = frame[2:-3]
    assert struct.unpack(">H", frame[-3:-1])[0] == fastcrc.crc16.xmodem(payload)
    return payload


@pytest.fixture
def board(clock):
    return VescEmulator(ROBOT, OPTIONS, clock=clock)


@pytest.fixture
def rig(tmp_path):
    rig = Rig("vesc", f"pty:{tmp_path}/port")
    yield rig
    rig.close()


def test_speaks_the_bytes_of_the_firmware(board, clock):
    assert board.handle(bytes.fromhex("02 05 08 00 00 0b b8 f8 04 03")) == b""
    clock.now += 0.5
    payload = opened(board.handle(bytes.fromhex("02 01 04 40 84 03")))
    assert payload[0] == 4 and len(payload) == 74
    assert struct.unpack(">i", payload[23:27])[0] == pytest.approx(3000, abs=1)  # rpm
    assert struct.unpack(">h", payload[27:29])[0] == 126  # volts
    assert struct.unpack(">i", payload[45:49])[0] == pytest.approx(
        3000 / 60 * 6 * 0.45, rel=0.02
    )  # tachometer
    assert payload[53] == 0 and payload[58] == 77  # fault, controller id


def test_second_motor_through_can(board, clock):
    board.handle(framed(b"\x22\x05" + struct.pack(">Bi", 8, RPM_60)))
    board.handle(framed(b"\x22\x06" + struct.pack(">Bi", 8, 9 * RPM_60)))
    clock.now += 0.5
    left, right = board.wheel_command
    assert left == 0.0 and right > 0.0
    payload = opened(board.handle(framed(b"\x22\x05\x04")))
    assert (
        struct.unpack(">i", payload[23:27])[0] == pytest.approx(RPM_60, abs=1) and payload[58] == 5
    )


def test_each_motor_coasts_after_a_second_without_a_command(board, clock):
    first, second = (
        framed(struct.pack(">Bi", 8, RPM_60)),
        framed(b"\x22\x05" + struct.pack(">Bi", 8, RPM_60)),
    )
    board.handle(first + second)
    clock.now += 0.9
    board.handle(second + bytes.fromhex("02 01 04 40 84 03"))
    clock.now += 0.2
    left, right = board.wheel_command
    assert left == 0.0 and right > 0.0
    clock.now += 1.0
    assert board.stopped
    x = board.pose[0]
    clock.now += 0.3
    assert board.pose[0] > x, "it rolls on"


def test_the_driver_never_sends_alive_and_lets_the_board_time_out(tmp_path):
    rig = Rig("vesc", f"pty:{tmp_path}/port").connect()
    rig.drive(0.3, 0.0, 0.2)
    rig.driver.send(0.0, 0.0)
    assert until(lambda: rig.driver._held.zeros == 0 and not rig.driver._held.pending)
    written = len(rig.wire.frames)
    assert not until(lambda: False, 0.3)
    assert all(frame[2] in (0, 4, 50, 34) for frame in rig.wire.frames[written:])
    assert not any(
        ALIVE in (frame[2], frame[4] if frame[2] == 34 else None) for frame in rig.wire.frames
    )
    assert not any(frame[4] in (6, 7, 8) for frame in rig.wire.frames[written:] if frame[2] == 34)
    rig.close()


def test_old_firmware_without_selective_values(tmp_path):
    rig = Rig("vesc", f"pty:{tmp_path}/port", selective=False).connect()
    rig.drive(0.3, 0.3, 0.3)
    assert rig.driver.state().v == pytest.approx(0.3, abs=0.02)
    rig.driver.send(0.0, 0.0)
    assert until(lambda: rig.driver.state().v == 0.0) and until(
        lambda: distance(rig.driver, rig.emulator)[0] < 0.01
    )
    rig.close()


def test_faults_in_words(rig):
    rig.connect()
    rig.emulator.faults = [0, 5]
    assert until(
        lambda: rig.driver.health().faults == ("second VESC: over-temperature of the bridge",)
    )
    assert not rig.driver.health().ready and rig.driver.health().pose_ok
    rig.emulator.faults = [25, 0]
    assert (
        until(lambda: rig.driver.health().faults == ("first VESC: encoder without magnet",))
        and not rig.driver.health().pose_ok
    )
    rig.emulator.faults = [250, 0]
    assert until(lambda: rig.driver.health().faults == ("first VESC: fault 250",))
    rig.emulator.faults = [0, 0]
    assert until(lambda: rig.driver.health().ready)
    assert all(FAULTS[1:])


def test_second_vesc_missing_on_can_is_reported(tmp_path):
    board = VescEmulator.from_options(with_board("vesc", can_id=9))
    board.start(f"pty:{tmp_path}/port")
    driver = VescDriver.from_options(open_transport(f"pty:{tmp_path}/port"), with_board("vesc"))
    with pytest.raises(
        LinkError, match=r"is the second VESC \(CAN id 5\) powered and on the CAN bus"
    ):
        driver.connect(0.4)
    board.close()


def test_replies_of_a_third_controller_are_refused(rig):
    rig.connect()
    selective = struct.pack(
        ">BIiiBB", 50, 1 << 7 | 1 << 13 | 1 << 15 | 1 << 17, 99999, 12345, 0, 33
    )
    before = rig.driver.state().x
    for _ in range(10):
        rig.emulator.say(vesc_packet(selective))
        rig.emulator.say(vesc_packet(selective[:-2]))
    assert until(lambda: rig.counters["unexpected_replies"] >= 20)
    assert rig.driver.state().x == before and rig.counters["odometry_jumps"] == 0


@pytest.mark.parametrize(
    ("board", "message"),
    [
        ({"pole_pairs": 7}, "board.can_id: missing"),
        ({"can_id": 5}, "board.pole_pairs: missing"),
        ({"can_id": 300, "pole_pairs": 7}, "board.can_id: expected 0 to 253, got 300"),
        ({"can_id": 5, "pole_pairs": 7.5}, "board.pole_pairs: expected int, got 7.5"),
        (
            {"can_id": 5, "pole_pairs": 200},
            "board.pole_pairs: 200 makes speeds past the board's 32 bits",
        ),
    ],
)
def test_bad_options_name_the_key(board, message):
    geometry = {**GEOMETRY, "gear_ratio": 10_000.0, "max_wheel_speed": 50.0}
    with pytest.raises(ConfigError) as caught:
        VescDriver.from_options(
            open_transport("pty:unused"), {"geometry": geometry, "board": board}
        )
    assert str(caught.value).startswith(message)
