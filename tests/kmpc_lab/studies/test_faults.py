"""Forced failures: the short version of ``kmpc study faults``, and that the study sees what must
not be.
"""

import numpy as np
import pytest
from executors import Inline

from kmpc_lab.sim.maps.families import random_map
from kmpc_lab.studies import faults
from kmpc_lab.studies.faults import FIXED, drive_faults, faults_study, format_faults
from kmpc_lab.studies.faulty_loop import KINDS, FaultCounts, FaultyLoop
from kmpc_lab.studies.records import Work
from kmpc_lab.studies.training import train
from kmpc_lite.control.estimate.history import CommandHistory
from kmpc_lite.control.plan import PlanStatus
from kmpc_lite.control.stop.safe_motion import SafeMotion, SafeMotions
from kmpc_lite.control.verification import Verification
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import Array


@pytest.fixture(scope="module")
def slippery() -> KoopmanModel:
    return train(0.2, "integral", 100, 100)


@pytest.mark.parametrize(
    ("fixed", "failures"), [((), 600), pytest.param(FIXED, 1000, marks=pytest.mark.long)]
)
def test_forced_failures_never_collide_and_end_in_a_verified_stop(
    fixed: tuple[str, ...], failures: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(faults, "FIXED", fixed)  # on a random map only, or on four more
    rows = faults_study(
        Work(Inline()),
        maps=1,
        slips=(0.2,),
        families=("moving",),
        first_seed=1,
        training={"episodes": 100, "steps": 100},
    )
    assert [row.kind for row in rows] == list(KINDS)
    assert sum(row.failed_steps for row in rows) >= failures
    for row in rows:
        assert row.collisions == row.late_stops == row.blind_steps == 0, row
        assert row.steps > row.failed_steps > 10, row
    failing = {row.kind: row.fallback + row.stopped for row in rows}
    for kind in (
        "primal infeasible",
        "dual infeasible",
        "non-convex",
        "unsolved",
        "update refused",
        "pose NaN",
        "pose lost for long",
    ):
        assert failing[kind] > 0, kind
    # what can still be driven is driven
    for row in rows:
        if row.kind in (
            "solved inaccurate",
            "max iter",
            "time limit",
            "clock jumps",
            "warm start NaN",
            "warm start huge",
        ):
            assert row.arrived == row.drives, row


def test_the_study_sees_a_robot_that_does_not_stop(
    monkeypatch: pytest.MonkeyPatch, slippery: KoopmanModel
) -> None:
    def drive_on(state: CommandHistory) -> Array:
        return np.tile(state.command, (2, 1))

    monkeypatch.setattr(CommandHistory, "rest", property(drive_on))
    monkeypatch.setattr(Verification, "clearance", lambda *_: np.inf)
    scenarios = [random_map("dense", seed, 0.2) for seed in range(3)]
    blind = drive_faults("pose lost for long", 0.2, slippery, scenarios)
    assert blind.bad and blind.collisions and blind.late_stops
    assert drive_faults("pose NaN", 0.2, slippery, scenarios).late_stops


def test_a_failing_controller_never_recovers_and_is_reported_so(
    monkeypatch: pytest.MonkeyPatch, slippery: KoopmanModel
) -> None:
    monkeypatch.setattr(
        SafeMotions, "find", lambda _, states, inputs, task: SafeMotion(states, inputs, None)
    )
    counts = FaultCounts("pose NaN", 0.2)
    loop = FaultyLoop(slippery, random_map("dense", 1, 0.2), "pose NaN", counts)
    for _ in range(120):
        assert loop.step((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)).status is PlanStatus.STOPPED
    assert counts.late_recoveries > 0 and counts.bad
    assert "late plan" in format_faults([counts])
