/* The way along a path from a host, as the guide in Python drives it: the robot's place on it, its
 * last turn, when it holds at the goal, and the reference of a plan. */
#include "core.h"

#include <math.h>
#include <string.h>

#define K kmpc_numbers

static const real ROUNDING = R(1e-9), INSTANT = R(1e-9);
static const real GRID_STEP = R(0.05), PLACES = R(20000.0); /* time between places, and how many */
static const real FAR = R(0.05);        /* how much nearer a place must be that lies farther on */
static const real NEAR_CUSP = R(0.075); /* from a change of gear: the robot goes on */
static const real AT_GOAL = R(1e-6);    /* distance that rounding leaves to the goal */
static const real PATIENCE = R(0.8), NEAR_GOAL = R(0.3); /* time and distance to wait beside it */
enum { TRIES = 8 };

static struct kmpc_timed timed(const struct kmpc_path *path)
{
    return (struct kmpc_timed){path->count, path->cusps, path->pose[0], path->begins,
                               path->cusp,  path->step,  path->braking};
}

/* 1 ahead, -1 backwards, 0 turning on the spot. */
static int gear_of(const real *a, const real *b)
{
    const real ahead = (b[0] - a[0]) * M(cos)(a[2]) + (b[1] - a[1]) * M(sin)(a[2]);
    return ahead > ROUNDING ? 1 : ahead < -ROUNDING ? -1 : 0;
}

static int is_apart(const real *a, const real *b)
{
    return M(hypot)(b[0] - a[0], b[1] - a[1]) > ROUNDING;
}

/* Distance of a point from the nearest thing at rest. */
static real nearest_of(const real *point, int things, const real *thing)
{
    real least = INFINITY;
    for (int i = 0; i < things; i++, thing += KMPC_THING) {
        const real far = M(hypot)(point[0] - thing[0], point[1] - thing[1]) - thing[2];
        if (thing[3] == 0 && thing[4] == 0 && far < least)
            least = far;
    }
    return least;
}

/* When each pose is reached, where the gear changes, and where the robot is. */
static void begin(struct kmpc_path *path, const real *here)
{
    real (*pose)[3] = path->pose;
    int reversed = 0, gear = 0;
    for (int i = 0; i + 1 < path->count; i++)
        reversed = reversed || gear_of(pose[i], pose[i + 1]) < 0;
    const real *speed = reversed ? K.backward : K.forward;
    path->begins[0] = 0;
    path->cusps = 0;
    for (int i = 0; i + 1 < path->count; i++) {
        const real length = M(hypot)(pose[i + 1][0] - pose[i][0], pose[i + 1][1] - pose[i][1]);
        const real turned = M(fabs)(pose[i + 1][2] - pose[i][2]);
        const real by_wheel = (length + K.wheel_arm * turned) / K.wheel_speed;
        const int next = gear_of(pose[i], pose[i + 1]);
        path->begins[i + 1] = path->begins[i] + M(fmax)(M(fmax)(length / speed[0], turned / speed[1]),
                                                        M(fmax)(by_wheel, INSTANT));
        if (next && gear && next != gear)
            path->cusp[path->cusps++] = path->begins[i];
        gear = next ? next : gear;
    }
    const real duration = path->begins[path->count - 1];
    path->step = duration / PLACES > GRID_STEP ? duration / PLACES : GRID_STEP;
    path->braking = speed[0] / K.deceleration;
    path->begun = 1;
    /* it may have been given to a robot that is on it already */
    const struct kmpc_timed way = timed(path);
    real least = INFINITY, found[2];
    for (real from = 0; from <= duration; from += 1) {
        kmpc_locate(&way, here, from, 0, found);
        if (found[1] < least - (from > 0 ? FAR : 0)) {
            least = found[1];
            path->time = found[0];
        }
    }
}

/* A robot that waits near its goal, beside it, drives straight there, ahead or (n = 2) backwards: a
 * few times, for there may be no way. */
static void mend_end(struct kmpc_path *path, const real *here, const real *error)
{
    const real far = M(hypot)(error[0], error[1]);
    const int gets_on = path->turning || path->holding || path->time > path->reached + GRID_STEP;
    path->reached = gets_on ? path->time : path->reached;
    path->waited = gets_on ? 0 : path->waited + K.dt;
    path->tries = path->holding ? 0 : path->tries;
    if (path->waited <= PATIENCE || far > NEAR_GOAL || path->tries == TRIES)
        return;
    const real course = M(atan2)(-error[1], -error[0]), n = K.backward[0] > 0 ? 2 : 1;
    memmove(path->pose[3], path->pose[path->count - 1], 3 * sizeof(real));
    memcpy(path->pose[2], path->pose[3], 3 * sizeof(real));
    for (int k = 0; k < 2; k++)
        memcpy(path->pose[k], here, 3 * sizeof(real));
    path->pose[1][2] = path->pose[2][2] = course - kmpc_nearest_turn(n * (course - here[2])) / n;
    path->pose[3][2] -= kmpc_nearest_turn(path->pose[3][2] - path->pose[2][2]);
    path->count = 4;
    path->begun = 0;
    path->time = path->leg = path->waited = path->reached = 0;
    path->tries++;
}

/* Go on to the next leg where the robot has come to a change of gear. */
static void change_gear(struct kmpc_path *path, const struct kmpc_timed *way, const real *here)
{
    const real end = kmpc_leg_end(way, path->leg);
    real from[3], cusp[3];
    if (!(end < INFINITY))
        return;
    kmpc_pose_at(way, path->leg, from);
    kmpc_pose_at(way, end, cusp);
    const real far = M(hypot)(from[0] - here[0], from[1] - here[1]);
    if (M(hypot)(cusp[0] - here[0], cusp[1] - here[1]) <= (far < NEAR_CUSP ? far : NEAR_CUSP))
        path->leg = path->time = end;
}

/* Where a robot that was sent past commands, and brakes now, comes to rest. */
static void braked(const real *pose, const real *past, real *at)
{
    static real ramp[2 * KMPC_T], led[3 * (KMPC_T + KMPC_L + 1)];
    const int periods = kmpc_braking(past + 2 * (KMPC_PAST - 1), ramp);
    kmpc_model_rollout(pose, past, ramp, periods, periods + KMPC_L, led);
    memcpy(at, led + 3 * (periods + KMPC_L), 3 * sizeof(real));
}

/* Displacement of a robot that brakes from its last command, of which its model knows nothing. */
static void rolls_on(const real *pose, const real *past, real *by)
{
    const real *last = past + 2 * (KMPC_PAST - 1);
    real time = 0;
    for (int i = 0; i < 2; i++) {
        const real needed = M(fabs)(last[i]) * K.dt / K.ramp_step[i];
        time = needed > time ? needed : time;
    }
    const real driven = R(0.5) * time * last[0], turned = R(0.5) * time * last[1];
    by[0] = driven * M(cos)(pose[2] + R(0.5) * turned);
    by[1] = driven * M(sin)(pose[2] + R(0.5) * turned);
    by[2] = turned;
}

static int is_within(const real *error, const real *tolerance)
{
    return M(hypot)(error[0], error[1]) <= tolerance[0] && M(fabs)(error[2]) <= tolerance[1];
}

/* Whether the robot has arrived, and is not pushed out of its tolerances again. */
static int holds(struct kmpc_path *path, const real *error, const real *rest, const real *rolled)
{
    if (path->holding) {
        for (int i = 0; i < 3; i++)
            path->mean_error[i] += K.averaging * (error[i] - path->mean_error[i]);
        path->holding = is_within(error, K.pushed) && is_within(path->mean_error, K.leave);
    } else if (is_within(error, K.enter) && is_within(rest, K.enter) &&
               is_within(rolled, K.enter)) {
        path->holding = 1;
        memcpy(path->mean_error, error, 3 * sizeof(real));
    }
    return path->holding;
}

void kmpc_follow_path(struct kmpc_path *path, const real *pose, const real *past,
                      const real *coming, int things, const real *thing, struct kmpc_way *way)
{
    static real led[3 * (KMPC_L + 1)], states[3 * (KMPC_N + 1)], later[KMPC_N + 1];
    real error[3], rest[3], rolled[3] = {0}, found[2];
    kmpc_model_rollout(pose, past, coming, coming ? KMPC_N - 1 : 0, K.late, led);
    const real *here = led + 3 * K.late, *goal = path->pose[path->count - 1];
    for (int i = 0; i < 3; i++)
        error[i] = here[i] - goal[i];
    error[2] -= kmpc_nearest_turn(error[2]);
    memcpy(rest, here, sizeof(rest));
    if (K.limits_changes || K.late)
        braked(pose, past, rest);
    else
        rolls_on(pose, past, rolled);
    for (int i = 0; i < 3; i++)
        rolled[i] += rest[i] += error[i] - here[i];
    /* the last turn begins where the robot comes to a stop, and is given up where it has left */
    path->turning = M(hypot)(error[0], error[1]) <= (path->turning ? K.turn_limit : K.turn_distance) &&
                    (path->turning || M(hypot)(rest[0], rest[1]) <= K.turn_distance);
    mend_end(path, here, error);
    const int is_new = !path->begun;
    if (is_new)
        begin(path, here);
    const struct kmpc_timed on = timed(path);
    const real drive_end = path->begins[path->count - 2];
    if (!is_new) {
        kmpc_locate(&on, here, path->time, path->turning ? drive_end : path->leg, found);
        path->time = found[0];
        change_gear(path, &on, here);
    }
    if (path->turning ? path->time < drive_end : path->time > drive_end)
        path->time = drive_end;
    way->holds = holds(path, error, rest, rolled);
    for (int k = 0; k <= KMPC_N; k++)
        later[k] = K.lead_time + K.dt * (real)k;
    kmpc_along_path(&on, KMPC_N + 1, later, path->time, path->leg, here[2], path->turning, states);
    int arrived = 0;
    for (int k = 1; k <= KMPC_N; k++)
        arrived += M(fabs)(states[3 * k] - goal[0]) <= AT_GOAL &&
                   M(fabs)(states[3 * k + 1] - goal[1]) <= AT_GOAL;
    way->share_at_goal = (real)arrived / KMPC_N;
    way->to_goal = 0;
    const real at_goal = nearest_of(goal, things, thing) - K.distance;
    for (int k = 0; k <= KMPC_N; k++) {
        real *row = way->reference + 3 * k;
        memcpy(row, k < K.late ? led + 3 * k : states + 3 * (k - K.late), 3 * sizeof(real));
        const real around = nearest_of(row, things, thing) - K.distance;
        const real least = at_goal > 0 ? at_goal : 0;
        if (k)
            way->clearance[k - 1] = around > least ? around : least;
    }
}

int kmpc_set_path(struct kmpc *robot, int count, const real *poses)
{
    struct kmpc_path *path = &robot->path;
    if (count < 0 || count > KMPC_PATH)
        return 1;
    for (int i = 0; i < 3 * count; i++)
        if (!(M(fabs)(poses[i]) <= R(1e4))) /* also NaN */
            return 1;
    memset(path, 0, sizeof(*path));
    for (int k = 0; k < count; k++) {
        /* a turn on the spot at either end, be it none */
        const int begins = !k && (count < 2 || is_apart(poses, poses + 3));
        const int ends = k == count - 1 && (count < 3 || is_apart(poses + 3 * k - 3, poses + 3 * k));
        for (int copies = 1 + begins + ends; copies; copies--) {
            real *pose = path->pose[path->count++];
            for (int i = 0; i < 3; i++)
                pose[i] = poses[3 * k + i] / K.state[i];
            if (k)
                pose[2] -= kmpc_nearest_turn(pose[2] - path->pose[path->count - 2][2]);
        }
    }
    return 0;
}
