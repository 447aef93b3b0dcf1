"""`python -m kmpc_lab.experiments` is `kmpc experiments`."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from kmpc_lite.cli.main import main as kmpc


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line and return its exit status."""
    return kmpc(["experiments", *(sys.argv[1:] if arguments is None else arguments)])


if __name__ == "__main__":
    sys.exit(main())
