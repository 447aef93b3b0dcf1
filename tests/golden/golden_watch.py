"""Who notices each option of the controller: the list of a mutation check.

Every default is changed by 20 % (counts up, to the next whole number; switches the other way; zero
to a fifth), and a golden drive answers otherwise, or a test goes red: `test_golden_watch.py` tries
it.
"""

from __future__ import annotations

DRIVES: dict[str, int] = {
    "guidance.wide_clearance": 0,
    "guidance.back_off": 40,
    "guidance.off_path_share": 38,
    "guidance.off_path_limit": 55,
    "guidance.replan_interval": 9,
    "guidance.retry_interval": 42,
    "guidance.shuttle_speed": 100,
    "guidance.patience": 40,
    "guidance.turn_share": 0,
    "guidance.lead_time": 0,
    "guidance.free_turn": 38,
    "guidance.free_turn_length": 65,
    "guidance.free_turn_clearance": 202,
    "guidance.goal_stretch": 169,
    "guidance.brake_share": 63,
    "guidance.grid_step": 19,
    "guidance.turn_length": 55,
    "guidance.arc_step": 11,
    "guidance.turning_radius_limit": 11,
    "guidance.lattice_border": 169,
    "goal.turn_distance": 169,
    "goal.enter_angle": 86,
    "goal.leave_distance": 250,
    "goal.off_path": 95,
    "moving_obstacles.look_ahead": 260,
    "moving_obstacles.look_step": 202,
    "moving_obstacles.clearance": 260,
    "moving_obstacles.path_clearance": 202,
    "moving_obstacles.long_look": 260,
    "moving_obstacles.speed_scales": 202,
    "moving_obstacles.arc_speeds": 260,
    "moving_obstacles.arc_turns": 50,
    "moving_obstacles.arc_times": 260,
    "margins.risk": 202,
    "margins.solver_margin": 0,
    "margins.headway": 0,
    "margins.side_margin": 260,
    "margins.far_clearance": 50,
    "margins.adapted_step_risk": 155,
    "margins.step_quantile_limit": 202,
    "margins.adapted_step_quantile_limit": 5,
    "margins.unknown_floor_slip": 36,
    "margins.check_margin": 40,
    "margins.check_corrections": 152,
    "margins.retreat_share": 260,
    "margins.innovation_attack_time": 36,
    "margins.innovation_release_time": 36,
    "margins.fading_period": 133,
    "margins.innovation_calm": 36,
    "margins.judged_step": 146,
    "margins.step_tolerance": 36,
    "margins.step_tolerance_share": 36,
    "margins.turn_tolerance": 36,
    "margins.turn_tolerance_share": 36,
    "margins.usual_speed": 36,
    "margins.drift_threshold": 61,
    "margins.drift_fading": 169,
    "solver.real_time.tolerance": 1,
    "solver.real_time.max_iter": 202,
    "solver.real_time.rho": 1,
    "solver.real_time.alpha": 1,
    "solver.real_time.adaptive_rho": 260,
    "solver.real_time.scaling": 1,
    "solver.real_time.check_termination": 1,
    "solver.lagging.tolerance": 32,
    "solver.lagging.max_iter": 78,
    "solver.lagging.rho": 32,
    "solver.lagging.alpha": 71,
    "solver.lagging.adaptive_rho": 32,
    "solver.lagging.adaptive_rho_interval": 71,
    "solver.lagging.scaling": 32,
    "solver.lagging.check_termination": 71,
    "solver.converged.adaptive_rho_interval": 19,
    "solver.converged.tolerance": 19,
    "solver.converged.rho": 19,
    "solver.converged.alpha": 19,
    "solver.converged.adaptive_rho": 19,
    "solver.converged.scaling": 19,
    "solver.converged.check_termination": 19,
    "solver.half_plane_scale": 20,
    "solver.slack_scale": 20,
    "solver.cold_passes": 260,
    "solver.new_path_passes": 32,
    "solver.cold_tolerance": 146,
    "solver.straight_defect": 145,
    "stop.spend_share": 5,
    "stop.turn_only_share": 75,
    "step.reach_beyond_plan": 169,
    "step.lookup_distance": 169,
    "step.guide_share": 38,
}
"""Options, and the golden drive whose answers change with them."""

TESTS: dict[str, tuple[str, ...]] = {
    "control/options/test_effects.py::"
    "test_paths_keep_two_centimetres_beyond_a_margin_and_ten_in_all": (
        "guidance.spare_clearance",
        "guidance.speed_clearance_limit",
    ),
    "control/path/test_shuttle.py::test_it_is_tried_three_times_for_one_goal": (
        "guidance.shuttles",
    ),
    "control/options/test_effects.py::test_a_path_that_is_half_a_second_longer_is_a_detour": (
        "guidance.progress_time",
        "guidance.detour_time",
    ),
    "control/options/test_effects.py::"
    "test_a_robot_that_gets_no_nearer_has_stalled_after_five_seconds": ("guidance.stall_time",),
    "control/options/test_effects.py::"
    "test_who_moves_by_a_radius_or_turns_by_half_a_radian_does_not_stand": (
        "guidance.stall_distance",
        "guidance.stall_angle",
    ),
    "control/path/test_tangent_graph.py::test_small_circles_keep_their_arcs": (
        "guidance.cut_depth",
    ),
    "control/options/test_effects.py::test_a_turning_centre_counts_from_four_millimetres": (
        "guidance.centre_distance",
    ),
    "control/options/test_effects.py::"
    "test_a_twentieth_of_a_command_is_believed_of_a_robot_that_does_not_move": (
        "guidance.least_speed_share",
    ),
    "control/path/test_goal_checker.py::"
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
    "control/path/test_goal_checker.py::test_the_papers_robot_parks_within_these_tolerances": (
        "goal.turn_limit",
        "goal.enter_distance",
        "goal.leave_angle",
        "goal.pushed_distance",
        "goal.pushed_angle",
    ),
    "control/path/test_goal_checker.py::"
    "test_who_has_stalled_four_times_is_content_with_twice_and_later_with_five_times": (
        "goal.content_stalls",
        "goal.content_most",
    ),
    "control/path/test_goal_checker.py::"
    "test_a_push_is_forgotten_in_half_a_second_or_with_five_poses": (
        "goal.averaging_time",
        "goal.averaging_period",
    ),
    "control/margins/test_command_check.py::"
    "test_what_is_farther_than_some_periods_of_driving_is_not_looked_at": (
        "margins.check_far_periods",
    ),
    "control/options/test_effects.py::test_a_plan_is_no_start_for_a_robot_half_a_metre_from_it": (
        "solver.lost_position",
    ),
    "control/options/test_effects.py::test_steps_that_are_short_and_defects_that_are_small": (
        "solver.short_step",
        "solver.short_turn",
        "solver.short_speed_change",
        "solver.short_turn_rate_change",
        "solver.straight_turn_defect",
    ),
    "control/nmpc/test_solver_options.py::test_line_searches_end_at_the_length_of_their_mode": (
        "solver.shortest_step",
        "solver.shortest_converging_step",
    ),
    "control/nmpc/test_solver_options.py::"
    "test_the_exact_hessian_is_used_late_or_after_a_shortened_step": (
        "solver.gauss_newton_passes",
    ),
    "control/nmpc/test_exact_hessian.py::"
    "test_states_on_which_gauss_newton_needs_hundreds_of_passes": ("solver.least_curvature",),
    "control/nmpc/test_solver_options.py::"
    "test_the_slack_penalty_grows_while_a_plan_stands_in_an_obstacle": (
        "solver.penalty_growth",
        "solver.largest_penalty",
    ),
    "control/stop/test_stop_options.py::"
    "test_the_rest_of_the_plan_is_tried_for_as_long_as_it_is_told": ("stop.further_time",),
    "control/stop/test_stop_options.py::test_commands_are_slowed_to_the_shares_that_are_told": (
        "stop.slower_shares",
    ),
    "control/stop/test_passers_by.py::test_he_may_turn_for_three_tenths_of_a_second_at_the_most": (
        "stop.swerve_time",
    ),
    "control/stop/test_passers_by.py::test_a_motion_makes_room_that_leads_away_by_sixty_degrees": (
        "stop.makes_room",
    ),
    "control/stop/test_stop_options.py::test_what_is_far_is_not_looked_at": ("stop.overspeed",),
    "control/options/test_effects.py::test_a_ramp_takes_ten_seconds_at_most": (
        "stop.longest_ramp",
    ),
    "control/test_step_bounds.py::test_a_step_stops_where_obstacles_are_too_many": (
        "obstacles.circles",
        "obstacles.edges",
        "obstacles.grids",
        "obstacles.grid_cells",
        "obstacles.grid_runs",
        "obstacles.scans",
    ),
    "control/options/test_effects.py::"
    "test_polygons_have_a_hundred_corners_and_cells_a_tenth_of_a_millimetre": (
        "obstacles.polygon_corners",
        "obstacles.cell",
    ),
    "control/options/test_options.py::"
    "test_a_pose_is_believed_for_two_seconds_or_a_thousand_periods": (
        "step.oldest_pose",
        "step.oldest_pose_periods",
    ),
    "control/options/test_options.py::"
    "test_periods_lie_between_a_tenth_of_a_millisecond_and_a_hundred_seconds": (
        "step.shortest_period",
        "step.longest_period",
    ),
    "control/path/test_guidance_options.py::"
    "test_a_robot_that_is_not_round_is_looked_at_in_400_places_of_a_path": (
        "guidance.body_samples",
    ),
    "control/options/test_effects.py::test_nor_for_one_that_is_turned_by_a_radian": (
        "solver.lost_heading",
    ),
    "control/path/test_lattice_options.py::"
    "test_the_tangent_graph_takes_the_corners_of_24_rectangles": ("guidance.lattice_rectangles",),
    "control/path/test_lattice_options.py::"
    "test_nodes_lie_five_centimetres_apart_and_farther_where_they_are_too_many": (
        "guidance.lattice_step",
        "guidance.lattice_nodes",
    ),
    "control/path/test_lattice_options.py::test_a_field_has_a_million_cells_at_the_most": (
        "guidance.lattice_field_cells",
    ),
    "control/path/test_lattice_options.py::test_a_step_along_an_obstacle_counts_a_fifth_more": (
        "guidance.lattice_near_cost",
    ),
    "control/path/test_lattice_options.py::"
    "test_a_path_may_cut_the_cells_of_a_grid_by_two_centimetres": ("guidance.lattice_cut",),
    "control/path/test_lattice_options.py::"
    "test_lines_are_looked_at_every_four_centimetres_at_400_points_at_the_most": (
        "guidance.lattice_sample",
        "guidance.lattice_samples",
    ),
    "control/path/test_lattice_options.py::"
    "test_the_farthest_node_in_sight_is_looked_for_among_eighty": ("guidance.lattice_look",),
    "control/path/test_lattice_options.py::test_four_searches_from_goals_are_kept": (
        "guidance.lattice_searches",
    ),
    "control/path/test_lattice_options.py::"
    "test_corners_are_added_twelve_times_before_the_lattices_own_path_is_taken": (
        "guidance.corner_rounds",
    ),
    "control/path/test_lattice_options.py::test_a_graph_takes_150_circles": (
        "guidance.graph_circles",
    ),
    "control/path/test_guidance_options.py::"
    "test_paths_keep_six_or_three_centimetres_or_five_millimetres": (
        "guidance.narrow_clearance",
        "guidance.least_clearance",
    ),
    "control/path/test_guidance_options.py::"
    "test_who_is_carried_by_half_a_metre_gets_another_path_at_once": ("guidance.lost_distance",),
    "control/path/test_guidance_options.py::"
    "test_an_obstacle_may_be_a_centimetre_from_where_it_was": ("guidance.moved_distance",),
    "control/path/test_guidance_options.py::"
    "test_repeated_searches_are_hurried_within_two_radii_of_the_goal": ("guidance.near_goal",),
    "control/path/test_guidance_options.py::"
    "test_three_parts_of_a_hurried_search_are_done_in_a_step": ("guidance.hurried_parts",),
    "control/path/test_guidance_options.py::"
    "test_two_parts_of_a_third_search_near_the_goal_are_done_in_a_step": (
        "guidance.near_goal_parts",
    ),
    "control/path/test_guidance_options.py::"
    "test_near_the_goal_who_is_sent_at_four_tenths_of_the_speed_does_not_look_for_a_path": (
        "guidance.settled_share",
    ),
    "control/path/test_guidance_options.py::"
    "test_a_path_from_near_the_goal_ends_beside_it_by_half_of_where_the_last_turn_may_begin": (
        "guidance.goal_slack",
    ),
    "control/path/test_guidance_options.py::"
    "test_sixty_parts_of_a_search_that_is_needed_at_once_are_done_in_a_step": (
        "guidance.urgent_parts",
    ),
    "control/path/test_guidance_options.py::"
    "test_another_side_is_taken_where_it_is_quicker_by_half_a_second_and_a_tenth": (
        "guidance.switch_time",
        "guidance.switch_share",
    ),
    "control/path/test_guidance_options.py::test_a_path_has_twenty_thousand_poses_at_the_most": (
        "guidance.grid_poses",
    ),
    "control/path/test_guidance_options.py::"
    "test_the_place_moves_by_half_a_second_back_and_one_and_a_half_ahead": (
        "guidance.locate_back",
        "guidance.locate_ahead",
    ),
    "control/path/test_guidance_options.py::"
    "test_the_robot_turns_on_circles_of_three_tenths_of_the_way": (
        "guidance.turning_radius_share",
    ),
    "control/path/test_guidance_options.py::"
    "test_a_turning_centre_is_certain_by_three_and_a_half_standard_errors": (
        "guidance.centre_certainty",
    ),
    "control/path/test_guidance_options.py::test_a_turning_centre_explains_half_of_the_motion": (
        "guidance.centre_share",
    ),
    "control/path/test_guidance_options.py::test_a_model_is_asked_for_turns_at_eight_headings": (
        "guidance.centre_headings",
    ),
    "control/path/test_shuttle.py::test_beside_its_goal_a_robot_backs_up_and_comes_again": (
        "guidance.shuttle_length",
    ),
    "control/path/test_shuttle.py::test_it_must_be_quicker_than_turning_on_the_spot_by_a_second": (
        "guidance.shuttle_gain",
    ),
    "control/path/test_shuttle.py::test_it_turns_back_within_half_a_radius_of_its_end": (
        "guidance.shuttle_reach",
    ),
    "control/path/test_turning_centre.py::test_a_point_that_is_learned_anew_keeps_the_way": (
        "guidance.centre_change",
    ),
    "control/path/test_moving_obstacles.py::"
    "test_an_evasive_arc_may_lead_out_of_the_area_by_a_millimetre": ("moving_obstacles.touch",),
    "control/path/test_moving_obstacles.py::"
    "test_an_arc_is_left_for_one_with_three_centimetres_more_clearance": (
        "moving_obstacles.switch_clearance",
    ),
    "control/margins/test_drift_detector.py::"
    "test_a_floor_is_unknown_where_its_noise_is_three_times_the_known": (
        "margins.unknown_floor_inflation",
    ),
    "control/margins/test_drift_detector.py::"
    "test_an_error_counts_as_twenty_times_the_expected_one_at_the_most": (
        "margins.largest_innovation",
    ),
    "control/margins/test_quantiles.py::test_a_single_command_is_allowed_an_error_in_a_thousand": (
        "margins.step_risk",
    ),
    "control/nmpc/test_solver_options.py::test_rho_is_adapted_as_often_as_osqp_does_by_itself": (
        "solver.real_time.adaptive_rho_interval",
    ),
    "control/nmpc/test_solver_options.py::"
    "test_a_step_must_bring_its_share_of_the_predicted_decrease": ("solver.armijo",),
    "control/nmpc/test_solver_options.py::"
    "test_a_converged_plan_may_stand_in_an_obstacle_by_a_hundredth_of_a_millimetre": (
        "solver.constraint_tolerance",
    ),
    "control/nmpc/test_solver_options.py::"
    "test_passes_to_convergence_solve_with_four_thousand_iterations_at_the_most": (
        "solver.converged.max_iter",
    ),
    "control/nmpc/test_solver_options.py::"
    "test_more_than_0_6_radians_in_a_period_need_more_than_one_pass": (
        "solver.real_time_turn",
        "solver.long_period_passes",
    ),
    "control/nmpc/test_solver_options.py::test_a_qp_gets_some_time_even_past_the_deadline": (
        "solver.least_solve_time",
    ),
    "control/test_verification.py::test_what_the_model_contradicts_is_linearised_again": (
        "solver.contradicted_passes",
    ),
    "control/test_verification.py::"
    "test_the_model_may_contradict_a_plan_by_five_centimetres_a_period": ("step.accepted_defect",),
    "control/test_verification.py::test_a_plan_that_was_rolled_out_may_cut_in_by_two_centimetres": (
        "step.accepted_depth",
    ),
    "control/stop/test_stop_options.py::test_the_quick_look_keeps_its_error_beyond_the_margin": (
        "stop.quick_look_error",
        "stop.quick_look_error_share",
    ),
    "control/world/test_scan.py::test_scans_that_are_none_are_refused": ("obstacles.scan_beams",),
    "control/estimate/test_pose_watch.py::"
    "test_a_third_of_a_radius_and_all_that_was_driven_is_no_jump": (
        "pose.tolerated",
        "pose.slip",
        "pose.slip_memory",
    ),
    "control/estimate/test_pose_watch.py::"
    "test_a_tenth_of_a_radian_and_two_and_a_half_times_the_turn_is_no_jump": (
        "pose.tolerated_turn",
        "pose.turn_slip",
    ),
    "control/estimate/test_pose_watch.py::test_a_pose_that_stays_is_believed_after_two_seconds": (
        "pose.agreement",
    ),
    "control/world/test_tracker_options.py::"
    "test_what_was_seen_once_is_known_to_two_centimetres_and_may_drive_twice_as_fast": (
        "tracker.noise",
        "tracker.first_speed",
        "tracker.turn_rate",
    ),
    "control/world/test_tracker_options.py::"
    "test_accelerations_of_two_thirds_of_the_fastest_speed_and_turns_of_two_seconds": (
        "tracker.acceleration",
        "tracker.turn_memory",
    ),
    "control/world/test_tracker_options.py::"
    "test_who_is_where_chance_leads_once_in_ten_thousand_is_still_the_same": ("tracker.gate",),
    "control/world/test_tracker_options.py::"
    "test_who_stands_is_taken_to_move_once_in_a_thousand_times": ("tracker.false_alarm",),
    "control/world/test_tracker_options.py::"
    "test_who_is_hidden_is_expected_for_a_second_and_a_half": ("tracker.coast",),
    "control/world/test_tracker_options.py::"
    "test_who_was_seen_to_move_grows_by_three_standard_deviations_of_his_velocity": (
        "tracker.spread",
    ),
    "control/world/test_tracker_options.py::test_two_hundred_circles_are_followed": (
        "tracker.most",
    ),
    "control/world/test_tracker_options.py::test_who_is_seen_has_a_radius_of_three_of_the_robots": (
        "tracker.largest_cluster",
    ),
    "control/world/test_tracker_options.py::test_three_hits_are_somebody": ("tracker.fewest_hits",),
    "control/world/test_tracker_options.py::test_a_step_of_a_radius_separates_two_things": (
        "tracker.gap",
    ),
    "control/world/test_tracker_options.py::"
    "test_somebody_moves_by_half_of_his_radius_in_a_second": ("tracker.strayed",),
    "control/world/test_tracker_options.py::"
    "test_somebody_has_left_his_place_for_three_tenths_of_a_second": ("tracker.begins",),
    "control/world/sight/test_sight_options.py::"
    "test_cells_have_a_third_of_a_radius_and_twice_the_noise_of_the_ranges": (
        "sight.cell",
        "sight.cell_noise",
    ),
    "control/world/sight/test_sight_options.py::"
    "test_the_map_reaches_twice_as_far_as_the_scanner_and_has_400_cells_a_side": (
        "sight.map_reach",
        "sight.most_cells",
    ),
    "control/world/sight/test_sight_options.py::"
    "test_what_is_out_of_sight_is_known_for_two_minutes": ("sight.memory",),
    "control/world/sight/test_sight_options.py::"
    "test_a_cell_that_was_hit_is_free_after_three_scans_have_passed": ("sight.passes",),
    "control/world/sight/test_sight_options.py::"
    "test_hits_are_nearer_than_seen_by_two_standard_deviations": ("sight.certainty",),
    "control/world/sight/test_sight_options.py::"
    "test_what_is_within_a_cell_of_a_line_counts_as_behind_it": ("sight.level",),
    "control/world/sight/test_sight_options.py::test_cells_are_noted_as_free_up_to_three_metres": (
        "sight.free_distance",
    ),
    "control/world/sight/test_sight_options.py::"
    "test_nothing_is_known_of_what_stands_beside_a_robot_that_begins": ("sight.free_at_start",),
    "control/world/sight/test_sight_options.py::test_sixty_four_poses_of_the_past_are_kept": (
        "sight.trail",
    ),
    "control/world/sight/test_sight_options.py::test_nobody_steps_out_of_what_is_not_seen": (
        "sight.emerging_speed",
    ),
    "control/world/sight/test_scan_watch.py::test_a_robot_drives_for_a_second_without_scans": (
        "sight.blind_time",
    ),
    "control/world/sight/test_scan_watch.py::"
    "test_a_scan_counts_as_told_again_from_half_a_radius_away": ("sight.same_scan_distance",),
    "control/world/sight/test_sight_options.py::"
    "test_a_path_is_looked_for_anew_after_three_seconds": ("sight.refresh_interval",),
    "control/world/sight/test_sight_options.py::"
    "test_five_times_a_second_is_looked_for_what_stands_on_the_path": ("sight.blocked_interval",),
    "control/world/sight/test_sight_options.py::"
    "test_a_lattice_of_what_was_seen_has_twelve_thousand_nodes": ("sight.lattice_nodes",),
    "control/world/sight/test_sight_options.py::"
    "test_nodes_of_a_lattice_of_what_was_seen_lie_seven_and_a_half_centimetres_apart": (
        "sight.lattice_step",
    ),
    "control/world/sight/test_sight_options.py::"
    "test_a_path_without_a_change_of_gear_may_take_two_seconds_longer": ("sight.gear_time",),
    "adaptation/test_adaptation_options.py::"
    "test_the_window_has_two_seconds_and_eight_steps_and_the_memory_thirty_seconds": (
        "adaptation.window",
        "adaptation.memory",
    ),
    "adaptation/test_adaptation_options.py::"
    "test_a_model_is_given_from_eight_steps_since_a_change_on": ("adaptation.fewest_steps",),
    "adaptation/test_adaptation_options.py::test_the_window_raises_an_alarm_at_forty": (
        "adaptation.window_alarm",
    ),
    "adaptation/test_adaptation_options.py::test_the_memory_raises_an_alarm_at_thirty": (
        "adaptation.memory_alarm",
    ),
    "adaptation/test_adaptation_options.py::"
    "test_an_alarm_is_confirmed_by_the_scatter_of_the_steps_themselves": (
        "adaptation.confirmation",
    ),
    "adaptation/test_adaptation_options.py::"
    "test_a_step_weighs_by_half_a_millimetre_and_three_tenths_of_the_usual": (
        "adaptation.even_noise",
        "adaptation.noise_floor",
        "adaptation.turn_noise_floor",
    ),
    "adaptation/test_adaptation_options.py::"
    "test_a_step_of_two_millimetres_or_milliradians_tells_of_the_floor": (
        "adaptation.least_step",
        "adaptation.least_turn",
    ),
    "adaptation/test_adaptation_options.py::"
    "test_three_times_what_was_commanded_and_five_centimetres_more_is_a_jump": (
        "adaptation.jump_factor",
        "adaptation.jump",
        "adaptation.jump_turn",
    ),
    "adaptation/test_adaptation_options.py::test_who_does_less_than_a_tenth_is_held": (
        "adaptation.held",
        "adaptation.held_turn",
        "adaptation.held_share",
    ),
    "adaptation/test_adaptation_options.py::test_gains_of_a_floor_and_those_of_another_robot": (
        "adaptation.least_gain",
        "adaptation.largest_gain",
        "adaptation.largest_drift",
        "adaptation.largest_pull",
    ),
    "adaptation/test_adaptation_options.py::test_gains_found_twice_are_those_of_another_robot": (
        "adaptation.refusals_for_wrong",
    ),
    "adaptation/test_adaptation_options.py::"
    "test_a_drive_that_takes_half_of_itself_back_tells_nothing": ("adaptation.back_and_forth",),
    "adaptation/test_adaptation_options.py::test_an_adapted_model_may_be_worse_by_a_tenth": (
        "adaptation.worse",
    ),
    "control/world/test_ways.py::test_ways_are_looked_at_where_steps_are_long": (
        "solver.long_step",
    ),
}
"""Tests below tests, and the options that they watch."""
