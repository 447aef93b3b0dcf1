/* Margins of a plan: how far a robot spreads around it, from its speed, and between its samples. */
#include "kernels.h"

#include <math.h>
#include <string.h>

enum { MEMORY = 8, COLUMNS = 6 };
static const real FORWARD = R(0.5), LATERAL = R(0.2), TURN = R(0.5), STILL = R(0.03);

/* out (3, n) = a (3, 3) b (3, n); `out` is neither. */
static void product(const real *a, const real *b, int n, real *out)
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < n; j++)
            out[i * n + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[n + j] + a[3 * i + 2] * b[2 * n + j];
}

/* sum (3, 3) += f f' of columns f (3, COLUMNS) */
static void add_square(const real *f, real *sum)
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < COLUMNS; k++)
                sum[3 * i + j] += f[i * COLUMNS + k] * f[j * COLUMNS + k];
}

/* c = a c a' of a covariance (3, 3) */
static void carry(const real *a, real *c)
{
    real half[9], turned[9];
    product(a, c, 3, half);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            turned[3 * i + j] = half[3 * j + i];
    product(a, turned, 3, c);
}

/* Jacobian (3, 3) of a step under the feedback that later steps give. */
static void closed_loop(const real *by_x, real c, real s, real *out)
{
    const real drift = c * by_x[5] - s * by_x[2];
    const real gain = LATERAL * drift / (drift * drift + STILL * STILL);
    memcpy(out, by_x, 9 * sizeof(real));
    out[0] -= FORWARD * c * c;
    out[1] -= FORWARD * c * s;
    out[3] -= FORWARD * s * c;
    out[4] -= FORWARD * s * s;
    out[6] += gain * s;
    out[7] -= gain * c;
    out[8] -= TURN;
}

/* What periods add, carried on through the later ones: columns (3, n), or a covariance where n is 0.
 * Feedback takes back what is older than its delay, and has forgotten what is older still. */
struct carried {
    int columns, delay;
    real part[3 * COLUMNS * KMPC_HORIZON]; /* of each period */
};

/* Sum at the end of period k, which adds some; periods are asked for in turn. */
static void after(struct carried *c, int k, const real *by_x, const real *steered,
                  const real *added, real *sum)
{
    const int size = c->columns ? 3 * c->columns : 9, oldest = k - c->delay - MEMORY + 1;
    memcpy(c->part + size * k, added, (size_t)size * sizeof(real));
    memcpy(sum, added, (size_t)size * sizeof(real));
    for (int from = oldest > 0 ? oldest : 0; from < k; from++) {
        const real *step = k - from <= c->delay ? by_x : steered;
        real *part = c->part + size * from, moved[3 * COLUMNS];
        if (c->columns) {
            product(step, part, c->columns, moved);
            memcpy(part, moved, (size_t)size * sizeof(real));
        } else {
            carry(step, part);
        }
        for (int i = 0; i < size; i++)
            sum[i] += part[i];
    }
}

/* Covariances (stages, 3, 3) of the pose at stages 1 to N. */
static void spread(const struct kmpc_noise *noise, int stages, const real *by_x,
                   const real *states, const real *inputs, real *covariance)
{
    struct carried white, lasting;
    int lasts = white.columns = 0;
    lasting.columns = COLUMNS, white.delay = lasting.delay = noise->delay;
    for (int i = 0; i < COLUMNS; i++)
        lasts |= noise->lasting[i] > 0;
    for (int k = 0; k < stages; k++, by_x += 9, states += 3, inputs += 2, covariance += 9) {
        const real c = M(cos)(states[2]), s = M(sin)(states[2]);
        const real turned[9] = {c, -s, 0, s, c, 0, 0, 0, 1};
        const real squares[2] = {inputs[0] * inputs[0], inputs[1] * inputs[1]};
        real steered[9], own[9], pose[9], columns[3 * COLUMNS], together[3 * COLUMNS];
        closed_loop(by_x, c, s, steered);
        for (int i = 0; i < 9; i++) {
            own[i] = squares[0] * noise->white[i] + squares[1] * noise->white[9 + i];
            pose[i] = noise->pose[i] + squares[0] * noise->pose_speed[i];
        }
        carry(turned, own);
        carry(turned, pose);
        after(&white, k, by_x, steered, own, covariance);
        for (int i = 0; i < 9; i++)
            covariance[i] += pose[i];
        if (!lasts)
            continue;
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < COLUMNS; j++)
                columns[COLUMNS * i + j] = turned[3 * i + j % 3] * noise->lasting[j] * inputs[j / 3];
        after(&lasting, k, by_x, steered, columns, together);
        add_square(together, covariance);
    }
}

/* How far the path between samples may come nearer than they are; each ends a chord and begins the
 * next, but the last. */
static real between_samples(const struct kmpc_noise *noise, const real *states, int last)
{
    real square = 0, bulge = 0;
    for (int k = 0; k < (last ? 1 : 2); k++, states += 3) {
        const real dx = states[3] - states[0], dy = states[4] - states[1];
        const real turn = M(fabs)(states[5] - states[2]);
        const real length = M(sqrt)(dx * dx + dy * dy) + noise->reach * turn;
        square = length * length / 4 > square ? length * length / 4 : square;
        bulge = length * turn / 8 > bulge ? length * turn / 8 : bulge;
    }
    const real beyond = noise->touch + bulge;
    return M(sqrt)(beyond * beyond + square) - noise->touch;
}

/* Margins towards normals [m]: of the first `columns` of each row (stages, row). */
void kmpc_tube_margins(const struct kmpc_noise *noise, int stages, int columns, int row,
                       int directions, const real *by_x, const real *states, const real *inputs,
                       const real *all_normals, const real *path_clearance, real *all_margins)
{
    real covariance[9 * KMPC_HORIZON];
    if (noise->spreads)
        spread(noise, stages, by_x, states, inputs, covariance);
    for (int k = 0; k < stages; k++) {
        const real chords =
            between_samples(noise, states + 3 * k, k + 1 == stages) + noise->solver_margin;
        real least = M(fabs)(inputs[2 * k]) * noise->headway_time;
        if (path_clearance[k] < least)
            least = path_clearance[k];
        const real *normals = all_normals + k * row * directions;
        real *margins = all_margins + k * row;
        for (int j = 0; j < columns; j++, margins++, normals += directions) {
            *margins = least;
            if (noise->spreads) {
                real variance = 0;
                for (int a = 0; a < directions; a++)
                    for (int b = 0; b < directions; b++)
                        variance += normals[a] * covariance[9 * k + 3 * a + b] * normals[b];
                const real kept = noise->quantile * M(sqrt)(variance > 0 ? variance : 0);
                if (kept > least)
                    *margins = kept;
            }
            *margins += chords;
        }
    }
}
