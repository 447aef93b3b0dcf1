/* What can be where, and when: distances from a table of things, each a disc that moves and grows. */
#include "kernels.h"

#include <math.h>

static const real AT_CENTRE = R(1e-9);

/* By how much a thing's edge lies farther out at a time. */
static real edge_at(const real *thing, real time)
{
    const real grown = time * thing[5];
    return thing[2] + (grown < thing[6] ? grown : thing[6]);
}

/* Distances (motions, samples, places, things) of points (motions, sampled, places, 2) at times
 * (samples,); `sampled` is `samples`, or 1 of points that stay. */
void kmpc_distances(int things, const real *thing, int motions, int samples, int places,
                    int sampled, const real *points, const real *times, real *distance)
{
    for (int c = 0; c < motions; c++)
        for (int q = 0; q < samples; q++)
            for (int e = 0; e < places; e++) {
                const real *p = points + 2 * ((c * sampled + (sampled > 1 ? q : 0)) * places + e);
                for (int k = 0; k < things; k++) {
                    const real *t = thing + KMPC_THING * k;
                    const real x = p[0] - t[0] - times[q] * t[3];
                    const real y = p[1] - t[1] - times[q] * t[4];
                    *distance++ = M(hypot)(x, y) - edge_at(t, times[q]);
                }
            }
}

/* Distances (count, things) of points (count, 2) at times (count,), and directions away. */
void kmpc_distances_and_directions(int things, const real *thing, int count, const real *points,
                                   const real *times, real *distance, real *away)
{
    for (int i = 0; i < count; i++)
        for (int k = 0; k < things; k++, away += 2) {
            const real *t = thing + KMPC_THING * k;
            real x = points[2 * i] - t[0] - times[i] * t[3];
            real y = points[2 * i + 1] - t[1] - times[i] * t[4];
            real length = M(hypot)(x, y);
            if (length < AT_CENTRE) {
                x = length = AT_CENTRE;
                y = 0;
            }
            away[0] = x / length;
            away[1] = y / length;
            *distance++ = length - edge_at(t, times[i]);
        }
}
