"""Files that are nearly right: a seeded mutator of bytes, numbers, archives and headers."""

from __future__ import annotations

import io
import json
import re
from typing import Any

import numpy as np

TOKENS = [
    *(b"nan", b"-inf", b"1e999", b"1e308", b"-1e308", b"1e-320", b"-1", b"0", b"-0.0", b"1e7"),
    *(
        b"9" * 400,
        b"9" * 5000,
        b"0x" + b"f" * 5000,
        b"1_0",
        b"True",
        b"true",
        b"null",
        b"1979-05",
    ),
    *(b"[", b"]", b"[[", b"{", b"}", b"=", b".", b",", b"#", b'"', b"'", b'"""', b"'''", b"\\"),
    *(b"\n", b"\r", b"\r\n", b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\xc3", b"\x1b[2J", b"\t", b" "),
    *(b"[" * 3000, b"a." * 300, b"/dev/zero", b"../../etc/passwd", b"\xed\xa0\x80", b"\x7f"),
    *(b"PK\x01\x02", b"PK\x05\x06", b"\x93NUMPY", b"P5", b"P2", b"\xfd", b"\xfe", b"\xff" * 8),
]
VALUES: list[Any] = [
    *(None, True, False, 0, -1, 1e308, -1e308, 1e-320, float("nan"), float("inf"), 10**30, 2**63),
    *(
        "",
        "x",
        "\0",
        "both \" and '",
        "\u2028",
        [],
        {},
        [[]],
        [None],
        {"": 0},
        [1, 2, 3],
        "1" * 99,
    ),
]
NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


class Mutator:
    """Changes files; the same seed gives the same changes."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)

    def below(self, count: int) -> int:
        return int(self.random.integers(max(count, 1)))

    def one_of(self, things: Any) -> Any:
        return things[self.below(len(things))]

    def file(self, content: bytes) -> bytes:
        """Change a file in one place or a few."""
        archive = content.startswith(b"PK")
        for _ in range(1 + self.below(3)):
            if archive and self.random.random() < 0.7:
                content = self.archive(content)
                archive = content.startswith(b"PK")
            elif not archive and self.random.random() < 0.4:
                content = self.number(content)
            else:
                content = self.bytes(content)
        return content

    def bytes(self, content: bytes) -> bytes:
        """Change bytes, whatever they mean."""
        a, b = sorted((self.below(len(content) + 1), self.below(len(content) + 1)))
        match self.below(8):
            case 0:
                return content[:a] + content[b:]
            case 1:
                return content[:a]
            case 2:
                return content[:b] + content[a:]
            case 3:
                return content[:a] + self.one_of(TOKENS) + content[a:]
            case 4:
                return content[:a] + self.one_of(TOKENS) + content[a + self.below(9) :]
            case 5:
                return content[:a] + content[a : a + 40] * self.below(400) + content[a:]
            case 6:
                return content[:a] + self.random.bytes(self.below(9)) + content[a:]
            case _:
                flipped = bytearray(content)
                for _ in range(1 + self.below(4)):
                    if flipped:
                        flipped[self.below(len(flipped))] ^= 1 << self.below(8)
                return bytes(flipped)

    def number(self, content: bytes) -> bytes:
        """Put something else in a number's place."""
        found = list(NUMBER.finditer(content))
        if not found:
            return self.bytes(content)
        place = self.one_of(found)
        return content[: place.start()] + self.one_of(TOKENS) + content[place.end() :]

    def archive(self, content: bytes) -> bytes:
        """Change an array of an npz archive, or its header of JSON."""
        try:
            with np.load(io.BytesIO(content), allow_pickle=False) as file:
                arrays = dict(file)
        except Exception:  # it was changed before
            return self.bytes(content)
        name = self.one_of(list(arrays))
        if name == "header" and self.random.random() < 0.9:
            try:
                header = json.loads(str(arrays[name]))
                arrays[name] = np.array(json.dumps(self.value(header)))
            except (ValueError, TypeError):
                arrays[name] = np.array("{")
        elif self.random.random() < 0.1:
            del arrays[name]
        else:
            arrays[name] = self.array(arrays[name])
        out = io.BytesIO()
        self.one_of((np.savez, np.savez_compressed))(out, **arrays)
        return out.getvalue()

    def array(self, array: np.ndarray) -> np.ndarray:
        """Change the type, shape or values of an array."""
        match self.below(6):
            case 0:
                kind = self.one_of(("i1", "u8", "f2", "c16", "b1", "U5", "S3", "M8[s]", ">f8"))
                try:
                    return array.astype(kind)
                except (ValueError, TypeError, RuntimeError):
                    return np.zeros(array.shape, kind)
            case 1:
                return array[..., None] if self.below(2) else array[None]
            case 2:
                return array.ravel()[: self.below(array.size + 1)]
            case 3:
                return np.concatenate([array.ravel()] * self.below(4) or [np.zeros(0)])
            case 4:
                return array.T
            case _:
                if array.dtype.kind != "f" or not array.size:
                    return np.zeros(self.below(5))
                changed = array.copy().ravel()
                value = self.one_of((np.nan, np.inf, 1e308, -1e308, 1e-320, 0.0, -1.0, 1e13))
                changed[self.below(changed.size) :: 1 + self.below(changed.size)] = value
                return changed.reshape(array.shape)

    def value(self, value: Any) -> Any:
        """Put something else somewhere into a tree of lists and tables."""
        if isinstance(value, dict) and value and self.random.random() < 0.9:
            key = self.one_of(sorted(value))
            if self.random.random() < 0.1:
                return {k: v for k, v in value.items() if k != key}
            return {**value, key: self.value(value[key])}
        if isinstance(value, list) and value and self.random.random() < 0.8:
            place = self.below(len(value))
            return [*value[:place], self.value(value[place]), *value[place + 1 :]]
        if isinstance(value, str) and "\n" in value and self.random.random() < 0.8:
            return self.number(value.encode()).decode("utf-8", "replace")
        return self.one_of(VALUES)
