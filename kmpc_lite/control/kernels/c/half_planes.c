/* The half-planes of a plan: what it must be kept out of, and the nearest few of each stage. */
#include "kernels.h"

#include <math.h>
#include <string.h>

static const real LEAST_DISTANCE = R(1e-9);

int kmpc_kinds(const struct kmpc_keep_out *keep)
{
    return keep->places * (keep->things + keep->solids) + keep->sides + (keep->range < INFINITY);
}

/* Directions (count, 2) become normals in place; turning moves a circle across its arm. */
static void add_slopes(int count, int directions, real arm_x, real arm_y, real *normals)
{
    if (directions < 3)
        return;
    for (int j = count - 1; j >= 0; j--) {
        const real x = normals[2 * j], y = normals[2 * j + 1];
        normals[3 * j] = x;
        normals[3 * j + 1] = y;
        normals[3 * j + 2] = x * -arm_y + y * arm_x;
    }
}

static void sides_of(const struct kmpc_keep_out *keep, const real *here, const real *state,
                     real *clear, real *normal)
{
    const int d = keep->directions;
    for (int i = 0; i < keep->sides; i++, normal += d) {
        const real *n = keep->side_normal + 2 * i;
        const real now = n[0] * here[0] + n[1] * here[1];
        /* a robot that stands outside is asked to come back, at no obstacle's expense */
        const real offset = keep->side_offset[i] < now ? keep->side_offset[i] : now;
        *clear++ = n[0] * state[0] + n[1] * state[1] - offset;
        memset(normal, 0, (size_t)d * sizeof(real));
        memcpy(normal, n, 2 * sizeof(real));
    }
    if (keep->range < INFINITY) {
        const real x = here[0] - state[0], y = here[1] - state[1], distance = M(hypot)(x, y);
        const real most = distance > LEAST_DISTANCE ? distance : LEAST_DISTANCE;
        *clear = keep->range - distance;
        memset(normal, 0, (size_t)d * sizeof(real));
        normal[0] = x / most;
        normal[1] = y / most;
    }
}

void kmpc_clearances(const struct kmpc_keep_out *keep, int stages, const real *states,
                     real *clearances, real *normals)
{
    const int kinds = kmpc_kinds(keep), d = keep->directions, e = keep->places;
    for (int k = 0; k < stages; k++, clearances += kinds, normals += kinds * d) {
        const real *state = states + 3 * (k + 1), time = keep->dt * (real)(k + 1);
        for (int i = 0; i < e; i++) {
            const int at = k * e + i, solids = keep->solids, column = e * keep->things + i * solids;
            const real *point = keep->points + 2 * at;
            const real arm_x = point[0] - state[0], arm_y = point[1] - state[1];
            real *clear = clearances + i * keep->things, *normal = normals + i * keep->things * d;
            kmpc_distances_and_directions(keep->things, keep->thing, 1, point, &time, clear, normal);
            add_slopes(keep->things, d, arm_x, arm_y, normal);
            if (!solids)
                continue;
            memcpy(clearances + column, keep->gaps + at * solids, (size_t)solids * sizeof(real));
            normal = normals + column * d;
            memcpy(normal, keep->away + d * at * solids, (size_t)(d * solids) * sizeof(real));
        }
        const int obstacles = e * (keep->things + keep->solids);
        for (int i = 0; i < obstacles; i++)
            clearances[i] -= keep->distance;
        sides_of(keep, states, state, clearances + obstacles, normals + obstacles * d);
    }
}

void kmpc_nearest_half_planes(int stages, int kinds, int slots, int directions, const real *states,
                              const real *clearances, const real *normals, real *chosen,
                              real *offsets)
{
    for (int k = 0; k < stages; k++) {
        const real *state = states + 3 * (k + 1), *clear = clearances + k * kinds;
        for (int slot = 0, i = 0; slot < slots; i++) {
            if (i >= kinds) { /* fewer than slots */
                for (int d = 0; d < directions; d++)
                    *chosen++ = 0;
                *offsets++ = -INFINITY;
                slot++;
                continue;
            }
            int nearer = 0;
            for (int j = 0; j < kinds && nearer < slots; j++)
                nearer += clear[j] < clear[i] || (j < i && !(clear[i] < clear[j]));
            if (nearer >= slots)
                continue;
            const real *normal = normals + (k * kinds + i) * directions;
            real offset = -clear[i];
            for (int d = 0; d < directions; d++) {
                *chosen++ = normal[d];
                offset += normal[d] * state[d];
            }
            *offsets++ = offset;
            slot++;
        }
    }
}
