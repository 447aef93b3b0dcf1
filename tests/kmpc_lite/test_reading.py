"""Files of strangers are read in bounded time and memory, or refused in one line."""

from __future__ import annotations

import errno
import os
import time
from pathlib import Path

import pytest

import kmpc_lite as kl
from kmpc_lite.errors import KmpcError
from kmpc_lite.reading import MAX_TOML_VALUES, open_regular, parse_toml, read_bytes, text_lines


@pytest.mark.parametrize("kind", ["device", "pipe", "socket", "folder", "missing", "zero", "half"])
def test_anything_else_is_refused_at_once(tmp_path: Path, kind: str) -> None:
    path: Path | str = tmp_path / "it"
    match kind:
        case "device":
            path = "/dev/zero"
        case "pipe":
            os.mkfifo(path)
        case "socket":
            import socket

            socket.socket(socket.AF_UNIX).bind(str(path))
        case "folder":
            path = tmp_path
        case "zero":
            path = f"{path}\0"
        case "half":
            path = f"{path}\ud800"
    before = len(os.listdir("/proc/self/fd"))
    with pytest.raises(
        OSError, match=r"not a regular file|Is a directory|No such|null byte|surrogates"
    ) as e:
        open_regular(path)
    assert e.value.errno in (errno.EINVAL, errno.EISDIR, errno.ENOENT)
    assert len(os.listdir("/proc/self/fd")) == before


def test_a_file_that_reports_no_size_is_bounded_too() -> None:
    with pytest.raises(OSError, match="larger than 10 bytes"):
        read_bytes("/proc/self/maps", 10)


def test_lines_have_any_ends_and_a_bound(tmp_path: Path) -> None:
    path = tmp_path / "lines"
    path.write_bytes(b"\xef\xbb\xbfa\r\nb\rc\xff\nlast")
    assert list(text_lines(path, 5)) == ["a\n", "b\n", "c\ufffd\n", "last"]
    with pytest.raises(ValueError, match="line 4: longer than 3 characters"):
        list(text_lines(path, 3))
    with open(path, "wb") as file:
        file.truncate(2**40)  # a file of a terabyte that takes no place, and has no line end
    with pytest.raises(ValueError, match="line 1: longer than 1,000 characters"):
        list(text_lines(path, 1000))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("a = " + 10**5 * "[", "nested too deeply"),
        ("a = " + 5000 * "1", "4300 digits"),
        ("a" + 10**5 * ".a" + " = 1", "a key of more than 8 parts"),
        ("a = {" + 9 * "'b' . " + "b = 1}", "a key of more than 8 parts"),
        ('# it\'s\na = [{x = """a"""", ' + 9 * "b." + "b = 1}]", "a key of more than 8 parts"),
        ("a = [" + MAX_TOML_VALUES * "1," + "]", "longer than"),
        ('a = ["' + MAX_TOML_VALUES * "x" + '"]', "longer than"),
        ("a", "Expected '='"),
    ],
)
def test_toml_that_would_take_hours_or_memory_is_refused(text: str, told: str) -> None:
    begun = time.process_time()
    with pytest.raises(ValueError, match=told) as error:
        parse_toml(text)
    assert "\n" not in str(error.value)
    assert time.process_time() - begun < 5.0


@pytest.mark.parametrize("kind", [KmpcError, kl.DataError, kl.ScenarioError])
def test_a_name_with_a_line_break_breaks_no_message(kind):
    told = str(kind("message ve\nicle\x1b[2J: expected µm"))
    assert told == "message ve\\nicle\\x1b[2J: expected µm"
