/* Margins of a plan: how far a robot spreads around it, from its speed, and between its samples. */
#include "kernels.h"

#include <math.h>
#include <string.h>

enum { MEMORY = 8, COLUMNS = 3 * KMPC_INPUTS };
static const real FORWARD = R(0.5), LATERAL = R(0.2), TURN = R(0.5), STILL = R(0.03);

/* out (3, n) = a (3, 3) b (3, n); `out` is neither. */
static void product(const real *a, const real *b, int n, real *out)
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < n; j++)
            out[i * n + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[n + j] + a[3 * i + 2] * b[2 * n + j];
}

/* sum (3, 3) += f f' of a factor (3, n) */
static void add_square(const real *f, int n, real *sum)
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < n; k++)
                sum[3 * i + j] += f[i * n + k] * f[j * n + k];
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

/* Noise of a period: factors (3, 3 m), each three columns times their command, turned by R. */
static void period_noise(const real *factors, int inputs, const real *u, const real *turned,
                         real *out)
{
    const int n = 3 * inputs;
    real scaled[3 * COLUMNS];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < n; j++)
            scaled[i * n + j] = factors[i * n + j] * u[j / 3];
    product(turned, scaled, n, out);
}

/* What older periods have left at a stage: graduated covariances, or columns, moved on. */
static void add_old(const real *steered, const real *graduated, int stage, int columns, real *sum)
{
    real moved[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, next[9], part[3 * COLUMNS];
    for (int back = 0; back < MEMORY && back <= stage; back++) {
        const real *from = graduated + (stage - back) * 3 * columns;
        product(moved, from, columns, part);
        for (int i = 0; i < 3 * columns; i++)
            sum[i] += part[i];
        product(moved, steered + 9 * (stage - back), 3, next);
        memcpy(moved, next, sizeof(next));
    }
}

static void add_old_squares(const real *steered, const real *graduated, int stage, real *sum)
{
    real moved[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, next[9];
    for (int back = 0; back < MEMORY && back <= stage; back++) {
        real part[9];
        memcpy(part, graduated + 9 * (stage - back), sizeof(part));
        carry(moved, part);
        for (int i = 0; i < 9; i++)
            sum[i] += part[i];
        product(moved, steered + 9 * (stage - back), 3, next);
        memcpy(moved, next, sizeof(next));
    }
}

/* Covariances (stages, 3, 3) of the pose at stages 1 to N. */
static void spread(const struct kmpc_noise *noise, int stages, const real *by_x,
                   const real *states, const real *inputs, real *covariance)
{
    const int m = noise->inputs, columns = 3 * m;
    static const int most = KMPC_HORIZON;
    real steered[9 * KMPC_HORIZON], turned[9 * KMPC_HORIZON];
    real graduated[9 * KMPC_HORIZON], lasting[3 * COLUMNS * KMPC_HORIZON];
    if (stages > most)
        stages = most;
    memset(graduated, 0, sizeof(graduated));
    memset(lasting, 0, sizeof(lasting));
    memset(covariance, 0, 9 * (size_t)stages * sizeof(real));
    for (int k = 0; k < stages; k++) {
        const real c = M(cos)(states[3 * k + 2]), s = M(sin)(states[3 * k + 2]);
        const real rotation[9] = {c, -s, 0, s, c, 0, 0, 0, 1};
        memcpy(turned + 9 * k, rotation, sizeof(rotation));
        closed_loop(by_x + 9 * k, c, s, steered + 9 * k);
    }
    /* each period's noise, carried on without feedback until that acts */
    for (int from = 0; from < stages; from++) {
        real fresh[9] = {0}, columns_of[3 * COLUMNS], next[3 * COLUMNS];
        period_noise(noise->white, m, inputs + m * from, turned + 9 * from, columns_of);
        add_square(columns_of, columns, fresh);
        for (int age = 0; from + age < stages; age++) {
            const int stage = from + age;
            if (age)
                carry(by_x + 9 * stage, fresh);
            if (age == noise->delay) {
                memcpy(graduated + 9 * stage, fresh, sizeof(fresh));
                break;
            }
            for (int i = 0; i < 9; i++)
                covariance[9 * stage + i] += fresh[i];
        }
        if (!noise->lasting)
            continue;
        period_noise(noise->lasting, m, inputs + m * from, turned + 9 * from, columns_of);
        for (int age = 0; from + age < stages && age <= noise->delay; age++) {
            const int stage = from + age;
            if (age) {
                product(by_x + 9 * stage, columns_of, columns, next);
                memcpy(columns_of, next, 3 * (size_t)columns * sizeof(real));
            }
            if (age == noise->delay)
                memcpy(lasting + 3 * columns * stage, columns_of,
                       3 * (size_t)columns * sizeof(real));
        }
    }
    for (int k = 0; k < stages; k++) {
        real *sum = covariance + 9 * k, part[9];
        add_old_squares(steered, graduated, k, sum);
        if (noise->lasting) {
            real together[3 * COLUMNS] = {0}, young[3 * COLUMNS], next[3 * COLUMNS];
            add_old(steered, lasting, k, columns, together);
            for (int age = 0; age < noise->delay && age <= k; age++) {
                period_noise(noise->lasting, m, inputs + m * (k - age), turned + 9 * (k - age),
                             young);
                for (int stage = k - age + 1; stage <= k; stage++) {
                    product(by_x + 9 * stage, young, columns, next);
                    memcpy(young, next, 3 * (size_t)columns * sizeof(real));
                }
                for (int i = 0; i < 3 * columns; i++)
                    together[i] += young[i];
            }
            add_square(together, columns, sum);
        }
        product(turned + 9 * k, noise->pose, 3, part);
        add_square(part, 3, sum);
        if (noise->pose_speed) {
            product(turned + 9 * k, noise->pose_speed, 3, part);
            for (int i = 0; i < 9; i++)
                part[i] *= inputs[m * k];
            add_square(part, 3, sum);
        }
    }
}

/* How far the path between samples may come nearer than they are: of one chord. */
static void chord(const struct kmpc_noise *noise, const real *states, real *square, real *bulge)
{
    const real dx = states[3] - states[0], dy = states[4] - states[1];
    const real turn = M(fabs)(states[5] - states[2]);
    const real length = M(sqrt)(dx * dx + dy * dy) + noise->reach * turn;
    *bulge = length * turn / 8;
    *square = length * length / 4;
}

static real between_samples(const struct kmpc_noise *noise, const real *states, int last)
{
    real square, bulge;
    chord(noise, states, &square, &bulge);
    if (!last) { /* a sample ends one chord and begins the next */
        real next_square, next_bulge;
        chord(noise, states + 3, &next_square, &next_bulge);
        square = square > next_square ? square : next_square;
        bulge = bulge > next_bulge ? bulge : next_bulge;
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
        real least = M(fabs)(inputs[noise->inputs * k]) * noise->headway_time;
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
