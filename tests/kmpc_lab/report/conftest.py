"""Runs of every kind that are reported and drawn."""

from dataclasses import replace

import numpy as np
import pytest
from report_page import MODEL, a_run

import kmpc_lite as kl
from kmpc_lab import Outcome
from kmpc_lite.scenario.files import Scenario


class Straight:
    """Drives straight ahead at 0.5 m/s, whatever stands there."""

    def step(self, x, goal, obstacles=()):
        inputs = np.tile((0.5, 0.0), (20, 1))
        return kl.Plan(
            inputs[0], MODEL.rollout(x, inputs), inputs, kl.PlanStatus.FEASIBLE, 1, {"total": 2e-3}
        )


class Blind:
    """Our controller behind a sensor that fails for a while."""

    def __init__(self, controller):
        self.controller, self.count = controller, 0

    def step(self, x, goal, obstacles=()):
        self.count += 1
        return self.controller.step(
            np.full(3, np.nan) if 14 <= self.count < 24 else x, goal, obstacles
        )


@pytest.fixture(scope="session")
def runs():
    map_1 = replace(Scenario.load("four_circles_1"), slip=0.0)
    moving = (kl.Circle(1.6, 0.2, 0.2, -0.15, 0.05), kl.Circle(-0.2, 1.4, 0.15, 0.12, -0.08))
    found = {
        "reached": a_run(map_1),
        "moving": a_run(replace(map_1, circles=moving)),
        "empty": a_run(replace(map_1, circles=())),
        "single": a_run(replace(map_1, timeout=0.1)),
        "timeout": a_run(replace(map_1, timeout=1.5)),
        "blind": a_run(map_1, Blind(kl.Controller(MODEL, map_1.problem()))),
        "collision": a_run(replace(map_1, circles=(kl.Circle(0.59, 0.0, 0.15),)), Straight()),
        "corridor": a_run(
            replace(
                map_1,
                bounds=(-1.0, -0.6, 9.0, 0.6),
                goal=(8.0, 0.0, 0.0),
                circles=(kl.Circle(3.0, 0.1, 0.2),),
                timeout=30.0,
            )
        ),
    }
    outcomes = {name: run.outcome for name, run in found.items()}
    late = dict.fromkeys(("single", "timeout"), Outcome.TIMEOUT)
    assert outcomes == {
        **dict.fromkeys(found, Outcome.REACHED),
        **late,
        "collision": Outcome.COLLISION,
    }
    assert {"SOLVED", "FALLBACK", "STOPPED"} <= set(found["blind"].statuses)
    return found


@pytest.fixture
def blank(monkeypatch):
    """Nothing is drawn on the pictures of a report: where only its words are looked at."""
    svg = b'<svg xmlns="http://www.w3.org/2000/svg"/>'
    monkeypatch.setattr("kmpc_lab.report.html.render", lambda figure, kind: svg)
