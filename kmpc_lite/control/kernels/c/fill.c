/* From a linearisation and what is around a plan to the numbers of a pass's QP. */
#include "kernels.h"

#include <math.h>
#include <string.h>

/* right -= J (3, m) u (m,) */
static void take_off(const real *jacobian, int columns, const real *u, real *right)
{
    for (int row = 0; row < 3; row++)
        for (int i = 0; i < columns; i++)
            right[row] -= jacobian[row * columns + i] * u[i];
}

/* Margins of obstacles, the first columns, and of sides, taken off clearances. */
static void take_off_margins(const struct kmpc_plan_margins *margins, int stages, int kinds,
                             int count, int directions, const struct kmpc_pass *plan,
                             const real *normals, real *clearances, real *room)
{
    real nearest = INFINITY;
    for (int k = 0; k < stages; k++)
        for (int i = 0; i < count; i++) {
            const real clear = clearances[k * kinds + i];
            if (nearest == nearest && !(clear >= nearest)) /* NaN stays */
                nearest = clear;
        }
    const int near = count && nearest < margins->widest + margins->far_clearance;
    if (near)
        kmpc_tube_margins(&margins->noise, stages, count, kinds, directions, plan->by_x,
                          plan->states, margins->speeds, normals, margins->path_clearance, room);
    for (int k = 0; k < stages; k++, clearances += kinds, room += kinds)
        for (int i = 0; i < kinds; i++)
            clearances[i] -= i >= count ? margins->side_margin : near ? room[i] : margins->widest;
}

/* Blocks of A in the order in which they are counted: by the states, by commands from the youngest
 * to the oldest, half-planes; `places` says where each entry lies. */
static void write_entries(const struct kmpc_layout *size, const struct kmpc_pass *plan,
                          const real *normals, const int *places, real *entries)
{
    const int n = size->stages, block = 3 * size->inputs, history = size->history;
    for (int i = 9; i < 9 * n; i++)
        entries[*places++] = -plan->by_x[i];
    for (int i = 0; i < n * block; i++)
        entries[*places++] = -plan->by_u[i];
    for (int j = 1; j <= history && j < n; j++)
        for (int k = j; k < n; k++)
            for (int i = 0; i < block; i++)
                entries[*places++] = -plan->by_past[(k * history + j - 1) * block + i];
    for (int i = 0; i < n * size->slots * size->directions; i++)
        entries[*places++] = size->half_plane_scale * normals[i];
}

/* What is known of the dynamics moves to the right:
 * x+ - A x - sum_j B_j u_j = f - A x0 - sum_j B_j u0_j. */
static void write_dynamics(const struct kmpc_layout *size, const struct kmpc_pass *plan,
                           const real *local, const struct kmpc_qp *qp)
{
    const int n = size->stages, m = size->inputs, block = 3 * m, history = size->history;
    const real *value = plan->value, *u = plan->inputs, *origin = plan->states;
    for (int k = 0; k < n; k++) {
        real right[3] = {value[3 * k] - origin[0], value[3 * k + 1] - origin[1], value[3 * k + 2]};
        take_off(plan->by_u + k * block, m, u + k * m, right);
        if (k)
            take_off(plan->by_x + 9 * k, 3, local + 3 * k, right);
        for (int j = 1; j <= history && j <= k; j++)
            take_off(plan->by_past + (k * history + j - 1) * block, m, u + (k - j) * m, right);
        for (int row = 0; row < 3; row++)
            qp->dynamics_lower[3 * k + row] = qp->dynamics_upper[3 * k + row] = right[row];
    }
}

/* The reference's pull, and the plan as the QP's variables: states, commands, slacks. */
static void write_start(const struct kmpc_layout *size, const struct kmpc_pass *plan,
                        const real *local, int kinds, const real *clearances,
                        const struct kmpc_qp *qp)
{
    const int n = size->stages, m = size->inputs;
    const real *origin = plan->states;
    memcpy(qp->start, local + 3, 3 * (size_t)n * sizeof(real));
    memcpy(qp->start + 3 * n, plan->inputs, (size_t)(m * n) * sizeof(real));
    for (int k = 0; k < n; k++) {
        const real *w = k + 1 < n ? plan->weight : plan->weight_terminal;
        const real *to = plan->reference + 3 * (k + 1);
        const real x = to[0] - origin[0], y = to[1] - origin[1];
        for (int i = 0; i < 3; i++)
            qp->pull[3 * k + i] = x * w[i] + y * w[3 + i] + to[2] * w[6 + i];
        real violation = 0;
        for (int i = 0; i < kinds; i++)
            if (-clearances[k * kinds + i] > violation)
                violation = -clearances[k * kinds + i];
        qp->start[(3 + m) * n + k] = violation;
    }
}

/* How a way to a far goal bends with its heading: the second derivative of what its later places
 * cost. Without it a plan turns too far, and back in the next period. */
static void write_curvature(int n, const struct kmpc_pass *plan, const struct kmpc_qp *qp)
{
    real x = 0, y = 0; /* what all later places gain by being farther on */
    for (int k = n - 1; k > 0; k--) {
        const real *from = plan->states + 3 * k, *to = from + 3, *goal = plan->reference + 3 * k + 3;
        const real *w = k + 1 < n ? plan->weight : plan->weight_terminal;
        for (int i = 0; i < 3; i++) {
            x -= (goal[i] - to[i]) * w[3 * i];
            y -= (goal[i] - to[i]) * w[3 * i + 1];
        }
        real bends = plan->to_goal ? x * (to[0] - from[0]) + y * (to[1] - from[1]) : 0;
        bends = bends > 0 ? bends : 0; /* also of NaN */
        qp->turn[k - 1] = plan->turn_weight + bends;
        qp->pull[3 * (k - 1) + 2] -= bends * from[2];
    }
}

long kmpc_fill_room(const struct kmpc_layout *size, int kinds)
{
    const long n = size->stages, d = size->directions;
    return n * (2L * kinds + kinds * d + size->slots * (d + 1L)) + 3 * (n + 1);
}

void kmpc_fill(const struct kmpc_layout *size, const struct kmpc_keep_out *keep,
               const struct kmpc_plan_margins *margins, const struct kmpc_pass *plan,
               const struct kmpc_qp *qp, real *room)
{
    const int n = size->stages, d = size->directions, slots = size->slots;
    const int kinds = kmpc_kinds(keep), obstacles = keep->places * (keep->things + keep->solids);
    real *clearances = room, *of_things = clearances + n * kinds;
    real *normals = of_things + n * kinds, *chosen = normals + n * kinds * d;
    real *offsets = chosen + n * slots * d, *local = offsets + n * slots;
    kmpc_clearances(keep, n, plan->states, clearances, normals);
    if (margins)
        take_off_margins(margins, n, kinds, obstacles, d, plan, normals, clearances, of_things);
    for (int i = 0; i < 3 * (n + 1); i++)
        local[i] = plan->states[i] - (i % 3 < 2 ? plan->states[i % 3] : 0);
    kmpc_nearest_half_planes(n, kinds, slots, d, local, clearances, normals, chosen, offsets);
    write_entries(size, plan, chosen, qp->places, qp->entries);
    write_dynamics(size, plan, local, qp);
    write_start(size, plan, local, kinds, clearances, qp);
    write_curvature(n, plan, qp);
    for (int i = 0; i < n * slots; i++) {
        const real lower = size->half_plane_scale * offsets[i];
        qp->half_plane_lower[i] = lower > -size->open ? lower : -size->open;
    }
}
