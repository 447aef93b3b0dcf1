/* The passes of the SQP: linearise, fill the QP, solve it, go there. */
#include "core.h"

#include <math.h>
#include <string.h>

#include "osqp/kmpc_workspace.h"
#include "osqp/osqp.h"

#define K kmpc_numbers

static const real LARGEST = R(1e10), INFINITE = R(1e20), LEAST_SHARE = R(0.1);

static int rho_is_adapted;
static real entries[KMPC_ENTRIES], lower[KMPC_ROWS], upper[KMPC_ROWS], q[KMPC_VARIABLES];
static real turn[KMPC_TURNS];

void kmpc_duals_in_the_open(real *duals)
{
    for (int i = 0; i < KMPC_ROWS; i++)
        duals[i] = 0;
    for (int i = 0; i < KMPC_N; i++)
        duals[KMPC_SLACK_ROW + i] = K.slack_dual;
}

int kmpc_all_within(const real *numbers, int count, real most)
{
    for (int i = 0; i < count; i++)
        if (!(M(fabs)(numbers[i]) <= most))
            return 0;
    return 1;
}

/* Go from the last command towards a new one as far as is allowed, by one share of both. */
void kmpc_rate_limit(const real *last, real *command)
{
    real share = 1;
    for (int i = 0; i < 2 && K.limits_changes; i++) {
        const real change = command[i] - last[i], size = M(fabs)(change);
        real allowed = K.change[i];
        if (change * last[i] < 0)
            allowed = M(fmax)(allowed, M(fmin)(K.brake[i], M(fabs)(last[i])));
        if (size > allowed * (1 + R(1e-9)) && allowed / size < share)
            share = allowed / size;
    }
    if (share < 1)
        for (int i = 0; i < 2; i++)
            command[i] = last[i] + share * (command[i] - last[i]);
}

real kmpc_clip(real value, real least, real most)
{
    return value < least ? least : value > most ? most : value;
}

/* Why OSQP must not be given these numbers; null if it may. */
static const char *fault(void)
{
    if (!kmpc_all_within(entries, KMPC_ENTRIES, LARGEST) ||
        !kmpc_all_within(q, KMPC_VARIABLES, LARGEST) ||
        !kmpc_all_within(turn, KMPC_N - 1, LARGEST))
        return "QP data not finite";
    for (int i = 0; i < KMPC_ROWS; i++)
        if (!(lower[i] <= upper[i]))
            return "QP bounds not finite, or they cross";
    return NULL;
}

/* Give OSQP the matrices: constraints, weights of headings, and the share of the terminal weight
 * that counts. */
static int update_matrices(real share)
{
    enum { TURNS = KMPC_N - 1, COUNT = TURNS + KMPC_LAST_WEIGHTS };
    static OSQPFloat weights[COUNT];
    static OSQPInt places[COUNT];
    for (int i = 0; i < COUNT; i++) {
        weights[i] = i < TURNS ? turn[i] : share * K.last_weight[i - TURNS];
        places[i] = i < TURNS ? K.turn_place[i] : KMPC_LAST_WEIGHT + i - TURNS;
    }
    return osqp_update_data_mat(&kmpc_solver, weights, places, COUNT, entries, NULL, KMPC_ENTRIES);
}

/* One pass from an iterate: what its QP finds; the reason if it failed, null else. */
static const char *pass(const struct kmpc_iterate *at, const real *window, const real *last,
                        const struct kmpc_way *way, int things, const real *thing,
                        struct kmpc_iterate *found, int *early)
{
    static real value[3 * KMPC_N], by_x[9 * KMPC_N], by_u[6 * KMPC_N];
    static real by_past[6 * KMPC_N * (KMPC_L > 0 ? KMPC_L : 1)];
    static real points[2 * KMPC_N], pull_terminal[9], start[KMPC_VARIABLES], duals[KMPC_ROWS];
    static real room[KMPC_N * (4 * KMPC_MOST + 3 * KMPC_SLOTS_USED) + 3 * (KMPC_N + 1)];
    const struct kmpc_layout size = {KMPC_N, 2, KMPC_L, KMPC_SLOTS_USED, 2, K.half_plane_scale,
                                     K.open};
    const struct kmpc_keep_out keep = {
        1,    things,        0,             K.sides,    2,    thing,    points,
        NULL, NULL,          K.side_normal, K.side_offset, K.distance, K.dt, INFINITY,
    };
    const struct kmpc_plan_margins margins = {
        {K.delay, K.white, K.lasting, K.pose, K.pose_by_speed, K.quantile, K.headway_time,
         K.distance, 0, K.solver_margin, K.spreads},
        at->inputs[0], way->clearance, K.widest, K.far_clearance, K.side_margin,
    };
    const struct kmpc_pass plan = {
        at->states[0], at->inputs[0], way->reference, value,     by_x,          by_u,
        by_past,       K.pull,        pull_terminal,  K.turn_weight, way->to_goal,
    };
    const struct kmpc_qp qp = {K.places, entries, lower, upper, lower + 3 * KMPC_N, q, start, turn};
    kmpc_model_linearize(at->states[0], window, value, by_x, by_u, by_past);
    for (int k = 0; k < KMPC_N; k++)
        memcpy(points + 2 * k, at->states[k + 1], 2 * sizeof(real));
    for (int i = 0; i < 9; i++)
        pull_terminal[i] = way->share_at_goal * K.pull_terminal[i];
    kmpc_fill(&size, &keep, K.tightens ? &margins : NULL, &plan, &qp, room);
    memcpy(duals, at->duals, sizeof(duals));
    const char *wrong = fault();
    if (wrong)
        return wrong;
    if (osqp_update_data_vec(&kmpc_solver, q, lower, upper) ||
        update_matrices(way->share_at_goal))
        return "OSQP refused the data";
    osqp_warm_start(&kmpc_solver, start, duals);
    osqp_solve(&kmpc_solver);
    rho_is_adapted = rho_is_adapted || kmpc_solver.info->rho_updates > 0;
    const OSQPInt status = kmpc_solver.info->status_val;
    *early = status != OSQP_SOLVED;
    if (*early && status != OSQP_SOLVED_INACCURATE && status != OSQP_MAX_ITER_REACHED)
        return "OSQP found no solution";
    const OSQPFloat *x = kmpc_solver.solution->x, *y = kmpc_solver.solution->y;
    memcpy(found->duals, y, sizeof(found->duals));
    if (!kmpc_all_within(x, KMPC_VARIABLES, LARGEST) || !kmpc_all_within(y, KMPC_ROWS, LARGEST))
        return "OSQP: solution not finite";
    memcpy(found->states[0], at->states[0], 3 * sizeof(real));
    for (int k = 0; k < KMPC_N; k++) {
        for (int i = 0; i < 3; i++)
            found->states[k + 1][i] = x[3 * k + i] + (i < 2 ? at->states[0][i] : 0);
        for (int i = 0; i < 2; i++) {
            real u = x[3 * KMPC_N + 2 * k + i];
            if (!k && K.limits_changes)
                u = kmpc_clip(u, last[i] - K.change[i], last[i] + K.change[i]);
            found->inputs[k][i] = kmpc_clip(u, K.u_min[i], K.u_max[i]);
        }
    }
    return NULL;
}

/* Take a share of the step from one to another; its largest part before. */
static real towards(const real *at, real *found, int count, real share)
{
    real step = 0;
    for (int i = 0; i < count; i++) {
        const real change = found[i] - at[i];
        step = M(fabs)(change) > step ? M(fabs)(change) : step;
        found[i] = share < 1 ? at[i] + share * change : found[i];
    }
    return step;
}

/* Take a share of the step to what a QP found, and ask the model about it. */
static real go(struct kmpc_iterate *at, struct kmpc_iterate *found, real *window, real share,
               struct kmpc_result *result)
{
    static real predicted[3 * KMPC_N];
    const real moved = towards(at->states[0], found->states[0], 3 * (KMPC_N + 1), share);
    const real changed = towards(at->inputs[0], found->inputs[0], 2 * KMPC_N, share);
    memcpy(window + 2 * KMPC_L, found->inputs, sizeof(found->inputs));
    kmpc_model_linearize(found->states[0], window, predicted, NULL, NULL, NULL);
    result->defect = 0;
    for (int i = 0; i < 3 * KMPC_N; i++) {
        const real apart = M(fabs)(predicted[i] - found->states[1 + i / 3][i % 3]);
        if (!(apart <= result->defect)) /* also of NaN */
            result->defect = apart;
    }
    memcpy(result->next_state, predicted, 3 * sizeof(real));
    memcpy(at, found, sizeof(*at));
    return moved > changed ? moved : changed;
}

void kmpc_solve(struct kmpc_iterate *iterate, const real *past, const struct kmpc_way *way,
                int things, const real *thing, int least, int most, struct kmpc_result *result)
{
    static struct kmpc_iterate found;
    real window[2 * (KMPC_L + KMPC_N)], share = 1, step = INFINITE;
    const real *last = past + 2 * (KMPC_PAST - 1);
    memcpy(entries, K.entries, sizeof(entries));
    memcpy(lower, K.lower, sizeof(lower));
    memcpy(upper, K.upper, sizeof(upper));
    memcpy(q, K.q, sizeof(q));
    for (int i = 0; i < 2; i++) /* changes begin at what was sent last */
        q[3 * KMPC_N + i] += K.pull_last[2 * i] * last[0] + K.pull_last[2 * i + 1] * last[1];
    memcpy(window, past, 2 * KMPC_L * sizeof(real));
    if (rho_is_adapted) /* as if nothing had been solved before */
        rho_is_adapted = osqp_update_rho(&kmpc_solver, K.rho) != 0;
    for (int k = 0; k < KMPC_N; k++)
        for (int i = 0; i < 2; i++) {
            if (K.limits_changes) {
                const real reach = (real)(k + 1) * K.change[i];
                iterate->inputs[k][i] =
                    kmpc_clip(iterate->inputs[k][i], last[i] - reach, last[i] + reach);
            }
            window[2 * (KMPC_L + k) + i] = iterate->inputs[k][i];
        }
    if (K.limits_changes)
        for (int i = 0, row = KMPC_CHANGE_ROW; i < 2; i++)
            if (K.change[i] < INFINITE) {
                lower[row] = K.change_scale[i] * (last[i] - K.change[i]);
                upper[row++] = K.change_scale[i] * (last[i] + K.change[i]);
            }
    *result = (struct kmpc_result){.reason = ""};
    memcpy(result->next_state, iterate->states[0], 3 * sizeof(real));
    for (;;) {
        const real before = step;
        const char *wrong =
            pass(iterate, window, last, way, things, thing, &found, &result->early);
        result->passes++;
        result->reason = result->early ? "maximum iterations reached" : "";
        if (wrong) {
            result->failed = 1;
            result->reason = wrong;
            return;
        }
        step = go(iterate, &found, window, share, result);
        if (result->passes >= least &&
            (result->defect <= K.tolerated || result->passes >= most))
            return;
        if (step >= before) /* going there and back: the half of it lies between */
            share = R(0.5) * share > LEAST_SHARE ? R(0.5) * share : LEAST_SHARE;
    }
}
