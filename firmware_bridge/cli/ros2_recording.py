"""`kmpc ros2 --record`: a drive by topics as MCAP, as `kmpc run --record` writes it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from firmware_bridge.cli.recording import DriveRecorder, about_drive
from firmware_bridge.recording.drive.encoder import DriveEncoder
from firmware_bridge.recording.drive.records import Record, Stepped
from firmware_bridge.recording.drive.seen import scan_among
from firmware_bridge.recording.durable import DurableFile
from firmware_bridge.ros2.navigator import GoalNavigator
from kmpc_lite.control.controller import Controller
from kmpc_lite.control.world.occupancy import OccupancyGrid
from kmpc_lite.errors import ScenarioError
from kmpc_lite.scenario.files import Scenario

if TYPE_CHECKING:
    from firmware_bridge.runtime.session import Session

AROUND = 2.0
"""Shown round start, goal and map [m]."""
MOST_WAITING = 20_000
"""Records that are kept until the first plan: of minutes."""


class Driven(NamedTuple):
    """What is driven, as recorders want it."""

    controller: Controller
    navigator: GoalNavigator
    watchers: list[Callable[[Any, Any], None]]
    """Receive each pose and plan, in the thread that plans."""


class LateEncoder:
    """Encodes from the first plan on: only then it is known what is driven, and on which map.

    Parameters
    ----------
    make : callable
        Makes the encoder of the first step.
    """

    def __init__(self, make: Callable[[Stepped], DriveEncoder]) -> None:
        self._make = make
        self._encoder: DriveEncoder | None = None
        self._waiting: list[Record] = []

    def __call__(self, records: Iterable[Record]) -> list[bytes]:
        """Give the pieces of records."""
        if self._encoder is not None:
            return self._encoder.encode(records)
        self._waiting = [*self._waiting, *records][-MOST_WAITING:]
        first = next((r for r in self._waiting if isinstance(r, Stepped)), None)
        if first is None:
            return []
        self._encoder, waiting = self._make(first), self._waiting
        self._waiting = []
        return [self._encoder.begin(first.time), *self._encoder.encode(waiting)]


class TopicRecorder(DriveRecorder):
    """Records a drive to the goals of topics."""

    def __init__(
        self, path: Path, job: Driven, session: Session, about: dict[str, Any], period: float
    ) -> None:
        def encoder(first: Stepped) -> DriveEncoder:
            offset = time.time() - time.monotonic()
            return DriveEncoder(scenario_of(job, first), period, about, offset)

        super().__init__(DurableFile(path, LateEncoder(encoder)), job, session)

    def _seen(self) -> Any:
        return self._job.navigator.obstacles

    def _scan(self, seen: Any) -> Any:
        return scan_among(seen)


def scenario_of(job: Driven, first: Stepped) -> Scenario:
    """What was driven, as far as a first step tells: start, goal, robot and map."""
    goal = job.navigator.goal
    end = first.pose if goal is None else (goal.x, goal.y, goal.theta)
    grid = next((o for o in job.navigator.obstacles if isinstance(o, OccupancyGrid)), None)
    places = np.array([first.pose[:2], end[:2]])
    if grid is not None and len(grid.rectangles):
        corners = grid.rectangles.reshape(-1, 2)
        places = np.vstack([places, grid.to_map(corners)])
    low, high = places.min(axis=0) - AROUND, places.max(axis=0) + AROUND

    def made(shown: OccupancyGrid | None) -> Scenario:
        return Scenario(
            name="ros2",
            bounds=(*low.tolist(), *high.tolist()),
            circles=(),
            radius=job.controller.problem.robot_radius,
            start=first.pose,
            goal=end,
            grid=shown,
        )

    try:
        return made(grid)
    except ScenarioError:  # the goal lies where the map has something
        return made(None)


def topic_recorder(
    job: Driven, period: float, command: str
) -> Callable[[Session, Path], TopicRecorder]:
    """Give what records drives to the goals of topics, once there is a session."""

    def make(session: Session, name: Path) -> TopicRecorder:
        plant = f"ROS 2 topics over {session.robot.link.url}; poses as they came"
        about = about_drive(session.robot, plant, job.controller, command)
        return TopicRecorder(name.with_name(f"{name.name}.mcap"), job, session, about, period)

    return make
