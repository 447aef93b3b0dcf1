"""Runs as npz files: numbers and JSON, no pickle."""

from __future__ import annotations

import json
import os
import zipfile
from pathlib import Path

import numpy as np

from kmpc_lite.errors import ScenarioError
from kmpc_lite.sim.closed_loop import Outcome, Run
from kmpc_lite.sim.scenario import Scenario

FORMAT, VERSION = "kmpc_lite.run", 1
ARRAYS = ("states", "path", "inputs", "plans", "step_times")


def save_run(run: Run, path: Path) -> None:
    """Write a run, whole or not at all."""
    header = {
        "format": FORMAT,
        "version": VERSION,
        "name": run.scenario.name,
        "scenario": run.scenario.to_toml(),
        "dt": run.dt,
        "outcome": run.outcome.value,
        "duration": run.duration,
        "statuses": run.statuses,
        "clearance": run.clearance if np.isfinite(run.clearance) else None,
        "info": run.info,
    }
    temporary = path.with_name(path.name + ".part")
    try:
        with open(temporary, "wb") as file:
            arrays = {name: getattr(run, name) for name in ARRAYS}
            np.savez_compressed(file, allow_pickle=False, header=np.array(json.dumps(header)), **arrays)
        os.replace(temporary, path)
    except OSError as error:
        raise ScenarioError(f"{path}: cannot write the run: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def load_run(path: Path) -> Run:
    """Read a run; ScenarioError for anything else."""
    import tomllib

    try:
        with np.load(path, allow_pickle=False) as archive:
            header = json.loads(str(archive["header"]))
            arrays = {name: archive[name] for name in ARRAYS}
        if header["format"] != FORMAT or header["version"] != VERSION:
            raise ScenarioError(f"{path}: expected {FORMAT} version {VERSION}, got {header['format']} version {header['version']}")
        scenario = Scenario.from_table(tomllib.loads(header["scenario"]), header["name"], str(path))
        return Run(
            scenario=scenario,
            dt=float(header["dt"]),
            outcome=Outcome(header["outcome"]),
            duration=float(header["duration"]),
            statuses=tuple(header["statuses"]),
            clearance=np.inf if header["clearance"] is None else float(header["clearance"]),
            info=header["info"],
            **arrays,
        )
    except OSError as error:
        raise ScenarioError(f"{path}: cannot read the run: {error.strerror or error}") from error
    except ScenarioError:
        raise
    except (ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile, AttributeError) as error:
        raise ScenarioError(f"{path}: not a run that kmpc simulate wrote: {error}") from error
