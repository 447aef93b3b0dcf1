"""A robot that does not slip, driven by what was learned from its log, goes where the known model
drives it.
"""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import kmpc_lab
import kmpc_lite as kl
from kmpc_lab import Run, drive
from kmpc_lite.scenario.files import Scenario

DT = 0.1
PAPER: dict[str, Any] = {"guidance": False, "tightening": None}


@cache
def learned(method: Any) -> kl.KoopmanModel:
    train, held = kmpc_lab.generate_dataset(
        kmpc_lab.DifferentialDrive(), episodes=60, steps=100, dt=DT, seed=1
    ).split(0.5, seed=0)
    model = kl.fit(train, method=method)
    return kl.with_quantiles(model, held) if method == "integral" else model


def driven(model: kl.KoopmanModel, name: str, options: dict[str, Any]) -> Run:
    scenario = replace(Scenario.load(name), slip=0.0)
    return drive(kl.Controller(model, scenario.problem(), **options), scenario, dt=DT)


def apart(one: Run, other: Run) -> float:
    """Largest distance between two paths at the same time [m]."""
    shared = min(len(one.path), len(other.path))
    return float(np.hypot(*(one.path[:shared, :2] - other.path[:shared, :2]).T).max())


@pytest.mark.parametrize("options", [{}, PAPER], ids=["everything on", "paper"])
@pytest.mark.parametrize(
    "name", ["mehrez", "four_circles_1", "four_circles_2", "four_circles_3", "four_circles_4"]
)
def test_without_slip_the_learned_controller_follows_the_known_one_within_a_millimetre(
    name: str, options: dict[str, Any]
) -> None:
    known, ours = (
        driven(kl.nominal_unicycle(DT), name, options),
        driven(learned("integral"), name, options),
    )
    assert (ours.outcome, ours.duration) == (known.outcome, known.duration)
    assert apart(ours, known) < (1e-3 if not options else 1e-7)
