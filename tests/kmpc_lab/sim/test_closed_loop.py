"""How a drive is judged: arrival, collision to the sub-sample, time-out."""

import numpy as np
import pytest
from scripted import Scripted, field

import kmpc_lite as kl
from kmpc_lab import Outcome, drive


def test_arrives_when_within_both_tolerances() -> None:
    run = drive(Scripted((0.5, 0.0)), field())
    # within 6 cm of it after 1.88 s at 0.5 m/s
    assert run.outcome is Outcome.REACHED
    assert run.duration == pytest.approx(1.9)
    assert run.position_error == pytest.approx(0.05, abs=1e-6)
    assert run.heading_error == pytest.approx(0.0, abs=1e-9)


def test_the_papers_end_of_a_run_is_a_norm_over_the_whole_state() -> None:
    run = drive(Scripted(*[(0.5, 0.0)] * 20, (0.0, 0.0)), field(), stop_norm=1e-2)
    assert run.duration == pytest.approx(2.0)
    assert (
        drive(
            Scripted(*[(0.5, 0.0)] * 20, (0.0, 0.0)), field(goal=(1.0, 0.0, 0.011)), stop_norm=1e-2
        ).outcome
        is Outcome.TIMEOUT
    )


def test_a_collision_is_timed_to_the_sub_sample() -> None:
    # edges meet after 0.505 - 0.1 - 0.1 = 0.305 m, 0.61 s at 0.5 m/s; the first sub-sample behind
    # that is at 0.625 s
    run = drive(Scripted((0.5, 0.0)), field(circles=(kl.Circle(0.505, 0.0, 0.1),)))
    assert run.outcome is Outcome.COLLISION
    assert run.duration == pytest.approx(0.625)
    assert run.clearance == pytest.approx(0.305 - 0.5 * 0.7)  # at the end of the period
    assert len(run.inputs) == 7


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


@pytest.mark.parametrize("age", [0.05, 0.1, 0.25, 0.31])
def test_a_pose_is_as_old_as_the_scenario_says(age: float) -> None:
    script = Scripted((0.5, 0.0))
    run = drive(script, field(pose_age=age, timeout=1.0, goal=(3.0, 0.0, 0.0)))
    seen = np.array([x[0] for x, _, _ in script.asked])
    np.testing.assert_allclose(seen, np.maximum(run.states[:-1, 0] - 0.5 * age, 0.0), atol=1e-12)
