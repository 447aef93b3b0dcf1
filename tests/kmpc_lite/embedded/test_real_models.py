"""Models of real robots' logs: what is exported drives as Python drives it, and smoothly."""

from pathlib import Path

import numpy as np
import pytest
from outcomes.models import DATA, LOGS

import kmpc_lite as kl
from kmpc_lite.cli.self_drive import problem_of
from kmpc_lite.embedded.folder import recorded_vectors
from kmpc_lite.embedded.numbers import controller_of
from kmpc_lite.learn.learning import learn


@pytest.mark.skipif(not DATA.is_dir(), reason="needs the logs in ../shared/data")
@pytest.mark.parametrize("name", ["husky", "warthog", "rover, quiet"])
def test_the_exported_controller_is_the_one_of_python(name: str, tmp_path: Path) -> None:
    model = learn(kl.Dataset.load(DATA / LOGS[name][0], dt=0.1), [DATA / LOGS[name][0]]).model
    problem = problem_of(model, robot_radius=0.4)
    python = controller_of(model, problem, tightening=True, options=None)
    exported = kl.CompiledController(kl.export(model, problem, tmp_path / "robot"))
    commands = []
    for vector in recorded_vectors(python):
        commands.append(exported.step(vector.pose, vector.goal, vector.circles).command)
        np.testing.assert_allclose(commands[-1], vector.command, rtol=0, atol=1e-6)
    # it turns smoothly, too, though the goal is far away
    changes = np.diff(commands, axis=0) / problem.u_max
    large = np.abs(changes) > 0.1
    back = ((changes[1:] * changes[:-1] < 0) & large[1:] & large[:-1]).any(axis=1)
    assert back.mean() <= 0.1
