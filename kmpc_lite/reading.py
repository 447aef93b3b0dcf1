"""Files of strangers: regular ones only, in bounded time and memory.

Whatever reads a file reads it through here. A device, a pipe or a folder is refused before a byte
of it is read; a file without an end, or a line without one, is refused at its bound.
"""

from __future__ import annotations

import codecs
import errno
import io
import os
import re
import stat
import tomllib
from collections.abc import Generator
from typing import Any, BinaryIO

MAX_TOML_BYTES = 2**23  # longest TOML file that is read ...
MAX_TOML_VALUES = 2**19
"""... and how much of it may be anything but grids that are drawn in it [characters]: values take
time."""
MAX_KEY_PARTS = 8
"""Parts of the longest dotted key: the time that a key takes grows with their square."""
_PART = r"""(?:[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')"""
_TOKENS = re.compile(
    rf"""\#[^\n]*+
    |\"\"\"(?:[^"\\]|\\.|"(?!""))*+"{{0,5}}+
    |'''(?:[^']|'(?!''))*+'{{0,5}}+
    |(?P<long_key>(?:{_PART}[ \t]*+\.[ \t]*+){{{MAX_KEY_PARTS}}})
    |{_PART}|["'][^\n]*+|[^\w"'\#-]++""",
    re.VERBOSE | re.DOTALL,
)
_DRAWN = re.compile(r'"[.#?]*+"')


def open_regular(path: str | os.PathLike[str], most: int | None = None) -> BinaryIO:
    """Open a regular file for reading.

    `path`: symbolic links are followed. `most`: largest size that is accepted [bytes]. Raises
    OSError for a file that cannot be opened, is no regular file, or is larger; its `strerror` says
    which.
    """
    try:
        # looked at before it is opened, too: opening a serial port resets some boards
        _check_kind(os.stat(path).st_mode)
        # without O_NONBLOCK a pipe without a writer would block the program here
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    except ValueError as error:  # a zero byte, or half a surrogate pair
        raise OSError(errno.EINVAL, str(error)) from error
    try:
        found = os.fstat(descriptor)
        _check_kind(found.st_mode)
        if most is not None and found.st_size > most:
            raise _too_large(most)
        return os.fdopen(descriptor, "rb")
    except OSError:
        os.close(descriptor)
        raise


def _check_kind(mode: int) -> None:
    if stat.S_ISDIR(mode):
        raise OSError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "not a regular file")


def _too_large(most: int) -> OSError:
    return OSError(errno.EFBIG, f"larger than {most:,} bytes")


def read_bytes(path: str | os.PathLike[str], most: int) -> bytes:
    """Read a whole regular file of bounded size; raises OSError for any other."""
    with open_regular(path, most) as file:
        content = file.read(most + 1)
    if len(content) > most:  # some files tell no size, as those of /proc
        raise _too_large(most)
    return content


def text_lines(path: str | os.PathLike[str], longest: int) -> Generator[str, None, None]:
    """Yield the lines of a text file, with their ends, whatever these are.

    A byte order mark is left out, and tells UTF-16; bytes that are not UTF-8 become replacement
    characters.

    `path`: a regular file. `longest`: characters of the longest line that is accepted. Raises
    OSError if the file cannot be read. Raises ValueError for a longer line; names it.
    """
    with open_regular(path) as content:
        begins = content.read(2)
        content.seek(0)
        wide = begins in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
        file = io.TextIOWrapper(content, "utf-16" if wide else "utf-8-sig", errors="replace")
        number = 0
        while line := file.readline(longest + 1):
            number += 1
            if len(line) > longest:
                raise ValueError(f"line {number}: longer than {longest:,} characters")
            yield line


def read_toml(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read a TOML file; see `parse_toml`.

    Raises OSError if the file cannot be read, or is longer than `MAX_TOML_BYTES`. Raises ValueError
    for what is not TOML.
    """
    return parse_toml(read_bytes(path, MAX_TOML_BYTES).decode("utf-8"))


def parse_toml(text: str) -> dict[str, Any]:
    """Parse TOML that may take a second, not an hour; raises ValueError, in one line, for others.

    >>> parse_toml("a.b = [1, 2]")
    {'a': {'b': [1, 2]}}
    >>> parse_toml("a = " + 10**5 * "[")
    Traceback (most recent call last):
    ValueError: nested too deeply
    """
    if len(text) > MAX_TOML_BYTES or len(_DRAWN.sub("", text)) > MAX_TOML_VALUES:
        raise ValueError(
            f"longer than {MAX_TOML_VALUES:,} characters, grids that are drawn in it aside"
        )
    # each token is looked at once, so this ends soon where the parser would not
    if any(token.lastgroup for token in _TOKENS.finditer(text)):
        raise ValueError(f"a key of more than {MAX_KEY_PARTS} parts")
    try:
        table = tomllib.loads(text)
    except RecursionError:
        raise ValueError("nested too deeply") from None
    _check_whole_numbers(table)
    return table


def _check_whole_numbers(value: Any) -> None:
    """Refuse whole numbers that no float holds, and some of which Python could not even print."""
    if isinstance(value, int) and value.bit_length() > 1000:
        raise ValueError("a whole number of more than 300 digits")
    items = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    for item in items:
        if isinstance(item, int | list | dict):
            _check_whole_numbers(item)
