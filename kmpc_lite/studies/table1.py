"""Monte-Carlo studies: scenarios x seeds x controllers, on any `concurrent.futures.Executor`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from kmpc_lite.control.controller import Controller
from kmpc_lite.learn.calibration import with_quantiles
from kmpc_lite.learn.fitting import fit
from kmpc_lite.learn.regression import Method
from kmpc_lite.model.koopman import KoopmanModel, nominal_unicycle
from kmpc_lite.sim.closed_loop import Outcome, Run, drive
from kmpc_lite.sim.plants.robots import DifferentialDrive, generate_dataset
from kmpc_lite.sim.scenario.files import Scenario

Progress = Callable[[int, int], None]
"""Called with tasks done and tasks in all."""

DT = 0.1
STOP_NORM = 1e-2
"""The paper's end of a run: ``|x - x_ref|`` over the whole state."""
LAMBDAS = (0.0, 0.01, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2)
TRAINING = {"episodes": 1000, "steps": 1000}
TRAINING_SEED, REPORTING_SEED = 1_000, 500_000
"""Seeds of training data, and of the trials that are reported; nothing is tuned on the latter."""

PAPER_TABLE_1: dict[str, tuple[tuple[int, float | None, float | None], ...]] = {
    "paper: NMPC": (
        (0, 8.30, None),
        (1, 8.10, 6.84),
        (4, 8.98, 3.28),
        (5, None, 1.52),
        (5, None, 1.52),
        (5, None, 1.50),
        (5, None, 1.40),
        (5, None, 1.36),
    ),
    "paper: K-NMPC": (
        (0, 7.30, None),
        (0, 7.30, None),
        (1, 7.23, 3.20),
        (0, 7.05, None),
        (1, 6.94, 1.66),
        (1, 6.70, 1.60),
        (3, 6.55, 1.43),
        (1, 6.85, 1.47),
    ),
}
"""Collisions of 5, mean duration of collision-free runs [s], mean time to collision [s], for each
of LAMBDAS."""


@dataclass(frozen=True)
class ControllerSpec:
    """What a worker needs to build a controller."""

    label: str
    solver: Literal["ipopt", "plain", "kmpc"]
    """IPOPT; ours in the paper's formulation, the goal as the reference and no learned margins;
    ours with everything on."""
    fit: Method | None
    """How the model is learned; None is the nominal unicycle."""
    margin: float = 0.0
    """Distance to keep beyond the radii [m]."""
    adaptation: bool | None = None
    """Whether ours adapts its model while driving; its own choice where not given."""

    def build(self, model: KoopmanModel, scenario: Scenario) -> Any:
        """Make the controller for a scenario."""
        problem = replace(scenario.problem(), margin=self.margin)
        if self.solver == "ipopt":
            from kmpc_lite.peers.ipopt import IpoptController

            return IpoptController(model, problem)
        if self.solver == "plain":
            return Controller(
                model, problem, guidance=False, tightening=None, pose_age=scenario.pose_age
            )
        return Controller(model, problem, adaptation=self.adaptation, pose_age=scenario.pose_age)


TABLE_1_CONTROLLERS = (
    ControllerSpec("NMPC, IPOPT", "ipopt", None),
    ControllerSpec("K-NMPC, IPOPT", "ipopt", "edmdc"),
    ControllerSpec("ours, paper's formulation", "plain", "edmdc"),
    ControllerSpec("ours, paper's, integral fit", "plain", "integral"),
    ControllerSpec("ours, everything on", "kmpc", "integral"),
)


@dataclass(frozen=True)
class Cell:
    """One controller at one slip: the runs of all trials, as numbers."""

    label: str
    trained_at: float | None
    slip: float
    runs: tuple[dict[str, Any], ...]

    @property
    def collisions(self) -> int:
        """How many runs collided."""
        return sum(r["outcome"] == Outcome.COLLISION.value for r in self.runs)

    def mean(self, key: str, collided: bool = False) -> float | None:
        """Mean of a number over the collision-free (or the collided) runs that have it."""
        values = [
            r[key]
            for r in self.runs
            if (r["outcome"] == Outcome.COLLISION.value) == collided and r[key] is not None
        ]
        return float(np.mean(values)) if values else None

    @property
    def arrived(self) -> int:
        """How many runs came within the scenario's tolerances of the goal, untouched."""
        return sum(
            r["outcome"] != Outcome.COLLISION.value and r["arrival_s"] is not None
            for r in self.runs
        )

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {
            "controller": self.label,
            "trained_at": self.trained_at,
            "slip": self.slip,
            "trials": len(self.runs),
            "collisions": self.collisions,
            "arrived": self.arrived,
            "mean_duration_s": self.mean("duration_s"),
            "mean_arrival_s": self.mean("arrival_s"),
            "mean_time_to_collision_s": self.mean("duration_s", collided=True),
            "runs": list(self.runs),
        }


def train(slip: float, method: Method, episodes: int, steps: int) -> KoopmanModel:
    """Learn as the paper does, at one slip; quantiles for margins come from drives of their own."""
    plant = DifferentialDrive(slip, seed=TRAINING_SEED)
    model = fit(generate_dataset(plant, episodes, steps, DT, seed=TRAINING_SEED + 1), method=method)
    if method == "edmdc":
        return model
    held = generate_dataset(
        DifferentialDrive(slip, seed=TRAINING_SEED + 2),
        max(episodes // 5, 10),
        max(steps // 5, 100),
        DT,
        seed=TRAINING_SEED + 3,
    )
    return with_quantiles(model, held)


def run_trials(
    spec: ControllerSpec,
    model: KoopmanModel,
    scenario: Scenario,
    seeds: Sequence[int],
    stop_norm: float,
) -> list[dict[str, Any]]:
    """Drive one scenario with each seed; numbers only, so that a worker can send them back."""
    results = []
    controller = spec.build(model, scenario)
    for seed in seeds:
        controller.reset()
        run = drive(controller, replace(scenario, seed=seed), dt=DT, stop_norm=stop_norm)
        results.append({**run.summary(), "seed": seed, "arrival_s": arrival_time(run)})
    return results


def arrival_time(run: Run) -> float | None:
    """First time at which the robot is within the scenario's tolerances of the goal [s]."""
    error = run.states - np.array(run.scenario.goal)
    turn = np.abs(np.remainder(error[:, 2] + np.pi, 2 * np.pi) - np.pi)
    there = (np.hypot(error[:, 0], error[:, 1]) <= run.scenario.tolerance) & (
        turn <= run.scenario.heading_tolerance
    )
    return float(np.argmax(there) * run.dt) if there.any() else None


def table1(
    scenario: Scenario,
    executor: Executor,
    trials: int = 5,
    controllers: Sequence[ControllerSpec] = TABLE_1_CONTROLLERS,
    lambdas: Sequence[float] = LAMBDAS,
    training: dict[str, int] = TRAINING,
    progress: Progress = lambda done, total: None,
) -> list[Cell]:
    """Run the paper's table 1 on a map.

    Train and drive at each slip, then train at 0.1 and drive at 0.15 and 0.2.

    Parameters
    ----------
    scenario : Scenario
        Map; its slip and seed are replaced.
    executor : Executor
        Does the work; its workers must be able to import this package.
    trials : int
        Runs for each slip and controller.
    controllers : sequence of ControllerSpec
        Rows.
    lambdas : sequence of float
        Slips.
    training : dict
        ``episodes`` and ``steps`` of the training data.
    progress : callable
        Called as tasks finish.

    Returns
    -------
    list of Cell
        By controller, then slip; generalisation last.
    """
    driven = [(spec, slip, slip) for spec in controllers for slip in lambdas]
    driven += [(spec, 0.1, slip) for spec in controllers if spec.fit for slip in (0.15, 0.2)]
    needed = sorted({(trained, spec.fit) for spec, trained, _ in driven if spec.fit})
    total, done = len(needed) + len(driven), 0
    futures = {
        executor.submit(train, slip, method, **training): (slip, method) for slip, method in needed
    }
    models: dict[tuple[float, Method], KoopmanModel] = {}
    for future in as_completed(futures):
        models[futures[future]] = future.result()
        done += 1
        progress(done, total)
    seeds = [REPORTING_SEED + i for i in range(trials)]
    cells: dict[int, Cell] = {}
    jobs = {}
    for i, (spec, trained, slip) in enumerate(driven):
        model = models[trained, spec.fit] if spec.fit else nominal_unicycle(DT)
        job = executor.submit(
            run_trials, spec, model, replace(scenario, slip=slip), seeds, STOP_NORM
        )
        jobs[job] = i, spec, trained if spec.fit else None, slip
    for finished in as_completed(jobs):
        i, spec, trained_at, slip = jobs[finished]
        cells[i] = Cell(spec.label, trained_at, slip, tuple(finished.result()))
        done += 1
        progress(done, total)
    return [cells[i] for i in sorted(cells)]


def format_table1(cells: Sequence[Cell]) -> str:
    """Render the cells beside the paper's figures, one block per figure, one row per controller."""

    def seconds(value: float | None) -> str:
        return "-" if value is None else f"{value:.2f}"

    def cut(cell: Cell) -> str:
        worst = min(
            (r["clearance_m"] for r in cell.runs if r["clearance_m"] is not None), default=0.0
        )
        return f"{-1e3 * worst:.0f}" if worst < 0 else "-"

    blocks: tuple[
        tuple[
            str,
            Callable[[Cell], str],
            Callable[[tuple[int, float | None, float | None]], str] | None,
        ],
        ...,
    ] = (
        ("collisions / runs", lambda c: f"{c.collisions}/{len(c.runs)}", lambda p: f"{p[0]}/5"),
        ("deepest cut into an obstacle [mm]", cut, None),
        (
            "collision-free runs that came within 5 cm and 0.15 rad",
            lambda c: f"{c.arrived}/{len(c.runs) - c.collisions}",
            None,
        ),
        (
            "mean time of collision-free runs until there [s] (paper: until its own end)",
            lambda c: seconds(c.mean("arrival_s")),
            lambda p: seconds(p[1]),
        ),
        (
            "mean time to collision [s]",
            lambda c: seconds(c.mean("duration_s", collided=True)),
            lambda p: seconds(p[2]),
        ),
    )
    lines = [f"{'lambda':<48}" + "".join(f"{slip:>8g}" for slip in LAMBDAS)]
    for title, text, paper_text in blocks:
        lines += ["", title]
        if paper_text is not None:
            lines += [
                f"  {name:<46}" + "".join(f"{paper_text(p):>8}" for p in row)
                for name, row in PAPER_TABLE_1.items()
            ]
        for label, trained in dict.fromkeys(
            (c.label, None if c.trained_at in (None, c.slip) else c.trained_at) for c in cells
        ):
            by_slip = {
                c.slip: c
                for c in cells
                if c.label == label
                and (c.trained_at if c.trained_at not in (None, c.slip) else None) == trained
            }
            name = label if trained is None else f"{label}, trained at {trained:g}"
            lines.append(
                f"  {name:<46}"
                + "".join(
                    f"{text(by_slip[slip]) if slip in by_slip else '':>8}" for slip in LAMBDAS
                )
            )
    collisions = {
        label: [c for c in cells if c.label == label and c.trained_at in (None, c.slip)]
        for label in dict.fromkeys(c.label for c in cells)
    }
    sums = ", ".join(
        f"{label}: {sum(c.collisions for c in own)}/{sum(len(c.runs) for c in own)}"
        for label, own in collisions.items()
    )
    return "\n".join(
        [*lines, "", f"collisions in all: paper: NMPC: 30/40, paper: K-NMPC: 7/40, {sums}"]
    )
