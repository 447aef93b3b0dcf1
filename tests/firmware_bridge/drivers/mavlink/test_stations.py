"""What a ground station may send while the bridge drives, and while a pilot does."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from firmware_bridge.drivers.mavlink.codec import MavlinkCodec
from firmware_bridge.drivers.mavlink.stations import StationRules

COMMAND = dialect.MAVLink_command_long_message
INT = dialect.MAVLink_command_int_message
ITEM = dialect.MAVLink_mission_item_int_message
STREAM = dialect.MAVLink_request_data_stream_message


def command(number: int, first: float = 0.0):
    return COMMAND(1, 1, number, 0, first, 0, 0, 0, 0, 0, 0)


PASS = {
    "heartbeat": dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3),
    "parameters": dialect.MAVLink_param_request_list_message(1, 1),
    "parameter": dialect.MAVLink_param_set_message(1, 1, b"WP_SPEED", 0.4, 9),
    "mission": ITEM(1, 1, 3, 3, 16, 0, 1, 0, 0, 0, 0, 474000000, 85000000, 0),
    "mission count": dialect.MAVLink_mission_count_message(1, 1, 4),
    "mode": command(176, 1),
    "old mode": dialect.MAVLink_set_mode_message(1, 1, 4),
    "arm": command(400, 1),
    "return": command(20),
    "stream of no concern": STREAM(1, 1, 2, 4, 1),
    "interval of no concern": command(511, 24),
    "corrections": dialect.MAVLink_gps_rtcm_data_message(0, 10, bytes(180)),
    "time": dialect.MAVLink_timesync_message(0, 5),
}
WHILE_DRIVING = {
    "joystick": dialect.MAVLink_manual_control_message(1, 1000, 0, 500, 0, 0),
    "radio": dialect.MAVLink_rc_channels_override_message(1, 1, *[1500] * 8),
    "go there": INT(1, 1, 6, 192, 0, 0, 0.5, 1, 0, 0, 474000000, 85000000, 0),
    "guided item": ITEM(1, 1, 0, 3, 16, 2, 1, 0, 0, 0, 0, 474000000, 85000000, 0),
    "old guided item": dialect.MAVLink_mission_item_message(
        1, 1, 0, 3, 16, 2, 1, 0, 0, 0, 0, 47.4, 8.5, 0
    ),
    "speed": command(178, 1),
    "reverse": command(194, 1),
    "motor test": command(209, 1),
    "origin": dialect.MAVLink_set_gps_global_origin_message(1, 474000000, 85000000, 0),
    "pose": dialect.MAVLink_vision_position_estimate_message(1, 9.0, 9.0, 0, 0, 0, 0),
    "all streams": STREAM(1, 1, 0, 4, 1),
    "position stream": STREAM(1, 1, 6, 4, 1),
    "slower poses": command(511, 32),
}
NEVER = {
    "velocity": dialect.MAVLink_set_position_target_local_ned_message(
        1, 1, 1, 8, 0x5C7, 0, 0, 0, 0.5, 0, 0, 0, 0, 0, 0, 0
    ),
    "place": dialect.MAVLink_set_position_target_global_int_message(
        1, 1, 1, 6, 0x5C7, 474000000, 85000000, 0, 0, 0, 0, 0, 0, 0, 0, 0
    ),
    "attitude": dialect.MAVLink_set_attitude_target_message(1, 1, 1, 0, [1, 0, 0, 0], 0, 0, 0, 0.5),
    "key": dialect.MAVLink_setup_signing_message(1, 1, bytes(32), 1),
}


def judged(message, holds: bool, version: int = 2, key: bytes | None = None) -> str:
    station = MavlinkCodec(255, 190, key=key, wall_time=1.7e9)
    rules = StationRules((1, 1), lambda: holds)
    (frame,) = rules.cut()(station.encode(message, version), 1.0)
    assert frame == bytes(frame) and len(frame) > 8
    return rules.judge(frame)


@pytest.mark.parametrize("version", [1, 2])
def test_what_passes_and_what_does_not(version: int) -> None:
    for holds in (True, False):
        for name, message in PASS.items():
            assert judged(message, holds, version) == "", name
        for name, message in WHILE_DRIVING.items():
            assert bool(judged(message, holds, version)) is holds, name
        for name, message in NEVER.items():
            if version == 2 or message.get_msgId() < 256:
                assert judged(message, holds, version), name


def test_no_station_speaks_in_the_vehicles_name_and_noise_is_no_frame() -> None:
    rules = StationRules((1, 1), lambda: False)
    frame = MavlinkCodec(1, 1).encode(PASS["heartbeat"])
    assert "own name" in rules.judge(frame)
    assert list(rules.cut()(b"\xfd" * 500 + b"\xfe\x00", 1.0)) == []


def test_our_signatures_count_apart_from_those_of_a_station_with_our_ids() -> None:
    """QGroundControl and MAVProxy sign on links 0 and up."""
    codec = MavlinkCodec(255, 190, key=bytes(32), wall_time=1.7e9)
    link = codec.encode(PASS["heartbeat"])[-13]
    assert link > 16
