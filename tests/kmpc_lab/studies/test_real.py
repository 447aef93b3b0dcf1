"""A plant made from a log errs as the log did, and the study drives it."""

from pathlib import Path

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.studies.any_robot import Robot, record
from kmpc_lab.studies.real import RealPlant, drive

SKIDDING = Robot("skidding", 0.3, 0.8, 1.0, slip=0.05, turn_gain=0.6, noise=(0.01, 0.01))


@pytest.fixture(scope="module")
def log() -> kl.Dataset:
    return record(SKIDDING, 4).windows(5.0)


@pytest.fixture(scope="module")
def model(log: kl.Dataset) -> kl.KoopmanModel:
    return kl.fit(log, lags="auto")


def test_a_plant_stands_at_zero_command_and_errs_when_it_drives(
    log: kl.Dataset, model: kl.KoopmanModel
) -> None:
    plant = RealPlant(model, log, 1, motor_lag=0.0)
    pose = np.array([1.0, 2.0, 0.5])
    for _ in range(30):
        np.testing.assert_allclose(plant.drive(pose, np.zeros(2))[-1], pose, atol=1e-9)
    errors = []
    for _ in range(300):
        end = plant.drive(pose, np.array([0.6, 0.3]))[-1]
        errors.append(end - model.predict(pose, (0.6, 0.3)))
    spread = np.std(errors, axis=0)
    assert 1e-3 < spread[0] < 0.05


def test_it_drives_the_other_half_of_a_log_to_its_pose(tmp_path: Path, log: kl.Dataset) -> None:
    log.save(tmp_path / "skidding.csv")
    row = drive(str(tmp_path / "skidding.csv"), 0.3, 0.8, 1.0, "auto", 300)
    assert row.arrived and not row.collided
    assert 0.0 < row.more["aside"] < 0.3 and row.more["within"] > 0.8
