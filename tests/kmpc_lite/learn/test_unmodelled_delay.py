"""How late a robot answers, where its model does not know it."""

import pytest

import kmpc_lite as kl
from kmpc_lab.studies.any_robot import Robot, record
from kmpc_lite.learn.stopping import unmodelled_delay


@pytest.mark.parametrize("dt", [0.05, 0.1, 0.2])
def test_a_delay_is_found_at_any_period(dt):
    robot = Robot("late", lag=0.2, dead_time=0.1, dt=dt)
    # a command is held for a period, of which half is delay, too
    assert unmodelled_delay(record(robot, 3)) == pytest.approx(0.3, abs=0.75 * dt)


def test_a_robot_that_obeys_at_once_has_none_however_noisy_its_poses_are():
    for seed in range(5):
        robot = Robot("prompt", noise=(0.02, 0.05), seconds=60.0)
        assert unmodelled_delay(record(robot, seed)) == 0.0


def test_the_delay_is_kept_in_the_file_and_a_nonsensical_one_is_refused(tmp_path):
    from dataclasses import replace

    model = kl.fit(record(Robot("late", lag=0.2), 4))
    path = tmp_path / "robot.npz"
    model.save(path)
    read = kl.KoopmanModel.load(path)
    assert read.info["unmodelled_delay"] == model.info["unmodelled_delay"] > 0.1
    replace(model, info={"unmodelled_delay": -1.0}).save(path)
    with pytest.raises(kl.ModelError, match="unmodelled_delay: expected a time"):
        kl.KoopmanModel.load(path)


def test_margins_know_that_feedback_acts_later_in_any_units():
    from kmpc_lite.model.motion import in_units
    from kmpc_lite.model.tube import feedback_delay
    from kmpc_lite.scale import Scale

    model = kl.fit(record(Robot("late", lag=0.2, dead_time=0.1), 4))
    assert feedback_delay(model) == round(model.info["unmodelled_delay"] / model.dt) > 1
    assert feedback_delay(in_units(model, Scale(3.0, 2.0))) == feedback_delay(model)
