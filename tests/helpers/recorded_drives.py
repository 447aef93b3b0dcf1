"""A simulated drive, recorded once."""

from __future__ import annotations

import pytest
from drive_kinds import SCENARIO, controller_of

from kmpc_lab import Run, drive
from kmpc_lab.recording.simulated import SimulationRecorder
from kmpc_lite.scenario.files import Scenario


@pytest.fixture(scope="session")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Scenario:
    path = tmp_path_factory.mktemp("recording") / "field.toml"
    path.write_text(SCENARIO)
    return Scenario.load(path)


@pytest.fixture(scope="session")
def recorded(scenario: Scenario) -> tuple[Run, SimulationRecorder]:
    controller = controller_of(scenario)
    recorder = SimulationRecorder(controller)
    return drive(controller, scenario, watch=recorder), recorder


@pytest.fixture(scope="session")
def content(recorded: tuple[Run, SimulationRecorder]) -> bytes:
    run, recorder = recorded
    return recorder.content(run)
