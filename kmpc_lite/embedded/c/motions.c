/* The largest share of a plan that the robot can drive and still come to rest clear. */
#include "core.h"

#include <math.h>
#include <string.h>

#define K kmpc_numbers

static const real TINY = R(1e-9), TINY_STEP = R(1e-4), OVERSPEED = R(1.25);
static const real TURN_ALLOWANCE = R(1.0) / R(150.0);
enum { MOST_SAMPLES = 8 };

/* What is around the robot: things as they move, then all who may turn, wherever they turn to. */
struct around {
    int count;
    real thing[KMPC_AROUND * KMPC_THING];
    unsigned char may_turn[KMPC_AROUND];
    real fastest;
};

static void look_around(int things, const real *thing, struct around *out)
{
    out->count = things;
    out->fastest = 0;
    for (int i = 0; i < things; i++) {
        real *row = out->thing + KMPC_THING * i;
        memcpy(row, thing + KMPC_THING * i, KMPC_THING * sizeof(real));
        out->may_turn[i] = 0;
        const real speed = M(hypot)(row[3], row[4]);
        if (!(speed > 0))
            continue;
        real *turning = out->thing + KMPC_THING * out->count;
        memcpy(turning, row, 3 * sizeof(real));
        turning[3] = turning[4] = 0;
        turning[5] = speed;
        turning[6] = speed * K.swerve_time;
        out->may_turn[out->count++] = 1;
        out->fastest = speed > out->fastest ? speed : out->fastest;
    }
}

static struct kmpc_brakes brakes(void)
{
    return (struct kmpc_brakes){2, K.longest_ramp, K.ramp_step, K.change, K.brake, INFINITY};
}

/* Commands that brake after one, both speeds by one factor; the last is zero. How many. */
int kmpc_braking(const real *command, real *ramp)
{
    const struct kmpc_brakes b = brakes();
    return kmpc_ramp(&b, command, ramp);
}

/* States (periods + 1, 3) of a motion to rest and of the coasting after it; how many periods. */
static int rolled_out(const real *here, const real *past, const struct kmpc_motion_to_rest *motion,
                      real *states)
{
    const int periods = motion->kind.ends + KMPC_L;
    kmpc_model_rollout(here, past, motion->commands[0], motion->kind.ends, periods, states);
    return periods;
}

static void errors_of(const real *distances, const real *turns, int periods, real *margins)
{
    if (K.errs)
        kmpc_stop_errors(1, periods, K.dt, distances, turns, K.position_errors, K.heading_errors,
                         K.step_quantile, K.quantile, 0, margins);
    for (int k = 0; k < periods; k++)
        margins[k] = K.solver_margin + (K.errs ? margins[k] : 0);
}

/* Errors (things,) of a single command towards each thing. */
static void errors_towards(const real *command, const real *slopes, int count, real *errors)
{
    for (int j = 0; j < count; j++) {
        real variance = 0;
        for (int a = 0; a < 2; a++)
            for (int b = 0; b < 2; b++) {
                const real noise = command[0] * command[0] * K.command_noise[3 * a + b] +
                                   command[1] * command[1] * K.command_noise[9 + 3 * a + b];
                variance += slopes[2 * j + a] * noise * slopes[2 * j + b];
            }
        errors[j] = K.step_quantile * M(sqrt)(variance > 0 ? variance : 0);
    }
}

/* By how much clearances grow ahead and to the left (things, 2). */
static void slopes_at(const real *here, const struct around *around, real *slopes)
{
    const real step = TINY_STEP * K.radius, now = 0;
    const real c = M(cos)(here[2]), s = M(sin)(here[2]);
    real at[3][KMPC_AROUND];
    for (int i = 0; i < 3; i++) {
        const real point[2] = {here[0] + (i == 1 ? step : 0), here[1] + (i == 2 ? step : 0)};
        kmpc_distances(around->count, around->thing, 1, 1, 1, 1, point, &now, at[i]);
    }
    for (int j = 0; j < around->count; j++) {
        const real x = (at[1][j] - at[0][j]) / step, y = (at[2][j] - at[0][j]) / step;
        slopes[2 * j] = c * x + s * y;
        slopes[2 * j + 1] = c * y - s * x;
    }
}

/* How a motion is judged: what all of its batch share. */
struct judge {
    const real *here, *past;
    const struct around *around;
    int stands_at_once, count; /* samples a period */
};

/* Whether a motion is admissible. */
static int is_clear(const struct judge *judge, const struct kmpc_motion_to_rest *motion)
{
    static real states[3 * (KMPC_T + KMPC_L + 1)], distances[KMPC_T + KMPC_L];
    static real turns[KMPC_T + KMPC_L], margins[KMPC_T + KMPC_L];
    real poses[3 * MOST_SAMPLES], slopes[2 * KMPC_AROUND], own[KMPC_AROUND];
    real raw[KMPC_AROUND], before[KMPC_AROUND], clear[KMPC_AROUND], standing[KMPC_AROUND];
    real spend[KMPC_AROUND], at[2] = {judge->here[0], judge->here[1]};
    const unsigned char strict = (unsigned char)motion->kind.strict;
    const struct around *around = judge->around;
    const int one = 1, things = around->count;
    const int periods = rolled_out(judge->here, judge->past, motion, states);
    for (int k = 0; k < periods; k++) {
        const real *s = states + 3 * k;
        distances[k] = M(hypot)(s[3] - s[0], s[4] - s[1]);
        turns[k] = s[5] - s[2];
    }
    errors_of(distances, turns, periods, margins);
    slopes_at(judge->here, around, slopes);
    errors_towards(motion->commands[0], slopes, things, own);
    for (int j = 0; j < things && motion->kind.turns; j++)
        own[j] = -TURN_ALLOWANCE * K.radius;
    for (int k = 0, q = 0; k < periods; k++) {
        const real margin = judge->stands_at_once && !k ? -INFINITY : margins[k];
        kmpc_samples(1, 1, judge->count, states + 3 * k, poses);
        for (int i = 0; i < judge->count; i++, q++) {
            const real time = K.dt / (real)judge->count * (real)(q + 1);
            const real point[2] = {poses[3 * i], poses[3 * i + 1]};
            const real driven = M(hypot)(point[0] - judge->here[0], point[1] - judge->here[1]);
            unsigned char good;
            kmpc_distances(things, around->thing, 1, 1, 1, 1, point, &time, raw);
            kmpc_distances(things, around->thing, 1, 1, 1, 1, judge->here, &time, standing);
            for (int j = 0; j < things; j++) {
                raw[j] -= K.radius;
                standing[j] -= K.radius;
                const real sure = standing[j] - K.pose_error;
                spend[j] = K.spend_share * (sure > 0 ? sure : 0);
                if (!q)
                    before[j] = standing[j];
            }
            kmpc_between_samples(1, 1, 1, things, raw, before, point, at, K.radius, clear);
            kmpc_admissible(1, 1, 1, things, !k, clear, standing, spend, &margin, &driven, own,
                            around->may_turn, &strict, &one, K.pose_error, &good);
            if (!good)
                return 0;
            memcpy(before, raw, sizeof(raw));
            memcpy(at, point, sizeof(at));
        }
    }
    return 1;
}

static void candidate(const struct kmpc_batch *batch, int i, struct kmpc_motion_to_rest *out)
{
    out->length = batch->periods;
    kmpc_candidate(batch, i, out->commands[0], &out->kind);
}

/* The first motion of a batch that is clear; whether there is one. */
static int choose(const struct kmpc_batch *batch, struct judge *judge, struct kmpc_motion_to_rest *found)
{
    static real states[3 * (KMPC_T + KMPC_L + 1)];
    const real part = R(0.25) * K.radius;
    real longest = 0;
    for (int i = 0; i < batch->count; i++) {
        candidate(batch, i, found);
        const int periods = rolled_out(judge->here, judge->past, found, states);
        for (const real *s = states; s < states + 3 * periods; s += 3) {
            const real step = M(hypot)(s[3] - s[0], s[4] - s[1]);
            longest = step > longest ? step : longest;
        }
    }
    const real samples = M(ceil)(longest / (part > TINY ? part : TINY));
    judge->count = (int)kmpc_clip(samples, 1, MOST_SAMPLES);
    for (int i = 0; i < batch->count; i++) {
        candidate(batch, i, found);
        if (is_clear(judge, found))
            return 1;
    }
    return 0;
}

static int is_far(const real *here, const real *past, const struct kmpc_motion_to_rest *motion,
                  const struct around *around)
{
    real way[2] = {0, 0}, margin, distance[KMPC_AROUND];
    const real now = 0, time = K.dt * (real)(motion->length + KMPC_L);
    for (int i = 0; i < 2; i++) {
        for (int k = KMPC_PAST - KMPC_L; k < KMPC_PAST; k++)
            way[i] += K.dt * M(fabs)(past[2 * k + i]);
        for (int k = 0; k < motion->length; k++)
            way[i] += K.dt * M(fabs)(motion->commands[k][i]);
    }
    errors_of(way, way + 1, 1, &margin);
    const real far = OVERSPEED * way[0] + margin + time * around->fastest;
    kmpc_distances(around->count, around->thing, 1, 1, 1, 1, here, &now, distance);
    for (int i = 0; i < around->count; i++)
        if (!(distance[i] - K.radius > far))
            return 0;
    return 1;
}

/* Find what may be driven of a plan; it is slowed in place. Whether anything may. */
int kmpc_find_motion(real *states, real *inputs, const real *past, int things, const real *thing,
                     struct kmpc_motion_to_rest *found, int *slowed)
{
    static struct around around;
    const struct kmpc_brakes b = brakes();
    const int at_once = !(KMPC_L || K.limits_changes);
    struct kmpc_batch batch = {&b, inputs, KMPC_N, K.further, 1, at_once, 0, 0, 0, {{0}}};
    real here[3], hardest[2 * KMPC_T] = {0};
    *slowed = 0;
    memcpy(here, states, sizeof(here));
    memcpy(found->commands[0], inputs, 2 * sizeof(real));
    found->length = 1 + kmpc_ramp(&b, inputs, found->commands[1]);
    look_around(things, thing, &around);
    if (!K.tightens || !things || is_far(here, past, found, &around))
        return 1;
    struct judge judge = {here, past, &around, at_once, 1};
    kmpc_candidates(&batch, hardest);
    if (!choose(&batch, &judge, found)) {
        if (K.limits_changes) {
            const real *last = past + 2 * (KMPC_PAST - 1);
            kmpc_ramp(&b, last, hardest);
            kmpc_rate_limit(last, hardest);
        }
        batch.whole = 0;
        kmpc_candidates(&batch, hardest);
        if (!choose(&batch, &judge, found))
            return 0;
    }
    if (found->commands[0][0] == inputs[0] && found->commands[0][1] == inputs[1])
        return 1;
    *slowed = 1;
    memcpy(inputs, found->commands[0], 2 * sizeof(real));
    kmpc_model_rollout(here, past, inputs, KMPC_N, KMPC_N, states);
    return 1;
}

/* Smallest clearance of the body along states (count, 3), one for each period from now. */
real kmpc_clearance_along(const real *states, int count, int things, const real *thing)
{
    real least = INFINITY, distance[KMPC_THINGS];
    for (int k = 0; k < count; k++) {
        const real time = K.dt * (real)k;
        kmpc_distances(things, thing, 1, 1, 1, 1, states + 3 * k, &time, distance);
        for (int i = 0; i < things; i++)
            if (!(distance[i] - K.radius >= least)) /* also of NaN */
                least = distance[i] - K.radius;
    }
    return least;
}
