"""Whatever else a ground station says to the emulated rover is answered as the protocol says."""

import math

import pytest
from ground_station import ACCEPTED, Ground
from mavlink_rig import dialect

from kmpc_lab.emulator.rover.parameters import DEFAULTS


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


class TestOther:
    """What is not emulated is answered as the protocol says, not with silence."""

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
