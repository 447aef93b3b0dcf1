"""Every array that outlives a step, and nothing else does."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.adaptation.steps import AdaptationState
from kmpc_lite.control.estimate.history import CommandHistory, LatenessState
from kmpc_lite.control.estimate.innovation import InnovationState
from kmpc_lite.control.nmpc.qp import Trajectory
from kmpc_lite.control.world.scene import SceneState
from kmpc_lite.control.world.tracks import TrackedCircles
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.path.situation import GuideState
    from kmpc_lite.control.world.local_map import LocalMap
    from kmpc_lite.control.world.sight import ScanWatchState


@dataclass(slots=True)
class StandstillState:
    """Where the robot stands, and what it was commanded there."""

    place: tuple[float, ...] = (math.nan,) * 6
    """Pose that it has not moved away from, and its goal: another one is a new beginning."""
    time: float = 0.0  # since it came there [s]
    ways: Array = field(default_factory=lambda: np.zeros((2, 2)))
    """How far its commands would have driven it since [m], and turned it [rad]; and how far it has
    come from there at the most."""


@dataclass(slots=True)
class ControllerState:
    """What a controller remembers between two steps; it copies, pickles, and restores a drive.

    Lengths and times are in the robot's units (`kmpc_lite.scale`), but for the models' and the
    adaptation's, which are in metres and seconds.
    """

    base_model: KoopmanModel  # the model as it was learned
    model: KoopmanModel  # the model in use: the learned one, or that one as corrected by adaptation
    history: CommandHistory  # commands sent, and the past period
    scene: SceneState  # polygons, walls and grids that were prepared
    guide: GuideState | None  # path, search and checkers; none without guidance
    innovation: InnovationState = field(default_factory=InnovationState)
    """How poses differed from what was predicted, and whether the pose has jumped."""
    lateness: LatenessState | None = None
    """How the robot answers beyond its model; None where that is not looked for."""
    circles: TrackedCircles = field(default_factory=TrackedCircles)
    """Circles as given, those out of reach, and what is followed of them and in scans."""
    turn: float = 0.0
    """Signed turn to the goal's heading in the step before, without guidance [rad]."""
    standstill: StandstillState = field(default_factory=StandstillState)
    """Where the robot stands, and what it was commanded there."""
    trajectory: Trajectory | None = None  # last plan: the warm start of the next step
    adaptation: AdaptationState | None = None  # of adaptation; None without it
    seen: LocalMap | None = None  # what scans have shown; None without any
    scans: ScanWatchState | None = None  # what scanners told last; None without any
    after_solve: float = 0.0
    """How long the work after a QP has taken lately [s]; a time budget leaves so much for it."""

    @property
    def ramps(self) -> Array | None:
        """Ramps (m,) that were found while driving."""
        return None if self.lateness is None else self.lateness.ramps

    @classmethod
    def start(
        cls,
        model: KoopmanModel,
        history: CommandHistory,
        guided: bool,
        adaptation: AdaptationState | None,
    ) -> ControllerState:
        """State of a drive that begins with a learned model."""
        guide = None
        if guided:
            # here, for guidance costs as much to import as all the rest
            from kmpc_lite.control.path.situation import GuideState

            guide = GuideState()
        return cls(model, model, history, SceneState(), guide, adaptation=adaptation)
