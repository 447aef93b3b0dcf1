"""How one drive is stepped through, while it is recorded and when it is replayed.

A replay is open loop: it feeds the recorded poses and compares what the controller answers. It
knows the package by its public names only, and the QP solver's workspace, whose answers some
drives replace.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np
from golden_file import INPUT_SUMS, STATE_SUMS, STATUSES, Array, Drive
from numpy.typing import NDArray

import kmpc_lite as kl

SUMS_SEED = 20_240


class Clock:
    """Tells the recorded time of a step; it may jump after the first look and after every QP."""

    def __init__(self) -> None:
        self._now, self._jump, self._looked = 0.0, 0.0, False

    def begin(self, now: float, jump: float) -> None:
        """Begin a step at a time [s]; every look after the first is later by a jump [s]."""
        self._now, self._jump, self._looked = now, jump, False

    def advance(self, seconds: float) -> None:
        """Let time pass [s]."""
        self._now += seconds

    def __call__(self) -> float:
        if not self._looked:
            self._looked = True
            return self._now
        return self._now + self._jump


def workspace_module() -> Any:
    """The module of the QP solver's workspace, wherever it lives."""
    places = ("kmpc_lite.control.nmpc.osqp_workspace", "kmpc_lite.control.osqp_workspace")
    for place in places:
        try:
            return import_module(place)
        except ModuleNotFoundError as error:
            if not place.startswith(str(error.name)):
                raise
    raise ModuleNotFoundError(f"no OSQPWorkspace in any of {', '.join(places)}")


class QPFaults:
    """What becomes of the QP solver's answers in the step that is made."""

    def __init__(self, clock: Clock) -> None:
        self.clock, self.kind, self.first, self.seconds, self.count = clock, "", 0, 0.0, 0

    def begin(self, event: dict[str, Any]) -> None:
        """Take over an event: kind of fault, first QP that has it, time that each takes [s]."""
        self.kind, self.first = event.get("qp", ("", 0))
        self.seconds, self.count = event.get("qp_seconds", 0.0), 0

    @contextmanager
    def installed(self, wanted: bool) -> Iterator[None]:
        """Stand between the controller and its solver."""
        if not wanted:
            yield
            return
        module = workspace_module()
        original = module.OSQPWorkspace.solve

        def solve(workspace: Any, *args: Any, **kwargs: Any) -> Any:
            number, self.count = self.count, self.count + 1
            self.clock.advance(self.seconds)
            if self.kind and number >= self.first and self.kind == "failed":
                zeros = np.zeros(workspace.n), np.zeros(workspace.m)
                return module.QPSolution(
                    module.QPStatus.FAILED, *zeros, 0, np.inf, np.inf, "made to fail"
                )
            solution = original(workspace, *args, **kwargs)
            if not self.kind or number < self.first:
                return solution
            if self.kind == "stopped":
                return replace(
                    solution, status=module.QPStatus.STOPPED_EARLY, reason="made to stop"
                )
            return replace(
                solution, **{self.kind: np.full_like(getattr(solution, self.kind), np.nan)}
            )

        module.OSQPWorkspace.solve = solve
        try:
            yield
        finally:
            module.OSQPWorkspace.solve = original


@lru_cache(maxsize=8)
def projections(horizon: int) -> tuple[Array, Array]:
    """Fixed random matrices (6, 3 N + 3) and (4, 2 N)."""
    random = np.random.default_rng([SUMS_SEED, horizon])
    sizes = (STATE_SUMS, 3 * (horizon + 1)), (INPUT_SUMS, 2 * horizon)
    states, inputs = (random.normal(size=size) / np.sqrt(size[1]) for size in sizes)
    return states, inputs


def measure(plan: Any) -> tuple[Array, list[int]]:
    """The numbers (len(COLUMNS),) and the codes of a plan."""
    by_states, by_inputs = projections(len(plan.inputs))
    parts = (
        plan.command,
        by_states @ plan.states.ravel(),
        by_inputs @ plan.inputs.ravel(),
        [plan.clearance],
    )
    codes = [
        STATUSES.index(plan.status.name),
        int(plan.holding),
        int(plan.reachable),
        min(plan.iterations, 255),
    ]
    return np.concatenate(parts), codes


def solids_of(table: dict[str, Any]) -> list[Any]:
    """Polygons, walls and the grid of an obstacles event."""
    solids: list[Any] = [kl.Polygon(corners) for corners in table.get("polygons", ())]
    solids += [kl.Wall(*row) for row in table.get("walls", ())]
    if "grid" in table:
        grid = table["grid"]
        cells = np.array([[cell == "#" for cell in row] for row in grid["rows"]])
        solids.append(kl.OccupancyGrid(cells, grid["resolution"], grid["origin"]))
    return solids


class Session:
    """A controller that is driven through a recorded drive's events, step by step."""

    def __init__(self, setup: dict[str, Any], models: list[kl.KoopmanModel]) -> None:
        self._models, self._dt = models, setup["problem"].get("dt", 0.1)
        self._events = {event["step"]: event for event in setup["events"]}
        self._clock = Clock()
        self.faults = QPFaults(self._clock)
        self.faulty = any("qp" in event or "qp_seconds" in event for event in setup["events"])
        problem = kl.NavigationProblem(**setup["problem"])
        self.controller = kl.Controller(
            models[setup["model"]], problem, clock=self._clock, **setup["options"]
        )
        self.goal: Array = np.zeros(3)
        self.circles: Array = np.empty((0, 5))
        self._as_objects, self._solids = False, []

    def add(self, event: dict[str, Any]) -> None:
        """Add to what happens at a step."""
        self._events.setdefault(event["step"], {}).update(event)

    def step(self, k: int, pose: Array, sent: Array | None, now: float) -> Any:
        """Make step k and return the plan."""
        event = self._events.get(k, {})
        if "goal" in event:
            self.goal = np.array(event["goal"], dtype=float)
        if "obstacles" in event:
            table = event["obstacles"]
            self.circles = np.array(table["circles"], dtype=float).reshape(-1, 5)
            self._as_objects, self._solids = table.get("objects", False), solids_of(table)
        if "update_model" in event:
            self.controller.update_model(self._models[event["update_model"]])
        if event.get("reset"):
            self.controller.reset()
        self._clock.begin(now, event.get("jump", 0.0))
        self.faults.begin(event)
        plan = self.controller.step(
            pose,
            self.goal,
            self._obstacles(k * self._dt),
            **({} if sent is None else {"sent": sent}),
        )
        return plan

    def spoil(self, k: int, plan: Any) -> None:
        """Write NaN into the plan, as a careless caller does, where step k's event says so."""
        if self._events.get(k, {}).get("spoil"):
            plan.states[:], plan.inputs[:] = np.nan, np.nan

    def circles_at(self, time: float) -> Array:
        """Rows x, y, radius, vx, vy (M, 5) at a time [s]."""
        rows = self.circles.copy()
        rows[:, :2] += time * rows[:, 3:]
        return rows

    def _obstacles(self, time: float) -> Any:
        rows = self.circles_at(time)
        if self._as_objects:
            return [*(kl.Circle(*row) for row in rows.tolist()), *self._solids]
        return [*rows, *self._solids] if self._solids else rows


def replay(drive: Drive, models: list[kl.KoopmanModel]) -> tuple[Array, NDArray[np.uint8]]:
    """Feed the recorded poses; answers as values (T, len(COLUMNS)) and codes (T, len(CODES))."""
    session = Session(drive.setup, models)
    values, codes = np.empty(drive.values.shape), np.empty(drive.codes.shape, dtype=np.uint8)
    with session.faults.installed(session.faulty):
        for k, pose in enumerate(drive.poses):
            sent = None if np.isinf(drive.sent[k]).all() else drive.sent[k]
            plan = session.step(k, pose.copy(), sent, float(drive.clock[k]))
            values[k], codes[k] = measure(plan)
            session.spoil(k, plan)
    return values, codes
