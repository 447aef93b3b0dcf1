/* What the files of the controller share: its numbers, and its parts. All in the robot's units. */
#ifndef KMPC_CORE_H
#define KMPC_CORE_H

#include "kmpc.h"

enum { KMPC_AROUND = 2 * KMPC_THINGS, KMPC_MOST = KMPC_THINGS + 4, KMPC_TERMS = 11 };

struct kmpc_numbers {
    real dt;
    real state[3], command[2], circle[5]; /* metres and seconds of a unit */
    real u_min[2], u_max[2];
    real radius, distance; /* of the body, and with the margin [units] */
    real side_normal[8], side_offset[4];
    int sides;
    /* cost */
    real pull[9], pull_terminal[9], pull_last[4], slack_dual;
    /* limits of changes */
    int limits_changes;
    real change[2], change_scale[2], brake[2], ramp_step[2];
    int longest_ramp, further;
    /* passes */
    int most_passes;
    real tolerated, lost, fastest[2];
    real spend_share, swerve_time;
    real accepted_defect, accepted_depth;
    real half_plane_scale, open, rho;
    int places[KMPC_WRITTEN]; /* of the entries that a pass writes */
    real entries[KMPC_ENTRIES], lower[KMPC_ROWS], upper[KMPC_ROWS], q[KMPC_VARIABLES];
    int next_stage[KMPC_ROWS];
    real last_weight[KMPC_LAST_WEIGHTS]; /* of P: of the last state */
    int turn_place[KMPC_TURNS];          /* of P: of the headings before it */
    real turn_weight;
    /* what was learned: which terms are inputs; weights of commands by age, newest first */
    int term[KMPC_TERMS], terms, nodes;
    real kernel[(KMPC_L + 1) * 2], smoothing[2], limits[2], motion[3 * KMPC_TERMS], node[8];
    /* margins */
    int tightens, errs, delay, spreads;
    real white[18], lasting[6], pose[9], pose_by_speed[9];
    real quantile, step_quantile, headway_time, solver_margin, side_margin, far_clearance, widest;
    real position_errors[4], heading_errors[4], command_noise[18], pose_error;
    /* along a path */
    int late; /* periods until a command has had half of its effect */
    real forward[2], backward[2], wheel_arm, wheel_speed, deceleration, lead_time;
    real turn_distance, turn_limit, enter[2], leave[2], pushed[2], averaging;
};

extern const struct kmpc_numbers kmpc_numbers;

/* model.c: predictions (N, 3) of N commands that follow L past ones, and by_x not null: Jacobians;
 * `window` is (L + N, 2), oldest first */
void kmpc_model_linearize(const real *states, const real *window, real *value, real *by_x,
                          real *by_u, real *by_past);
/* States (periods + 1, 3) of a robot that is sent `count` commands, then zeros, after those of the
 * past (KMPC_PAST, 2). */
void kmpc_model_rollout(const real *here, const real *past, const real *commands, int count,
                        int periods, real *states);

/* path.c: what a path asks of a plan, of a robot at a pose that was sent past commands; NULL, or
   the N - 1 that were planned next */
struct kmpc_way {
    int holds;                         /* whether the robot is to stand: it has arrived */
    real reference[3 * (KMPC_N + 1)];  /* states to steer for */
    real clearance[KMPC_N];            /* that the path keeps at stages 1 to N */
    real share_at_goal;                /* of these stages whose reference is at the goal */
    int to_goal;                       /* whether that is the goal itself, however far */
};
void kmpc_follow_path(struct kmpc_path *path, const real *pose, const real *past,
                      const real *coming, int things, const real *thing, struct kmpc_way *way);

/* solve.c: at most `most` passes, at least `least` */
real kmpc_clip(real value, real least, real most);
int kmpc_all_within(const real *numbers, int count, real most); /* no NaN either */
struct kmpc_iterate {
    real states[KMPC_N + 1][3], inputs[KMPC_N][2], duals[KMPC_ROWS];
};
struct kmpc_result {
    int failed, early, passes;
    real defect, next_state[3];
    const char *reason;
};
void kmpc_solve(struct kmpc_iterate *iterate, const real *past, const struct kmpc_way *way,
                int things, const real *thing, int least, int most, struct kmpc_result *result);
void kmpc_duals_in_the_open(real *duals);
void kmpc_rate_limit(const real *last, real *command);

/* motions.c */
struct kmpc_motion_to_rest {
    int length;
    struct kmpc_tried kind;
    real commands[KMPC_T][2];
};
int kmpc_braking(const real *command, real *ramp);
int kmpc_find_motion(real *states, real *inputs, const real *past, int things, const real *thing,
                     struct kmpc_motion_to_rest *found, int *slowed);
real kmpc_clearance_along(const real *states, int count, int things, const real *thing);

#endif
