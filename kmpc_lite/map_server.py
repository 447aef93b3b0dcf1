"""The pair of files that ROS's map_server writes: map.yaml, and the PGM image that it names."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.errors import ProblemError
from kmpc_lite.reading import read_bytes

OCCUPIED, FREE, UNKNOWN = 100, 0, -1
LIMITS = {"occupied_thresh": 0.65, "free_thresh": 0.196}
"""map_server's own, for a file without them."""
MAP_SAVERS_GREY = 205 / 255  # brightness by which map_saver writes what is unknown
MOST_YAML_BYTES = 2**13  # longest map.yaml
MOST_HEADER_BYTES = 2**16  # longest header of an image
HEADER = re.compile(rb"(P[25])" + 3 * rb"(?:\s++|#[^\n]*+\n)++(\d{1,9}+)" + rb"\s")
"""Possessive: each byte is looked at once, whatever follows."""


def read_map(path: Path, most_cells: int) -> tuple[NDArray[np.int8], float, tuple[float, ...]]:
    """Read a map's cells, resolution and origin.

    The cells (height, width) are -1, 0 or 100, with the lowest row first; the resolution is in [m],
    and the origin is x, y [m] and yaw [rad]. Of an image of more than `most_cells` no pixel is
    read.

    Raises ProblemError: names the file, and what is wrong with it.
    """
    fields = _fields(_read(path, MOST_YAML_BYTES).decode("utf-8", "replace"))
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
    free, occupied = _thresholds(path, fields)
    image = _image(path, fields["image"].strip("\"'"))
    pixels, white = _read_pgm(image, most_cells)
    # of each value, since there are fewer of these than pixels
    dark = np.arange(white + 1) / white
    if _number(path, "negate", fields.get("negate", "0")) == 0.0:
        dark = 1.0 - dark
    cells = np.full(dark.shape, UNKNOWN, dtype=np.int8)
    cells[dark > occupied] = OCCUPIED
    cells[dark < free] = FREE
    grey = round(white * MAP_SAVERS_GREY)
    if cells[grey] == FREE and (pixels == grey).any():
        cells[grey] = UNKNOWN
        warnings.warn(
            f"{path}: free_thresh {free:g} makes the grey {grey} free by which map_saver writes "
            f"what is unknown: it stays unknown; with {LIMITS['free_thresh']:g} nothing is warned",
            stacklevel=2,
        )
    # an image begins at the top, a grid at the bottom
    return cells[pixels][::-1], _number(path, "resolution", fields["resolution"]), origin


def _thresholds(path: Path, fields: dict[str, str]) -> tuple[float, float]:
    """Shares of darkness below which a pixel is free, and above which it is occupied."""
    found = {key: _number(path, key, fields.get(key, str(n))) for key, n in LIMITS.items()}
    for key, value in found.items():
        if not 0.0 <= value <= 1.0:
            percent = f"; {value:g} % would be {value / 100.0:g}" if 1.0 < value <= 100.0 else ""
            raise ProblemError(
                f"{path}: {key}: expected a share from 0 to 1, got {value:g}{percent}"
            )
    free, occupied = found["free_thresh"], found["occupied_thresh"]
    if free >= occupied:
        raise ProblemError(
            f"{path}: expected free_thresh < occupied_thresh, got {free:g} and {occupied:g}"
        )
    return free, occupied


def _image(path: Path, name: str) -> Path:
    """Path of a map's image, which lies in the map's folder or below: a map reads nothing else."""
    own, beside = path.parent / name, path.parent / Path(name).name
    image = beside if Path(name).is_absolute() and beside.is_file() else own
    if "\0" in name or not image.resolve().is_relative_to(path.parent.resolve()):
        raise ProblemError(
            f"{path}: image: expected a file in the map's own folder, got {name!r:.80}"
        )
    if image.resolve() != own.resolve():  # map_saver writes all of the path that it was given
        warnings.warn(f"{path}: image: {beside.name} beside it is read, not {own}", stacklevel=2)
    return image


def _fields(text: str) -> dict[str, str]:
    """Keys and values of a flat YAML file; a list over several lines is joined."""
    joined = re.sub(
        r"\[[^\]]*\]",
        lambda found: " ".join(found.group().split()),
        re.sub(r"(?m)(^|\s)#.*$", "", text),
    )
    joined = re.sub(
        r"(?m)^(\w+):\s*\n((?:\s*-\s+\S+\s*\n?)+)",
        lambda found: f"{found[1]}: [" + ", ".join(re.findall(r"-\s+(\S+)", found[2])) + "]\n",
        joined,
    )
    return {key: value.strip() for key, value in re.findall(r"(?m)^(\w+):[ \t]*(.*)$", joined)}


def _number(path: Path, key: str, value: str) -> float:
    text = value.strip().lower()
    try:
        return float(text == "true") if text in ("true", "false") else float(text)
    except ValueError as error:
        raise ProblemError(f"{path}: {key}: expected a number, got {value.strip()!r}") from error


def _read(path: Path, most: int) -> bytes:
    try:
        return read_bytes(path, most)
    except OSError as error:
        raise ProblemError(f"{path}: cannot read the map: {error.strerror or error}") from error


def _read_pgm(path: Path, most_cells: int) -> tuple[NDArray[Any], int]:
    """Values (height, width) of a PGM image, binary (P5) or plain (P2), and the one of white."""
    # as of plain values of three digits
    content = _read(path, MOST_HEADER_BYTES + 4 * most_cells)
    header = HEADER.match(content, 0, MOST_HEADER_BYTES)
    if header is None:
        told = f"`convert {path.name} {path.stem}.pgm` makes one" if content else "it is empty"
        raise ProblemError(f"{path}: expected a PGM image (P5 or P2); {told}")
    kind, width, height, white = header[1], *(int(v) for v in header.groups()[1:])
    if not (0 < white < 65536 and 0 < width * height <= most_cells):
        raise ProblemError(
            f"{path}: expected a PGM image of at most {most_cells:,} pixels of values up to 65,535,"
            f" got {width} x {height} of values up to {white}"
        )
    pixels = (_binary if kind == b"P5" else _plain)(content[header.end() :], white)
    if pixels is None:
        raise ProblemError(f"{path}: expected whole numbers in a plain PGM image")
    if len(pixels) < width * height:
        raise ProblemError(
            f"{path}: expected {width} x {height} pixels, the file ends after {len(pixels)}"
        )
    # what is brighter than white is white
    return np.minimum(pixels[: width * height], white).reshape(height, width), white


def _binary(body: bytes, white: int) -> NDArray[Any]:
    """Values of a P5 image."""
    kind = np.dtype(">u2" if white > 255 else "u1")
    return np.frombuffer(body, kind, len(body) // kind.itemsize)


def _plain(body: bytes, white: int) -> NDArray[Any] | None:
    """Values of a P2 image; None for anything but whole numbers."""
    if body.translate(None, b"0123456789 \t\r\n\v\f"):
        return None
    values = np.fromstring(body.decode("ascii"), dtype=np.float32, sep=" ")
    return np.minimum(values, white).astype(np.uint16)
