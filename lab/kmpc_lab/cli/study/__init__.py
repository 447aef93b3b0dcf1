"""`kmpc study`: one command a study."""

from __future__ import annotations

from kmpc_lab.cli.study import clutter, limits, maps, robots, surprises
from kmpc_lite.cli.command import Command

COMMAND = Command(
    text="Reproduce the paper's table 1 beside ours, or drive random maps and robots.\n"
    "Each study has a --help of its own.",
    examples=(
        "kmpc study table1 --trials 100 --json > table1.json",
        "kmpc study maps --families dense trap moving --slips 0.1",
        "kmpc study lag --records lag.jsonl --failures failures",
    ),
    commands={
        **maps.COMMANDS,
        **robots.COMMANDS,
        **surprises.COMMANDS,
        "real": robots.REAL,
        "parking": robots.PARKING,
        "sight": surprises.SIGHT,
        "clutter": clutter.CLUTTER,
        "limits": limits.LIMITS,
    },
)
