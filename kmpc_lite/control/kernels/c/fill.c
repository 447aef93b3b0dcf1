/* From a linearisation and half-planes to the numbers of a pass's QP. */
#include "kernels.h"

/* right -= J (3, m) u (m,) */
static void take_off(const real *jacobian, int columns, const real *u, real *right)
{
    for (int row = 0; row < 3; row++)
        for (int i = 0; i < columns; i++)
            right[row] -= jacobian[row * columns + i] * u[i];
}

/* Blocks of A in the order in which they are counted: by the states, by commands from the youngest
 * to the oldest, half-planes; `places` says where each entry lies. What is known of the dynamics
 * moves to the right: x+ - A x - sum_j B_j u_j = f - A x0 - sum_j B_j u0_j. */
void kmpc_fill(const struct kmpc_layout *size, const real *value, const real *by_x,
               const real *by_u, const real *by_past, const real *x, const real *u,
               const real *normals, const real *offsets, const int *places, real *entries,
               real *dynamics_lower, real *dynamics_upper, real *half_plane_lower)
{
    const int n = size->stages, m = size->inputs, block = 3 * m;
    for (int i = 9; i < 9 * n; i++)
        entries[*places++] = -by_x[i];
    for (int i = 0; i < n * block; i++)
        entries[*places++] = -by_u[i];
    for (int j = 1; j <= size->history && j < n; j++)
        for (int k = j; k < n; k++)
            for (int i = 0; i < block; i++)
                entries[*places++] = -by_past[(k * size->history + j - 1) * block + i];
    for (int k = 0; k < n; k++) {
        real right[3] = {value[3 * k], value[3 * k + 1], value[3 * k + 2]};
        take_off(by_u + k * block, m, u + k * m, right);
        if (k)
            take_off(by_x + 9 * k, 3, x + 3 * k, right);
        for (int j = 1; j <= size->history && j <= k; j++)
            take_off(by_past + (k * size->history + j - 1) * block, m, u + (k - j) * m, right);
        for (int row = 0; row < 3; row++)
            dynamics_lower[3 * k + row] = dynamics_upper[3 * k + row] = right[row];
    }
    for (int i = 0; i < n * size->slots * size->directions; i++)
        entries[*places++] = size->half_plane_scale * normals[i];
    for (int i = 0; i < n * size->slots; i++) {
        const real lower = size->half_plane_scale * offsets[i];
        half_plane_lower[i] = lower > -size->open ? lower : -size->open;
    }
}
