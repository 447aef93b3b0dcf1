/* Motions that end at rest: a coming command, and a brake after it. */
#include "kernels.h"

#include <math.h>
#include <string.h>

static const real TINY = R(1e-9);
/* Shares (of 32) of the coming command's change that are tried if the whole one is not clear:
 * eighths, and finer ones of a robot that must be slow; of its turn alone where below zero. */
static const real SHARE[KMPC_SLOWER] = {28, 24, 20, 16, 12, 8, 6, 4, 3, -32, 2, 1, -8, 0};

/* Periods that braking takes. */
static real size_of(const struct kmpc_brakes *b, const real *command)
{
    real most = 0;
    for (int i = 0; i < b->commands; i++) {
        const real size = M(fabs)(command[i]) / b->step[i];
        most = size > most ? size : most;
    }
    return most;
}

static int periods_of(const struct kmpc_brakes *b, const real *command)
{
    const real size = size_of(b, command) - TINY;
    const int periods = size < (real)b->longest ? (int)M(ceil)(size) : b->longest;
    return periods < 1 ? 1 : periods;
}

/* A car that stands cannot turn. */
static void within(const struct kmpc_brakes *b, real *command)
{
    real *turn = command + b->commands - 1;
    const real most = b->curvature * M(fabs)(command[0]);
    if (b->curvature < INFINITY)
        *turn = *turn > most ? most : *turn < -most ? -most : *turn;
}

/* Both speeds shrink by one factor to zero in `length` periods: the robot keeps to its curve. */
static void straight(const struct kmpc_brakes *b, const real *first, int length, real *ramp)
{
    const real size = size_of(b, first), periods = size > TINY ? size : TINY;
    for (int k = 1; k <= length; k++, ramp += b->commands)
        for (int i = 0; i < b->commands; i++) {
            const real share = 1 - (real)k / periods;
            ramp[i] = k == length || share < 0 ? 0 : share * first[i];
        }
}

int kmpc_ramp(const struct kmpc_brakes *b, const real *command, real *ramp)
{
    const int count = periods_of(b, command);
    straight(b, command, count, ramp);
    return count;
}

/* A plan's command (m,) as a direction, at a place on the way that braking would take along it. */
static int turned(const struct kmpc_batch *batch, real place, real *direction)
{
    real ends = 0, before = 0, from[KMPC_INPUTS];
    int drives = 0;
    for (int k = 0; k < batch->stages; k++) {
        const real *u = batch->inputs + k * batch->brakes->commands;
        const real size = size_of(batch->brakes, u), middle = ends + R(0.5) * size;
        ends += size;
        if (!(size > TINY))
            continue;
        const real share = drives && middle > place ? (place - before) / (middle - before) : 1;
        for (int i = 0; i < batch->brakes->commands; i++) {
            const real own = u[i] / size;
            direction[i] = share < 1 ? from[i] + (own - from[i]) * share : own;
            from[i] = own;
        }
        if (middle >= place)
            return 1;
        drives = 1;
        before = middle;
    }
    return drives;
}

/* A command as near to another one as it may be a period later. */
static real limited(const struct kmpc_brakes *b, int i, real before, real command)
{
    const real change = command - before, most = change * before < 0 ? b->slower[i] : b->faster[i];
    return change > most ? before + most : change < -most ? before - most : command;
}

/* A brake along the path of the plan, which is driven ever more slowly: its commands, as
 * directions, over how far they lead; whether they end at rest as fast as they may change. */
static int along(const struct kmpc_batch *batch, const real *first, real *ramp)
{
    const struct kmpc_brakes *b = batch->brakes;
    const real begins = size_of(b, first), *before = first;
    real driven = 0, direction[KMPC_INPUTS];
    for (int k = 1; k <= batch->length; k++, before = ramp, ramp += b->commands) {
        const real left = k < batch->length && begins > (real)k ? begins - (real)k : 0;
        driven += left;
        if (!turned(batch, begins + driven - R(0.5) * left, direction))
            return 0;
        for (int i = 0; i < b->commands; i++)
            ramp[i] = limited(b, i, before[i], left * direction[i]);
        within(b, ramp);
        for (int i = 0; i < b->commands; i++)
            if (ramp[i] != limited(b, i, before[i], ramp[i]) || (k == batch->length && ramp[i] != 0))
                return 0;
    }
    return 1;
}

void kmpc_candidates(struct kmpc_batch *batch, const real *hardest)
{
    const struct kmpc_brakes *b = batch->brakes;
    const int m = b->commands;
    batch->count = batch->whole ? 2 : batch->at_once ? KMPC_SLOWER : 2 * KMPC_SLOWER + batch->further;
    batch->length = batch->whole ? periods_of(b, batch->inputs) : 1;
    for (int j = 0; !batch->whole && j < KMPC_SLOWER; j++) {
        for (int i = 0; i < m; i++) {
            const real share = SHARE[j] > 0 ? SHARE[j] : i == m - 1 ? -SHARE[j] : 0;
            batch->first[j][i] = hardest[i] + share / 32 * (batch->inputs[i] - hardest[i]);
        }
        within(b, batch->first[j]);
        const int periods = periods_of(b, batch->first[j]);
        batch->length = periods > batch->length && !batch->at_once ? periods : batch->length;
    }
    batch->periods = 1 + batch->length;
    for (int j = 1; !batch->whole && !batch->at_once && j <= batch->further; j++) {
        const int periods = j + 1 + periods_of(b, batch->inputs + j * m);
        batch->periods = periods > batch->periods ? periods : batch->periods;
    }
}

void kmpc_candidate(const struct kmpc_batch *batch, int i, real *commands, struct kmpc_tried *kind)
{
    const struct kmpc_brakes *b = batch->brakes;
    const int m = b->commands, further = batch->whole || batch->at_once ? 0 : batch->further;
    const size_t one = (size_t)m * sizeof(real);
    const int pair = batch->at_once ? i : (i - further) / 2;
    const real *first = batch->whole ? batch->inputs : batch->first[i < further ? 0 : pair];
    kind->strict = i < further;
    kind->turns = !batch->whole && i >= further && pair == KMPC_SLOWER - 2;
    memset(commands, 0, (size_t)batch->periods * one);
    memcpy(commands, i < further ? batch->inputs : first, one);
    if (i < further) {
        memcpy(commands, batch->inputs, (size_t)(i + 2) * one);
        kmpc_ramp(b, commands + (i + 1) * m, commands + (i + 2) * m);
    } else if (batch->at_once ? batch->whole && !i
                              : (i - further) % 2 == 0 || !along(batch, first, commands + m)) {
        straight(b, first, batch->length, commands + m);
    }
    int last = batch->periods * m;
    while (last && commands[last - 1] == 0)
        last--;
    kind->ends = (last + m - 1) / m;
}
