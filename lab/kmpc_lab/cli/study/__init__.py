"""`kmpc study`: one command a study."""

from __future__ import annotations

from kmpc_lab.cli.study import faults, learning, maps, real, robots, sight, surprises, table1
from kmpc_lite.cli.command import Command

COMMAND = Command(
    text="Reproduce the paper's table 1 beside ours, drive random maps, or force failures.\n"
    "Each study has a --help of its own.",
    examples=(
        "kmpc study table1 --trials 100 --json > table1.json",
        "kmpc study maps --families dense trap moving --slips 0.1",
        "kmpc study lag --records lag.jsonl --failures failures",
    ),
    commands={
        "table1": table1.COMMAND,
        **maps.COMMANDS,
        **robots.COMMANDS,
        "faults": faults.COMMAND,
        **surprises.COMMANDS,
        "learning": learning.COMMAND,
        "real": real.COMMAND,
        "sight": sight.COMMAND,
    },
)
