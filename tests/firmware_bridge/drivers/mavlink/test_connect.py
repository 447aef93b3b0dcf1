"""A driver that cannot connect says what a user can do."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from mavlink_rig import other
from rover_link import READY

from firmware_bridge.drivers.mavlink.driver import MavlinkDriver
from firmware_bridge.drivers.mavlink.options import MavlinkOptions
from firmware_bridge.link import open_transport
from firmware_bridge.messages import ConfigError, LinkError
from kmpc_lab.emulator.rover.rover import RoverEmulator


class TestNobodyThere:
    """Each failure to connect says what a user can do."""

    def fails(
        self, url: str, closing: Callable[..., None], timeout: float = 0.3, **options: object
    ) -> str:
        driver = MavlinkDriver(open_transport(url), MavlinkOptions(**options))  # type: ignore[arg-type]
        closing(driver)
        with pytest.raises(LinkError) as caught:
            driver.connect(timeout)
        assert "\n" not in str(caught.value)
        return str(caught.value)

    def serve(self, data: bytes, closing: Callable[..., None]) -> str:
        server = socket.create_server(("127.0.0.1", 0))
        closing(server)

        def talk() -> None:
            peer, _ = server.accept()
            closing(peer)
            peer.sendall(data)

        threading.Thread(target=talk, daemon=True).start()
        return f"tcp:127.0.0.1:{server.getsockname()[1]}"

    def test_not_mavlink(self, closing: Callable[..., None]) -> None:
        assert "no frame: is the baud rate right" in self.fails(
            self.serve(b"hello" * 50, closing), closing
        )

    def test_another_system(self, tcp: str, closing: Callable[..., None]) -> None:
        rover = RoverEmulator(**READY)  # type: ignore[arg-type]
        closing(rover)
        rover.start(tcp)
        assert "frames of other systems: is the id right?" in self.fails(
            tcp, closing, 1.5, system=5
        )

    def test_another_vehicle(self, closing: Callable[..., None]) -> None:
        from mavlink_rig import dialect

        copter = other(1).encode(dialect.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3))
        assert "system 1 is no ArduPilot rover: autopilot 3, type 2" in self.fails(
            self.serve(copter, closing), closing, 5.0
        )

    def test_a_vehicle_that_answers_nothing(self, closing: Callable[..., None]) -> None:
        from mavlink_rig import dialect

        rover = other(1).encode(dialect.MAVLink_heartbeat_message(10, 3, 0, 0, 4, 3))
        assert "answers no request" in self.fails(self.serve(rover, closing), closing)

    def test_the_wrong_key(self, tcp: str, tmp_path: Path, closing: Callable[..., None]) -> None:
        key = tmp_path / "key"
        key.write_bytes(bytes(32))
        key.chmod(0o600)
        rover = RoverEmulator(**READY, key=bytes(range(32)))  # type: ignore[arg-type]
        closing(rover)
        rover.start(tcp)
        assert "wrongly signed frames: is board.key_file the vehicle's key?" in self.fails(
            tcp, closing, 1.5, key_file=str(key)
        )
        assert rover.counters["bad_signature"] > 0


@pytest.mark.parametrize("table", [{"system": 1}, {"board": {"systems": 1}}, {"board": 5}])
def test_robot_files_that_are_wrong(table: dict[str, object]) -> None:
    with pytest.raises(ConfigError, match="system|board"):
        MavlinkDriver.from_options(open_transport("tcp:127.0.0.1:1"), table)


@pytest.mark.parametrize(
    ("table", "key"),
    [
        ({"system": "1"}, "board.system"),
        ({"own_system": 1, "own_component": 1}, "board.own_system"),
        ({"role": "pilot"}, "board.role"),
        ({"pose": "gps"}, "board.pose"),
        ({"rate": 0}, "board.rate"),
        ({"arm": "yes"}, "board.arm"),
        ({"origin": [1.0, 2.0]}, "board.origin"),
        ({"key_file": 5}, "board.key_file"),
        ({"key_file": "/does/not/exist"}, "board.key_file"),
    ],
)
def test_what_is_wrong_is_named(table: dict[str, object], key: str) -> None:
    with pytest.raises(ConfigError, match=f"^{key}: "):
        MavlinkOptions.from_table(table)


def test_key_files(tmp_path: Path) -> None:
    path, key = tmp_path / "key", bytes(range(32))
    for content in (key, key.hex().encode(), key.hex().upper().encode() + b"\n"):
        path.write_bytes(content)
        path.chmod(0o600)
        assert MavlinkOptions.from_table({"key_file": str(path)}).read_key() == key
    for content in (b"", key[:31], b"zz" * 32):
        path.write_bytes(content)
        with pytest.raises(ConfigError, match="expected 32 bytes or 64 hexadecimal digits"):
            MavlinkOptions.from_table({"key_file": str(path)})
    path.write_bytes(key)
    path.chmod(0o640)
    with pytest.raises(ConfigError, match="chmod 600"):
        MavlinkOptions.from_table({"key_file": str(path)})
