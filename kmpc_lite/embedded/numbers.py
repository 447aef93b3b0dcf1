"""The numbers of a controller, as its C code has them: read from a controller of Python."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from kmpc_lite.control.controller import Controller
from kmpc_lite.control.kernels.predictor import Inputs, Predictor
from kmpc_lite.control.knowledge import motion_model
from kmpc_lite.control.limits import RateLimit
from kmpc_lite.control.margins import Margins
from kmpc_lite.control.nmpc.qp import HALF_PLANE_SCALE, OPEN, SLACK_SCALE, NavigationQP
from kmpc_lite.control.nmpc.sqp import MOST_PASSES, SQP
from kmpc_lite.control.options import ControllerOptions, fastest
from kmpc_lite.control.path.capabilities import capabilities
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.safe_motion import SafeMotions, Verification
from kmpc_lite.control.wheels import Differential
from kmpc_lite.errors import ProblemError
from kmpc_lite.model.dictionary.response import TERMS
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.scale import Scale
from kmpc_lite.types import STATES, Array

LAST_WEIGHTS = STATES * (STATES + 1) // 2  # entries of P that weigh the last state
MOST_THINGS = 24  # circles that a step looks at
NO_LIMIT = 1e30  # what stands for infinity in numbers that are written


def check_can_be_exported(model: KoopmanModel, problem: NavigationProblem) -> None:
    """Raise ProblemError for what the C code does not have, with what would do instead."""
    # what lifts the pose does not matter to a symmetric model, only what its inputs are
    inputs = Inputs.of(model.dictionary)
    refused = {
        "wheels": not isinstance(problem.wheels, Differential),
        "footprint": problem.footprint is not None,
        "sensor_range": problem.sensor_range is not None,
        "max_wheel_speed": problem.limits_wheels,
        "robot_radius": not problem.robot_radius > 0.0,
    }
    for name, given in refused.items():
        if given:
            raise ProblemError(
                f"export: {name}: the C code drives round robots past circles that are all given; "
                f"got {name}={getattr(problem, name)!r}"
            )
    if model.closed_form is None or inputs is None or len(inputs.kernel) > 1:
        raise ProblemError(
            f"export: expected a symmetric model of the unicycle or with a response, got one of "
            f'{type(model.dictionary).__name__}; fit(data, symmetric=True, lags="auto") makes one'
        )


def solver_of(controller: Controller) -> SQP:
    """The SQP of a controller without guidance, its QP as it was set up."""
    options = controller.options
    history = controller.model.history
    return SQP(controller.units, history, options=options.solver, step=options.step)


def sizes_of(controller: Controller, qp: NavigationQP) -> dict[str, int]:
    """Sizes of the arrays, by their names in C."""
    units, history = controller.units, controller.model.history
    rates, motions = RateLimit(units), SafeMotions(units, controller.options.stop)
    return {
        "KMPC_N": units.horizon,
        "KMPC_L": history,
        "KMPC_PAST": max(history, 1),
        "KMPC_T": motions.further + 4 + rates.longest_ramp,
        "KMPC_THINGS": MOST_THINGS,
        "KMPC_ROWS": qp.row_count,
        "KMPC_VARIABLES": qp.size,
        "KMPC_ENTRIES": qp.A.nnz,
        "KMPC_WRITTEN": len(qp.numbers.places),
        "KMPC_SLOTS_USED": qp.slots,
        "KMPC_LAST_WEIGHT": _last_weight(qp),
        "KMPC_LAST_WEIGHTS": LAST_WEIGHTS,
        "KMPC_TURNS": max(units.horizon - 1, 1),
        "KMPC_SLACK_ROW": int(qp.slack_rows[0]),
        "KMPC_CHANGE_ROW": int(qp.change_rows.ravel()[0]) if qp.change_rows.size else 0,
    }


def numbers_of(controller: Controller, sqp: SQP) -> dict[str, Any]:
    """Numbers of `struct kmpc_numbers`, by their names there."""
    units, scale, options = controller.units, controller.scale, controller.options
    qp, keep_out, rates = sqp.qp, sqp.fill.keep_out, RateLimit(units)
    checks = Verification(units, options.step, motions := SafeMotions(units, options.stop))
    return {
        "dt": units.dt,
        "state": scale.state,
        "command": scale.command,
        "circle": scale.circle,
        "u_min": units.u_min,
        "u_max": units.u_max,
        "radius": units.body_radius,
        "distance": units.body_radius + units.margin,
        "side_normal": _padded(keep_out.side_normals, 8),
        "side_offset": _padded(keep_out.side_offsets, 4),
        "sides": len(keep_out.side_offsets),
        "pull": qp.cost.pull,
        "pull_terminal": qp.cost.pull_terminal,
        "pull_last": qp.pull_last,
        "slack_dual": -float(units.slack_weights[0]) / SLACK_SCALE,
        "limits_changes": int(rates.active),
        "change": rates.faster,
        "change_scale": qp.change_scale,
        "brake": rates.slower,
        "ramp_step": rates.ramp_step,
        "longest_ramp": rates.longest_ramp,
        "further": motions.further,
        "most_passes": MOST_PASSES,
        "tolerated": sqp.tolerated,
        "lost": qp.lost,
        "fastest": fastest(units),
        "spend_share": options.stop.spend_share,
        "swerve_time": options.stop.swerve_time,
        "accepted_defect": checks.accepted_defect,
        "accepted_depth": checks.accepted_depth,
        "half_plane_scale": HALF_PLANE_SCALE,
        "open": OPEN,
        "rho": options.solver.real_time.rho,
        "places": qp.numbers.places,
        "entries": qp.A.data,
        "lower": qp.lower,
        "upper": qp.upper,
        "q": qp.q,
        "next_stage": qp.next_stage,
        "last_weight": qp.P.data[(first := _last_weight(qp)) : first + LAST_WEIGHTS],
        "turn_place": qp.turn_places if len(qp.turn_places) else np.zeros(1, dtype=int),
        "turn_weight": qp.numbers.turn_weight,
        **_model(controller),
        **_margins(controller),
        **_along_path(controller),
    }


def _last_weight(qp: NavigationQP) -> int:
    """Where the weights of the last state begin among the entries of P."""
    return int(qp.P.indptr[STATES * (qp.horizon - 1)])


def _along_path(controller: Controller) -> dict[str, Any]:
    """What the guide knows of the robot."""
    model, options = controller.known.model, controller.options
    guidance, margins = options.guidance, controller.known.margins
    can = capabilities(model, controller.units, margins, guidance, options.goal)
    limits = can.tolerances
    both = ("enter", "leave", "pushed")
    return {
        "late": can.late,
        "forward": can.forward,
        "backward": can.backward,
        "wheel_arm": can.wheels[0],
        "wheel_speed": can.wheels[1],
        "deceleration": can.deceleration,
        "lead_time": guidance.lead_time,
        "turn_distance": limits.turn_distance,
        "turn_limit": limits.turn_limit,
        **{n: [getattr(limits, f"{n}_{of}") for of in ("distance", "angle")] for n in both},
        "averaging": limits.averaging,
    }


def controller_of(
    model: KoopmanModel,
    problem: NavigationProblem,
    *,
    tightening: bool,
    options: ControllerOptions | None,
) -> Controller:
    """Make the controller in Python that the C code is."""
    check_can_be_exported(model, problem)
    tuning = options or ControllerOptions()
    return Controller(
        model,
        problem,
        guidance=False,
        adaptation=False,
        tightening="learned" if tightening else None,
        options=replace(tuning, pose=replace(tuning.pose, weighed=False)),
    )


def _model(controller: Controller) -> dict[str, Any]:
    """The symmetric form, and how its inputs follow from commands."""
    driven = motion_model(controller.model, controller.units, Scale())
    assert isinstance(driven, Predictor) and driven.model.closed_form is not None
    form, inputs = driven.model.closed_form, Inputs.of(driven.model.dictionary)
    assert inputs is not None
    return {
        "kernel": inputs.kernel[0],
        "smoothing": np.array(inputs.smoothing),
        "limits": np.minimum(inputs.limits, NO_LIMIT),
        "term": _padded(np.array([TERMS.index(name) for name in inputs.terms]), len(TERMS)),
        "terms": len(inputs.terms),
        "motion": _padded(form.motion, STATES * len(TERMS)),
        "node": _padded(np.array(form.nodes), 8),
        "nodes": len(form.nodes),
    }


def _margins(controller: Controller) -> dict[str, Any]:
    """Margins of plans and of motions, and whether they are kept."""
    known = controller.known
    margins = known.margins or Margins(known.model, controller.units)
    felt = margins.calm
    noise = felt.tube
    return {
        "tightens": int(known.margins is not None),
        "errs": int(felt.command_errs),
        "side_margin": margins.side_margin,
        "far_clearance": margins.far_clearance,
        "widest": felt.widest,
        "position_errors": felt.position_errors,
        "heading_errors": felt.heading_errors,
        "command_noise": felt.command,
        "step_quantile": margins.noise.step_quantile,
        "pose_error": felt.pose_error,
        "white": noise.white,
        "lasting": noise.lasting,
        "pose": noise.pose,
        "pose_by_speed": noise.pose_by_speed,
        "delay": noise.delay,
        "spreads": int(noise.spreads),
        "quantile": noise.quantile,
        "headway_time": noise.headway_time,
        "solver_margin": noise.solver_margin,
    }


def _padded(values: Array, count: int) -> Array:
    """All of an array in a row, zeros after it."""
    flat = np.ravel(values)[:count]
    return np.concatenate([flat, np.zeros(count - len(flat), dtype=flat.dtype)])
