"""Scans in a run's file."""

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab import Run, drive
from kmpc_lab.sim.lidar import Lidar
from kmpc_lab.sim.run_file import scans_of, scans_to_arrays
from kmpc_lite.errors import ScenarioError
from kmpc_lite.scenario.files import Scenario

MAP = {
    "map": {"bounds": [-1, -1, 2, 1], "circles": [[1.0, 0.4, 0.2]]},
    "robot": {"start": [0, 0, 0], "goal": [0.3, 0, 0]},
    "run": {"timeout": 0.5},
    "lidar": {"reach": 2.0, "beams": 90, "rate": 5.0, "mount": [0.1, 0.0, 3.1416]},
}


def test_a_run_keeps_what_its_lidar_saw(tmp_path):
    scenario = Scenario.from_table(MAP, "seen", "here")
    assert scenario.lidar is not None
    controller = kl.Controller(kl.nominal_unicycle(0.1), scenario.problem())
    run = drive(controller, scenario, lidar=Lidar(scenario, scenario.lidar))
    assert [round(time, 6) for time, _ in run.scans] == [0.0, 0.2, 0.4]
    run.save(tmp_path / "run.npz")
    read = Run.load(tmp_path / "run.npz")
    assert read.scenario.lidar == scenario.lidar and len(read.scans) == 3
    for (time, scan), (told_time, told) in zip(run.scans, read.scans, strict=True):
        assert time == told_time
        for name in ("hits", "clear"):
            np.testing.assert_array_equal(getattr(scan, name), getattr(told, name))
        np.testing.assert_allclose(scan.ends, told.ends, atol=1e-6)


@pytest.mark.parametrize("bad", ["times", "ranges", "scanner", "nan", "text"])
def test_damaged_scans_are_refused(bad):
    scan = kl.LaserScan(np.full(8, 2.0), 0.0, 0.1, 4.0)
    arrays = scans_to_arrays([(0.0, scan), (0.1, scan)])
    match bad:
        case "times":
            arrays["scan_times"] = arrays["scan_times"][:1]
        case "ranges":
            arrays["scan_ranges"] = arrays["scan_ranges"].ravel()
        case "scanner":
            arrays["scanner"] = arrays["scanner"][:2]
        case "nan":
            arrays["scanner"][0] = np.nan
        case "text":
            arrays["scan_ranges"] = np.array([["far"] * 8] * 2)
    with pytest.raises((ScenarioError, ValueError)):
        scans_of(arrays)
