"""What a busy computer costs a drive is measured in turns, and reported in a row a mode."""

import os
from pathlib import Path

from kmpc_lab.attacks.busy import MODES, TIMES, Mode, measure, told


def report(clearance: float, outcome: str) -> dict:
    return {
        "outcome": outcome,
        "arrived_after_s": 12.0 if outcome == "arrived" else None,
        "clearance_m": clearance,
        "loop": {
            "controller_periods_skipped": 2,
            "times_ms": {name: {"p50": 1.0, "p99": 5.0, "max": 9.0} for name in TIMES},
        },
    }


def children() -> set[str]:
    """Processes of this one."""
    mine = str(os.getpid())
    found = set()
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            name, fields = path.parent.name, path.read_text().rpartition(")")[2].split()
        except OSError:  # it has ended meanwhile
            continue
        if fields[1] == mine and fields[0] != "Z":
            found.add(name)
    return found


def test_the_modes_take_turns_and_the_worst_clearance_is_reported(tmp_path: Path) -> None:
    seen: list[tuple[str, int]] = []
    before = children()

    def drive(mode: Mode) -> dict:
        seen.append((mode.name, len(children() - before)))
        late = mode.busy and len(seen) > 3
        return report(0.03 if late else 0.06, "timeout" if late else "arrived")

    rows = measure(drive, 2, tmp_path)
    jobs = (os.cpu_count() or 1) + 1
    assert seen == 2 * [(mode.name, jobs if mode.busy else 0) for mode in MODES]
    assert children() == before and not list(tmp_path.iterdir())
    assert [row["arrived"] for row in rows] == [2, 1, 1]
    assert [row["least_clearance_m"] for row in rows] == [0.06, 0.03, 0.03]
    assert all(row["controller_periods_skipped"] == 4 for row in rows)
    lines = told(rows).splitlines()
    assert lines[2].startswith("| nothing else runs | 2 of 2 | 12.0 | 6.0 | 1.0 / 5.0 / 9.0 |")
    assert len(lines) == 5
