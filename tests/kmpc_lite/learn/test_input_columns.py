"""Whether a log's input columns are commands or measured speeds, judged by how they change."""

from pathlib import Path

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.learn.input_columns import tell_inputs

DT = 0.1
REAL = Path(__file__).parents[4] / "shared" / "data" / "norlab_drive"


def log(inputs: np.ndarray, dt: float = DT) -> kl.Dataset:
    """A log of these inputs; poses do not matter here."""
    return kl.Dataset([kl.Episode(np.zeros((len(inputs) + 1, 3)), inputs, dt)])


def commands(rows: int, seed: int = 0, length: int = 600) -> np.ndarray:
    """Random commands, each held for so many rows."""
    random = np.random.default_rng(seed)
    return np.repeat(random.uniform(-1.0, 1.0, (-(-length // rows), 2)), rows, axis=0)[:length]


def slewed(inputs: np.ndarray, most: float) -> np.ndarray:
    """The same with changes of at most so much a row, as a gate sends them."""
    sent = [np.zeros(2)]
    for wanted in inputs:
        change = wanted - sent[-1]
        sent.append(sent[-1] + change * min(1.0, most / max(np.abs(change).max(), 1e-12)))
    return np.array(sent[1:])


def lagged(inputs: np.ndarray, keep: float, noise: float, seed: int = 1) -> np.ndarray:
    """Speeds of wheels that follow such commands, as encoders tell them."""
    random, speed, found = np.random.default_rng(seed), np.zeros(2), []
    for wanted in inputs:
        speed = keep * speed + (1.0 - keep) * wanted
        found.append(speed + noise * random.normal(size=2))
    return np.array(found)


@pytest.mark.parametrize("rows", [1, 2, 3, 5, 10, 30])
@pytest.mark.parametrize("period", [0.07, 0.1, 0.15])
def test_held_commands_are_commands_however_long_and_at_whatever_period(
    rows: int, period: float
) -> None:
    told = tell_inputs(log(commands(rows)).resample(period), 0.2)
    assert told.startswith("commands (") and "0.20 s later" in told


@pytest.mark.parametrize("most", [0.05, 0.1, 0.3])
def test_commands_that_a_gate_has_slowed_are_commands(most: float) -> None:
    assert tell_inputs(log(slewed(commands(8), most)), 0.2).startswith("commands (")


@pytest.mark.parametrize("noise", [0.002, 0.01, 0.05])
@pytest.mark.parametrize("keep", [0.6, 0.8])
def test_speeds_of_encoders_are_measured_speeds(noise: float, keep: float) -> None:
    told = tell_inputs(log(lagged(commands(10), keep, noise)), 0.05)
    assert told.startswith("measured speeds") and "motors' lag is not in them" in told


@pytest.mark.parametrize("times", [2, 3])
def test_measured_speeds_that_a_recorder_repeats_are_not_taken_for_commands(times: int) -> None:
    repeated = np.repeat(lagged(commands(10), 0.7, 0.01), times, axis=0)
    assert tell_inputs(log(repeated, DT / times), 0.05).startswith("measured speeds")


def test_inputs_that_never_change_are_unknown() -> None:
    assert tell_inputs(log(np.full((100, 2), 0.3)), 0.1).startswith("unknown")
    assert tell_inputs(log(np.zeros((100, 2))), 0.1).startswith("unknown")


@pytest.mark.skipif(not REAL.is_dir(), reason="needs the real logs of the Norlab robots")
@pytest.mark.parametrize("name", ["husky", "warthog"])
@pytest.mark.parametrize("dt", [0.05, 0.1])
def test_the_encoders_of_real_robots_are_reported(name: str, dt: float) -> None:
    assert tell_inputs(kl.Dataset.load(REAL / f"{name}.csv", dt=dt), 0.1).startswith("measured")
