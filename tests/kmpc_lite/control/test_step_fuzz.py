"""Whatever a step is given: a finite command within bounds, or ValueError for wrong shapes.

KMPC_STEPS of them where that is set, some hundreds each time, a million in the long run.
"""

import os
import time
import warnings
from typing import Any

import numpy as np
import pytest

import kmpc_lite as kl

STRANGE = (np.nan, np.inf, -np.inf, 1e308, -1e308, 1e5, -1e5, 1e-300, 0.0, -1.0, 1e4)
SHAPES: tuple[Any, ...] = (
    *(None, "x", 3, 1j, {}, [[1, 2], [3]], np.zeros((2, 4)), np.zeros((1, 1, 5)), object()),
    *(np.zeros((3, 0)), [None], [kl.Circle(1, 1, 0.1), "x"], np.array(["a"]), b"x"),
)
CAR: dict[str, Any] = {"wheels": kl.Car(0.4), "u_min": (-0.6, -1.5), "u_max": (0.6, 1.5)}
LONG = kl.Footprint.rectangle(0.5, 0.25, ahead=0.1)
DENSE = kl.ControllerOptions.from_dict({"sight": {"most_cells": 1200}})
KINDS: tuple[dict[str, Any], ...] = (
    {},
    {"guidance": False},
    # solves to the bitter end whatever cannot be solved: a short horizon lets it do more of it
    {
        "guidance": False,
        "tightening": None,
        "sqp_iterations": 3,
        "problem": kl.NavigationProblem(horizon=6),
    },
    {"time_budget": 0.005},
    {"pose_age": 0.15, "adaptation": True},
    {"problem": kl.NavigationProblem(du_max=(0.5, 1.5), horizon=8)},
    {"problem": kl.NavigationProblem(u_min=(0.0, -0.4), robot_radius=0.0, margin=0.05, horizon=12)},
    {"problem": kl.NavigationProblem(x_min=[-np.inf] * 3, x_max=[np.inf] * 3, horizon=10)},
    {"problem": kl.NavigationProblem(sensor_range=1.5), "time_budget": 0.05},
    {"problem": kl.NavigationProblem(**CAR, horizon=10)},
    {"problem": kl.NavigationProblem(**CAR, footprint=LONG, horizon=10), "adaptation": True},
    {"problem": kl.NavigationProblem(wheels=kl.Omni(), horizon=10)},
    {"problem": kl.NavigationProblem(wheels=kl.Omni(), footprint=LONG, horizon=10)},
    {"problem": kl.NavigationProblem(footprint=LONG, horizon=10)},
    {"options": DENSE},
)
LONGEST_STEP = 3.0  # of the processor [s]; a budget counts where a fifth more than it is longer


class Sender:
    """Poses, goals and obstacles, most of which can be meant."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)

    def below(self, count: int) -> int:
        return int(self.random.integers(count))

    def one_of(self, things: Any) -> Any:
        return things[self.below(len(things))]

    def rarely(self) -> bool:
        return bool(self.random.random() < 0.05)

    def numbers(self, count: int, spread: float = 2.0) -> np.ndarray:
        values = self.random.uniform(-spread, spread, count)
        if self.rarely():
            values[self.below(count)] = self.one_of(STRANGE)
        return values

    def circles(self) -> np.ndarray:
        count = self.one_of((0, 1, 3, 10, 60, 200))
        rows = self.random.uniform(-2.0, 2.0, (count, self.one_of((3, 5))))
        rows[:, 2] = np.abs(rows[:, 2]) * self.one_of((0.02, 0.1, 1.0))
        if count and self.rarely():
            rows[self.below(count), self.below(rows.shape[1])] = self.one_of(STRANGE)
        return rows

    def solid(self) -> Any:
        x, y = self.numbers(2)
        match self.below(5):
            case 0:
                angles = np.sort(self.random.uniform(0, 2 * np.pi, self.one_of((3, 5, 20))))
                size = self.one_of((1e-4, 0.1, 0.5, 50.0))
                return kl.Polygon(
                    np.stack([x + size * np.cos(angles), y + size * np.sin(angles)], 1)
                )
            case 1:
                return kl.Wall(x, y, *self.numbers(2), thickness=abs(self.numbers(1, 0.3)[0]))
            case 2:
                return kl.Circle(x, y, abs(self.numbers(1, 0.3)[0]), *self.numbers(2))
            case 3:
                return self.scan()
            case _:
                shape = self.one_of(((1, 1), (3, 4), (30, 30), (1, 500)))
                cells = self.random.random(shape) < self.one_of((0.0, 0.1, 0.5, 1.0))
                side = self.one_of((1e-4, 0.01, 0.05, 1.0, 1e3))
                return kl.OccupancyGrid(cells, side, (x, y, self.numbers(1)[0]))

    def scan(self) -> kl.LaserScan:
        beams = self.one_of((1, 2, 36, 360, 2000, 16_000))
        reach = self.one_of((0.3, 2.0, 12.0, 1e4))
        ranges = np.abs(np.cumsum(self.random.normal(0.0, reach / 20, beams)) + reach / 2)
        if not self.below(4):
            ranges = self.random.uniform(0.0, reach, beams)  # nothing but noise
        for strange in (np.inf, np.nan, 0.0, -1.0, reach, 1e308, -np.inf):
            if self.below(2):
                ranges[self.random.random(beams) < self.one_of((0.01, 0.3))] = strange
        return kl.LaserScan(
            ranges,
            angle_min=self.numbers(1, 4.0)[0],
            angle_increment=self.one_of((2 * np.pi / beams, -0.01, 0.0, 1.0, 1e5)),
            range_max=reach,
            range_min=self.one_of((0.0, 0.05, 0.2)),
            mount=self.numbers(3, 0.1),
            mirrored=bool(self.below(2)),
            noise=self.one_of((0.0, 0.01, 0.1, 10.0)),
            age=self.one_of((0.0, 0.05, 0.3, 100.0)),
            time_increment=self.one_of((0.0, 1e-4, 1.0)),
            self_radius=self.one_of((0.0, 0.2)),
            ignore=[self.numbers(2, 4.0)] if self.below(2) else (),
        )

    def goal(self, pose: np.ndarray) -> np.ndarray:
        """Anywhere, where the robot stands, or nearly so."""
        near = self.one_of((None, None, 0.0, 0.02))
        return self.numbers(3) if near is None else pose + self.numbers(3, near)

    def obstacles(self) -> Any:
        if self.rarely():
            return self.one_of(SHAPES)
        if self.below(2):
            return self.circles()
        made = []
        for _ in range(self.one_of((0, 1, 2, 5, 20))):
            try:
                made.append(self.solid())
            except kl.ProblemError:
                continue  # refused where it is made
        return made

    def sent(self) -> Any:
        counts = self.one_of((2, 2, 3))
        return self.one_of((None, None, self.numbers(counts))) if self.below(3) else None


def make(kind: dict[str, Any]) -> kl.Controller:
    omni = isinstance(kind.get("problem", kl.NavigationProblem()).wheels, kl.Omni)
    return kl.Controller((kl.nominal_omni if omni else kl.nominal_unicycle)(0.1), **kind)


def fuzz(steps: int, seed: int) -> dict[int, float]:
    """Drive all kinds of controllers through steps; every few, a pose, goal or map is new.

    Numbers of the steps that took too long, and the processor's time for each [s].
    """
    sender, slow = Sender(seed), {}
    controllers = [make(kind) for kind in KINDS]
    drives: list[Any] = [(np.zeros(3), np.zeros(3), ())] * len(KINDS)
    for number in range(steps):
        kind = number % len(controllers)
        controller, (pose, goal, obstacles) = controllers[kind], drives[kind]
        match sender.below(12):
            case 0:
                pose = sender.numbers(3, 1.0)
                goal, obstacles = sender.goal(pose), sender.obstacles()
            case 1:
                goal = sender.goal(pose)
            case 2 | 3:
                obstacles = sender.obstacles()
        drives[kind] = pose, goal, obstacles
        shown = sender.one_of(SHAPES) if sender.rarely() else obstacles
        at = sender.numbers(3) if sender.rarely() else pose
        begun = time.process_time()
        try:
            plan = controller.step(at, goal, shown, sent=sender.sent())
        except ValueError:
            continue
        finally:
            took = time.process_time() - begun
            budget = KINDS[kind].get("time_budget", 0.0)
            if took > max(1.2 * budget, LONGEST_STEP):
                slow[number] = took
        low, high, _, _ = controller.problem.bounds
        assert np.isfinite(plan.command).all(), (seed, number)
        assert (plan.command >= low - 1e-9).all(), (seed, number)
        assert (plan.command <= high + 1e-9).all(), (seed, number)
        assert np.isfinite(plan.inputs).all() and np.isfinite(plan.states).all(), (seed, number)
        assert plan.reason.isprintable() or "\n" in plan.reason
        drives[kind] = plan.states[1], goal, obstacles
    return slow


def judge(steps: int, seed: int) -> None:
    """Fuzz; a step that took too long is tried again: what else runs here may have held it up."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        slow = fuzz(steps, seed)
        if slow:
            again = fuzz(max(slow) + 1, seed)
            assert not slow.keys() & again.keys(), (seed, slow, again)


def test_fuzzed_steps_command_what_a_robot_can_do() -> None:
    judge(int(os.environ.get("KMPC_STEPS", "400")), seed=0)


@pytest.mark.long
def test_a_million_fuzzed_steps_too() -> None:
    for seed in range(1, 101):
        judge(int(os.environ.get("KMPC_STEPS", "1000000")) // 100, seed)
