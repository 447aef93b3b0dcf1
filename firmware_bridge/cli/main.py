"""kmpc-bridge: another name of `kmpc`."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from firmware_bridge.cli import COMMANDS
from kmpc_lite.cli.main import main as kmpc


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line: status 0 done, 1 not done, 2 bad input, 130 interrupted."""
    return kmpc(arguments, COMMANDS)


if __name__ == "__main__":
    sys.exit(main())
