"""Data at the border: arrays checked, archives distrusted, files written whole or not at all."""

from __future__ import annotations

import errno
import io
import math
import os
import zipfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kmpc_lite.errors import KmpcError
from kmpc_lite.reading import open_regular

MAX_ARCHIVE_BYTES = 2**28
"""An archive whose arrays take more memory is refused before a byte of them is unpacked."""
ARCHIVE = b"PK"  # what an archive begins with
SAME_DT = 1e-6
"""Relative difference up to which two periods count as one: the digits of a log's time stamps end
somewhere."""


def real_array(value: ArrayLike, what: str, error: type[KmpcError]) -> NDArray[np.float64]:
    """Convert to a contiguous float array; raises `error`, naming `what`, for anything else."""
    try:
        raw = np.asarray(value)
        if raw.dtype.kind not in "fiubO":
            raise TypeError(f"got {raw.dtype}")
        return np.ascontiguousarray(raw, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as cause:
        raise error(f"{what}: expected an array of real numbers: {cause}") from cause


def read_npz(
    path: str | os.PathLike[str], wanted: Collection[str], most: int = MAX_ARCHIVE_BYTES
) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """Read an npz archive without trusting it.

    No pickle, and of each array its checksum; nothing is unpacked before its size is known.

    `path`: the archive, a regular file. `wanted`: which arrays to unpack, where the archive has
    them. `most`: memory that these may take together [bytes], numbers counted as float64. Returns
    the arrays by name, and the names of all that are there. Raises OSError if the file cannot be
    read. Raises ValueError for whatever is wrong with its content, in one line.
    """
    try:
        with open_regular(path) as file, zipfile.ZipFile(_SmallReads(file)) as archive:
            file.seek(0)
            if file.read(len(ARCHIVE)) != ARCHIVE:  # zipfile would look for one behind it
                raise ValueError("no archive of NumPy's")
            names = [name.removesuffix(".npy") for name in archive.namelist()]
            arrays: dict[str, NDArray[Any]] = {}
            for name in wanted:
                if name in names:
                    arrays[name] = _read_array(archive, name, most)
                    most -= _memory(arrays[name].shape, arrays[name].dtype)
            return arrays, names
    except OSError:
        raise
    except Exception as error:  # zipfile, zlib, ast and tokenize all have exceptions of their own
        raise ValueError(" ".join(str(error).split()) or type(error).__name__) from error


class _SmallReads(io.BufferedIOBase):
    """The file of an archive in portions.

    Its directory says itself how long it is, and zipfile believes it: it must not be read at once.
    """

    PORTION = 2**20

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def read(self, size: int | None = -1) -> bytes:
        """Read up to `size` bytes."""
        return self._file.read(min(self.PORTION if size is None else size, self.PORTION))

    def seek(self, place: int, whence: int = os.SEEK_SET) -> int:
        """Go to a place."""
        return self._file.seek(place, whence)

    def tell(self) -> int:
        """Tell the place."""
        return self._file.tell()

    def seekable(self) -> bool:
        """Say yes: it is a regular file."""
        return True


def _read_array(archive: zipfile.ZipFile, name: str, most: int) -> NDArray[Any]:
    """Read an array of bounded size from an archive; ValueError for any other."""
    try:
        entry = archive.getinfo(f"{name}.npy")
    except KeyError:
        raise ValueError(f"{name} is no array") from None
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"{name} is packed in a way that NumPy does not use")
    with archive.open(entry) as packed:
        version = np.lib.format.read_magic(packed)
        if version not in ((1, 0), (2, 0)):
            raise ValueError(f"{name} is in version {version} of the npy format")
        header = {1: np.lib.format.read_array_header_1_0, 2: np.lib.format.read_array_header_2_0}
        shape, _, dtype = header[version[0]](packed)
    needed = _memory(shape, dtype)
    if not 0 <= needed <= most:
        raise ValueError(f"{name} of shape {shape} takes more than {most:,} bytes")
    with archive.open(entry) as packed:
        array: NDArray[Any] = np.lib.format.read_array(packed, allow_pickle=False)
        if packed.read(1):  # which also reads on to where the checksum is compared
            raise ValueError(f"{name} goes on behind its end")
    return array


def _memory(shape: tuple[int, ...], dtype: np.dtype[Any]) -> int:
    """Bytes of an array, once its numbers are float64; less than zero for what is none."""
    return -1 if min(shape, default=0) < 0 else math.prod(shape) * max(dtype.itemsize, 8)


@contextmanager
def write_whole(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Open a file for writing that takes its name only when the block has ended well.

    Symbolic links to it are followed. What is written lies beside it until then, under a name that
    cannot be predicted: a link planted there would lead to another's file.

    Raises OSError if it cannot be written; nothing is left behind then.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():
        raise OSError(errno.EINVAL, "not a regular file")
    temporary = target.with_name(f".{os.urandom(8).hex()}.part")
    file = open(temporary, "xb")
    try:
        with file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
