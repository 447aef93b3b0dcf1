"""Conditions of a study beside slip (lag, noise, old poses), and the studies by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from kmpc_lab.sim.plants.lag import LaggingDrive, drive_log
from kmpc_lab.studies.contenders import EVERYTHING, STUDY_CONTENDERS, Contender
from kmpc_lab.studies.training import DT, LAMBDAS, TRAINING_SEED, train
from kmpc_lite.errors import ProblemError
from kmpc_lite.learn.calibration import with_quantiles
from kmpc_lite.learn.fitting import fit
from kmpc_lite.learn.regression import Method
from kmpc_lite.model.dictionary import Dictionary, HermiteTrigDictionary, InputHistoryDictionary
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.scenario.files import Scenario

POSE_NOISE = (0.005, 0.005, 0.02)
"""Of a good motion capture or lidar [m, m, rad]."""
HISTORY = 2.0
"""How far back a model of a robot that lags looks, in time constants beyond the dead time: older
commands weigh less than the noise."""
LOG_EPISODES, LOG_STEPS = 100, 400
"""Drives of a log and periods of each, at the most: an hour of driving."""


@dataclass(frozen=True)
class Condition:
    """A kind of robot, pose and floor; its model is learned from a log of the same robot."""

    name: str = ""
    """In tables and files; empty for the paper's robot, which only slips."""
    lag: float = 0.0
    """Time constant of the motors [s]."""
    dead_time: float = 0.0
    """[s]"""
    pose_noise: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Of driving, and of the log [m, m, rad]."""
    pose_age: float = 0.0
    """While driving; poses of a log have stamps [s]."""
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

    def learn(self, slip: float, method: Method, episodes: int, steps: int) -> KoopmanModel:
        """Learn as the paper does where the robot only slips, else from a log of the robot.

        Half of such a log is for the fit, half for the margins' quantiles, as ``kmpc fit`` does
        with a real one.
        """
        if not (self.lag or self.dead_time or any((*self.pose_noise, *self.turning_point))):
            return train(slip, method, episodes, steps)
        plant = LaggingDrive(
            self.lag, self.dead_time, slip, seed=TRAINING_SEED, turning_point=self.turning_point
        )
        log = drive_log(
            plant,
            min(episodes, LOG_EPISODES),
            min(steps, LOG_STEPS),
            DT,
            TRAINING_SEED + 1,
            pose_noise=self.pose_noise,
        )
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


@dataclass(frozen=True)
class MapLesson:
    """What a model of a study is learned from: equal lessons give the same model."""

    condition: Condition
    """As a log shows it: `Condition.log`."""
    slip: float
    method: Method

    def learn(self, episodes: int, steps: int) -> KoopmanModel:
        """Make the data, and fit."""
        return self.condition.learn(self.slip, self.method, episodes, steps)


PLAIN = Condition()
LAGGING = Condition("lag 0.3 s, dead time 0.15 s", 0.3, 0.15)
NOISY_LAGGING = replace(LAGGING, name="lag, noisy poses", pose_noise=POSE_NOISE)
OLD_LAGGING = replace(NOISY_LAGGING, name="lag, noisy poses 0.1 s old", pose_age=0.1)


OURS, PAPERS = EVERYTHING.label, "K-NMPC, IPOPT"


@dataclass(frozen=True)
class MapsStudy:
    """What one of the ``kmpc study`` commands drives if nothing else is asked for."""

    text: str
    controllers: tuple[str, ...] = (OURS,)
    """Labels."""
    conditions: tuple[Condition, ...] = (PLAIN,)
    slips: tuple[float, ...] = LAMBDAS


STUDIES: Mapping[str, MapsStudy] = {
    "maps": MapsStudy("random maps by families and slips", (PAPERS, OURS)),
    "lag": MapsStudy(
        "a robot whose motors lag, driven with a model learned from its log, with exact, "
        "noisy and old poses",
        conditions=(LAGGING, NOISY_LAGGING, OLD_LAGGING),
        slips=(0.0, 0.1),
    ),
}


def choose(study: MapsStudy, words: Sequence[str] | None) -> list[Contender]:
    """Controllers whose labels contain one of the words; the study's own if none are given.

    Raises
    ------
    ProblemError
        If nobody is left, or the paper's one-step fit is asked to learn from a log that is no
        simulation of its own.
    """
    if words is None:
        return [c for c in STUDY_CONTENDERS if c.label in study.controllers]
    chosen = [c for c in STUDY_CONTENDERS if any(word.lower() in c.label.lower() for word in words)]
    if not chosen:
        raise ProblemError(
            f"--controllers {' '.join(words)}: nobody is left; "
            f"labels are {'; '.join(c.label for c in STUDY_CONTENDERS)}"
        )
    if study.conditions != (PLAIN,) and any(c.fit != "integral" for c in chosen):
        refused = "; ".join(c.label for c in chosen if c.fit != "integral")
        raise ProblemError(
            f"--controllers {refused}: only controllers with an integral fit are driven in this "
            "study"
        )
    return chosen
