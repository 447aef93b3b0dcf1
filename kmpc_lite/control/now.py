"""What a step is given, checked and in the robot's units: what a broken sensor sends stops here."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.control.input_checks import (
    EXPECTED,
    POSITION_LIMIT,
    are_plausible,
    first_implausible,
    is_plausible,
    step_numbers,
)
from kmpc_lite.control.kernels.records import COLUMNS, SPREAD_RATE, things_of
from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.control.world.scene import Obstacles, Scene
from kmpc_lite.geometry import nearest_turn
from kmpc_lite.scale import Scale
from kmpc_lite.types import STATES, Array

if TYPE_CHECKING:
    from kmpc_lite.control.clock import StepClock
    from kmpc_lite.control.knowledge import Knowledge
    from kmpc_lite.control.margins import FeltNoise
    from kmpc_lite.control.path.situation import Guidance
    from kmpc_lite.control.state import ControllerState
    from kmpc_lite.control.world.sight import View
    from kmpc_lite.control.world.solids import Nearby, Solids


@dataclass(slots=True)
class Now:
    """A step: what it works with, and pose, goal and obstacles, in the robot's units."""

    state: ControllerState  # all that outlives it; updated
    known: Knowledge  # what follows from the model
    clock: StepClock
    pose: Array  # (3,) as measured; brought forward by the estimate where poses are old
    goal: Array  # (3,), its heading within one turn
    things: Array  # (M, 7) what is round: given, seen to move, or remembered (`kernels.clearance`)
    solids: Solids | None  # polygons, walls and grids
    sent: Array | None  # (2,) what was really sent in the past period, where the caller says so
    refusal: str = ""  # why the step cannot be planned; empty if it can
    pose_is_known: bool = True  # whether the measured pose is plausible
    held: bool = False  # whether the last command was held back: the robot is not ours yet
    here: Array = field(default_factory=lambda: np.zeros(STATES))
    """(3,) the pose, its heading within one turn."""
    turns: float = 0.0  # by how much that heading differs [rad]
    nearby: Nearby | None = None
    """Solids that the robot can come to, and what it has not seen to be free."""
    scans: tuple[LaserScan, ...] = ()  # seen from the pose as measured
    view: View | None = None  # what was seen up to now; none without scans
    rolls_on: Array | None = None
    """(3,) by how much farther it comes than its model says, if it answers later than that."""
    felt: FeltNoise | None = None  # the noise, as past innovations inflate it; none without margins
    measured: Array = field(default_factory=lambda: np.zeros(STATES))
    """(3,) the pose as measured, not brought forward."""
    scanned: int = 0  # how many of the things, the last ones, scans have shown to walk
    perhaps: Array = field(default_factory=lambda: np.empty((0, COLUMNS)))
    """(P, 7) what seems to walk in scans, but may be a piece of something that stands."""
    guidance: Guidance | None = None  # where to: the reference along a path; none without guidance
    passes: int = 0  # of the SQP, as far as it has come

    @property
    def unsure(self) -> Array:
        """What is not known of the speeds (M,) at which things walk.

        Nothing for those in scans: the side that the robot sees of a pedestrian is nearer than the
        pedestrian, and a robot that may hardly move cannot make room.
        """
        unsure: Array = self.things[:, SPREAD_RATE].copy()
        unsure[len(unsure) - self.scanned :] = 0.0
        return unsure

    def bring_forward(self, pose: Array) -> None:
        """Take over where the robot is now; a model that runs away leads out of all numbers."""
        self.pose = pose
        self.pose_is_known = self.pose_is_known and bool(np.isfinite(pose).all())

    def place(self, scene: Scene) -> None:
        """Bring the heading within one turn, and look up what is near."""
        self.turns = float(nearest_turn(float(self.pose[2])))
        self.here = self.pose.copy()
        self.here[2] -= self.turns
        self.nearby = scene.near(self.state.scene, self.solids, self.pose[:2])


class Admission:
    """Checks what a step is given, and converts it."""

    def __init__(self, scale: Scale, scene: Scene) -> None:
        self._scale, self._scene = scale, scene

    def admit(
        self,
        tools: tuple[ControllerState, Knowledge, StepClock],
        x: ArrayLike,
        goal: ArrayLike,
        obstacles: Obstacles,
        sent: ArrayLike | None,
    ) -> Now:
        """Take in a step's arguments, in metres and seconds, and what it works with.

        Raises ValueError for wrong shapes and what is no numbers, and for nothing else.
        """
        pose, target, command = step_numbers(x, goal, sent, self._scale.inputs)
        if command is not None and not is_plausible(command):
            command = np.full(len(command), np.nan)  # what was sent is not known
        refusal, circles, solids, scans = self._scene.sort(tools[0].scene, obstacles)
        scale, pose_is_known = self._scale, is_plausible(pose)
        if refusal:
            pass
        elif not are_plausible(circles):
            row = first_implausible(circles)
            refusal = f"obstacle not usable: {row}; {EXPECTED}, no radius below 0"
            circles = circles[:0]
        elif not pose_is_known:
            refusal = f"pose not usable: {pose}; {EXPECTED}"
        elif not is_plausible(target):
            refusal = f"goal not usable: {target}; {EXPECTED}"
        elif solids is not None and not scale.length * solids.extent <= POSITION_LIMIT:
            far = scale.length * solids.extent
            refusal, solids = f"obstacle not usable: reaches out to {far:g} m", None
        else:
            target[2] -= nearest_turn(float(target[2]))
        measured = pose / scale.state
        return Now(
            *tools,
            measured,
            target / scale.state,
            things_of(circles / scale.circle),
            solids,
            None if command is None else command / scale.command,
            refusal,
            pose_is_known,
            scans=tuple(scan.scaled(scale.length, scale.time) for scan in scans),
            measured=measured,
        )
