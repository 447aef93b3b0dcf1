/* Small things that stand apart in a scan, as circles. */
#include "kernels.h"

#include <math.h>

enum { FEWEST = 3 }; /* hits of the smallest cluster */

static real apart(const real *a, const real *b)
{
    return M(hypot)(b[0] - a[0], b[1] - a[1]);
}

/* Circle of a run of hits, if it is small and nothing nearer hides a side of it. */
static int circle_of(const struct kmpc_ring *s, const int *ring, int count, int first, int hits,
                     real *circle)
{
    const int last = (first + hits - 1) % count;
    const int a = ring[first], b = ring[last];
    const real *begin = s->ends + 2 * a, *end = s->ends + 2 * b;
    real low[2] = {begin[0], begin[1]}, high[2] = {begin[0], begin[1]};
    for (int i = 1; i < hits; i++) {
        const real *at = s->ends + 2 * ring[(first + i) % count];
        for (int axis = 0; axis < 2; axis++) {
            low[axis] = at[axis] < low[axis] ? at[axis] : low[axis];
            high[axis] = at[axis] > high[axis] ? at[axis] : high[axis];
        }
    }
    if (high[0] - low[0] > 2 * s->largest || high[1] - low[1] > 2 * s->largest)
        return 0;
    /* what ends at the scanner's reach goes on beyond it */
    if (!(s->reach[ring[(first + count - 1) % count]] > s->reach[a] + s->gap) ||
        !(s->reach[ring[(last + 1) % count]] > s->reach[b] + s->gap))
        return 0;
    const real chord = apart(begin, end);
    const real near = s->reach[a] < s->reach[b] ? s->reach[a] : s->reach[b];
    const real radius = R(0.5) * (chord + s->step * near);
    if (!(radius <= s->largest))
        return 0;
    const real x = R(0.5) * (begin[0] + end[0]) - s->mount[0];
    const real y = R(0.5) * (begin[1] + end[1]) - s->mount[1];
    const real depth = radius * radius - R(0.25) * chord * chord;
    const real far = M(hypot)(x, y);
    const real by = 1 + (depth > 0 ? M(sqrt)(depth) : 0) / (far > radius ? far : radius);
    circle[0] = x * by + s->mount[0];
    circle[1] = y * by + s->mount[1];
    circle[2] = radius;
    return 1;
}

/* `ring` holds (beams) ints; `circles` (beams / 3, 3). The number of circles is returned. */
int kmpc_clusters(const struct kmpc_ring *s, int *ring, real *circles)
{
    int count = 0, found = 0, begin = -1;
    for (int i = 0; i < s->beams; i++)
        if (s->hits[i] || s->clear[i])
            ring[count++] = i;
    if (count < FEWEST + 2)
        return 0;
    /* from gap to gap once around; what lies behind the first gap comes first */
    for (int i = 0; i < 2 * count; i++) {
        const int at = i % count, here = ring[at], next = ring[(at + 1) % count];
        if (s->hits[here] && s->hits[next] &&
            apart(s->ends + 2 * here, s->ends + 2 * next) <= s->gap)
            continue;
        if (begin >= 0) {
            const int hits = i - begin + 1;
            if (hits >= FEWEST && s->hits[ring[begin % count]])
                found += circle_of(s, ring, count, begin % count, hits, circles + 3 * found);
            if (i >= count)
                break;
        } else if (i >= count) {
            break;
        }
        begin = i + 1;
    }
    return found;
}
