/* Circles that are followed: a Kalman filter of many, and which is seen as which. */
#include "kernels.h"

#include <math.h>

enum { STATES = 5, COVARIANCE = 5, RADIUS = 30, GIVEN = 31, MOVING = 33, SEEN = 34, UNSEEN = 35,
       SOURCE = 38 };

static real sinc(real angle)
{
    return angle == 0 ? 1 : M(sin)(angle) / angle;
}

static void product(const real *a, const real *b, int transposed, real *out)
{
    for (int i = 0; i < STATES; i++)
        for (int j = 0; j < STATES; j++) {
            real sum = 0;
            for (int k = 0; k < STATES; k++)
                sum += a[STATES * i + k] * b[transposed ? STATES * j + k : STATES * k + j];
            out[STATES * i + j] = sum;
        }
}

/* State and covariance a period later. */
static void predict(const struct kmpc_walk *w, real fading, real *x, real *covariance)
{
    const real angle = w->dt * x[4], cosine = M(cos)(angle), sine = M(sin)(angle);
    const real half = sinc(R(0.5) * angle), dt = w->dt;
    const real ahead = dt * sinc(angle), aside = R(0.5) * dt * angle * half * half;
    const real vx = cosine * x[2] - sine * x[3], vy = sine * x[2] + cosine * x[3];
    real change[STATES * STATES] = {
        1, 0, ahead,  -aside, R(-0.5) * dt * dt * vy,
        0, 1, aside,  ahead,  R(0.5) * dt * dt * vx,
        0, 0, cosine, -sine,  -dt * vy,
        0, 0, sine,   cosine, dt * vx,
        0, 0, 0,      0,      fading,
    };
    real half_way[STATES * STATES];
    x[0] += ahead * x[2] - aside * x[3];
    x[1] += ahead * x[3] + aside * x[2];
    x[2] = vx;
    x[3] = vy;
    x[4] *= fading;
    product(change, covariance, 0, half_way);
    product(half_way, change, 1, covariance);
    const real pushed = w->acceleration * w->acceleration;
    for (int axis = 0; axis < 2; axis++) {
        real *own = covariance + (STATES + 1) * axis;
        own[0] += pushed * R(0.25) * dt * dt * dt * dt;
        own[2] += pushed * R(0.5) * dt * dt * dt;
        own[2 * STATES] += pushed * R(0.5) * dt * dt * dt;
        own[2 * STATES + 2] += pushed * dt * dt;
    }
    covariance[24] += (1 - fading * fading) * w->turning * w->turning;
}

/* What turned round may have any velocity of the same pace. */
static void turn_round(const struct kmpc_walk *w, real *covariance)
{
    const real other = w->other * w->other;
    for (int axis = 0; axis < 2; axis++) {
        real *own = covariance + (STATES + 1) * axis;
        own[0] += other * w->dt * w->dt;
        own[2] += other * w->dt;
        own[2 * STATES] += other * w->dt;
        own[2 * STATES + 2] += other;
    }
}

static real square(real a, real b, real d, real x, real y)
{
    return (d * x * x - 2 * b * x * y + a * y * y) / (a * d - b * b);
}

/* Cost of the pair of a track and a circle, infinite beyond the gate; and its square. */
static real cost_of(const struct kmpc_walk *w, const real *x, const real *covariance, real more,
                    const real *circle, real *squared)
{
    const real noise = w->noise * w->noise + more;
    const real a = covariance[0] + noise, b = covariance[1], d = covariance[6] + noise;
    *squared = square(a, b, d, circle[0] - x[0], circle[1] - x[1]);
    return *squared <= w->gate ? *squared + M(log)(a * d - b * b) : (real)INFINITY;
}

static void update(const struct kmpc_walk *w, const real *circle, real *x, real *covariance)
{
    const real noise = w->noise * w->noise;
    const real a = covariance[0] + noise, b = covariance[1], d = covariance[6] + noise;
    const real size = a * d - b * b, off_x = circle[0] - x[0], off_y = circle[1] - x[1];
    real gain[STATES][2], kept[STATES * STATES] = {0}, half_way[STATES * STATES];
    for (int i = 0; i < STATES; i++) {
        const real *row = covariance + STATES * i;
        gain[i][0] = (row[0] * d - row[1] * b) / size;
        gain[i][1] = (row[1] * a - row[0] * b) / size;
        kept[STATES * i + i] = 1;
        kept[STATES * i] -= gain[i][0];
        kept[STATES * i + 1] -= gain[i][1];
    }
    /* Joseph's form: symmetric and positive whatever is rounded */
    product(kept, covariance, 0, half_way);
    product(half_way, kept, 1, covariance);
    for (int i = 0; i < STATES; i++) {
        x[i] += gain[i][0] * off_x + gain[i][1] * off_y;
        for (int j = 0; j < STATES; j++)
            covariance[STATES * i + j] +=
                noise * (gain[i][0] * gain[j][0] + gain[i][1] * gain[j][1]);
    }
}

/* Give a row that has no column one, along the shortest path of reduced costs. */
static void augment(int rows, int columns, const real *costs, real alone, int begin,
                    struct kmpc_pairs *p)
{
    const int total = rows + columns;
    int row = begin, column = -1;
    real so_far = 0;
    for (int j = 0; j < total; j++) {
        p->shortest[j] = (real)INFINITY;
        p->before[j] = -1;
        p->done[j] = 0;
    }
    for (;;) {
        int nearest = -1;
        for (int j = 0; j < total; j++) {
            if (p->done[j])
                continue;
            if (j < columns || j == columns + row) {
                const real cost = j < columns ? costs[(long)row * columns + j] : alone;
                const real found = cost + (so_far - p->row_price[row]) - p->column_price[j];
                if (found < p->shortest[j]) {
                    p->shortest[j] = found;
                    p->before[j] = row;
                }
            }
            if (nearest < 0 || p->shortest[j] < p->shortest[nearest])
                nearest = j;
        }
        column = nearest;
        so_far = p->shortest[column];
        p->done[column] = 1;
        if (p->row_of[column] < 0)
            break;
        row = p->row_of[column];
    }
    p->row_price[begin] += so_far;
    for (int j = 0; j < total; j++)
        if (p->done[j]) {
            if (j != column)
                p->row_price[p->row_of[j]] += so_far - p->shortest[j];
            p->column_price[j] -= so_far - p->shortest[j];
        }
    for (row = -1; row != begin;) {
        row = p->before[column];
        p->row_of[column] = row;
        const int other = p->of_row[row];
        p->of_row[row] = column;
        column = other;
    }
}

static int is_finite(real value)
{
    return value > -(real)INFINITY && value < (real)INFINITY;
}

/* Column of each row at the least total cost; `columns` and more: it stays alone. */
static void assign(int rows, int columns, real *costs, struct kmpc_pairs *p)
{
    real least = (real)INFINITY, most = -(real)INFINITY;
    for (long i = 0; i < (long)rows * columns; i++)
        if (is_finite(costs[i])) {
            least = costs[i] < least ? costs[i] : least;
            most = costs[i] > most ? costs[i] : most;
        }
    /* to stay alone costs more than all the rest together */
    const real alone = least <= most ? (most - least + 1) * (rows + 1) : 1;
    for (long i = 0; i < (long)rows * columns; i++)
        costs[i] = is_finite(costs[i]) ? costs[i] - least : (real)INFINITY;
    for (int j = 0; j < rows + columns; j++) {
        p->row_of[j] = -1;
        p->column_price[j] = 0;
    }
    for (int i = 0; i < rows; i++) {
        /* each takes its favourite that is left; most have one of their own */
        const real *own = costs + (long)i * columns;
        int favourite = 0;
        for (int j = 1; j < columns; j++)
            if (own[j] < own[favourite])
                favourite = j;
        const int pairs = columns > 0 && own[favourite] <= alone;
        p->row_price[i] = pairs ? own[favourite] : alone;
        favourite = pairs ? favourite : columns + i;
        p->of_row[i] = p->row_of[favourite] < 0 ? favourite : -1;
        if (p->of_row[i] >= 0)
            p->row_of[favourite] = i;
    }
    for (int i = 0; i < rows; i++)
        if (p->of_row[i] < 0)
            augment(rows, columns, costs, alone, i, p);
}

void kmpc_follow(const struct kmpc_walk *w, int tracks, int circles, const real *circle,
                 const real *source, struct kmpc_pairs *p, real *costs, real *after, int *found)
{
    const real fading = M(exp)(-w->dt / w->memory);
    const real round = w->other * w->other * w->dt * w->dt;
    for (int i = 0; i < tracks; i++) {
        real *track = after + KMPC_TRACK * i, *covariance = track + COVARIANCE, squared;
        predict(w, fading, track, covariance);
        for (int j = 0; j < circles; j++) {
            const real *at = circle + KMPC_CIRCLE * j;
            const real steady = cost_of(w, track, covariance, 0, at, &squared);
            const real wide = cost_of(w, track, covariance, round, at, &squared);
            const real least = steady < wide ? steady : wide;
            costs[(long)i * circles + j] =
                track[SOURCE] == source[j] ? least : (real)INFINITY;
        }
    }
    assign(tracks, circles, costs, p);
    for (int j = 0; j < circles; j++)
        found[j] = -1;
    for (int i = 0; i < tracks; i++) {
        real *track = after + KMPC_TRACK * i, *covariance = track + COVARIANCE, squared;
        const int j = p->of_row[i];
        int moved = 0;
        track[SEEN] += w->dt;
        track[UNSEEN] += w->dt;
        if (j < circles) {
            const real *at = circle + KMPC_CIRCLE * j;
            found[j] = i;
            cost_of(w, track, covariance, 0, at, &squared);
            if (squared > w->gate) { /* who turns on the spot moves on */
                moved = track[MOVING] > 0;
                turn_round(w, covariance);
            }
            update(w, at, track, covariance);
            track[UNSEEN] = 0;
            track[RADIUS] = at[2];
            track[GIVEN] = at[3];
            track[GIVEN + 1] = at[4];
        }
        /* two sightings may be two circles */
        const real differs = square(covariance[12], covariance[13], covariance[18],
                                    track[2] - track[GIVEN], track[3] - track[GIVEN + 1]);
        track[MOVING] = moved || (track[SEEN] > R(1.5) * w->dt && differs > w->chance);
    }
}
