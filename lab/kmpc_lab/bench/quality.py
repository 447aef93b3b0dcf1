"""What the passes converge to, against IPOPT; both plan from rest at each recorded state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from kmpc_lab.bench.drives import RecordedDrive
from kmpc_lab.peers.ipopt import IpoptController, short_way
from kmpc_lite.control.controller import Controller
from kmpc_lite.control.kernels import records as things
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.geometry import distances, wrap
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import Array

PASSES, TOLERANCE = 200, 1e-6  # of ours: passes at the most, and the change that ends them
EQUAL = 1e-3  # a cost is as good as another that is smaller by no more than this share of it
OBEYED = 1e-4  # a plan is feasible that enters no obstacle by more [m]
VERDICTS = {
    "as good": (
        f"cost within {100 * EQUAL:g} % of IPOPT's or better, violation at most {1e3 * OBEYED:g} mm"
    ),
    "another minimum": "both converged, but to plans that go another way",
    "IPOPT failed": "IPOPT says that it did not converge, or its plan enters an obstacle",
    "starts inside": (
        "the state itself lies in an obstacle or outside the area, so that no plan is feasible"
    ),
    "not converged": "ours used all its passes",
    "violated": "ours enters an obstacle although IPOPT's plan does not",
    "worse": "none of these, and yet worse",
}
APART = 0.05  # plans that are farther apart than this somewhere go another way [m]


@dataclass(frozen=True)
class Comparison:
    """One state, two plans."""

    drive: int
    step: int
    excess: float  # cost of ours over IPOPT's, less 1
    violation: float  # how deep ours enters an obstacle or leaves the area [m]
    peer_violation: float
    verdict: str  # one of `VERDICTS`


def compare(
    model: KoopmanModel,
    problem: NavigationProblem,
    drives: Sequence[RecordedDrive],
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Comparison]:
    """Plan from every state with both, each time from a robot that stands there.

    Raises KmpcError if CasADi is missing.
    """
    ours = Controller(
        model,
        problem,
        guidance=False,
        tightening=None,
        adaptation=False,
        sqp_iterations=PASSES,
        tolerance=TOLERANCE,
    )
    peer, rows = IpoptController(model, problem), []
    for i, drive in enumerate(drives):
        for k, state in enumerate(drive.states):
            # a learned model need not be the same a turn further on: both get the heading that ours
            # would make of it
            x = np.append(state[:2], wrap(float(state[2])))
            ours.reset()
            peer.reset()
            rows.append(_judge(i, k, x, drive, ours, peer, problem))
        progress(i + 1, len(drives))
    return rows


def violation(states: Array, circles: Array, problem: NavigationProblem) -> float:
    """How deep a plan (N + 1, 3) enters an obstacle or leaves the area after its start [m]."""
    _, _, x_min, x_max = problem.bounds
    positions = states[1:, :2]
    deepest = max(0.0, float((x_min[:2] - positions).max()), float((positions - x_max[:2]).max()))
    if len(circles):
        times = problem.dt * np.arange(1, len(states))
        gaps = things.distances(things.things_of(circles), positions, times)
        deepest = max(deepest, problem.robot_radius + problem.margin - float(gaps.min()))
    return deepest


def _judge(
    i: int, k: int, x: Array, drive: RecordedDrive, ours: Any, peer: Any, problem: NavigationProblem
) -> Comparison:
    plans = [controller.step(x, drive.goal, drive.circles) for controller in (ours, peer)]
    goal = short_way(drive.goal, x)
    cost, best = (problem.cost(plan.states, plan.inputs, goal) for plan in plans)
    inside, peer_inside = (violation(plan.states, drive.circles, problem) for plan in plans)
    excess = cost / max(best, 1e-9) - 1.0
    apart = float(distances(plans[0].states, plans[1].states).max())
    if violation(np.array([x, x]), drive.circles, problem) > 0.0:
        verdict = "starts inside"
    elif plans[1].status.name != "SOLVED" or peer_inside > OBEYED:
        verdict = "IPOPT failed"
    elif excess <= EQUAL and inside <= OBEYED:
        verdict = "as good"
    elif plans[0].status.name != "SOLVED":
        verdict = "not converged"
    elif inside > OBEYED:
        verdict = "violated"
    else:
        verdict = "another minimum" if apart > APART else "worse"
    return Comparison(i, k, excess, inside, peer_inside, verdict)


def as_dicts(rows: Sequence[Comparison]) -> list[dict[str, Any]]:
    """Plain values, for JSON."""
    return [asdict(row) for row in rows]


def format_comparison(rows: Sequence[Comparison]) -> str:
    """Render the counts of the verdicts, and how much more ours costs where both are feasible."""
    count = len(rows)
    lines = [
        f"{count} states, each planned from a standing robot, "
        "ours to convergence against CasADi + IPOPT"
    ]
    for verdict, meaning in VERDICTS.items():
        number = sum(row.verdict == verdict for row in rows)
        if number:
            lines.append(f"  {verdict:<16}{number:>6}  {100 * number / count:5.1f} %  {meaning}")
    judged = [row for row in rows if row.verdict not in ("starts inside", "IPOPT failed")]
    if judged:
        excess = np.array([row.excess for row in judged])
        inside = np.array([row.violation for row in judged])
        good = sum(row.verdict == "as good" for row in judged)
        lines.append(
            f"as good on {good} of the {len(judged)} states on which IPOPT has a feasible plan: "
            f"{100 * good / len(judged):.1f} %"
        )
        lines.append(
            f"excess of the cost: median {np.median(excess):.1e}, "
            f"p99 {np.quantile(excess, 0.99):.1e}, max {excess.max():.1e}"
        )
        lines.append(
            f"violation: p99 {1e3 * np.quantile(inside, 0.99):.3f} mm, "
            f"max {1e3 * inside.max():.3f} mm"
        )
    return "\n".join(lines)
