"""The [board] table."""

from pathlib import Path

import pytest

from firmware_bridge.drivers.mavlink.options import MavlinkOptions
from firmware_bridge.messages import ConfigError


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
