/* The largest share of a plan that the robot can drive and still come to rest clear. */
#include "core.h"

#include <math.h>
#include <string.h>

#define K kmpc_numbers
#define L kmpc_model

static const real TINY = R(1e-9), TINY_STEP = R(1e-4), OVERSPEED = R(1.25);
static const real TURN_ALLOWANCE = R(1.0) / R(150.0);
static const real SHARE[] = {28, 24, 20, 16, 12, 8, 6, 4, 3, 2, 1}; /* of 32 */
static const real TURN_SHARE[] = {R(1.0), R(0.25)};
enum { SHARES = 11, TURN_SHARES = 2, SLOWER = SHARES + TURN_SHARES + 1, MOST_SAMPLES = 8 };

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

static real size_of(const real *command)
{
    const real v = M(fabs)(command[0]) / K.ramp_step[0], o = M(fabs)(command[1]) / K.ramp_step[1];
    return v > o ? v : o;
}

/* Commands that brake after one, both speeds by one factor; the last is zero. How many. */
int kmpc_braking(const real *command, real *ramp)
{
    const real periods = size_of(command);
    int count = (int)M(ceil)(periods - TINY);
    count = count < 1 ? 1 : count > K.longest_ramp ? K.longest_ramp : count;
    for (int k = 1; k <= count; k++, ramp += 2)
        for (int i = 0; i < 2; i++) {
            const real share = 1 - (real)k / (periods > TINY ? periods : TINY);
            ramp[i] = k == count ? 0 : share * command[i];
        }
    return count;
}

/* A coming command, then `length` periods of a brake on the curve that the robot is on. */
static void straight(const real *first, int length, struct kmpc_motion_to_rest *out)
{
    const real periods = size_of(first) > TINY ? size_of(first) : TINY;
    out->length = length + 1;
    memcpy(out->commands[0], first, 2 * sizeof(real));
    for (int k = 1; k <= length; k++)
        for (int i = 0; i < 2; i++) {
            const real share = 1 - (real)k / periods;
            out->commands[k][i] = k == length || share < 0 ? 0 : share * first[i];
        }
}

/* The same along the path of a plan, driven ever more slowly; whether changes are allowed. */
static int along(const real *first, const real *inputs, int length,
                 struct kmpc_motion_to_rest *out)
{
    real middle[KMPC_N], direction[KMPC_N][2], ends = 0, driven = 0;
    const real begins = size_of(first);
    int drives = 0;
    for (int k = 0; k < KMPC_N; k++) {
        const real size = size_of(inputs + 2 * k);
        ends += size;
        if (size > TINY) {
            middle[drives] = ends - R(0.5) * size;
            for (int i = 0; i < 2; i++)
                direction[drives][i] = inputs[2 * k + i] / size;
            drives++;
        }
    }
    straight(first, length, out);
    if (!drives)
        return 1;
    for (int k = 1, j = 0; k <= length; k++) {
        const real left = k < length && begins > (real)k ? begins - (real)k : 0;
        driven += left;
        const real place = begins + driven - R(0.5) * left;
        while (j + 2 < drives && place > middle[j + 1])
            j++;
        for (int i = 0; i < 2; i++) {
            real turned = direction[drives - 1][i];
            if (place <= middle[0])
                turned = direction[0][i];
            else if (place < middle[drives - 1])
                turned = direction[j][i] + (direction[j + 1][i] - direction[j][i]) *
                                               ((place - middle[j]) / (middle[j + 1] - middle[j]));
            out->commands[k][i] = left * turned;
        }
    }
    for (int k = 1; k <= length; k++)
        for (int i = 0; i < 2; i++) {
            const real before = out->commands[k - 1][i], change = out->commands[k][i] - before;
            const real most = change * before < 0 && K.brake[i] > K.change[i] ? K.brake[i]
                                                                              : K.change[i];
            if (!(M(fabs)(change) <= most * (1 + TINY) + TINY))
                return 0;
        }
    return 1;
}

static int ends_after(const struct kmpc_motion_to_rest *motion)
{
    int length = motion->length;
    while (length && motion->commands[length - 1][0] == 0 && motion->commands[length - 1][1] == 0)
        length--;
    return length;
}

/* States (periods + 1, 3) of a motion to rest and of the coasting after it; how many periods. */
static int rolled_out(const real *here, const real *past, const struct kmpc_motion_to_rest *motion,
                      real *states)
{
    const int length = ends_after(motion), periods = length + KMPC_L;
    kmpc_model_rollout(here, past, motion->commands[0], length, periods, states);
    return periods;
}

static real longest_step(const real *states, int periods)
{
    real longest = 0;
    for (int k = 0; k < periods; k++) {
        const real step = M(hypot)(states[3 * k + 3] - states[3 * k], states[3 * k + 4] - states[3 * k + 1]);
        longest = step > longest ? step : longest;
    }
    return longest;
}

static void errors_of(const real *distances, const real *turns, int periods, real *margins)
{
    if (L.errs)
        kmpc_stop_errors(1, periods, K.dt, distances, turns, L.position_errors, L.heading_errors,
                         L.step_quantile, L.quantile, 0, margins);
    for (int k = 0; k < periods; k++)
        margins[k] = L.solver_margin + (L.errs ? margins[k] : 0);
}

/* Errors (things,) of a single command towards each thing. */
static void errors_towards(const real *command, const real *slopes, int count, real *errors)
{
    for (int j = 0; j < count; j++) {
        real variance = 0;
        for (int a = 0; a < 2; a++)
            for (int b = 0; b < 2; b++) {
                const real noise = command[0] * command[0] * L.command_noise[3 * a + b] +
                                   command[1] * command[1] * L.command_noise[9 + 3 * a + b];
                variance += slopes[2 * j + a] * noise * slopes[2 * j + b];
            }
        errors[j] = L.step_quantile * M(sqrt)(variance > 0 ? variance : 0);
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
    real lost;                 /* what chords between samples cut off at the most */
};

/* Whether a motion is surely clear, or (`closely`) admissible. */
static int is_clear(const struct judge *judge, const struct kmpc_motion_to_rest *motion, int strict,
                    int is_free, int closely)
{
    static real states[3 * (KMPC_T + KMPC_L + 1)], distances[KMPC_T + KMPC_L];
    static real turns[KMPC_T + KMPC_L], margins[KMPC_T + KMPC_L];
    real poses[3 * MOST_SAMPLES], slopes[2 * KMPC_AROUND], own[KMPC_AROUND];
    real raw[KMPC_AROUND], before[KMPC_AROUND], clear[KMPC_AROUND], standing[KMPC_AROUND];
    real spend[KMPC_AROUND], at[2] = {judge->here[0], judge->here[1]};
    const struct around *around = judge->around;
    const int things = around->count, periods = rolled_out(judge->here, judge->past, motion, states);
    const real *command = motion->commands[0];
    if (!periods) /* the robot stays where it is */
        return 1;
    for (int k = 0; k < periods; k++) {
        const real *s = states + 3 * k;
        distances[k] = M(hypot)(s[3] - s[0], s[4] - s[1]);
        turns[k] = s[5] - s[2];
    }
    errors_of(distances, turns, periods, margins);
    const real squares[2] = {command[0] * command[0], command[1] * command[1]};
    const real most = L.errs ? L.step_quantile * M(sqrt)(squares[0] * L.position_errors[0] +
                                                         squares[1] * L.position_errors[1])
                             : 0;
    const real error = most + L.pose_error;
    const int one = 1, none = 0;
    if (closely) {
        slopes_at(judge->here, around, slopes);
        errors_towards(command, slopes, things, own);
        for (int j = 0; j < things && is_free; j++)
            own[j] = -TURN_ALLOWANCE * K.radius;
    }
    for (int k = 0, q = 0; k < periods; k++) {
        kmpc_samples(1, 1, judge->count, states + 3 * k, poses);
        const real margin = judge->stands_at_once && !k && closely ? -INFINITY : margins[k];
        for (int i = 0; i < judge->count; i++, q++) {
            const real time = K.dt / (real)judge->count * (real)(q + 1);
            const real point[2] = {poses[3 * i], poses[3 * i + 1]};
            unsigned char good;
            kmpc_distances(things, around->thing, 1, 1, 1, 1, point, &time, raw);
            for (int j = 0; j < things; j++)
                raw[j] -= K.radius;
            if (!closely) {
                kmpc_surely_clear(1, 1, things, raw, &margin, &error, distances, &one, judge->lost,
                                  &good);
            } else {
                const real driven = M(hypot)(point[0] - judge->here[0], point[1] - judge->here[1]);
                const unsigned char is_strict = (unsigned char)strict;
                kmpc_distances(things, around->thing, 1, 1, 1, 1, judge->here, &time, standing);
                for (int j = 0; j < things; j++) {
                    standing[j] -= K.radius;
                    const real sure = standing[j] - L.pose_error;
                    spend[j] = K.spend_share * (sure > 0 ? sure : 0);
                    if (!q)
                        before[j] = standing[j];
                }
                kmpc_between_samples(1, 1, 1, things, raw, before, point, at, K.radius, clear);
                kmpc_admissible(1, 1, 1, things, k ? none : one, clear, standing, spend, &margin,
                                &driven, own, around->may_turn, &is_strict, &one, L.pose_error,
                                &good);
                memcpy(before, raw, sizeof(raw));
                memcpy(at, point, sizeof(at));
            }
            if (!good)
                return 0;
        }
    }
    return 1;
}

/* Candidates, the best first: those with the plan's coming command, or all others. */
struct batch {
    const real *inputs, *ramp; /* of the plan; of its coming command (length below) */
    int ramp_length, whole, stands_at_once, length;
    real first[SLOWER][2];
};

static int candidates(const struct batch *batch)
{
    if (batch->whole)
        return 2;
    return batch->stands_at_once ? SLOWER : K.further + 2 * SLOWER;
}

static void candidate(const struct batch *batch, int i, struct kmpc_motion_to_rest *out, int *strict,
                      int *is_free)
{
    *strict = *is_free = 0;
    memset(out, 0, sizeof(*out));
    if (batch->whole && batch->stands_at_once) {
        out->length = batch->ramp_length + 1;
        memcpy(out->commands[0], batch->inputs, 2 * sizeof(real));
        if (!i)
            memcpy(out->commands[1], batch->ramp, 2 * (size_t)batch->ramp_length * sizeof(real));
        return;
    }
    if (!batch->whole && batch->stands_at_once) {
        out->length = 2;
        memcpy(out->commands[0], batch->first[i], 2 * sizeof(real));
        *is_free = i == SLOWER - 2;
        return;
    }
    if (!batch->whole && i < K.further) {
        memcpy(out->commands[0], batch->inputs, 2 * (size_t)(i + 2) * sizeof(real));
        out->length = i + 2 + kmpc_braking(batch->inputs + 2 * (i + 1), out->commands[i + 2]);
        *strict = 1;
        return;
    }
    if (!batch->whole)
        i -= K.further;
    const real *first = batch->whole ? batch->inputs : batch->first[i / 2];
    *is_free = !batch->whole && i / 2 == SLOWER - 2;
    if (i % 2 == 0 || !along(first, batch->inputs, batch->length, out))
        straight(first, batch->length, out);
}

/* The first motion of a batch that is clear; whether there is one. */
static int choose(const struct batch *batch, struct judge *judge, struct kmpc_motion_to_rest *found)
{
    static real states[3 * (KMPC_T + KMPC_L + 1)];
    const int count = candidates(batch);
    real longest = 0;
    int strict, is_free;
    for (int i = 0; i < count; i++) {
        candidate(batch, i, found, &strict, &is_free);
        const int periods = rolled_out(judge->here, judge->past, found, states);
        const real step = longest_step(states, periods);
        longest = step > longest ? step : longest;
    }
    const real part = R(0.25) * K.radius;
    judge->count = (int)M(ceil)(longest / (part > TINY ? part : TINY));
    judge->count = judge->count < 1              ? 1
                   : judge->count > MOST_SAMPLES ? MOST_SAMPLES
                                                 : judge->count;
    const real chord = longest / (real)judge->count;
    judge->lost = chord * chord / (8 * K.radius);
    candidate(batch, 0, found, &strict, &is_free);
    if (is_clear(judge, found, strict, is_free, 0))
        return 1;
    for (int i = 0; i < count; i++) {
        candidate(batch, i, found, &strict, &is_free);
        if (is_clear(judge, found, strict, is_free, 1))
            return 1;
    }
    return 0;
}

static void coming_commands(const real *whole, const real *last, struct batch *out)
{
    static real ramp[2 * KMPC_T];
    real hardest[2] = {0, 0};
    if (K.limits_changes) {
        kmpc_braking(last, ramp);
        memcpy(hardest, ramp, sizeof(hardest));
        kmpc_rate_limit(last, hardest);
    }
    for (int j = 0; j < SLOWER; j++)
        for (int i = 0; i < 2; i++) {
            const real change = whole[i] - hardest[i];
            real share = 0;
            if (j < SHARES)
                share = SHARE[j] / 32;
            else if (j < SHARES + TURN_SHARES)
                share = i ? TURN_SHARE[j - SHARES] : 0;
            out->first[j][i] = hardest[i] + share * change;
        }
}

/* Periods of braking that a batch needs at the most. */
static int braking_length(const real *first, int count)
{
    real most = 0;
    for (int i = 0; i < count; i++)
        most = size_of(first + 2 * i) > most ? size_of(first + 2 * i) : most;
    const int periods = (int)M(ceil)(most - TINY);
    return periods < 1 ? 1 : periods > K.longest_ramp ? K.longest_ramp : periods;
}

static int is_far(const real *here, const real *past, const real *first, const real *ramp,
                  int length, const struct around *around)
{
    real driven = 0, turned = 0, margin = 0, distance[KMPC_AROUND];
    const real now = 0, time = K.dt * (real)(length + 1 + KMPC_L);
    for (int k = KMPC_PAST - KMPC_L; k < KMPC_PAST; k++) {
        driven += M(fabs)(past[2 * k]);
        turned += M(fabs)(past[2 * k + 1]);
    }
    for (int k = 0; k <= length; k++) {
        const real *command = k ? ramp + 2 * (k - 1) : first;
        driven += M(fabs)(command[0]);
        turned += M(fabs)(command[1]);
    }
    driven *= K.dt;
    turned *= K.dt;
    errors_of(&driven, &turned, 1, &margin);
    const real far = OVERSPEED * driven + margin + time * around->fastest;
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
    static struct batch batch;
    static real ramp[2 * KMPC_T];
    const int length = kmpc_braking(inputs, ramp);
    real here[3];
    *slowed = 0;
    memcpy(here, states, sizeof(here));
    look_around(things, thing, &around);
    if (!L.tightens || !things || is_far(here, past, inputs, ramp, length, &around)) {
        found->length = length + 1;
        memcpy(found->commands[0], inputs, 2 * sizeof(real));
        memcpy(found->commands[1], ramp, 2 * (size_t)length * sizeof(real));
        return 1;
    }
    struct judge judge = {here, past, &around, !(KMPC_L || K.limits_changes), 1, 0};
    batch.inputs = inputs;
    batch.ramp = ramp;
    batch.ramp_length = length;
    batch.stands_at_once = judge.stands_at_once;
    batch.whole = 1;
    batch.length = braking_length(inputs, 1);
    if (!choose(&batch, &judge, found)) {
        batch.whole = 0;
        coming_commands(inputs, past + 2 * (KMPC_PAST - 1), &batch);
        batch.length = braking_length(batch.first[0], SLOWER);
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
