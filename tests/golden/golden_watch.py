"""Who notices each option of the controller: the list of a mutation check.

Every default was changed by 20 % (counts up, to the next whole number; switches the other way), and
golden drives were replayed until one answered otherwise; what none of 45 drives noticed is looked
at by a test. A drive or a test that is named here goes red with the option changed.
"""

from __future__ import annotations

DRIVES: dict[str, int] = {
    "guidance.wide_clearance": 0,
    "guidance.spare_clearance": 179,
    "guidance.back_off": 11,
    "guidance.off_path_share": 179,
    "guidance.off_path_limit": 38,
    "guidance.replan_interval": 10,
    "guidance.retry_interval": 130,
    "guidance.shuttle_speed": 19,
    "guidance.patience": 0,
    "guidance.turn_share": 0,
    "guidance.lead_time": 0,
    "guidance.free_turn": 19,
    "guidance.free_turn_length": 19,
    "guidance.free_turn_clearance": 11,
    "guidance.goal_stretch": 19,
    "guidance.grid_step": 19,
    "guidance.turn_length": 19,
    "guidance.arc_step": 11,
    "guidance.turning_radius_limit": 11,
    "guidance.lattice_border": 13,
    "goal.turn_distance": 19,
    "goal.enter_angle": 19,
    "goal.leave_distance": 19,
    "goal.off_path": 19,
    "moving_obstacles.look_ahead": 38,
    "moving_obstacles.look_step": 38,
    "moving_obstacles.clearance": 38,
    "moving_obstacles.path_clearance": 186,
    "moving_obstacles.long_look": 38,
    "moving_obstacles.speed_scales": 186,
    "moving_obstacles.arc_speeds": 38,
    "moving_obstacles.arc_turns": 38,
    "moving_obstacles.arc_times": 38,
    "margins.risk": 0,
    "margins.solver_margin": 0,
    "margins.headway": 0,
    "margins.side_margin": 0,
    "margins.far_clearance": 9,
    "margins.adapted_step_risk": 76,
    "margins.step_quantile_limit": 11,
    "margins.adapted_step_quantile_limit": 6,
    "margins.unknown_floor_slip": 6,
    "margins.check_margin": 6,
    "margins.check_corrections": 76,
    "margins.retreat_share": 76,
    "margins.innovation_attack": 76,
    "margins.innovation_release": 76,
    "margins.innovation_calm": 76,
    "margins.judged_step": 76,
    "margins.step_tolerance": 76,
    "margins.step_tolerance_share": 76,
    "margins.turn_tolerance": 76,
    "margins.turn_tolerance_share": 76,
    "margins.usual_speed": 76,
    "margins.drift_threshold": 153,
    "margins.drift_fading": 153,
    "solver.real_time.tolerance": 1,
    "solver.real_time.max_iter": 1,
    "solver.real_time.rho": 1,
    "solver.real_time.alpha": 1,
    "solver.real_time.adaptive_rho": 1,
    "solver.real_time.scaling": 1,
    "solver.real_time.check_termination": 1,
    "solver.converged.tolerance": 20,
    "solver.converged.rho": 20,
    "solver.converged.alpha": 20,
    "solver.converged.adaptive_rho": 20,
    "solver.converged.scaling": 20,
    "solver.converged.check_termination": 20,
    "solver.half_plane_scale": 20,
    "solver.slack_scale": 20,
    "solver.cold_passes": 0,
    "solver.new_path_passes": 0,
    "solver.cold_tolerance": 3,
    "solver.straight_defect": 146,
    "stop.spend_share": 6,
    "stop.turn_only_share": 76,
    "step.reach_beyond_plan": 13,
    "step.lookup_distance": 13,
    "step.guide_share": 39,
}
"""Options, and the golden drive whose answers change with them."""

TESTS: dict[str, tuple[str, ...]] = {
    "options/test_effects.py::test_paths_keep_two_centimetres_beyond_a_margin_and_ten_in_all": (
        "guidance.speed_clearance_limit",
    ),
    "guidance/test_shuttle.py::test_it_is_tried_so_often_and_for_a_new_goal_again": (
        "guidance.shuttles",
    ),
    "options/test_effects.py::test_a_path_that_is_half_a_second_longer_is_a_detour": (
        "guidance.progress_time",
        "guidance.detour_time",
    ),
    "guidance/test_progress_checker.py::test_a_detour_is_driven_to_its_end_but_not_for_ever": (
        "guidance.stall_time",
    ),
    "options/test_effects.py::"
    "test_who_moves_by_a_radius_or_turns_by_half_a_radian_does_not_stand": (
        "guidance.stall_distance",
        "guidance.stall_angle",
    ),
    "guidance/test_tangent_graph.py::test_small_circles_keep_their_arcs": ("guidance.cut_depth",),
    "options/test_effects.py::test_a_turning_centre_counts_from_four_millimetres": (
        "guidance.centre_distance",
    ),
    "options/test_effects.py::"
    "test_a_twentieth_of_a_command_is_believed_of_a_robot_that_does_not_move": (
        "guidance.least_speed_share",
    ),
    "guidance/test_goal_checker.py::"
    "test_each_tolerance_is_widened_by_its_number_of_standard_deviations": (
        "goal.turn_distance_noise",
        "goal.turn_limit_noise",
        "goal.enter_noise",
        "goal.leave_distance_noise",
        "goal.leave_angle_noise",
        "goal.pushed_distance_noise",
        "goal.pushed_angle_noise",
        "goal.off_path_noise",
        "goal.quiet_position",
        "goal.quiet_heading",
    ),
    "guidance/test_goal_checker.py::test_the_papers_robot_parks_within_these_tolerances": (
        "goal.turn_limit",
        "goal.enter_distance",
        "goal.leave_angle",
        "goal.pushed_distance",
        "goal.pushed_angle",
    ),
    "guidance/test_goal_checker.py::test_a_push_is_forgotten_by_a_fifth_a_step": (
        "goal.averaging",
    ),
    "margins/test_command_check.py::"
    "test_what_is_farther_than_some_periods_of_driving_is_not_looked_at": (
        "margins.check_far_periods",
    ),
    "options/test_effects.py::test_a_plan_is_no_start_for_a_robot_half_a_metre_from_it": (
        "solver.lost_position",
    ),
    "options/test_effects.py::test_steps_that_are_short_and_defects_that_are_small": (
        "solver.short_step",
        "solver.short_turn",
        "solver.short_speed_change",
        "solver.short_turn_rate_change",
        "solver.straight_turn_defect",
    ),
    "nmpc/test_solver_options.py::test_line_searches_end_at_the_length_of_their_mode": (
        "solver.shortest_step",
        "solver.shortest_converging_step",
    ),
    "nmpc/test_solver_options.py::test_the_exact_hessian_is_used_late_or_after_a_shortened_step": (
        "solver.gauss_newton_passes",
    ),
    "nmpc/test_exact_hessian.py::test_states_on_which_gauss_newton_needs_hundreds_of_passes": (
        "solver.least_curvature",
    ),
    "nmpc/test_solver_options.py::"
    "test_the_slack_penalty_grows_while_a_plan_stands_in_an_obstacle": (
        "solver.penalty_growth",
        "solver.largest_penalty",
    ),
    "safe_stop/test_stop_options.py::"
    "test_the_rest_of_the_plan_is_tried_for_as_long_as_it_is_told": ("stop.further_time",),
    "safe_stop/test_stop_options.py::test_commands_are_slowed_to_the_shares_that_are_told": (
        "stop.slower_shares",
    ),
    "safe_stop/test_stop_options.py::test_what_is_far_is_not_looked_at": ("stop.overspeed",),
    "options/test_effects.py::test_a_ramp_takes_ten_seconds_at_most": ("stop.longest_ramp",),
    "test_step_bounds.py::test_a_step_stops_where_obstacles_are_too_many": (
        "obstacles.circles",
        "obstacles.edges",
        "obstacles.grids",
        "obstacles.grid_cells",
        "obstacles.grid_runs",
    ),
    "options/test_effects.py::"
    "test_polygons_have_a_hundred_corners_and_cells_a_tenth_of_a_millimetre": (
        "obstacles.polygon_corners",
        "obstacles.cell",
    ),
    "options/test_options.py::test_a_pose_is_believed_for_two_seconds_or_a_thousand_periods": (
        "step.oldest_pose",
        "step.oldest_pose_periods",
    ),
    "options/test_options.py::"
    "test_periods_lie_between_a_tenth_of_a_millisecond_and_a_hundred_seconds": (
        "step.shortest_period",
        "step.longest_period",
    ),
    "options/test_effects.py::test_nor_for_one_that_is_turned_by_a_radian": (
        "solver.lost_heading",
    ),
}
"""Tests below tests/control, and the options that they watch."""

OPEN: tuple[str, ...] = (
    "margins.step_risk",
    "margins.largest_innovation",
    "solver.contradicted_passes",
    "guidance.hurried_parts",
    "guidance.shuttle_length",
    "guidance.shuttle_gain",
    "guidance.turning_radius_share",
    "guidance.narrow_clearance",
    "guidance.least_clearance",
    "guidance.lost_distance",
    "guidance.moved_distance",
    "guidance.near_goal",
    "guidance.switch_time",
    "guidance.switch_share",
    "guidance.shuttle_reach",
    "guidance.grid_poses",
    "guidance.locate_back",
    "guidance.locate_ahead",
    "guidance.corner_rounds",
    "guidance.graph_circles",
    "guidance.lattice_rectangles",
    "guidance.lattice_step",
    "guidance.lattice_nodes",
    "guidance.lattice_field_cells",
    "guidance.lattice_near_cost",
    "guidance.lattice_cut",
    "guidance.lattice_sample",
    "guidance.lattice_samples",
    "guidance.lattice_look",
    "guidance.lattice_searches",
    "guidance.centre_headings",
    "guidance.centre_change",
    "guidance.centre_certainty",
    "guidance.centre_share",
    "moving_obstacles.touch",
    "moving_obstacles.switch_clearance",
    "margins.unknown_floor_inflation",
    "solver.converged.max_iter",
    "solver.armijo",
    "solver.accepted_depth",
    "solver.least_solve_time",
    "stop.quick_look_error",
    "stop.quick_look_error_share",
    "obstacles.scans",
    "obstacles.scan_beams",
    "step.accepted_defect",
    "step.accepted_depth",
)
"""Options of which it is not yet known who notices: no drive and no test that was tried does."""

OPEN_ROOMS = ("pose", "sight", "tracker")
"""Rooms of options that are newer than the check."""
