"""Which files a command may write."""

from __future__ import annotations

import os
from pathlib import Path

from kmpc_lite.errors import DataError


def keep_inputs(output: Path | None, *inputs: Path | None) -> None:
    """Refuse to write over a file that is read, or into a folder that cannot be written to.

    A command calls it before its work: learning may take minutes.
    """
    if output is not None:
        folder = output.parent
        if not folder.is_dir():
            raise DataError(f"{output}: cannot be written: there is no folder {folder}")
        if output.is_dir() or not os.access(folder, os.W_OK):
            reason = "it is a folder" if output.is_dir() else f"{folder} is write-protected"
            raise DataError(f"{output}: cannot be written: {reason}")
    for file in inputs:
        if output is not None and file is not None and output.resolve() == file.resolve():
            raise DataError(
                f"{output}: would be written over, but is read too; "
                "choose another name for what is written"
            )
