"""Whatever else a ground station says to the emulated rover is answered as the protocol says."""

from __future__ import annotations

import math
import random
import struct

import pytest
from ground_station import ACCEPTED, FAILED, UNSUPPORTED, Ground
from mavlink_rig import crc16_mcrf4xx, dialect

from kmpc_lab.emulator.rover.parameters import DEFAULTS
from kmpc_lab.emulator.rover.rover import RoverEmulator


class TestParameters:
    """PARAM_REQUEST_LIST, READ, SET."""

    def test_the_whole_list(self) -> None:
        answers = Ground().ask(dialect.MAVLink_param_request_list_message(1, 1), 1.0)
        values = [m for m in answers if m.get_type() == "PARAM_VALUE"]
        assert [(m.param_id, m.param_index, m.param_count) for m in values] == [
            (n, i, len(DEFAULTS)) for i, n in enumerate(DEFAULTS)
        ]
        told = {m.param_id: m.param_value for m in values}  # in single precision
        assert told == pytest.approx({name: value for name, (value, _) in DEFAULTS.items()})

    def test_one_by_name_or_index(self) -> None:
        ground = Ground()
        for name, index in ((b"WP_SPEED", -1), (b"", list(DEFAULTS).index("WP_SPEED"))):
            (told,) = [
                m
                for m in ground.ask(dialect.MAVLink_param_request_read_message(1, 1, name, index))
                if m.get_type() == "PARAM_VALUE"
            ]
            assert (told.param_id, told.param_value) == ("WP_SPEED", 2.0)
        assert not [
            m
            for m in ground.ask(dialect.MAVLink_param_request_read_message(1, 1, b"NO_SUCH", -1))
            if m.get_type() == "PARAM_VALUE"
        ]

    @pytest.mark.parametrize(
        ("name", "value", "then"),
        [(b"WP_SPEED", 0.8, 0.8), (b"FS_GCS_ENABLE", 1.0, 1.0), (b"FS_GCS_ENABLE", math.nan, 0.0)],
    )
    def test_set(self, name: bytes, value: float, then: float) -> None:
        ground = Ground()
        (told,) = [
            m
            for m in ground.ask(dialect.MAVLink_param_set_message(1, 1, name, value, 9))
            if m.get_type() == "PARAM_VALUE"
        ]
        assert told.param_value == pytest.approx(then)
        assert ground.rover.parameters[name.decode()] == pytest.approx(then)

    @pytest.mark.parametrize(
        ("name", "value"), [(b"SCHED_LOOP_RATE", 0.0), (b"WP_SPEED", -1.0), (b"WP_SPEED", 1e30)]
    )
    def test_values_out_of_range_change_nothing(self, name: bytes, value: float) -> None:
        ground = Ground()
        (told,) = [
            m
            for m in ground.ask(dialect.MAVLink_param_set_message(1, 1, name, value, 9))
            if m.get_type() == "PARAM_VALUE"
        ]
        assert told.param_value == DEFAULTS[name.decode()][0]

    def test_wrong_ones_at_the_border(self) -> None:
        for wrong in ({"NO_SUCH": 1.0}, {"WP_SPEED": math.nan}, {"SCHED_LOOP_RATE": 1.0}):
            with pytest.raises(ValueError, match="parameter "):
                RoverEmulator(parameters=wrong)


@pytest.mark.parametrize("enough", [100_000, pytest.param(1_000_000, marks=pytest.mark.long)])
def test_frames_with_random_content(enough: int) -> None:
    """Right CRC, random payloads of every kind, some junk between.

    The rover answers or ignores, and goes on.
    """
    noise, ground = random.Random(5), Ground()
    ground.guided()
    kinds = [kind for kind in dialect.mavlink_map.values() if kind.unpacker.size]
    handled = [kind for kind in kinds if kind.msgname in ground.rover._protocol._handlers]
    assert len(handled) == len(ground.rover._protocol._handlers)
    size = 0
    while size < enough:
        chunk = bytearray()
        for _ in range(50):
            kind = noise.choice(handled if noise.random() < 0.7 else kinds)
            payload = bytearray(
                noise.choice(
                    (
                        noise.randbytes(kind.unpacker.size),
                        bytes(kind.unpacker.size),
                        b"\xff" * kind.unpacker.size,
                    )
                )
            )
            head = struct.pack("<BBBBBB", len(payload), 0, 0, 0, 255, 190) + kind.id.to_bytes(
                3, "little"
            )
            chunk += (
                b"\xfd"
                + head
                + payload
                + struct.pack("<H", crc16_mcrf4xx(head + payload + bytes((kind.crc_extra,))))
            )
            chunk += noise.randbytes(noise.choice((0, 0, 0, 30)))
        size += len(chunk)
        ground.heard.clear()
        ground.rover.receive(bytes(chunk), ground.now)
        ground.run(0.02)
        assert all(map(math.isfinite, (*ground.rover.pose, *ground.rover.velocity)))
    assert ground.rover.counters["frames_in"] > 0.008 * enough
    ground.run(10.0)
    assert ground.of("HEARTBEAT")


class TestOther:
    """What is not emulated is answered as the protocol says, not with silence."""

    def test_unknown_commands_are_unsupported(self) -> None:
        ground = Ground()
        for command in (22, 178, 183, 31010):
            assert ground.command(command, 1.0) == UNSUPPORTED

    def test_commands_with_integers(self) -> None:
        ground = Ground()
        ground.run(3.0)
        answers = ground.ask(
            dialect.MAVLink_command_int_message(1, 1, 0, 400, 0, 0, 1.0, 0.0, 0.0, 0.0, 0, 0, 0.0)
        )
        assert [m.result for m in answers if m.get_type() == "COMMAND_ACK"] == [ACCEPTED]

    def test_missions(self) -> None:
        ground = Ground()
        (count,) = [
            m
            for m in ground.ask(dialect.MAVLink_mission_request_list_message(1, 1))
            if m.get_type() == "MISSION_COUNT"
        ]
        assert (count.count, count.target_system) == (0, 255)
        (ack,) = [
            m
            for m in ground.ask(dialect.MAVLink_mission_count_message(1, 1, 3))
            if m.get_type() == "MISSION_ACK"
        ]
        assert ack.type == dialect.MAV_MISSION_UNSUPPORTED
        (ack,) = [
            m
            for m in ground.ask(dialect.MAVLink_mission_clear_all_message(1, 1))
            if m.get_type() == "MISSION_ACK"
        ]
        assert ack.type == dialect.MAV_MISSION_ACCEPTED

    def test_file_transfer(self) -> None:
        payload = bytes((5, 0, 0, 4, 3, 0, 0, 0, 0, 0, 0, 0)) + b"abc"
        asked = dialect.MAVLink_file_transfer_protocol_message(
            0, 1, 1, tuple(payload.ljust(251, b"\0"))
        )
        (nak,) = [m for m in Ground().ask(asked) if m.get_type() == "FILE_TRANSFER_PROTOCOL"]
        assert tuple(nak.payload[:13]) == (6, 0, 0, 129, 1, 4, 0, 0, 0, 0, 0, 0, 7)

    def test_messages_for_other_vehicles_are_left_alone(self) -> None:
        ground = Ground()
        ground.run(3.0)
        answers = ground.ask(
            dialect.MAVLink_command_long_message(2, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
        )
        assert not [m for m in answers if m.get_type() == "COMMAND_ACK"]
        assert not ground.rover.armed

    def test_a_reboot_forgets_all_but_the_parameters(self) -> None:
        ground = Ground()
        ground.guided()
        assert ground.command(246, 1.0) == FAILED, "not while armed"
        ground.rover.parameters.set("WP_SPEED", 1.5)
        ground.rover.pilot_arm(False)
        assert ground.command(246, 1.0) == ACCEPTED
        assert (ground.rover.reboots, ground.rover.mode, ground.rover.parameters["WP_SPEED"]) == (
            1,
            "MANUAL",
            1.5,
        )
        ground.run(0.1)
        assert not ground.rover.pilot_arm()

    def test_a_stall_of_the_emulator_is_not_made_up_for(self) -> None:
        ground = Ground()
        ground.guided()
        ground.drive(0.5, 0.0, 3.0)
        x = ground.rover.pose[0]
        ground.now += 100.0
        ground.heard.clear()
        ground.rover.step()
        assert ground.rover.pose[0] - x < 0.1
        assert len(ground.of("HEARTBEAT")) <= 1
