"""Names of options that are gone, and what took their place: old scenario files get one line."""

from __future__ import annotations


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
        "what a scan shows of a pedestrian is measured in radii of the robot",
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
    "stop.overspeed": "margins say what is far",
    "stop.quick_look_error": "every motion is rolled out with the model",
    "stop.quick_look_error_share": "every motion is rolled out with the model",
    "margins.check_margin": "what arcs cut off is computed",
    "margins.check_corrections": "shares are tried at once",
    "margins.check_far_periods": "margins say what is far",
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
