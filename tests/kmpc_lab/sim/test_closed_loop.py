"""How a drive is judged: arrival, collision to the sub-sample, time-out."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scripted import Scripted, field

import kmpc_lite as kl
from kmpc_lab import Outcome, drive
from kmpc_lab.sim.plants.lag import Floor, LaggingDrive


def test_arrives_when_within_both_tolerances() -> None:
    run = drive(Scripted((0.5, 0.0)), field())
    # within 6 cm of it after 1.88 s at 0.5 m/s
    assert run.outcome is Outcome.REACHED
    assert run.duration == pytest.approx(1.9)
    assert run.position_error == pytest.approx(0.05, abs=1e-6)
    assert run.heading_error == pytest.approx(0.0, abs=1e-9)


def test_the_heading_must_be_right_too() -> None:
    sideways = field(goal=(1.0, 0.0, 0.2))
    assert drive(Scripted((0.5, 0.0)), sideways).outcome is Outcome.TIMEOUT
    # turns in place once it is there; wrapped headings are the same heading
    turns = [(0.5, 0.0)] * 20 + [(0.0, 1.1), (0.0, 0.9)]
    for goal in (0.2, 0.2 + 2 * np.pi, 0.2 - 6 * np.pi):
        run = drive(Scripted(*turns), field(goal=(1.0, 0.0, goal), heading_tolerance=0.08))
        assert run.outcome is Outcome.REACHED
        assert run.duration == pytest.approx(2.2)
        assert run.heading_error == pytest.approx(0.0, abs=1e-6)


def test_settling_asks_for_staying() -> None:
    passing = drive(Scripted((0.5, 0.0)), field(), settle=0.5)
    assert passing.outcome is Outcome.TIMEOUT
    staying = drive(Scripted(*[(0.5, 0.0)] * 20, (0.0, 0.0)), field(), settle=0.5)
    assert staying.outcome is Outcome.REACHED
    assert staying.duration == pytest.approx(1.9 + 0.5, abs=0.101)  # to one period


def test_the_papers_end_of_a_run_is_a_norm_over_the_whole_state() -> None:
    run = drive(Scripted(*[(0.5, 0.0)] * 20, (0.0, 0.0)), field(), stop_norm=1e-2)
    assert run.duration == pytest.approx(2.0)
    assert (
        drive(
            Scripted(*[(0.5, 0.0)] * 20, (0.0, 0.0)), field(goal=(1.0, 0.0, 0.011)), stop_norm=1e-2
        ).outcome
        is Outcome.TIMEOUT
    )


def test_a_run_out_of_time_is_told_with_its_length() -> None:
    run = drive(Scripted((0.0, 0.0)), field(timeout=0.75))
    assert run.outcome is Outcome.TIMEOUT
    assert run.duration == pytest.approx(0.8)  # whole periods
    assert run.inputs.shape == (8, 2) and run.states.shape == (9, 3) and run.path.shape == (33, 3)


def test_a_collision_is_timed_to_the_sub_sample() -> None:
    # edges meet after 0.505 - 0.1 - 0.1 = 0.305 m, 0.61 s at 0.5 m/s; the first sub-sample behind
    # that is at 0.625 s
    run = drive(Scripted((0.5, 0.0)), field(circles=(kl.Circle(0.505, 0.0, 0.1),)))
    assert run.outcome is Outcome.COLLISION
    assert run.duration == pytest.approx(0.625)
    assert run.clearance == pytest.approx(0.305 - 0.5 * 0.7)  # at the end of the period
    assert len(run.inputs) == 7


def test_sub_samples_catch_what_the_ends_of_periods_miss() -> None:
    # 1 m per period: the robot jumps over an obstacle that lies between two ends of periods
    scenario = field(circles=(kl.Circle(1.55, 0.0, 0.2),), goal=(4.0, 0.0, 0.0))
    run = drive(Scripted((10.0, 0.0)), scenario)
    ends = run.states[:, 0]
    assert (np.abs(ends - 1.55) > 0.4).all()
    assert run.outcome is Outcome.COLLISION
    assert run.duration == pytest.approx(0.1 + 0.05)  # x = 1.5 at half the second period
    assert run.clearance < 0.0


def test_moving_obstacles_move_during_the_period() -> None:
    # it crosses the robot's place within one period
    hit = drive(Scripted((0.0, 0.0)), field(circles=(kl.Circle(0.0, -1.01, 0.1, 0.0, 4.0),)))
    assert hit.outcome is Outcome.COLLISION
    assert hit.duration == pytest.approx(0.225)  # 0.81 m at 4 m/s is 0.2025 s
    gone = drive(Scripted((0.0, 0.0)), field(circles=(kl.Circle(0.0, -1.0, 0.1, 0.0, -4.0),)))
    assert gone.outcome is Outcome.TIMEOUT
    assert gone.clearance == pytest.approx(0.9, abs=1e-6)


def test_the_controller_is_shown_obstacles_where_they_are_now_and_how_they_move() -> None:
    controller = Scripted((0.0, 0.0))
    drive(controller, field(circles=(kl.Circle(1.0, -1.0, 0.1, 0.5, 0.25),), timeout=0.5))
    for k, (_, goal, circles) in enumerate(controller.asked):
        np.testing.assert_allclose(circles, [[1.0 + 0.05 * k, -1.0 + 0.025 * k, 0.1, 0.5, 0.25]])
        np.testing.assert_array_equal(goal, [1.0, 0.0, 0.0])


def test_pose_noise_is_what_the_controller_sees_not_what_is_driven() -> None:
    controller = Scripted((0.5, 0.0))
    run = drive(
        controller,
        field(
            pose_noise=(0.01, 0.02, 0.03),
            goal=(4.0, 4.0, 0.0),
            timeout=30.0,
            bounds=(-50.0, -50.0, 50.0, 50.0),
        ),
    )
    seen = np.array([x for x, _, _ in controller.asked])
    np.testing.assert_allclose(run.states[:, 0], 0.05 * np.arange(301), atol=1e-9)
    np.testing.assert_allclose((seen - run.states[:-1]).std(axis=0), [0.01, 0.02, 0.03], rtol=0.15)


def test_a_drive_is_a_function_of_its_seed() -> None:
    slippery = field(slip=0.1, pose_noise=(0.01, 0.01, 0.01), seed=4)
    one, other = drive(Scripted((0.5, 0.1)), slippery), drive(Scripted((0.5, 0.1)), slippery)
    np.testing.assert_array_equal(one.path, other.path)
    assert (
        np.abs(
            drive(Scripted((0.5, 0.1)), replace(slippery, seed=5)).states[5] - one.states[5]
        ).max()
        > 1e-4
    )


def test_a_run_holds_what_was_driven() -> None:
    run = drive(Scripted((0.5, 0.2), (0.4, -0.1), seconds=2e-3), field(), info={"what": "test"})
    steps = len(run.inputs)
    assert run.states.shape == (steps + 1, 3)
    assert run.path.shape == (4 * steps + 1, 3)
    assert run.plans.shape == (steps, 4, 3)
    assert len(run.statuses) == len(run.step_times) == steps
    np.testing.assert_array_equal(run.path[::4], run.states)
    np.testing.assert_array_equal(run.inputs[:2], [(0.5, 0.2), (0.4, -0.1)])
    np.testing.assert_allclose(
        kl.nominal_unicycle(0.1).rollout(run.states[0], run.inputs), run.states, atol=1e-6
    )
    summary = run.summary()
    assert json.loads(json.dumps(summary)) == summary
    assert summary["what"] == "test"
    assert summary["statuses"] == {"SOLVED": steps}
    assert summary["step_ms"] == {
        "p50": pytest.approx(2.0),
        "p99": pytest.approx(2.0),
        "max": pytest.approx(2.0),
    }


def test_a_plant_of_ones_own() -> None:
    class Treadmill:
        """Moves half as far as it is told."""

        def trace(self, x: np.ndarray, u: np.ndarray, dt: float, substeps: int) -> np.ndarray:
            return x + 0.5 * dt * u[0] * np.arange(1, substeps + 1)[:, None] / substeps * np.array(
                [1.0, 0.0, 0.0]
            )

    assert drive(Scripted((0.5, 0.0)), field(), Treadmill()).duration == pytest.approx(3.8)


def test_the_plant_is_the_scenarios() -> None:
    commands = (0.5, 0.1), (0.2, -0.3)
    slow = drive(Scripted(*commands), field(lag=0.3, dead_time=0.15, slip=0.1, seed=4, timeout=1.0))
    same = drive(Scripted(*commands), field(timeout=1.0), LaggingDrive(0.3, 0.15, 0.1, seed=4))
    np.testing.assert_array_equal(slow.states, same.states)
    changing = field(floors=(Floor(0.5, 0.2, 0.6),), timeout=1.0, seed=2)
    run = drive(Scripted((0.5, 0.3)), changing)
    np.testing.assert_allclose(np.diff(run.states[:, 2])[:5], 0.03)
    assert (np.diff(run.states[:, 2])[5:] != 0.03).all()


@pytest.mark.parametrize("age", [0.05, 0.1, 0.25, 0.31])
def test_a_pose_is_as_old_as_the_scenario_says(age: float) -> None:
    script = Scripted((0.5, 0.0))
    run = drive(script, field(pose_age=age, timeout=1.0, goal=(3.0, 0.0, 0.0)))
    seen = np.array([x[0] for x, _, _ in script.asked])
    np.testing.assert_allclose(seen, np.maximum(run.states[:-1, 0] - 0.5 * age, 0.0), atol=1e-12)
