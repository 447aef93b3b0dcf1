"""Study ``maps``: random maps by families, slips, and what else a robot and its poses are like."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from kmpc_lab.report.runs import trace_of
from kmpc_lab.sim.closed_loop import Outcome, Run
from kmpc_lab.sim.closed_loop import drive as drive_scenario
from kmpc_lab.sim.maps import random_map
from kmpc_lab.sim.plants.lag import LaggingDrive, drive_log
from kmpc_lab.studies.contenders import (
    DT,
    EPISODES,
    EVERYTHING,
    STEPS,
    STUDY_CONTENDERS,
    TRAINING_SEED,
    train,
)
from kmpc_lab.studies.drive import DriveResult, counted
from kmpc_lab.studies.table import AT_LEAST, DRIVES, GAP, SECONDS, STOPPED
from kmpc_lite.errors import DataError
from kmpc_lite.learn.calibration import with_quantiles
from kmpc_lite.learn.fitting import fit
from kmpc_lite.learn.regression import Method
from kmpc_lite.model.dictionary import Dictionary, HermiteTrigDictionary, InputHistoryDictionary
from kmpc_lite.model.koopman import KoopmanModel, nominal_unicycle
from kmpc_lite.scenario.files import Scenario

SETTLE = 1.0  # how long a robot must stay within the tolerances for a drive to end [s]
POSE_NOISE = (0.005, 0.005, 0.02)  # of a good motion capture or lidar [m, m, rad]
HISTORY = 2.0
"""How far back a model of a robot that lags looks, in time constants beyond the dead time: older
commands weigh less than the noise."""
LOG_EPISODES, LOG_STEPS = 100, 400
"""Drives of a log and periods of each, at the most: an hour of driving."""
CONTROLLERS = {spec.label: spec for spec in STUDY_CONTENDERS}
COLUMNS = *DRIVES, AT_LEAST, SECONDS, STOPPED, GAP
"""In pose at least: the lower end of its interval of 95 %."""


@dataclass(frozen=True)
class Condition:
    """A kind of robot, pose and floor; its model is learned from a log of the same robot."""

    name: str = ""  # in scenarios; empty for the paper's robot, which only slips
    lag: float = 0.0  # time constant of the motors [s]
    dead_time: float = 0.0  # [s]
    pose_noise: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Of driving, and of the log [m, m, rad]."""
    pose_age: float = 0.0  # while driving; poses of a log have stamps [s]
    turning_point: tuple[float, float] = (0.0, 0.0)
    """Where the robot turns on the spot, as seen from its pose: ahead, left [m]."""

    def apply(self, scenario: Scenario) -> Scenario:
        """Return the scenario under this condition."""
        if not self.name:
            return scenario
        return replace(
            scenario,
            name="-".join(
                [
                    scenario.name,
                    *"".join(c if c.isalnum() or c == "." else " " for c in self.name).split(),
                ]
            ),
            lag=self.lag,
            dead_time=self.dead_time,
            pose_noise=self.pose_noise,
            pose_age=self.pose_age,
            turning_point=self.turning_point,
        )

    @property
    def log(self) -> Condition:
        """What of it a log shows: conditions with the same log share a model."""
        return replace(self, name="", pose_age=0.0)

    def learn(
        self, slip: float, method: Method, episodes: int = EPISODES, steps: int = STEPS
    ) -> KoopmanModel:
        """Learn as the paper does where the robot only slips, else from a log of the robot.

        Half of such a log is for the fit, half for the margins' quantiles, as ``kmpc fit`` does
        with a real one.
        """
        if not (self.lag or self.dead_time or any((*self.pose_noise, *self.turning_point))):
            return train(slip, method, episodes, steps)
        plant = LaggingDrive(
            self.lag, self.dead_time, slip, seed=TRAINING_SEED, turning_point=self.turning_point
        )
        sizes = min(episodes, LOG_EPISODES), min(steps, LOG_STEPS)
        log = drive_log(plant, *sizes, DT, TRAINING_SEED + 1, pose_noise=self.pose_noise)
        half, held = log.split(0.5, seed=0)
        model = fit(half, self.dictionary(), method)
        return with_quantiles(model, held) if method == "integral" else model

    def dictionary(self) -> Dictionary:
        """Dictionary that a user would choose: no place is special, past commands are known.

        Commands are looked back on as long as they act.
        """
        trig = HermiteTrigDictionary(order=0)
        if not (self.lag or self.dead_time):
            return trig
        longest = round((self.dead_time + HISTORY * self.lag) / DT)
        return InputHistoryDictionary(trig, lags=tuple(range(longest + 1)))


LAGGING = Condition("lag 0.3 s, dead time 0.15 s", 0.3, 0.15)
NOISY = replace(LAGGING, name="lag, noisy poses", pose_noise=POSE_NOISE)
CONDITIONS = {
    "plain": Condition(),
    "lag": LAGGING,
    "lag, noisy": NOISY,
    "lag, noisy, old": replace(NOISY, name="lag, noisy poses 0.1 s old", pose_age=0.1),
}


@cache
def model_of(condition: Condition, slip: float, method: Method | None) -> KoopmanModel:
    """Model that a worker learns once: of a `Condition.log` on a floor."""
    return nominal_unicycle(DT) if method is None else condition.learn(slip, method)


def drive(label: str, condition: str, family: str, slip: float, seed: int) -> DriveResult:
    """Drive a map of a seed with a controller that has learned on the same floor."""
    spec, given = CONTROLLERS[label], CONDITIONS[condition]
    scenario = given.apply(random_map(family, seed, slip))
    controller = spec.build(model_of(given.log, slip, spec.fit), scenario)
    run = drive_scenario(controller, scenario, dt=DT, settle=SETTLE)
    return replace(result_of(run), peer=label != EVERYTHING.label)


def result_of(run: Run) -> DriveResult:
    """Account of a run; it arrives when it first is within both tolerances of the goal."""
    problem = run.scenario.problem()
    full = np.array(problem.u_max)
    collided, arrival = run.outcome is Outcome.COLLISION, run.arrival
    arrived = arrival is not None and not collided
    return DriveResult(
        arrived,
        collided,
        seconds=arrival if arrived and arrival is not None else run.duration,
        ideal_seconds=math.dist(run.scenario.start[:2], run.scenario.goal[:2]) / float(full[0]),
        clearance=run.clearance,
        fastest=float(np.abs(run.inputs[:, 0]).max()),
        ended=str(run.info.get("ended", run.outcome.value)),
        trace=trace_of(run),
        **counted(run.inputs / full, run.statuses, run.step_times),
    )


def prepare(values: Sequence[Sequence[object]]) -> None:
    """Build each controller: what is missing is reported now, not after minutes of training.

    Raises DataError: names a controller that cannot drive what is asked.
    """
    labels, conditions, families = (map(str, axis) for axis in values[:3])
    solid = [name for name in families if random_map(name, 0).solids is not None]
    logs = [name for name in conditions if name != "plain"]
    for spec in (CONTROLLERS[label] for label in labels):
        if solid and spec.form == "ipopt":
            told = f"maps of circles, got {', '.join(solid)}"
        elif logs and spec.fit == "edmdc":
            told = f"the condition plain, for it knows no lag and no noise, got {', '.join(logs)}"
        else:
            spec.build(nominal_unicycle(DT), Scenario.load("mehrez"))
            continue
        raise DataError(f"{spec.label}: expected {told}; --controllers everything drives them all")
