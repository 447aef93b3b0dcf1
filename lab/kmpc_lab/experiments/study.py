"""Experiments (a) to (d): commands, models and maps, all fixed before anything was driven."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import kmpc_lite as kl
from firmware_bridge.messages import ConfigError
from kmpc_lab.experiments.collect import FAST, SAMPLES, SLOW, collect
from kmpc_lab.experiments.trials import Contender, Trial, repeat
from kmpc_lab.sim.twin import Ground
from kmpc_lite.scenario.files import Scenario

Progress = Callable[[str], Callable[[int, int], None]]
"""Makes a bar of a name."""
REPORTING_SEED = 500_000
"""Of pose noise and delays; nothing was tuned on these."""
PAPER_BOUNDS, SLOW_BOUNDS = (0.6, 0.785), (0.2, 0.4)
"""Command bounds at 10 Hz (the paper's), and at 1 Hz (twice to four times what the training
commands usually are) [m/s, rad/s]."""
FITS = {
    "fast": ("fast", ("--dictionary", "trig", "--lags", "0", "1", "--product")),
    "fast_paper": ("fast", ("--dictionary", "unicycle", "--method", "edmdc")),
    "slow": ("slow", ("--dictionary", "trig", "--lags", "0", "1", "--product", "--dt", "1")),
    "slow_paper": ("slow", ("--dictionary", "unicycle", "--method", "edmdc", "--dt", "1")),
    "carpet": ("carpet", ("--dictionary", "trig", "--lags", "0", "1", "--product")),
    "wet": ("wet", ("--dictionary", "trig", "--lags", "0", "1", "--product")),
}
"""Models: the set that each is learned from, and the options of ``kmpc fit``."""
NEW_FLOOR_SAMPLES = 6_000
"""Of the sets on carpet and on wet tile."""


@dataclass(frozen=True)
class Experiment:
    """What is driven."""

    title: str
    maps: tuple[str, ...]
    trials: int
    paper: str
    """What the paper reports."""


EXPERIMENTS = {
    "a": Experiment(
        "four maps, goals (1.5, 1.5) and (-1.5, -1.5)",
        tuple(f"twin_a{i}" for i in range(1, 5)),
        5,
        "4/4 reached, 13 s, 0.01 m",
    ),
    "b": Experiment(
        "two maps with twice the obstacles",
        ("twin_b1", "twin_b2"),
        5,
        "8/10 without contact (5/5, 3/5), 0.09 m",
    ),
    "c": Experiment(
        "ten maps at 1 Hz, 0.2 to 0.5 s late",
        tuple(f"twin_c{i}" for i in range(1, 11)),
        5,
        "44/50 without contact, 21 to 60 s",
    ),
    "d": Experiment(
        "the floor changes under way", ("twin_carpet", "twin_wet", "twin_wet_patch"), 5, "-"
    ),
}


def learn(folder: Path, name: str, bar: Progress, robot: int = 0) -> kl.KoopmanModel:
    """Load a model from the folder; where it is missing, record its data and fit it.

    The data go through the link, the fit is ``kmpc fit``.
    """
    file = folder / f"{name}.npz"
    if not file.exists():
        data, options = FITS[name]
        kind = "slow" if data == "slow" else "fast"
        logs = folder / data
        if not logs.exists():
            ground = None if data in SAMPLES else Ground.named(data)
            count = SAMPLES.get(data, NEW_FLOOR_SAMPLES)
            collect(logs, kind, count, ground, robot=robot, progress=bar(f"recording {data}"))
        fit = ["fit", *map(str, sorted(logs.glob("*.csv"))), "-o", str(file), *options, "--json"]
        command = [sys.executable, "-m", "kmpc_lite", *fit]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
        if done.returncode:
            raise ConfigError(f"kmpc fit failed on {logs}: remove the folder and try again")
        (folder / f"{name}.json").write_text(done.stdout)
    return kl.KoopmanModel.load(file)


def prediction_errors(
    folder: Path, bar: Progress, robot: int = 0
) -> list[tuple[str, tuple[float, ...], tuple[float, ...]]]:
    """Held-out errors after 1 s of each model of the paper's sets, beside the nominal unicycle's.

    Errors are along, across [m] and of heading [rad].
    """
    rows = []
    for name in ("fast", "fast_paper", "slow", "slow_paper"):
        learn(folder, name, bar, robot)
        held = json.loads((folder / f"{name}.json").read_text())["held_out"]
        rows.append((name, tuple(held["multi_step"]), tuple(held["nominal_multi_step"])))
    return rows


def contenders(folder: Path, which: str, bar: Progress, robot: int = 0) -> list[Contender]:
    """Ours, and the paper's two controllers, as they are compared in an experiment."""
    if which == "c":
        slow = learn(folder, "slow", bar, robot)
        return [
            Contender("ours", "kmpc", slow, SLOW_BOUNDS),
            Contender(
                "K-NMPC, IPOPT", "ipopt", learn(folder, "slow_paper", bar, robot), SLOW_BOUNDS
            ),
            Contender("NMPC, IPOPT", "ipopt", kl.nominal_unicycle(1.0), SLOW_BOUNDS),
        ]
    ours = Contender("ours", "kmpc", learn(folder, "fast", bar, robot), PAPER_BOUNDS)
    if which == "d":
        return [ours, replace(ours, label="ours, no adaptation", adaptation=False)]
    return [
        ours,
        Contender("K-NMPC, IPOPT", "ipopt", learn(folder, "fast_paper", bar, robot), PAPER_BOUNDS),
        Contender("NMPC, IPOPT", "ipopt", kl.nominal_unicycle(0.1), PAPER_BOUNDS),
    ]


def run(
    folder: Path,
    which: str,
    bar: Progress,
    trials: int | None = None,
    first_seed: int = REPORTING_SEED,
    robot: int = 0,
    only: str = "",
) -> list[Trial]:
    """Run an experiment; models are learned first where they are not there.

    Parameters
    ----------
    folder : Path
        Of data and models, of one robot.
    which : str
        One of `EXPERIMENTS`.
    bar : callable
        See `Progress`.
    trials : int, optional
        For each map; the experiment's if not given.
    first_seed : int
        Of pose noise and delays.
    robot : int
        Which robot is learned and driven.
    only : str
        Only contenders whose labels contain this.
    """
    experiment = EXPERIMENTS[which]
    seeds = [first_seed + i for i in range(trials or experiment.trials)]
    scenarios = [Scenario.load(name) for name in experiment.maps]
    setup = replace(SLOW if which == "c" else FAST, robot=robot)
    chosen = [c for c in contenders(folder, which, bar, robot) if only.lower() in c.label.lower()]
    if not chosen:
        raise ConfigError(f"--only {only}: nobody is left")
    found = repeat(chosen, scenarios, setup, seeds, bar(f"experiment ({which})"))
    if which == "d":
        # what knows the new floor from the beginning: the whole floor is the new one
        for floor, scenario in (("carpet", scenarios[0]), ("wet", scenarios[1])):
            told = Contender(
                f"ours, learned on {floor}",
                "kmpc",
                learn(folder, floor, bar, robot),
                PAPER_BOUNDS,
                adaptation=False,
            )
            found += repeat([told], [scenario], setup, seeds, bar(f"learned on {floor}"))
    return found
