"""A model that drives itself for ten seconds: whether anybody should drive a robot with it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.problem import NavigationProblem
    from kmpc_lite.model.koopman import KoopmanModel


def problem_of(model: KoopmanModel, **told: Any) -> NavigationProblem:
    """The robot of a model, as far as its file tells it, without an area; `told` goes first."""
    from kmpc_lite.control.footprint import Footprint
    from kmpc_lite.control.problem import NavigationProblem
    from kmpc_lite.control.wheels import Differential
    from kmpc_lite.scenario.files import learned_wheels

    info, driven = model.info, model.info.get("driven", {})
    outline = Footprint.of(info["footprint"]) if "footprint" in info else None
    shape = {"robot_radius": info["radius"]} if "radius" in info else {}
    if driven:  # a robot drives no faster than its log shows
        v, omega = driven["forward"], driven["turn"]
        shape |= {"u_min": (-v, -omega), "u_max": (v, omega)}
    problem = NavigationProblem(dt=model.dt, footprint=outline, **{**shape, **told})
    return problem.with_wheels(learned_wheels(info) or Differential())


def warn_of_driving(model: KoopmanModel) -> list[str]:
    """What is wrong where the model is driven on itself, to a goal ahead and to one beside it.

    More than 15 % of its commands jump back, it comes no quarter of the way to a goal, or it leaves
    a straight way by two radii.
    """
    driven = model.info.get("driven", {})
    if not (driven.get("forward", 0.0) > 0.0 and driven.get("turn", 0.0) > 0.0):
        return ["it was not driven on itself: its log shows no speed ahead, or no turns"]
    problem = problem_of(model)
    seconds = max(5.0, 30 * model.dt)
    way = 0.6 * seconds * float(problem.u_max[0])
    ahead, beside = (
        _drive(model, problem, goal, round(seconds / model.dt))
        for goal in ((way, 0.0, 0.0), (0.6 * way, 0.6 * way, 1.57))
    )
    told = f"driven on itself with a radius of {problem.robot_radius:.2g} m"
    found = []
    if (share := max(_chatter(sent / problem.u_max) for _, sent in (ahead, beside))) > 0.15:
        found.append(f"{told} its commands jump back in {100 * share:.0f} % of the steps")
    nearer = [poses[-1, 0] / goal for (poses, _), goal in ((ahead, way), (beside, 0.6 * way))]
    if min(nearer) < 0.25:
        found.append(f"{told} it hardly comes nearer to its goal")
    aside = float(np.abs(ahead[0][:, 1]).max())
    if aside > 2.0 * problem.robot_radius:
        found.append(f"{told} it leaves a straight way by {aside:.2g} m")
    return found


def _drive(
    model: KoopmanModel, problem: NavigationProblem, goal: tuple[float, float, float], steps: int
) -> tuple[Array, Array]:
    """Poses (T + 1, 3) and commands (T, m) on the way to a goal, with the model as the robot."""
    from kmpc_lite.control import Controller

    controller, poses = Controller(model, problem), np.zeros((steps + 1, 3))
    sent = np.zeros((model.history + steps, model.inputs))
    for k in range(steps):
        now = model.history + k
        sent[now] = controller.step(poses[k], goal).command
        poses[k + 1] = model.predict(poses[k], sent[now], sent[k:now])
    return poses, sent[model.history :]


def _chatter(sent: Array) -> float:
    """Share of steps in which a command (T, m) [bounds] jumps back, by a tenth or more each way."""
    changes = np.diff(sent, axis=0)
    large = np.abs(changes) > 0.1
    back = (changes[1:] * changes[:-1] < 0.0) & large[1:] & large[:-1]
    return float(back.any(axis=1).mean())
