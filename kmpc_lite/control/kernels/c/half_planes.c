/* The half-planes of a stage: those of the nearest few obstacles and sides, in their order. */
#include "kernels.h"

#include <math.h>

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
