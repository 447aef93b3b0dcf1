"""A field with obstacles of every kind, and a recorded drive with messages of every kind."""

from __future__ import annotations

import numpy as np

import kmpc_lite as kl
from firmware_bridge.recording.drive.encoder import DriveEncoder
from firmware_bridge.recording.drive.schemas import (
    Ended,
    Gate,
    Health,
    Note,
    PoseSeen,
    Sent,
    Stepped,
)
from kmpc_lite.scenario.files import Scenario

SCENARIO = """\
[map]
bounds = [-2.0, -2.0, 2.0, 2.0]
circles = [[0.5, 0.6, 0.15], [1.0, -1.5, 0.1, 0.0, 0.2]]
polygons = [[[1.0, 0.8], [1.5, 0.8], [1.2, 1.2]]]
walls = [[-1.5, -1.5, -1.0, -1.5, 0.1]]
grid = {resolution = 0.1, origin = [-1.0, 1.0, 0.3], rows = ["..#", "?.#"]}
[robot]
start = [0.0, 0.0, 0.0]
goal = [1.0, 0.1, 0.0]
[run]
timeout = 5.0
"""


def controller_of(scenario: Scenario) -> kl.Controller:
    return kl.Controller(kl.nominal_unicycle(0.1), scenario.problem(), options=scenario.options)


def every_kind(scenario: Scenario) -> bytes:
    """A drive with a message of every kind."""
    controller = controller_of(scenario)
    plan = controller.step(scenario.start, scenario.goal, scenario.obstacles_at(0.0))
    scan = kl.LaserScan([1.0, np.inf, np.nan, 2.0], 0.5, 0.1, range_max=4.0)
    margins, circles = np.full(20, 0.05), scenario.circles_at(0.0)
    path = np.array([[0.0, 0.0, 0.1], [1.0, 0.1, 0.1]])
    encoder = DriveEncoder(scenario, 0.1, {"kind": "driven"}, offset=1.7e9)
    pose = (0.0, 0.0, 3.0)
    records = [
        PoseSeen(5.0, pose),
        Stepped(5.1, pose, plan, path, margins, circles, 0.02, scan),
        Sent(5.1, (0.3, -0.2, 0.0)),
        Gate(5.2, "ACTIVE", ()),
        Gate(5.3, "STOPPING", ("link down",)),
        Health(5.4, {"connected": True, "age": np.inf, "counters": {"frames": 3}}),
        Note(5.5, "<b>a note</b>", bad=True),
        PoseSeen(5.6, (np.nan, 0.0, 0.0)),
    ]
    ended = Ended(6.0, {"outcome": "timeout", "duration": 0.9, "clearance": None, "words": "so"})
    parts = [encoder.begin(5.0), *encoder.encode(records), *encoder.encode([ended])]
    return b"".join(parts)
