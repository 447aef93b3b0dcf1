"""What a desk needs beside a robot: simulation and twin, emulators, studies, reports, peers, bench.

The public names are imported when the first of them is asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from kmpc_lab.peers.ipopt import IpoptController
    from kmpc_lab.recording.drive_file import load_drive
    from kmpc_lab.report.html import write_report
    from kmpc_lab.report.runs import draw_drives
    from kmpc_lab.sim.closed_loop import Outcome, Run, drive
    from kmpc_lab.sim.plants.lag import LaggingDrive, drive_log
    from kmpc_lab.sim.plants.plant import LearnedPlant
    from kmpc_lab.sim.plants.robots import DifferentialDrive, generate_dataset
    from kmpc_lite.scenario.files import Scenario

__version__ = "0.3.0.dev0"
__all__ = [
    "DifferentialDrive",
    "IpoptController",
    "LaggingDrive",
    "LearnedPlant",
    "Outcome",
    "Run",
    "Scenario",
    "draw_drives",
    "drive",
    "drive_log",
    "generate_dataset",
    "load_drive",
    "write_report",
]
_WHERE = {
    "DifferentialDrive": "kmpc_lab.sim.plants.robots",
    "IpoptController": "kmpc_lab.peers.ipopt",
    "LaggingDrive": "kmpc_lab.sim.plants.lag",
    "drive_log": "kmpc_lab.sim.plants.lag",
    "LearnedPlant": "kmpc_lab.sim.plants.plant",
    "Outcome": "kmpc_lab.sim.closed_loop",
    "Run": "kmpc_lab.sim.closed_loop",
    "Scenario": "kmpc_lite.scenario.files",
    "drive": "kmpc_lab.sim.closed_loop",
    "generate_dataset": "kmpc_lab.sim.plants.robots",
    "load_drive": "kmpc_lab.recording.drive_file",
    "draw_drives": "kmpc_lab.report.runs",
    "write_report": "kmpc_lab.report.html",
}


def __getattr__(name: str) -> Any:
    """Import a public name."""
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_WHERE[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
