"""One trial: a controller drives the twin through the link, in a scenario, to the end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

import kmpc_lite as kl
from firmware_bridge.messages import State, VelocityCommand, command_of
from firmware_bridge.runtime.controller_thread import Predict, unicycle_arc
from firmware_bridge.runtime.navigator import Moment, Navigator, Planned, Task
from firmware_bridge.safety.gate_settings import TICK
from kmpc_lab.experiments.batch import BatchDrive, Setup
from kmpc_lab.experiments.wire import ManualClock
from kmpc_lab.sim.closed_loop import Outcome, Run
from kmpc_lab.sim.twin import Twin
from kmpc_lite.control.kernels.clearance import distances, things_of
from kmpc_lite.scenario.files import Scenario

SETTLE = 2.0
"""How long the robot must stay at the goal [s]; the final error is taken then."""
STANDING = 0.02
"""Commands below this tell nothing of a model [m/s, rad/s]."""
LEARNING = 1.0
"""After a change of the floor, before predictions are judged [s]."""
REST = 1.0
"""After the last command, before the final error is taken [s]."""


@dataclass(frozen=True)
class Contender:
    """A controller with its model."""

    label: str
    solver: Literal["kmpc", "ipopt"]
    model: kl.KoopmanModel
    u_max: tuple[float, float]
    """Command bounds [m/s, rad/s], either way."""
    horizon: int = 20
    adaptation: bool = True
    seconds: float = SETTLE
    """How long the goal must be held [s]."""
    tolerance: float = 0.015
    """Distance to the goal that counts as arrived [m]; IPOPT's rows end as ours do."""

    def build(self, scenario: Scenario) -> Any:
        """Make the controller."""
        u_max = np.array(self.u_max)
        base = kl.NavigationProblem(
            dt=self.model.dt, horizon=self.horizon, u_min=-u_max, u_max=u_max
        )
        problem = scenario.problem(base)
        if self.solver == "ipopt":
            from kmpc_lab.peers.ipopt import IpoptController

            return IpoptController(self.model, problem)
        options = scenario.options
        return kl.Controller(self.model, problem, adaptation=self.adaptation, options=options)


@dataclass(frozen=True)
class Trial:
    """What became of a drive."""

    label: str
    run: Run
    touched: bool
    """Whether the twin's body felt an obstacle."""
    final_error: float
    """True distance to the goal after all has come to rest [m]."""

    def surprises(self) -> np.ndarray:
        """How far each planned heading was off one period later, while moving [rad].

        After a change of the floor only what comes from `LEARNING` on counts.
        """
        run = self.run
        first = (
            round((run.scenario.ground_changes[-1][0] + LEARNING) / run.dt)
            if run.scenario.ground_changes
            else 0
        )
        errors = run.plans[:, 1, 2] - run.states[1 : len(run.plans) + 1, 2]
        moving = np.abs(run.inputs).max(axis=1) > STANDING
        moving[:first] = False
        found: np.ndarray = np.remainder(errors[moving] + np.pi, 2.0 * np.pi) - np.pi
        return found

    def row(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        run = self.run
        return {
            "controller": self.label,
            "scenario": run.scenario.name,
            "seed": run.scenario.seed,
            "outcome": run.outcome.value,
            "duration_s": round(run.duration, 3),
            "arrival_s": run.info["arrival_s"],
            "final_error_m": round(self.final_error, 4),
            "final_heading_error_rad": round(run.heading_error, 4),
            "clearance_m": round(run.clearance, 4),
            "touched": self.touched,
            "statuses": run.info["statuses"],
        }


def carry_with(model: kl.KoopmanModel) -> Predict:
    """Bring an old pose forward with the learned model instead of a unicycle's arc.

    Models with input history predict with the command that is held.
    """
    finest = model.with_dt(TICK) if not model.history and model.continuous else None
    if finest is None:
        return unicycle_arc

    def predict(state: State, v: float, omega: float, dt: float, vy: float = 0.0) -> State:
        step = finest if abs(dt - TICK) < 1e-9 else finest.with_dt(dt)
        x, y, theta = step.predict(np.array((state.x, state.y, state.theta)), np.array((v, omega)))
        return State(float(x), float(y), float(theta), v, omega, state.stamp + dt)

    return predict


def drive_trial(contender: Contender, scenario: Scenario, setup: Setup, seed: int) -> Trial:
    """Drive a scenario with one seed, of pose noise and delays; the robot is the setup's.

    A drive ends in a collision (four sub-samples a period or more, by the scenario's circles), when
    the goal is held, or when time is up.
    """
    scenario = replace(scenario, seed=seed)
    noise = scenario.pose_noise
    setup = replace(
        setup,
        period=contender.model.dt,
        mocap=replace(setup.mocap, noise=noise[0], heading_noise=noise[2]),
    )
    twin, clock = Twin.of(scenario, setup.robot), ManualClock()
    controller = contender.build(scenario)
    circles = scenario.circles_at(0.0)
    plans: list[Any] = []

    def step(pose: tuple[float, float, float], around: Any, moment: Moment) -> Planned:
        told = {}
        if isinstance(controller, kl.Controller):
            told["sent"] = command_of(moment.held, 2)
        plan = controller.step(pose, scenario.goal, around, **told)
        if moment.driving:
            plans.append(plan)
        v, omega = map(float, plan.command)
        return Planned(v, omega, plan.status.name)

    task = Task(
        scenario.goal,
        contender.tolerance + 3.0 * noise[0],
        0.05 + 3.0 * noise[2],
        scenario.radius,
        scenario.circles_at,
    )
    navigator = Navigator(step, task, contender.seconds, scenario.timeout, clock)

    def planner(state: State) -> VelocityCommand:
        return navigator(state, Moment(drive.driving, drive.planner.held))

    drive = BatchDrive(twin, planner, setup, clock, seed, predict=carry_with(contender.model))
    gaps: list[float] = []

    def gap() -> float:
        gaps = distances(things_of(circles), np.array([twin.pose[:2]]), np.zeros(1))
        return float(gaps.min(initial=np.inf)) - scenario.radius

    def finished() -> bool:
        gaps.append(gap())
        return gaps[-1] < 0.0 or twin.touched is not None or navigator.finished()

    path = drive.run(finished)
    collided = gaps[-1] < 0.0 or twin.touched is not None
    x, y, _ = drive.rest(REST)
    run = _as_run(
        scenario, contender.model.dt, _outcome(collided, navigator), path, plans, min(gaps)
    )
    arrival = navigator.arrived_after
    run.info["arrival_s"] = None if arrival is None else round(arrival, 2)
    run.info["statuses"] = dict(navigator.statuses)
    off = float(np.hypot(x - scenario.goal[0], y - scenario.goal[1]))
    return Trial(contender.label, run, twin.touched is not None, off)


def _outcome(collided: bool, navigator: Navigator) -> Outcome:
    if collided:
        return Outcome.COLLISION
    return Outcome.TIMEOUT if navigator.arrived_after is None else Outcome.REACHED


def _as_run(
    scenario: Scenario,
    dt: float,
    outcome: Outcome,
    path: np.ndarray,
    plans: list[Any],
    clearance: float,
) -> Run:
    """Put a drive into the form that pictures take: whole periods; the last ends at rest."""
    every = round(dt / TICK)
    periods = max(1, -(-(len(path) - 1) // every))
    filled = np.concatenate([path, np.repeat(path[-1:], periods * every + 1 - len(path), axis=0)])
    # the plan of the first period was made before the gate let it pass
    plans = (plans[:1] + plans + plans[-1:] * periods)[:periods]
    return Run(
        scenario,
        dt,
        outcome,
        (len(path) - 1) * TICK,
        filled[::every],
        filled,
        np.array([p.command for p in plans]),
        np.array([p.states for p in plans]),
        tuple(p.status.name for p in plans),
        np.array([p.timing["total"] for p in plans]),
        clearance,
        {},
    )


def repeat(
    contenders: list[Contender],
    scenarios: list[Scenario],
    setup: Setup,
    seeds: list[int],
    progress: Callable[[int, int], None],
) -> list[Trial]:
    """Drive every contender in every scenario with every seed."""
    trials = []
    total = len(contenders) * len(scenarios) * len(seeds)
    for contender in contenders:
        for scenario in scenarios:
            for seed in seeds:
                trials.append(drive_trial(contender, scenario, setup, seed))
                progress(len(trials), total)
    return trials
