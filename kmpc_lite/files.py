"""Data at the border: arrays checked, archives distrusted, files written whole or not at all."""

from __future__ import annotations

import errno
import os
import zipfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kmpc_lite.errors import KmpcError

MAX_ARCHIVE_BYTES = 2**30
"""An archive whose arrays unpack to more is refused before a byte of them is."""
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
    path: str | os.PathLike[str], wanted: Collection[str]
) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """Read an npz archive without trusting it: no pickle, every byte checked against its CRC.

    Parameters
    ----------
    path : path
        The archive.
    wanted : collection of str
        Which arrays to unpack, where the archive has them.

    Returns
    -------
    tuple
        The arrays by name, and the names of all that are there.

    Raises
    ------
    OSError
        Where the file cannot be read.
    ValueError
        For whatever is wrong with its content, in one line.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
            if size > MAX_ARCHIVE_BYTES:
                raise ValueError(
                    f"its arrays take {size:,} bytes, at most {MAX_ARCHIVE_BYTES:,} are read"
                )
            # NumPy stops reading where the array ends, which may be before the CRC is checked
            if (bad := archive.testzip()) is not None:
                raise ValueError(f"{bad} fails its checksum")
        with np.load(path, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in wanted if name in arrays.files}, list(
                arrays.files
            )
    except OSError:
        raise
    except Exception as error:  # zipfile, zlib, ast and tokenize all have exceptions of their own
        raise ValueError(" ".join(str(error).split()) or type(error).__name__) from error


@contextmanager
def write_whole(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Open a file for writing that takes its name only when the block has ended well.

    Symbolic links are followed.

    Raises
    ------
    OSError
        Where it cannot be written; nothing is left behind then.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():
        raise OSError(errno.EINVAL, "not a regular file")
    temporary = target.with_name(f"{target.name}.{os.getpid()}.part")
    file = open(temporary, "wb")
    try:
        with file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
