/* What a scan's beams tell, and measure together. */
#include "kernels.h"

#include <math.h>

enum { NEIGHBOURS = 8, INDEPENDENT = 2 };
static const real SAME_SURFACE = R(3.0);

void kmpc_told_beams(int beams, const real *ranges, const real *along, const unsigned char *counts,
                     const real *mount, real least, real most, real own, unsigned char *hits,
                     unsigned char *clear, real *reach, real *ends)
{
    for (int i = 0; i < beams; i++) {
        const real range = ranges[i];
        clear[i] = counts[i] && (range == (real)INFINITY || range == most);
        hits[i] = counts[i] && range >= least && range > 0 && range < most;
        reach[i] = hits[i] ? range : clear[i] ? most : 0;
        for (int axis = 0; axis < 2; axis++)
            ends[2 * i + axis] = reach[i] * along[2 * i + axis] + mount[axis];
        if (own > 0 && hits[i] && M(hypot)(ends[2 * i], ends[2 * i + 1]) <= own) {
            hits[i] = 0;
            reach[i] = 0;
            ends[2 * i] = mount[0];
            ends[2 * i + 1] = mount[1];
        }
    }
}

/* Sums are those of NumPy's pairs, in single precision. */
void kmpc_averaged_ranges(int beams, const real *ranges, const unsigned char *hits, real step,
                          real noise, real half, real *averaged, real *deviations)
{
    const float same = (float)(SAME_SURFACE * noise), far = (float)half, turn = (float)step;
    for (int i = 0; i < beams; i++) {
        float away[2 * NEIGHBOURS + 1] = {0};
        const float own = hits[i] ? (float)ranges[i] : 0;
        int count = 0;
        for (int k = 0; k <= 2 * NEIGHBOURS && hits[i]; k++) {
            const int j = i + k - NEIGHBOURS, beside = j < i ? i - j : j - i;
            if (j < 0 || j >= beams || !hits[j] || !((float)beside * turn * own <= far))
                continue;
            const float found = (float)ranges[j] - own;
            if (fabsf(found) <= same) {
                away[k] = found;
                count++;
            }
        }
        float sum[NEIGHBOURS];
        for (int k = 0; k < NEIGHBOURS; k++)
            sum[k] = away[k] + away[k + NEIGHBOURS];
        const float low = sum[0] + sum[1] + (sum[2] + sum[3]);
        const float all = low + (sum[4] + sum[5] + (sum[6] + sum[7])) + away[2 * NEIGHBOURS];
        averaged[i] = ranges[i] + (real)all / (real)(count > 1 ? count : 1);
        count = count > INDEPENDENT ? INDEPENDENT : count > 1 ? count : 1;
        deviations[i] = noise / M(sqrt)((real)count);
    }
}
