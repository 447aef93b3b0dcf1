"""``kmpc study real``: the nearest that a simulation comes to a real robot.

The plant is made from one half of a real log, the model of the controller from the other half. The
plant moves as its own model says, and errs as the log did: whole windows of the model's residuals
are drawn from the log, those of about the same speed. What the poses' own noise has put into
residuals is taken out, and is in the measured poses instead. Where the log's inputs are measured
speeds the motors' lag is not in it, and is added. Judged by the true pose.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np

from kmpc_lab.studies.any_robot import Robot
from kmpc_lab.studies.any_wheels import Moves
from kmpc_lab.studies.drive import DriveResult
from kmpc_lab.studies.robot_drives import COLUMNS as OF_ROBOTS
from kmpc_lab.studies.robot_drives import drive_course
from kmpc_lab.studies.table import Column, mean_of
from kmpc_lite.control import Controller
from kmpc_lite.control.margins import Margins
from kmpc_lite.errors import DataError
from kmpc_lite.geometry import rotate
from kmpc_lite.learn.calibration import prediction_errors, scores, with_quantiles
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.fitting import fit
from kmpc_lite.learn.windows import largest_inputs
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.tube import tube_noise
from kmpc_lite.scenario.touch import LOOKS
from kmpc_lite.types import Array

Lags = Literal["auto"] | tuple[int, ...] | None  # as `fit` takes them
FEWEST = 20  # a log of fewer drives is cut into pieces: halves of a few drives say little
PIECE = 5.0  # length of such a piece [s]


def load_drives(log: Path, dt: float) -> Dataset:
    """Read a log at a period [s]; one that holds few long drives is cut into pieces of 5 s."""
    data = Dataset.load(log, dt=dt)
    return data if len(data) >= FEWEST else data.windows(PIECE)


SPLIT_SEED = 7200  # of the halves of a log
WINDOW = 1.0  # how long residuals are taken from one place of the log [s]
MOTOR_LAG = 0.1  # time constant of motors that a log of measured speeds does not show [s]
AHEAD = 0.5  # how far ahead the error is that margins are held against [s]
SPEED_BINS = 4  # groups of windows, by how fast they were driven


@dataclass(frozen=True)
class Recipe:
    """How a model is learned and driven."""

    name: str
    lags: Lags
    adapts: bool = False


RECIPES = (
    Recipe("auto", "auto"),
    Recipe("auto, adapted", "auto", adapts=True),
    Recipe("no lags", None),
    Recipe("no lags, adapted", None, adapts=True),
    Recipe("lags 0 1 2 3", (0, 1, 2, 3)),
    Recipe("lags 0 1 2 3, adapted", (0, 1, 2, 3), adapts=True),
)
COLUMNS = (
    *OF_ROBOTS,
    Column("margin ahead [m]", ".3f", mean_of("ahead")),
    Column("aside [m]", ".3f", mean_of("aside")),
    Column("error 0.5 s ahead [m]", ".3f", mean_of("error")),
    Column("within 95 %", ".1%", mean_of("within")),
)


class RealPlant:
    """Moves as a model of a log says, and errs as the log did.

    `model`: with noise sources. `log`: where its errors come from. `seed`: of the windows that are
    drawn. `motor_lag`: time constant between commands and the log's inputs [s].
    """

    def __init__(self, model: KoopmanModel, log: Dataset, seed: int, motor_lag: float) -> None:
        self._model, self._random = model, np.random.default_rng([seed, 13])
        self._share = 1.0 - np.exp(-model.dt / motor_lag) if motor_lag else 1.0
        self._input, self._past = np.zeros(2), np.zeros((model.history, 2))
        windows = list(_residual_windows(model, log))
        if len(windows) < SPEED_BINS:
            raise DataError("the log is too short to draw errors from it")
        speeds = np.array([np.abs(w[0]).mean(axis=0)[0] for w in windows])
        order = np.argsort(speeds, kind="stable")
        self._bins = [[windows[i] for i in part] for part in np.array_split(order, SPEED_BINS)]
        self._edges = [float(np.abs(b[0][0]).mean(axis=0)[0]) for b in self._bins[1:]]
        self._window, self._place = self._bins[0][0], len(self._bins[0][0][0])

    def drive(self, pose: Array, command: Array) -> Array:
        """Poses (LOOKS, 3) during one period from a pose (3,), evenly spaced between its ends."""
        self._input = self._input + self._share * (command - self._input)
        end = self._model.predict(pose, self._input, self._past)
        error = self._error(self._input)
        end = end + (*rotate(error[0], error[1], pose[2]), error[2])
        self._past = np.concatenate([self._past, self._input[None]])[1:]
        share = np.arange(1, LOOKS + 1)[:, None] / LOOKS
        path: Array = pose + share * (end - pose)
        return path

    def _error(self, command: Array) -> Array:
        """Error of this period in the robot's frame (3,), as large as the command allows."""
        inputs, errors = self._window
        if self._place >= len(inputs):
            group = self._bins[int(np.searchsorted(self._edges, abs(float(command[0]))))]
            inputs, errors = self._window = group[self._random.integers(len(group))]
            self._place = 0
        told, error = inputs[self._place], errors[self._place]
        self._place += 1
        # a robot that is slower than the log's errs by less, and one that stands does not move
        size, was = (float(np.abs(u) @ (1.0, 0.3)) for u in (command, told))
        out: Array = error * min(1.0, size / max(was, 1e-9))
        return out


def _residual_windows(model: KoopmanModel, log: Dataset) -> Iterator[tuple[Array, Array]]:
    """Inputs (n, 2) and errors in the robot's frame (n, 3) of whole windows of a log."""
    steps, past = max(1, round(WINDOW / model.dt)), model.history
    noise = tube_noise(model.noise_model, model.dt)
    for episode in log.episodes:
        for first in range(past, len(episode) - steps + 1, steps):
            rows = np.arange(first, first + steps)
            history = episode.inputs[rows[:, None] + np.arange(-past, 0)] if past else None
            x, u = episode.states[rows], episode.inputs[rows]
            error = episode.states[rows + 1] - model.predict(x, u, history)
            ahead, left = rotate(error[:, 0], error[:, 1], -x[:, 2])
            # what measured poses put into a residual is no motion
            squares = u**2
            moved = np.tensordot(squares, noise.white + noise.lasting, axes=(-1, 0))
            pose = noise.pose + squares[:, :1, None] * noise.pose_by_speed
            motion, measured = (np.einsum("nii->ni", m) for m in (moved, noise.poses * pose))
            kept = np.sqrt(motion / np.maximum(motion + measured, 1e-18))
            yield u, kept * np.stack([ahead, left, error[:, 2]], axis=1)


@dataclass(frozen=True)
class RealRobot:
    """A real robot as far as its log tells of it."""

    robot: Robot
    log: Path

    def halves(self) -> tuple[Dataset, Dataset]:
        """What the model is learned from, and what the plant is made of."""
        return load_drives(self.log, self.robot.dt).split(0.5, seed=SPLIT_SEED)


def real_robot(log: Path, radius: float, speed: float, turn_rate: float) -> RealRobot:
    """Give a real robot from its log, which is driven at 10 Hz within these bounds.

    `log`: whatever `Dataset.load` reads. `radius`, `speed`, `turn_rate`: [m], [m/s], [rad/s].
    """
    return RealRobot(Robot(log.stem, radius, speed, turn_rate), log)


@lru_cache(maxsize=len(RECIPES))
def widths(real: RealRobot, lags: Lags) -> dict[str, float]:
    """How wide the margins of a model are, and what they hold of driving that nothing saw.

    Ahead and aside at 1 m/s [m], the error of a position 0.5 s ahead [m], and the share of the
    driving within the tube of 95 %.
    """
    model, its = _learn(real, lags)
    margins = Margins(model, real.robot.problem(20.0 * real.robot.radius))
    ahead, aside = margins.straight(1.0)
    errors, _ = prediction_errors(model, its, AHEAD)
    error = float(np.sqrt((errors[:, -1, :2] ** 2).sum(axis=1).mean()))
    within = float((scores(model, its) <= margins.noise.quantile).mean())
    return {"ahead": float(ahead), "aside": float(aside), "error": error, "within": within}


@lru_cache(maxsize=len(RECIPES))
def _learn(real: RealRobot, lags: Lags) -> tuple[KoopmanModel, Dataset]:
    """Model of one half, with margins, and the other half."""
    mine, its = real.halves()
    train, held = mine.split(0.5, seed=SPLIT_SEED + 1)
    return with_quantiles(fit(train, lags=lags), held), its


@lru_cache(maxsize=1)
def _plant_model(real: RealRobot) -> tuple[KoopmanModel, Robot]:
    """Model that the plant moves as, and the robot as it is by that model."""
    _, its = real.halves()
    truth = fit(its, lags="auto")
    limits = largest_inputs(its.inputs)
    spread = tube_noise(truth.noise_model, truth.dt).pose_deviation
    turned = truth.predict(
        np.zeros(3), (0.0, limits[1]), np.tile((0.0, limits[1]), (truth.history, 1))
    )
    gain = float(turned[2]) / (limits[1] * truth.dt)
    return truth, replace(real.robot, noise=spread, turn_gain=gain)


def drive(log: str, radius: float, speed: float, turn: float, name: str, seed: int) -> DriveResult:
    """Learn from one half, and drive over the map of a seed on a plant of the other half."""
    real = real_robot(Path(log), radius, speed, turn)
    recipe = next(r for r in RECIPES if r.name == name)
    model, its = _learn(real, recipe.lags)
    truth, robot = _plant_model(real)
    plant = RealPlant(truth, its, seed, MOTOR_LAG)

    def ready(side: float) -> tuple[Controller, Moves]:
        return Controller(model, robot.problem(side), adaptation=recipe.adapts), plant

    return replace(drive_course(robot, seed, ready), more=widths(real, recipe.lags))
