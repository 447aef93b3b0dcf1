"""Which files a command may write."""

from __future__ import annotations

from pathlib import Path

from kmpc_lite.errors import DataError


def keep_inputs(output: Path | None, *inputs: Path | None) -> None:
    """Refuse to write over a file that is read."""
    for file in inputs:
        if output is not None and file is not None and output.resolve() == file.resolve():
            raise DataError(
                f"{output}: would be written over, but is read too; "
                "choose another name for what is written"
            )
