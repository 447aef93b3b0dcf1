"""The pair of files that ROS's map_server writes: map.yaml, and the PGM image that it names."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.errors import ProblemError

OCCUPIED, FREE, UNKNOWN = 100, 0, -1
LIMITS = {"occupied_thresh": 0.65, "free_thresh": 0.196}
"""map_server's own, for a file without them."""
MOST_BYTES = 2**28


def read_map(path: Path) -> tuple[NDArray[np.int8], float, tuple[float, ...]]:
    """Read a map's cells, resolution and origin.

    The cells (height, width) are -1, 0 or 100, with the lowest row first; the resolution is in [m],
    and the origin is x, y [m] and yaw [rad].

    Raises
    ------
    ProblemError
        Names the file, and what is wrong with it.
    """
    fields = _fields(_read(path).decode("utf-8", "replace"))
    for key in ("image", "resolution", "origin"):
        if key not in fields:
            raise ProblemError(
                f"{path}: {key}: missing; "
                "expected image, resolution and origin, as map_server writes them"
            )
    if fields.get("mode", "trinary") != "trinary":
        raise ProblemError(f"{path}: mode: only trinary maps are read, got {fields['mode']!r}")
    origin = tuple(_number(path, "origin", v) for v in fields["origin"].strip("[]").split(","))
    if len(origin) not in (2, 3):
        raise ProblemError(f"{path}: origin: expected [x, y, yaw], got {fields['origin']!r}")
    limits = {
        key: _number(path, key, fields.get(key, str(default))) for key, default in LIMITS.items()
    }
    image = path.parent / fields["image"].strip("\"'")
    dark = _read_pgm(image)
    if _number(path, "negate", fields.get("negate", "0")) == 0.0:
        dark = 1.0 - dark
    cells = np.full(dark.shape, UNKNOWN, dtype=np.int8)
    cells[dark > limits["occupied_thresh"]] = OCCUPIED
    cells[dark < limits["free_thresh"]] = FREE
    # an image begins at the top, a grid at the bottom
    return cells[::-1], _number(path, "resolution", fields["resolution"]), origin


def _fields(text: str) -> dict[str, str]:
    """Keys and values of a flat YAML file; a list over several lines is joined."""
    joined = re.sub(
        r"\[[^\]]*\]",
        lambda found: " ".join(found.group().split()),
        re.sub(r"(?m)(^|\s)#.*$", "", text),
    )
    joined = re.sub(
        r"(?m)^(\w+):\s*\n((?:\s*-\s+\S+\s*\n?)+)",
        lambda found: f"{found[1]}: {_listed(found[2])}\n",
        joined,
    )
    return {key: value.strip() for key, value in re.findall(r"(?m)^(\w+):[ \t]*(.*)$", joined)}


def _listed(block: str) -> str:
    return "[" + ", ".join(re.findall(r"-\s+(\S+)", block)) + "]"


def _number(path: Path, key: str, value: str) -> float:
    text = value.strip().lower()
    try:
        return float(text == "true") if text in ("true", "false") else float(text)
    except ValueError as error:
        raise ProblemError(f"{path}: {key}: expected a number, got {value.strip()!r}") from error


def _read(path: Path) -> bytes:
    try:
        if path.stat().st_size > MOST_BYTES:
            raise ProblemError(f"{path}: larger than {MOST_BYTES:,} bytes")
        return path.read_bytes()
    except OSError as error:
        raise ProblemError(f"{path}: cannot read the map: {error.strerror or error}") from error


def _read_pgm(path: Path) -> NDArray[np.float64]:
    """Brightness (height, width) from 0 (black) to 1 of a PGM image, binary (P5) or plain (P2)."""
    content = _read(path)
    header = re.match(rb"(P[25])" + 3 * rb"(?:\s+|\s*#[^\n]*\n\s*)+(\d+)" + rb"\s", content)
    if header is None:
        raise ProblemError(f"{path}: expected a PGM image (P5 or P2); convert other formats first")
    kind, width, height, most = header[1], *(int(v) for v in header.groups()[1:])
    if not (0 < most < 65536 and 0 < width * height <= MOST_BYTES):
        raise ProblemError(
            f"{path}: expected a PGM image, got {width} x {height} of values up to {most}"
        )
    body = content[header.end() :]
    if kind == b"P5":
        pixels = np.frombuffer(
            body[: len(body) - len(body) % (2 if most > 255 else 1)],
            dtype=">u2" if most > 255 else "u1",
        )
    else:
        try:
            pixels = np.array(body.split(), dtype=np.int64)
        except ValueError as error:
            raise ProblemError(f"{path}: expected whole numbers in a plain PGM image") from error
    if len(pixels) < width * height:
        raise ProblemError(
            f"{path}: expected {width} x {height} pixels, the file ends after {len(pixels)}"
        )
    return pixels[: width * height].reshape(height, width) / most
