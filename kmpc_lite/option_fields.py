"""Fields of options that know their unit: what they accept, and how radii become lengths."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field, fields, replace
from typing import Any, TypeVar

from kmpc_lite.errors import ProblemError

Options = TypeVar("Options")


def _gone(room: str, instead: str, names: str) -> dict[str, str]:
    """Rows of `GONE` for names of one room that the same took the place of."""
    return {f"{room}.{name}": instead for name in names.split()}


GONE = {
    "guidance.near_goal_parts": "every search goes on by hurried_parts in each step",
    **_gone(
        "guidance",
        "it is a constant of the path search",
        "least_clearance back_off body_samples goal_slack unfit_cost shuttle_length "
        "shuttle_reach shuttle_gain shuttle_speed shuttles grid_step grid_poses turn_length "
        "locate_back locate_ahead cut_depth arc_step turning_radius_share turning_radius_limit "
        "corner_rounds graph_circles lattice_rectangles lattice_step lattice_nodes "
        "lattice_field_cells lattice_border lattice_near_cost lattice_cut lattice_sample "
        "lattice_samples lattice_look lattice_searches",
    ),
    **_gone(
        "guidance",
        "it follows from the model",
        "spare_clearance speed_clearance_limit centre_headings centre_distance centre_change "
        "centre_certainty centre_share least_speed_share",
    ),
    **_gone(
        "guidance",
        "`guidance.replan_interval` tells how often a path is looked for",
        "off_path_share off_path_limit lost_distance retry_interval moved_distance near_goal "
        "settled_share urgent_parts",
    ),
    **_gone(
        "guidance",
        "`guidance.stall_time` tells when another path is tried",
        "progress_time patience detour_time stall_distance stall_angle tried_paths",
    ),
    **_gone(
        "guidance",
        "`guidance.free_turn` tells how much the robot turns while it drives",
        "free_turn_length free_turn_clearance goal_stretch",
    ),
    **_gone(
        "goal",
        "it follows from the other tolerances",
        "turn_distance turn_limit off_path",
    ),
    **_gone(
        "goal",
        "noise widens tolerances by what it is",
        "turn_distance_noise turn_limit_noise enter_noise leave_distance_noise "
        "leave_angle_noise pushed_distance_noise pushed_angle_noise off_path_noise "
        "quiet_position quiet_heading",
    ),
    **_gone(
        "goal",
        "a robot that does not get nearer is content with more",
        "content_stalls content_most",
    ),
    **_gone(
        "goal",
        "`goal.averaging_time` tells how long poses are averaged",
        "averaging_period",
    ),
    **_gone(
        "sight",
        "it is a constant of the map of what scans show",
        "cell_noise map_reach level free_distance trail same_scan_distance",
    ),
    **_gone(
        "sight",
        "it is a constant of the path search",
        "blocked_interval refresh_interval gear_time lattice_nodes lattice_step",
    ),
    **_gone(
        "tracker",
        "`tracker.noise` and `tracker.acceleration` tell what is expected of what moves",
        "first_speed turn_rate turn_memory gate most",
    ),
    **_gone(
        "tracker",
        "what a scan shows of a pedestrian is told in radii of the robot",
        "gap largest_cluster fewest_hits strayed",
    ),
    **_gone(
        "moving_obstacles",
        "it is a share of `moving_obstacles.clearance`",
        "path_clearance touch switch_clearance",
    ),
    **_gone(
        "moving_obstacles",
        "it is a constant of the evasive arcs",
        "look_step long_look arc_speeds arc_turns arc_times",
    ),
    **_gone("obstacles", "at most 10 are looked at", "grids scans"),
    "obstacles.cell": "cells are 0.1 mm at least",
    "stop.slower_shares": "the largest share whose motion to rest stays clear is driven",
    "stop.turn_only_share": "turning alone is tried after the shares of a command",
    "stop.makes_room": "a motion leaves a thing if half of what it drives leads away",
    "stop.overspeed": "what is far is told by margins",
    "stop.quick_look_error": "every motion is rolled out with the model",
    "stop.quick_look_error_share": "every motion is rolled out with the model",
    "margins.check_margin": "what arcs cut off is computed",
    "margins.check_corrections": "shares are tried at once",
    "margins.check_far_periods": "what is far is told by margins",
    "margins.retreat_share": "a motion that leads away is always allowed",
    **_gone(
        "margins",
        "it is a constant of the innovation",
        "unknown_floor_inflation innovation_attack_time innovation_release_time fading_period "
        "innovation_calm largest_innovation judged_step step_tolerance step_tolerance_share "
        "turn_tolerance turn_tolerance_share usual_speed drift_threshold drift_fading",
    ),
    **_gone(
        "margins",
        "it follows from `margins.step_risk` and the model's noise",
        "adapted_step_risk step_quantile_limit adapted_step_quantile_limit unknown_floor_slip",
    ),
    **_gone("margins", "it is a constant of the margins", "solver_margin far_clearance"),
    **_gone("pose", "it is a constant of the innovation", "turn_slip slip_memory"),
    **_gone(
        "step",
        "it is a constant beside its use",
        "oldest_pose oldest_pose_periods shortest_period longest_period reach_beyond_plan "
        "lookup_distance accepted_depth",
    ),
    "stop.longest_ramp": "a ramp takes ten seconds at the most",
    **_gone(
        "adaptation",
        "it is a constant of adaptation",
        "fewest_steps confirmation even_noise noise_floor turn_noise_floor least_step least_turn "
        "jump_factor jump jump_turn held held_turn held_share largest_drift largest_pull "
        "refusals_for_wrong back_and_forth worse",
    ),
    "solver.real_time_turn": "another pass follows while the model contradicts the plan",
    "solver.long_period_passes": "another pass follows while the model contradicts the plan",
    "solver.long_step": "another pass follows while the model contradicts the plan",
    "solver.cold_passes": "another pass follows while the model contradicts the plan",
    "solver.new_path_passes": "another pass follows while the model contradicts the plan",
    "solver.contradicted_passes": "another pass follows while the model contradicts the plan",
    "solver.cold_tolerance": "another pass follows while the model contradicts the plan",
    **_gone("solver", "it follows from `solver.real_time`", "lagging thorough"),
    "solver.converged": "passes to convergence solve as exactly as their `tolerance` asks for",
    "solver.half_plane_scale": "rows of the QP are scaled by what they are",
    "solver.slack_scale": "rows of the QP are scaled by what they are",
    "solver.lost_position": "a plan is no start three radii from the pose",
    "solver.lost_heading": "a plan is no start a radian from the pose",
    "solver.short_step": "the model is asked about every plan",
    "solver.short_turn": "the model is asked about every plan",
    "solver.short_speed_change": "the model is asked about every plan",
    "solver.short_turn_rate_change": "the model is asked about every plan",
    "solver.straight_defect": "the model is asked about every plan",
    "solver.straight_turn_defect": "the model is asked about every plan",
    "solver.armijo": "passes go the whole way to what the QP found",
    "solver.shortest_step": "passes go the whole way to what the QP found",
    "solver.shortest_converging_step": "passes go the whole way to what the QP found",
    "solver.gauss_newton_passes": "every pass is Gauss-Newton's",
    "solver.least_curvature": "every pass is Gauss-Newton's",
    "solver.penalty_growth": "`slack_weights` of the problem count as they are",
    "solver.largest_penalty": "`slack_weights` of the problem count as they are",
    "solver.constraint_tolerance": "`slack_weights` of the problem count as they are",
    "solver.least_solve_time": "a QP gets 0.05 ms at the least",
}
"""Options of earlier versions by room and name, and what took their place; files may have them."""


def radii(default: float, *, zero: bool = True) -> Any:
    """Length in robot radii; may be zero unless excluded."""
    return _number(default, "radii", zero)


def metres(default: float, *, zero: bool = True) -> Any:
    """Length that does not follow from the robot's [m]."""
    return _number(default, "m", zero)


def seconds(default: float, *, zero: bool = True) -> Any:
    """Time of the robot that is its own unit [s]; another one takes `Scale.time` times as long."""
    return _number(default, "s", zero)


def clock_seconds(default: float, *, zero: bool = True) -> Any:
    """Time by the clock [s], whatever the robot: what hangs on sensors and computers."""
    return _number(default, "s by the clock", zero)


def speed(default: float, *, zero: bool = True) -> Any:
    """Speed [m/s]."""
    return _number(default, "m/s", zero)


def angle(default: float, *, zero: bool = True) -> Any:
    """Angle [rad]."""
    return _number(default, "rad", zero)


def share(default: float, *, zero: bool = True) -> Any:
    """Ratio of two values of the same unit."""
    return _number(default, "1", zero)


def part(default: float) -> Any:
    """Share from 0 to 1."""
    return _number(default, "1", True, most=1.0)


def probability(default: float) -> Any:
    """Probability between 0 and 1, neither of them."""
    return _number(default, "1", False, most=1.0, whole=False)


def shares(*default: float) -> Any:
    """Ratios that are tried one after the other; a negative one means the other direction."""
    return field(default=default, metadata={"unit": "1 each"})


def count(default: int, least: int = 1, most: float = math.inf) -> Any:
    """Whole number from a least one up to the most."""
    return field(default=default, metadata={"unit": "count", "least": least, "most": most})


def switch(default: bool) -> Any:
    """True or false."""
    return field(default=default, metadata={"unit": "switch"})


def group(default: Any) -> Any:
    """Options of their own."""
    return field(default=default, metadata={"unit": "group", "kind": type(default)})


def _number(
    default: float, unit: str, zero: bool, most: float = math.inf, whole: bool = True
) -> Any:
    """Finite number >= 0, or > 0, up to the most; without it where not the whole is allowed."""
    limits = {"unit": unit, "zero": zero, "most": most, "whole": whole}
    return field(default=default, metadata=limits)


def check(options: Any) -> None:
    """Check every field of an options dataclass against its unit.

    Raises
    ------
    ProblemError
        Names the class, the field, and the value that is wrong.
    """
    for f in fields(options):
        value = getattr(options, f.name)
        if expected := _expected(value, f.metadata):
            where = f"{type(options).__name__}.{f.name}"
            raise ProblemError(f"{where}: expected {expected}, got {value!r:.80}")


def _expected(value: Any, limits: Mapping[str, Any]) -> str:
    """What a field takes instead of a value, in words; nothing where the value is right."""
    unit = limits["unit"]
    if unit == "count":
        least, most = limits["least"], limits["most"]
        right = not isinstance(value, bool) and isinstance(value, int) and least <= value <= most
        upwards = f">= {least}" if most == math.inf else f"from {least} to {most}"
        return "" if right else f"a whole number {upwards}"
    if unit == "switch":
        return "" if isinstance(value, bool) else "true or false"
    if unit == "group":
        return "" if isinstance(value, limits["kind"]) else limits["kind"].__name__
    if unit.endswith("each"):
        right = isinstance(value, tuple) and bool(value) and all(map(_is_number, value))
        return "" if right else "a tuple of finite numbers"
    zero, most, whole = limits["zero"], limits["most"], limits["whole"]
    if _is_number(value) and (value > 0 or zero and value == 0):
        if value < most or whole and value == most:
            return ""
    if most == math.inf:
        return f"a number {'>=' if zero else '>'} 0 [{unit}]"
    return "a share from 0 to 1" if whole else "a probability between 0 and 1"


def lengths_from_radii(options: Options, radius: float) -> Options:
    """Return the same options with lengths for a radius, in the unit of that radius.

    Examples
    --------
    >>> from kmpc_lite.control.options import GuidanceOptions
    >>> lengths_from_radii(GuidanceOptions(), 0.15).wide_clearance
    0.06
    """
    described: Any = options
    lengths = [f.name for f in fields(described) if f.metadata["unit"] == "radii"]
    made: Options = replace(
        described, **{name: radius * getattr(options, name) for name in lengths}
    )
    return made


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
