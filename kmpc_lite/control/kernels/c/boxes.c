/* Rectangles along the axes: how far points are, which way, and which of them matter. */
#include "kernels.h"

#include <math.h>

static const real AT = R(1e-9);

/* Distance of a point from a rectangle, negative inside, and the normal times it. */
static real away(const real *low, const real *high, const real *point, real *x, real *y)
{
    const real within_x = point[0] > low[0] ? (point[0] < high[0] ? point[0] : high[0]) : low[0];
    const real within_y = point[1] > low[1] ? (point[1] < high[1] ? point[1] : high[1]) : low[1];
    *x = point[0] - within_x;
    *y = point[1] - within_y;
    real distance = M(sqrt)(*x * *x + *y * *y);
    if (distance <= AT) { /* the nearest side has a direction, touched or not */
        const real side[4] = {point[0] - low[0], point[1] - low[1], high[0] - point[0],
                              high[1] - point[1]};
        int nearest = 0;
        for (int i = 1; i < 4; i++)
            if (side[i] < side[nearest])
                nearest = i;
        distance = -side[nearest] < -AT ? -side[nearest] : -AT;
        *x = nearest == 0 ? -distance : nearest == 2 ? distance : 0;
        *y = nearest == 1 ? -distance : nearest == 3 ? distance : 0;
    }
    return distance;
}

/* Whether a rectangle is farther from a point than that, as one of its sides tells. */
static int is_beyond(const real *low, const real *high, const real *point, real far)
{
    return low[0] - point[0] > far || point[0] - high[0] > far || low[1] - point[1] > far ||
           point[1] - high[1] > far;
}

void kmpc_box_distances(int boxes, const real *low, const real *high, int count,
                        const real *points, real *least)
{
    for (int k = 0; k < count; k++) {
        real x, y;
        least[k] = away(low, high, points + 2 * k, &x, &y);
        for (int i = 1; i < boxes; i++) {
            if (is_beyond(low + 2 * i, high + 2 * i, points + 2 * k, least[k]))
                continue;
            const real found = away(low + 2 * i, high + 2 * i, points + 2 * k, &x, &y);
            if (found < least[k])
                least[k] = found;
        }
    }
}

/* `room` holds (boxes, 4): distance, x, y, and whether a box still counts. */
void kmpc_nearest_boxes(int boxes, const real *low, const real *high, int count,
                        const real *points, real behind, int columns, real *room, long *chosen,
                        real *distance, real *normals)
{
    for (int k = 0; k < count; k++) {
        real far = (real)INFINITY;
        int first = 0;
        for (int i = 0; i < boxes; i++) {
            real *found = room + 4 * i;
            if (columns == 1 && is_beyond(low + 2 * i, high + 2 * i, points + 2 * k, far))
                continue;
            found[0] = away(low + 2 * i, high + 2 * i, points + 2 * k, found + 1, found + 2);
            found[3] = 1;
            first = found[0] < far ? i : first;
            far = room[4 * first];
        }
        for (int j = 0; j < columns; j++, chosen++, distance++, normals += 2) {
            int nearest = columns == boxes ? j : j ? 0 : first;
            for (int i = 0; i < boxes && j && columns != boxes; i++)
                if (room[4 * i + 3] > 0 &&
                    (!(room[4 * nearest + 3] > 0) || room[4 * i] < room[4 * nearest]))
                    nearest = i;
            const real near = room[4 * nearest];
            const real x = room[4 * nearest + 1] / near, y = room[4 * nearest + 2] / near;
            *chosen = nearest;
            *distance = near;
            normals[0] = x;
            normals[1] = y;
            for (int i = 0; i < boxes && j + 1 < columns; i++) /* behind its half-plane, or itself */
                if (room[4 * i + 1] * x + room[4 * i + 2] * y >= near - behind)
                    room[4 * i + 3] = 0;
        }
    }
}
