"""Files that are nearly right: a seeded mutator of bytes, numbers, archives and headers."""

from __future__ import annotations

import io
import json
import re
from typing import Any

import numpy as np

TOKENS = [
    *b"nan|-inf|1e999|1e308|-1e308|1e-320|-1|0|-0.0|1e7|1_0|True|true|null|1979-05".split(b"|"),
    *b"[ ] [[ { } = . , # \" ' \"\"\" ''' \\ /dev/zero ../../etc/passwd P5 P2".split(b" "),
    *(b"\n", b"\r", b"\r\n", b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\xc3", b"\x1b[2J", b"\t", b" "),
    *(b"9" * 400, b"9" * 5000, b"0x" + b"f" * 5000, b"[" * 3000, b"a." * 300),
    *(b"\xed\xa0\x80", b"\x7f", b"PK\x01\x02", b"PK\x05\x06", b"\x93NUMPY", b"\xff" * 8),
]
VALUES: list[Any] = [
    *(None, True, False, 0, -1, 1e308, -1e308, 1e-320, float("nan"), float("inf"), 10**30, 2**63),
    *("", "x", "\0", "both \" and '", "\u2028", [], {}, [[]], [None], {"": 0}, [1, 2, 3], "1" * 99),
]
NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
KINDS = ("i1", "u8", "f2", "c16", "b1", "U5", "S3", "M8[s]", ">f8")


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
        for _ in range(1 + self.below(3)):
            if content.startswith(b"PK") and self.random.random() < 0.7:
                content = self.archive(content)
            else:
                content = (
                    self.number(content) if self.random.random() < 0.4 else self.bytes(content)
                )
        return content

    def bytes(self, content: bytes) -> bytes:
        """Change bytes, whatever they mean: cut, repeat, put in, or flip some."""
        a, b = sorted((self.below(len(content) + 1), self.below(len(content) + 1)))
        flipped = bytearray(content)
        for _ in range(1 + self.below(4) if flipped else 0):
            flipped[self.below(len(flipped))] ^= 1 << self.below(8)
        begin, token = content[:a], self.one_of(TOKENS)
        return self.one_of(
            (
                begin + content[b:],
                begin,
                content[:b] + content[a:],
                begin + token + content[a + self.below(9) * self.below(2) :],
                begin + content[a : a + 40] * self.below(400) + content[a:],
                begin + self.random.bytes(self.below(9)) + content[a:],
                bytes(flipped),
            )
        )

    def number(self, content: bytes) -> bytes:
        """Put something else in a number's place."""
        if not (found := list(NUMBER.finditer(content))):
            return self.bytes(content)
        place = self.one_of(found)
        return content[: place.start()] + self.one_of(TOKENS) + content[place.end() :]

    def archive(self, content: bytes) -> bytes:
        """Change an array of an npz archive, or its header of JSON."""
        try:
            with np.load(io.BytesIO(content), allow_pickle=False) as file:
                arrays = dict(file)
            name = self.one_of(list(arrays))
            if name == "header":
                arrays[name] = np.array(json.dumps(self.value(json.loads(str(arrays[name])))))
            elif self.random.random() < 0.1:
                del arrays[name]
            else:
                arrays[name] = self.array(arrays[name])
        except Exception:  # it was changed before
            return self.bytes(content)
        out = io.BytesIO()
        np.savez_compressed(out, **arrays)
        return out.getvalue()

    def array(self, array: np.ndarray) -> np.ndarray:
        """Change the type, shape or values of an array."""
        flat = array.ravel()
        match self.below(5):
            case 0:
                return np.zeros(array.shape, self.one_of(KINDS))
            case 1:
                return array[..., None] if self.below(2) else array.T
            case 2:
                return flat[: self.below(array.size + 1)]
            case 3:
                return np.concatenate([flat] * (1 + self.below(4)))
            case _:
                changed = flat.astype(float)
                value = self.one_of((np.nan, np.inf, 1e308, -1e308, 1e-320, 0.0, -1.0, 1e13))
                changed[self.below(changed.size) :: 1 + self.below(changed.size)] = value
                return changed.reshape(array.shape)

    def value(self, value: Any) -> Any:
        """Put something else somewhere into a tree of lists and tables."""
        if isinstance(value, dict) and value and self.random.random() < 0.9:
            key = self.one_of(sorted(value))
            gone = self.random.random() < 0.1
            changed = {} if gone else {key: self.value(value[key])}
            return {**{k: v for k, v in value.items() if k != key}, **changed}
        if isinstance(value, list) and value and self.random.random() < 0.8:
            place = self.below(len(value))
            return [*value[:place], self.value(value[place]), *value[place + 1 :]]
        if isinstance(value, str) and "\n" in value and self.random.random() < 0.8:
            return self.number(value.encode()).decode("utf-8", "replace")
        return self.one_of(VALUES)
