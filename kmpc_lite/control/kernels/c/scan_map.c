/* What the beams of a scan show of the cells of a map. */
#include "kernels.h"

#include <math.h>
#include <string.h>

static const float NOTHING = 1e-15f; /* keeps a quotient finite */

/* Whether rays passed through a point: in single precision, as the map is. */
static int passed(const real *point, const real *origin, const float *turn, const float *squares)
{
    const float quarter = 0.25f * KMPC_DIRECTIONS;
    const float x = (float)(point[0] - origin[0]), y = (float)(point[1] - origin[1]);
    const float ahead = turn[0] * x + turn[1] * y, aside = turn[0] * y - turn[1] * x;
    /* number of the direction from 0, straight back, counter-clockwise */
    const float size = fabsf(ahead) + fabsf(aside) + NOTHING;
    const float number = copysignf(ahead / size * -quarter + quarter, aside) + 2.0f * quarter;
    const int at = number >= 0 ? number < KMPC_DIRECTIONS ? (int)number : KMPC_DIRECTIONS : 0;
    return squares[at] >= x * x + y * y;
}

static void see_through(const struct kmpc_cells *c, const struct kmpc_rays *rays,
                        const int *window, int only_hit)
{
    const float turned[2] = {(float)rays->turn[0], (float)rays->turn[1]};
    for (int row = window[0]; row < window[1]; row++)
        for (int column = window[2]; column < window[3]; column++) {
            const long cell = (long)row * c->width + column;
            signed char *state = c->state + cell;
            if (only_hit && *state <= 0)
                continue;
            real point[2] = {c->cell * ((real)c->column + R(0.5) + (real)column),
                             c->cell * ((real)c->row + R(0.5) + (real)row)};
            if (only_hit) { /* beyond what was hit there */
                const float *box = c->extent + 4 * cell;
                const real low[2] = {(real)(column + c->column) * c->cell,
                                     (real)(row + c->row) * c->cell};
                for (int i = 0; i < 2; i++)
                    point[i] = R(0.5) * ((low[i] + (real)box[i]) + (low[i] + (real)box[2 + i]));
            }
            if (!passed(point, rays->origin, turned, rays->squares))
                continue;
            *state = (signed char)(*state > 0 ? *state - 1 : 0);
            if (!only_hit && c->seen[cell] < (float)c->clock)
                c->seen[cell] = (float)c->clock;
        }
}

static int clipped(real number, int most)
{
    return number > 0 ? number < (real)most ? (int)number : most : 0;
}

/* First row and the one behind the last, the same of columns, between two corners. */
static void window_between(const struct kmpc_cells *c, const real *low, const real *high,
                           int *window)
{
    for (int i = 0; i < 2; i++) {
        const int axis = 1 - i, most = i ? c->width : c->height;
        const real first = (real)(i ? c->column : c->row);
        window[2 * i] = clipped(M(floor)(low[axis] / c->cell) - first, most);
        window[2 * i + 1] = clipped(M(floor)(high[axis] / c->cell) - first + 1, most);
    }
}

void kmpc_pass_rays(const struct kmpc_cells *c, const struct kmpc_rays *rays)
{
    real low[2], high[2];
    int near[4], far[4];
    for (int i = 0; i < 2; i++) {
        const real least = rays->origin[i] - rays->distance, most = rays->origin[i] + rays->distance;
        low[i] = rays->low[i] > least ? rays->low[i] : least;
        high[i] = rays->high[i] < most ? rays->high[i] : most;
    }
    window_between(c, low, high, near);
    see_through(c, rays, near, 0);
    if (!rays->farther)
        return;
    window_between(c, rays->low, rays->high, far);
    if (near[0] >= near[1] || near[2] >= near[3]) {
        see_through(c, rays, far, 1);
        return;
    }
    const int sides[4][4] = {
        {far[0], near[0], far[2], far[3]},
        {near[1], far[1], far[2], far[3]},
        {near[0], near[1], far[2], near[2]},
        {near[0], near[1], near[3], far[3]},
    };
    for (int i = 0; i < 4; i++)
        see_through(c, rays, sides[i], 1);
}

/* Cell of a point, and its place in it; -1 beyond the map. */
static long cell_of(const struct kmpc_cells *c, const real *point, real *place)
{
    const real column = M(floor)(point[0] / c->cell), row = M(floor)(point[1] / c->cell);
    const real x = column - (real)c->column, y = row - (real)c->row;
    if (!(x >= 0 && y >= 0 && x < (real)c->width && y < (real)c->height))
        return -1;
    place[0] = point[0] - c->cell * column;
    place[1] = point[1] - c->cell * row;
    return (long)y * c->width + (long)x;
}

void kmpc_mark(const struct kmpc_cells *c, int count, const real *points, const real *errors,
               int level)
{
    real place[2];
    for (int i = 0; i < count; i++) {
        const long cell = cell_of(c, points + 2 * i, place);
        if (cell < 0)
            continue;
        if (c->state[cell] == 0)
            c->taken[cell] = (float)c->clock;
        c->state[cell] = (signed char)level;
        c->seen[cell] = (float)c->clock;
        for (int k = 0; k < 4; k++)
            c->extent[4 * cell + k] = k < 2 ? INFINITY : -INFINITY;
    }
    for (int i = 0; i < count; i++) {
        const long cell = cell_of(c, points + 2 * i, place);
        if (cell < 0)
            continue;
        float *box = c->extent + 4 * cell;
        for (int axis = 0; axis < 2; axis++) {
            const float low = (float)(place[axis] - errors[i]);
            const float high = (float)(place[axis] + errors[i]);
            box[axis] = low < box[axis] ? low : box[axis];
            box[2 + axis] = high > box[2 + axis] ? high : box[2 + axis];
        }
    }
}

/* Number of boxes; `low` and `high` hold one for each cell of the window. */
int kmpc_hit_boxes(const struct kmpc_cells *c, const int *window, real *low, real *high)
{
    int count = 0;
    for (int row = window[0]; row < window[1]; row++)
        for (int column = window[2]; column < window[3]; column++) {
            const long cell = (long)row * c->width + column;
            if (c->state[cell] <= 0)
                continue;
            const real x = (real)(column + c->column) * c->cell;
            const real y = (real)(row + c->row) * c->cell;
            const float *box = c->extent + 4 * cell;
            low[2 * count] = x + (real)box[0];
            low[2 * count + 1] = y + (real)box[1];
            high[2 * count] = x + (real)box[2];
            high[2 * count + 1] = y + (real)box[3];
            count++;
        }
    return count;
}

/* Whether a rectangle comes after another one: by its columns, then its rows. */
static int comes_after(const int *a, const int *b)
{
    if (a[0] != b[0])
        return a[0] > b[0];
    return a[2] != b[2] ? a[2] > b[2] : a[1] > b[1];
}

static void sort(int count, int *boxes)
{
    for (int i = 1; i < count; i++) {
        int box[4], j = i;
        memcpy(box, boxes + 4 * i, sizeof box);
        for (; j > 0 && comes_after(boxes + 4 * (j - 1), box); j--)
            memcpy(boxes + 4 * j, boxes + 4 * (j - 1), sizeof box);
        memcpy(boxes + 4 * j, box, sizeof box);
    }
}

/* Number of rectangles; `found` holds (height * (width / 2 + 1), 4), `open` twice (width / 2 + 1):
 * those that a row may go on with, and those of the row itself. */
int kmpc_rectangles(int height, int width, const unsigned char *cells, int *open, int *found)
{
    const int most = width / 2 + 1;
    int count = 0, before = 0, *old = open, *new = open + most;
    for (int row = 0; row < height; row++, cells += width) {
        int now = 0, next = 0;
        for (int left = 0, right; left < width; left = right + 1) {
            while (left < width && !cells[left])
                left++;
            for (right = left; right < width && cells[right];)
                right++;
            if (left == right)
                break;
            while (next < before && found[4 * old[next]] < left)
                next++;
            int *own = found + 4 * (next < before ? old[next] : count);
            if (next < before && own[0] == left && own[2] == right) {
                own[3] = row + 1;
                new[now++] = old[next++];
                continue;
            }
            own = found + 4 * count;
            own[0] = left;
            own[1] = row;
            own[2] = right;
            own[3] = row + 1;
            new[now++] = count++;
        }
        int *other = old;
        old = new;
        new = other;
        before = now;
    }
    sort(count, found);
    return count;
}
