"""What learning is worth: held-out errors of the default fit against the nominal robot's.

Every figure is of driving that nothing was fitted, chosen or calibrated on, from starts that
are the same for all models. Seeds are not those that anything was tuned with.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kmpc_lab.sim.plants.lag import LaggingDrive, drive_log
from kmpc_lab.studies.training import DT
from kmpc_lite.errors import DataError
from kmpc_lite.geometry import seen_along
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.episode import Episode
from kmpc_lite.learn.fitting import fit
from kmpc_lite.learn.noise import NoiseCheck, check_sources
from kmpc_lite.model.dictionary import HermiteTrigDictionary
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.nominal import nominal_unicycle
from kmpc_lite.types import Array

FEWEST = 20
"""A log of fewer drives is cut into pieces: halves of a few drives say little."""
PIECE = 5.0
"""Length of such a piece [s]."""


def load_drives(log: Path, dt: float) -> Dataset:
    """Read a log at a period [s]; one that holds few long drives is cut into pieces of 5 s."""
    data = Dataset.load(log, dt=dt)
    return data if len(data) >= FEWEST else data.windows(PIECE)


SPLIT_SEEDS = tuple(range(7100, 7110))
"""Seeds of the ten splits of a log."""
ROBOT_SEED = 52_000
"""Seed of the first synthetic robot."""
REFERENCE_START = 0.5
"""Predictions start this long after the beginning of a drive [s], whatever a model's history."""
AHEAD = 1.0
"""How far ahead predictions are judged [s]."""
RESAMPLES = 2000
"""Bootstrap samples of the drives."""


@dataclass(frozen=True)
class Ratio:
    """Errors of a model after a while, as shares of the nominal robot's."""

    name: str
    """Which log, and which split."""
    along: float
    across: float
    heading: float
    bounds: tuple[float, float, float]
    """One-sided 95 % bounds by a bootstrap of whole drives."""
    history: int
    """Past commands that the model looks back on."""

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return asdict(self)


def open_loop_errors(
    model: KoopmanModel,
    episodes: Iterable[Episode],
    first: float = REFERENCE_START,
    truth: Iterable[Array] | None = None,
) -> list[Array]:
    """Errors along, across [m] and of the heading [rad] of each episode's predictions, (n, 3) each.

    Parameters
    ----------
    model : KoopmanModel
        Predicts from the measured pose at each start.
    episodes : iterable of Episode
        Drives with measured poses.
    first : float
        Where predictions start [s]; the history of the model must fit before.
    truth : iterable of ndarray, optional
        Noise-free poses (T + 1, 3) to judge by.
    """
    drives = list(episodes)
    poses = [e.states for e in drives] if truth is None else list(truth)
    steps, begin = max(1, round(AHEAD / model.dt)), round(first / model.dt)
    if begin < model.history:
        raise DataError(
            f"a history of {model.history} periods does not fit before starts at {first:g} s"
        )
    errors = []
    for episode, true in zip(drives, poses, strict=True):
        starts = np.arange(begin, len(episode) - steps + 1)
        if not len(starts):
            continue
        rows = starts[:, None] + np.arange(-model.history, steps)
        inputs = episode.inputs[rows]
        x = episode.states[starts]
        ends = model.rollout(x, inputs[:, model.history :], inputs[:, : model.history])[:, -1]
        errors.append(seen_along(ends - true[starts + steps], x[:, 2]))
    return errors


def compare(name: str, model: KoopmanModel, ours: list[Array], nominal: list[Array]) -> Ratio:
    """Ratio of root mean squares, with bounds that resample whole drives."""
    mine = np.array([np.sum(e**2, axis=0) for e in ours])
    theirs = np.array([np.sum(e**2, axis=0) for e in nominal])
    ratio = np.sqrt(mine.sum(axis=0) / np.maximum(theirs.sum(axis=0), 1e-300))
    counts = np.random.default_rng(1).multinomial(
        len(mine), np.full(len(mine), 1 / len(mine)), RESAMPLES
    )
    resampled = np.sqrt((counts @ mine) / np.maximum(counts @ theirs, 1e-300))
    bounds = np.quantile(resampled, 0.95, axis=0)
    return Ratio(
        name,
        float(ratio[0]),
        float(ratio[1]),
        float(ratio[2]),
        (float(bounds[0]), float(bounds[1]), float(bounds[2])),
        model.history,
    )


def default_fit(train: Dataset) -> KoopmanModel:
    """What ``kmpc fit`` learns if nothing is asked for."""
    return fit(train, HermiteTrigDictionary(order=0), lags="auto")


def study_log(
    log: Path, progress: Callable[[int, int], None] = lambda done, total: None
) -> tuple[list[Ratio], NoiseCheck]:
    """Ten random halves of a log's drives, each judged on the other half; the noise of the last."""
    data = load_drives(log, DT)
    longest = max(len(e) for e in data.episodes)
    rows = []
    for k, seed in enumerate(SPLIT_SEEDS):
        train, held = data.split(0.5, seed=seed)
        model = default_fit(train)
        first = max(REFERENCE_START, model.history * DT) if longest > 40 else REFERENCE_START
        ours = open_loop_errors(model, held.episodes, first=first)
        nominal = open_loop_errors(nominal_unicycle(DT), held.episodes, first=first)
        rows.append(compare(f"{log.stem} {seed}", model, ours, nominal))
        progress(k + 1, len(SPLIT_SEEDS))
    noise = check_sources(model, held)
    if noise is None:
        raise DataError(f"{log}: too short to tell the sources of the errors apart")
    return rows, noise


def study_lagging(
    progress: Callable[[int, int], None] = lambda done, total: None, robots: int = 10
) -> list[Ratio]:
    """Robots with a lag of 0.25 s, a dead time of 0.1 s and slip 0.05, judged by the true pose.

    Two minutes of each are learned from; poses err by 2 mm and 4 mrad.
    """
    rows = []
    noise = (0.002, 0.002, 0.004)
    for k in range(robots):
        seed = ROBOT_SEED + k
        logs = [
            drive_log(
                LaggingDrive(0.25, 0.1, 0.05, seed=seed), 24, 100, 0.1, seed, hold=10, pose_noise=n
            )
            for n in (noise, (0.0, 0.0, 0.0))
        ]
        model = default_fit(Dataset(logs[0].episodes[:12]))
        held, truth = logs[0].episodes[12:], [e.states for e in logs[1].episodes[12:]]
        errors = [
            open_loop_errors(m, held, first=1.2, truth=truth)
            for m in (model, nominal_unicycle(0.1))
        ]
        rows.append(compare(f"lagging {seed}", model, *errors))
        progress(k + 1, robots)
    return rows


def nominal_log(seed: int, seconds: float = 60.0) -> Dataset:
    """A log of a robot that is nominal but for noise: its own, which lasts, and that of its poses.

    Speeds, and the size and the duration of every noise, are drawn at random.
    """
    random = np.random.default_rng(seed)
    steps = round(seconds / DT)
    largest = np.exp(random.uniform(np.log([0.2, 0.5]), np.log([3.0, 2.5])))
    inputs = np.zeros((steps, 2))
    k = 0
    while k < steps:
        held = int(random.integers(3, 25))
        inputs[k : k + held] = random.uniform(-1.0, 1.0, 2) * largest
        k += held
    forgets = np.exp(-DT / np.exp(random.uniform(np.log(0.1), np.log(2.0))))
    sizes = random.uniform(0.0, 0.1, 3)
    gains = np.empty((steps, 3))
    state = random.normal(size=3)
    for k in range(steps):
        state = forgets * state + np.sqrt(1.0 - forgets**2) * random.normal(size=3)
        gains[k] = sizes * state
    forward, left = inputs[:, 0] * (1.0 + gains[:, 0]), inputs[:, 0] * gains[:, 1]
    turn = inputs[:, 1] * (1.0 + gains[:, 2]) * DT
    heading = np.concatenate([[0.0], np.cumsum(turn)])
    chord = (forward + 1j * left) * DT * np.sinc(turn / (2.0 * np.pi))
    position = np.cumsum(np.concatenate([[0.0], chord * np.exp(1j * (heading[:-1] + turn / 2))]))
    poses = np.stack([position.real, position.imag, heading], axis=1)
    low, high = np.log([0.001, 0.001, 0.002]), np.log([0.02, 0.02, 0.05])
    poses = poses + random.normal(size=poses.shape) * np.exp(random.uniform(low, high))
    return Dataset([Episode(poses, inputs, DT)])


def study_nominal(
    progress: Callable[[int, int], None] = lambda done, total: None, robots: int = 200
) -> list[Ratio]:
    """Robots that are nominal: half of a one-minute log is learned from, ten minutes judge."""
    rows = []
    for k in range(robots):
        seed = ROBOT_SEED + 1000 + k
        train, _ = nominal_log(seed).windows(5.0).split(0.5, seed=0)
        model = default_fit(train)
        held = nominal_log(seed, 600.0).windows(10.0).episodes
        errors = [open_loop_errors(m, held, first=1.2) for m in (model, nominal_unicycle(0.1))]
        rows.append(compare(f"nominal {seed}", model, *errors))
        progress(k + 1, robots)
    return rows


def format_ratios(title: str, rows: list[Ratio]) -> str:
    """Mean and worst ratios of some splits or robots."""
    values = np.array([(r.along, r.across, r.heading) for r in rows])
    bounds = np.array([r.bounds for r in rows])
    lines = [f"{title}: 1 s error as a share of the nominal robot's, {len(rows)} of them"]
    lines.append(f"  {'':<22}{'along':>9}{'across':>9}{'heading':>9}")
    for name, row in (
        ("mean", values.mean(axis=0)),
        ("worst", values.max(axis=0)),
        ("mean of the bounds", bounds.mean(axis=0)),
        ("worst bound", bounds.max(axis=0)),
    ):
        lines.append(f"  {name:<22}" + "".join(f"{v:9.3f}" for v in row))
    longest = [r.history for r in rows]
    lines.append(f"  past commands: {min(longest)} to {max(longest)}")
    return "\n".join(lines)


def format_harm(rows: list[Ratio]) -> str:
    """How many nominal robots are worse off by learning, and by how much."""
    worst = np.array([max(r.along, r.across, r.heading) for r in rows])
    changed = np.array([(r.along, r.across, r.heading) != (1.0, 1.0, 1.0) for r in rows])
    harmed = worst > 1.0 + 1e-9
    return (
        f"nominal robots, one-minute logs: {len(rows)}; something was learned of {changed.sum()}; "
        f"harmed {harmed.sum()} ({100 * harmed.mean():.1f} %), "
        f"at most by {100 * (worst.max() - 1):.2f} %"
    )
