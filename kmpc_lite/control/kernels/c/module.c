/* The kernels as a Python module: buffers in, numbers written in place.
 *
 * kernels/library.py calls these, with the arrays first, those that are written
 * made there; then the numbers. Sizes are checked here, so that no kernel ever leaves an array. The
 * limited API keeps one build good for all Pythons.
 */
#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030b0000
#include <Python.h>
#include <stdarg.h>
#include <string.h>

#include "kernels.h"

#pragma GCC diagnostic ignored "-Wunused-parameter" /* some kernels take no numbers */

static long reals(const Py_buffer *buffer)
{
    return (long)(buffer->len / (Py_ssize_t)sizeof(real));
}

/* Whether arrays hold so many numbers, each given as long: r reals, i ints, l longs, f floats, b
 * bytes; o reals or none at all; - any. */
static int fit(const Py_buffer *b, const char *kinds, ...)
{
    va_list counts;
    int fits = 1;
    va_start(counts, kinds);
    for (; *kinds; kinds++, b++) {
        size_t each = 1;
        if (*kinds == '-')
            continue;
        if (strchr("ro", *kinds))
            each = sizeof(real);
        else if (*kinds != 'b')
            each = *kinds == 'l' ? sizeof(long) : *kinds == 'i' ? sizeof(int) : sizeof(float);
        const long count = va_arg(counts, long);
        fits = fits && count >= 0 &&
               (b->len == (Py_ssize_t)each * count || (*kinds == 'o' && !b->len));
    }
    va_end(counts);
    return fits;
}

/* Commands, ages, groups, terms of a group, stages and whether it is steered, then which terms; and
 * all reals of the struct, in its order. */
static int predictor_of(struct kmpc_predictor *p, const Py_buffer *layout, const Py_buffer *numbers)
{
    if (layout->len < 6 * (Py_ssize_t)sizeof(int))
        return 0;
    const int *n = layout->buf;
    const long m = n[0], ages = n[1], groups = n[2], terms = n[3], nodes = n[4];
    if ((m != 2 && m != 3) || ages < 1 || groups < 1 || terms < 1 || nodes < 1 ||
        !fit(layout, "ir", 6 + terms,
             groups * ages * m + 2 * m + 3 * groups * terms + 2 * nodes + 3 + m))
        return 0;
    const real *kernel = numbers->buf, *smoothing = kernel + groups * ages * m;
    const real *motion = smoothing + 2 * m, *node = motion + 3 * groups * terms;
    const real *state = node + 2 * nodes;
    *p = (struct kmpc_predictor){(int)m, n[1], n[2], n[3], n[4], n[5], n + 6, kernel, smoothing,
                                 smoothing + m, motion, node, state, state + 3};
    for (int i = 0; i < terms; i++)
        if (p->term[i] < 0 || p->term[i] >= kmpc_terms((int)m))
            return 0;
    return 1;
}

static int rollout(Py_buffer *b, const double *n) /* layout, numbers, x0, u, past, states */
{
    struct kmpc_predictor p;
    const long periods = (long)n[0], count = periods >= 0 ? reals(b + 5) / (3 * (periods + 1)) : 0;
    if (!predictor_of(&p, b, b + 1))
        return 0;
    /* many may begin at one pose, after the same commands */
    const long before = (p.ages - 1L) * p.commands, each = periods * p.commands;
    const long x = reals(b + 2) == 3 ? 0 : 3, past = reals(b + 4) == before ? 0 : before;
    if (periods < 0 || !fit(b + 2, "rror", x ? x * count : 3, count * each,
                            past ? past * count : before, 3 * count * (periods + 1)))
        return 0;
    for (long i = 0; i < count; i++)
        kmpc_rollout(&p, (int)periods, (int)periods, (real *)b[2].buf + x * i,
                     (real *)b[3].buf + each * i, b[4].len ? (real *)b[4].buf + past * i : NULL,
                     (real *)b[5].buf + 3 * i * (periods + 1));
    return 1;
}

/* layout, numbers, x, u, past, value, by x, by u, by past */
static int linearize(Py_buffer *b, const double *n)
{
    struct kmpc_predictor p;
    const long count = reals(b + 2) / 3;
    if (!predictor_of(&p, b, b + 1))
        return 0;
    const long m = p.commands, before = (p.ages - 1L) * m;
    if (!fit(b + 2, "rrorrrr", 3 * count, m * count, before * count, 3 * count, 9 * count,
             3 * m * count, 3 * before * count))
        return 0;
    for (long k = 0; k < count; k++) {
        const struct kmpc_sent sent = {(real *)b[3].buf + k * m,
                                       b[4].len ? (real *)b[4].buf + k * before : NULL, 0, 0};
        kmpc_linearize(&p, (real *)b[2].buf + 3 * k, &sent, (real *)b[5].buf + 3 * k,
                       (real *)b[6].buf + 9 * k, (real *)b[7].buf + 3 * m * k,
                       (real *)b[8].buf + 3 * before * k);
    }
    return 1;
}

static int distances(Py_buffer *b, const double *n) /* things, points, times, distance */
{
    const int motions = (int)n[0], sampled = (int)n[1], places = (int)n[2];
    const long things = reals(b) / KMPC_THING, samples = reals(b + 2);
    const long cells = (long)motions * places;
    if ((sampled != 1 && sampled != samples) ||
        !fit(b, "rrrr", KMPC_THING * things, 2 * cells * sampled, samples, cells * samples * things))
        return 0;
    kmpc_distances((int)things, b[0].buf, motions, (int)samples, places, sampled, b[1].buf,
                   b[2].buf, b[3].buf);
    return 1;
}

static int box_distances(Py_buffer *b, const double *n) /* low, high, points, least */
{
    const long boxes = reals(b) / 2, count = reals(b + 3);
    if (boxes < 1 || !fit(b, "rrr", 2 * boxes, 2 * boxes, 2 * count))
        return 0;
    kmpc_box_distances((int)boxes, b[0].buf, b[1].buf, (int)count, b[2].buf, b[3].buf);
    return 1;
}

/* low, high, points, room, chosen, distance, normals */
static int nearest_boxes(Py_buffer *b, const double *n)
{
    const int columns = (int)n[1];
    const long boxes = reals(b) / 2, count = reals(b + 2) / 2, cells = count * columns;
    if (columns < 1 || columns > boxes ||
        !fit(b, "rrrrlrr", 2 * boxes, 2 * boxes, 2 * count, 4 * boxes, cells, cells, 2 * cells))
        return 0;
    kmpc_nearest_boxes((int)boxes, b[0].buf, b[1].buf, (int)count, b[2].buf, n[0], columns,
                       b[3].buf, b[4].buf, b[5].buf, b[6].buf);
    return 1;
}

/* Noise of a plan: white, lasting, pose and pose by speed; numbers from the delay on. */
static int noise_of(struct kmpc_noise *noise, const Py_buffer *b, const double *n)
{
    *noise = (struct kmpc_noise){(int)n[0], b[0].buf, b[1].buf, b[2].buf, b[3].buf, n[1],
                                 n[2],      n[3],     n[4],     n[5],     n[6] != 0.0};
    return n[0] >= 0.0 && fit(b, "rrrr", 18L, 6L, 9L, 9L);
}

/* Whether the arrays of a pass have the sizes that go with each other. */
static int pass_fits(const Py_buffer *b, const struct kmpc_layout *size,
                     const struct kmpc_keep_out *keep, int tightens)
{
    const long n = size->stages, m = size->inputs, slots = size->slots, past = size->history;
    const long points = n * keep->places, cells = points * keep->solids, turns = keep->directions;
    long written = 9 * (n - 1) + n * slots * size->directions;
    for (long j = 0; j <= past && j < n; j++)
        written += 3 * m * (n - j);
    int fits = fit(b, "rrrrrrrrrrrrri-rrrrrrr", 3 * n, 9 * n, 3 * m * n, 3 * m * n * past,
                   3 * (n + 1), m * n, 3 * (n + 1), KMPC_THING * (long)keep->things, 2 * points,
                   cells, turns * cells, 2L * keep->sides, (long)keep->sides, written, 3 * n, 3 * n,
                   n * slots, 3 * n, (3 + m + 1) * n, 9L, 9L) &&
               fit(b + 29, "r", n - 1) && reals(b + 22) >= kmpc_fill_room(size, kmpc_kinds(keep));
    if (tightens) /* speeds, path clearance */
        fits = fits && n <= KMPC_HORIZON && fit(b + 23, "rr", 2 * n, n);
    const int *places = b[13].buf;
    for (long i = 0; fits && i < written; i++)
        fits = places[i] >= 0 && places[i] < reals(b + 14);
    return fits;
}

static int fill(Py_buffer *b, const double *n) /* in the order of kernels/library.py */
{
    const int stages = (int)n[0], places = (int)n[4], directions = (int)n[3];
    const int tightens = n[10] != 0.0;
    if (stages < 1 || places < 1 || n[1] < 0.0 || n[2] < 1.0 ||
        (directions != 2 && directions != 3))
        return 0;
    const struct kmpc_layout size = {stages, (int)(reals(b + 5) / stages), (int)n[1], (int)n[2],
                                     directions, n[5], n[6]};
    const int things = (int)(reals(b + 7) / KMPC_THING);
    const int solids = (int)(reals(b + 9) / stages / places);
    const struct kmpc_keep_out keep = {
        places, things, solids, (int)reals(b + 12), directions, b[7].buf, b[8].buf,
        b[9].buf, b[10].buf, b[11].buf, b[12].buf, n[7], n[8], n[9]};
    if (!pass_fits(b, &size, &keep, tightens))
        return 0;
    const struct kmpc_pass plan = {b[4].buf, b[5].buf, b[6].buf, b[0].buf, b[1].buf, b[2].buf,
                                   b[3].buf, b[20].buf, b[21].buf, n[21], n[22] != 0.0};
    const struct kmpc_qp qp = {b[13].buf, b[14].buf, b[15].buf, b[16].buf,
                               b[17].buf, b[18].buf, b[19].buf, b[29].buf};
    struct kmpc_plan_margins tight = {.speeds = b[23].buf, .path_clearance = b[24].buf,
                                      .widest = n[18], .far_clearance = n[19], .side_margin = n[20]};
    if (tightens && !noise_of(&tight.noise, b + 25, n + 11))
        return 0;
    kmpc_fill(&size, &keep, tightens ? &tight : NULL, &plan, &qp, b[22].buf);
    return 1;
}

/* by x, states, inputs, normals, path clearance, noise, margins */
static int tube_margins(Py_buffer *b, const double *n)
{
    struct kmpc_noise noise;
    const long turns = (long)n[0], stages = reals(b + 4), columns = stages ? reals(b + 9) / stages : 0;
    if ((turns != 2 && turns != 3) || stages > KMPC_HORIZON || !noise_of(&noise, b + 5, n + 1) ||
        !fit(b, "rrrrr----r", 9 * stages, 3 * (stages + 1), 2 * stages, turns * stages * columns,
             stages, stages * columns))
        return 0;
    kmpc_tube_margins(&noise, (int)stages, (int)columns, (int)columns, (int)turns, b[0].buf,
                      b[1].buf, b[2].buf, b[3].buf, b[4].buf, b[9].buf);
    return 1;
}

/* distances, turns, position, heading, errors */
static int stop_errors(Py_buffer *b, const double *n)
{
    const long periods = (long)n[0], motions = periods > 0 ? reals(b) / periods : 0;
    const long all = motions * periods;
    if (!fit(b, "rrrrr", all, all, 4L, 4L, all))
        return 0;
    kmpc_stop_errors((int)motions, (int)periods, n[1], b[0].buf, b[1].buf, b[2].buf, b[3].buf, n[2],
                     n[3], n[4], b[4].buf);
    return 1;
}

/* step, faster, slower, inputs, hardest, commands, kinds, count and periods */
static int candidates(Py_buffer *b, const double *n)
{
    const long m = reals(b), stages = m ? reals(b + 3) / m : 0;
    const struct kmpc_brakes brakes = {(int)m, (int)n[1], b[0].buf, b[1].buf, b[2].buf, n[0]};
    struct kmpc_batch batch = {&brakes, b[3].buf, (int)stages, (int)n[2], n[3] != 0, n[4] != 0,
                               0,       0,        0,           {{0}}};
    struct kmpc_tried *kinds = b[6].buf;
    if (m < 2 || m > KMPC_INPUTS || stages <= n[2] || !(n[1] >= 1.0) || !(n[2] >= 0.0) ||
        !fit(b, "rrrrr--i", m, m, m, m * stages, m, 2L))
        return 0;
    kmpc_candidates(&batch, b[4].buf);
    const long each = batch.periods * m;
    if (reals(b + 5) < batch.count * each || b[6].len < batch.count * (long)sizeof(*kinds))
        return 0;
    for (int i = 0; i < batch.count; i++)
        kmpc_candidate(&batch, i, (real *)b[5].buf + i * each, kinds + i);
    ((int *)b[7].buf)[0] = batch.count;
    ((int *)b[7].buf)[1] = batch.periods;
    return 1;
}

static int samples(Py_buffer *b, const double *n) /* states, poses */
{
    const long motions = (long)n[0], count = (long)n[1];
    const long periods = motions > 0 ? reals(b) / (3 * motions) - 1 : -1;
    if (count < 1 || !fit(b, "rr", 3 * motions * (periods + 1), 3 * motions * periods * count))
        return 0;
    kmpc_samples((int)motions, (int)periods, (int)count, b[0].buf, b[1].buf);
    return 1;
}

static int between_samples(Py_buffer *b, const double *n) /* clearance, standing, at, begin, out */
{
    const long motions = (long)n[0], places = reals(b + 3) / 2;
    const long samples = motions > 0 && places ? reals(b + 2) / (2 * motions * places) : 0;
    const long things = samples ? reals(b + 1) / (samples * places) : 0;
    const long row = samples * places * things;
    if (!fit(b, "rrrrr", motions * row, row, 2 * motions * samples * places, 2 * places,
             motions * row))
        return 0;
    kmpc_between_samples((int)motions, (int)samples, (int)places, (int)things, b[0].buf, b[1].buf,
                         b[2].buf, b[3].buf, n[1], b[4].buf);
    return 1;
}

/* clearance, margins, error, travel, ends, clear */
static int surely_clear(Py_buffer *b, const double *n)
{
    const long motions = reals(b + 2), samples = motions ? reals(b + 1) / motions : 0;
    const long rows = motions * samples, cells = rows ? reals(b) / rows : 0;
    if (!fit(b, "rrrrib", rows * cells, rows, motions, motions, motions, motions))
        return 0;
    kmpc_surely_clear((int)motions, (int)samples, (int)cells, b[0].buf, b[1].buf, b[2].buf,
                      b[3].buf, b[4].buf, n[0], b[5].buf);
    return 1;
}

/* clearance, standing, spend, margins, driven, error, turns, strict, ends, clear */
static int admissible(Py_buffer *b, const double *n)
{
    const long motions = (long)b[7].len, things = (long)b[6].len;
    const long samples = motions ? reals(b + 3) / motions : 0, rows = motions * samples;
    const long places = rows ? reals(b + 4) / rows : 0, row = places * things;
    if (!fit(b, "rrrrrr--ib", rows * row, samples * row, samples * row, rows, rows * places,
             motions * row, motions, motions))
        return 0;
    kmpc_admissible((int)motions, (int)samples, (int)places, (int)things, (int)n[0], b[0].buf,
                    b[1].buf, b[2].buf, b[3].buf, b[4].buf, b[5].buf, b[6].buf, b[7].buf,
                    b[8].buf, n[1], b[9].buf);
    return 1;
}

/* reach, ends, hits, clear, mount, ring, circles, count */
static int clusters(Py_buffer *b, const double *n)
{
    const long beams = reals(b);
    if (!fit(b + 1, "rbbriri", 2 * beams, beams, beams, 2L, beams, 3 * (beams / 3 + 1), 1L))
        return 0;
    const struct kmpc_ring s = {(int)beams, b[0].buf, b[1].buf, b[2].buf, b[3].buf,
                                b[4].buf, n[0], n[1], n[2]};
    *(int *)b[7].buf = kmpc_clusters(&s, b[5].buf, b[6].buf);
    return 1;
}

/* circles, sources, after, found, room, room for indices */
static int follow(Py_buffer *b, const double *n)
{
    const struct kmpc_walk walk = {n[0], n[1], n[2], n[3], n[4], n[5], n[6], n[7]};
    const long circles = reals(b + 1), tracks = reals(b + 2) / KMPC_TRACK, all = tracks + circles;
    if (!fit(b, "r-riri", KMPC_CIRCLE * circles, KMPC_TRACK * tracks, circles,
             tracks * circles + tracks + 2 * all, tracks + 3 * all))
        return 0;
    real *costs = b[4].buf, *room = costs + tracks * circles;
    int *indices = b[5].buf, *more = indices + tracks;
    struct kmpc_pairs pairs = {
        indices, more, more + all, more + 2 * all, room, room + tracks, room + tracks + all};
    kmpc_follow(&walk, (int)tracks, (int)circles, b[0].buf, b[1].buf, &pairs, costs, b[2].buf,
                b[3].buf);
    return 1;
}

/* ranges, along, counts, mount, hits, clear, reach, ends */
static int told_beams(Py_buffer *b, const double *n)
{
    const long beams = reals(b);
    if (!fit(b + 1, "rbrbbrr", 2 * beams, beams, 2L, beams, beams, beams, 2 * beams))
        return 0;
    kmpc_told_beams((int)beams, b[0].buf, b[1].buf, b[2].buf, b[3].buf, n[0], n[1], n[2],
                    b[4].buf, b[5].buf, b[6].buf, b[7].buf);
    return 1;
}

static int averaged_ranges(Py_buffer *b, const double *n) /* ranges, hits, averaged, deviations */
{
    const long beams = reals(b);
    if (!fit(b + 1, "brr", beams, beams, beams))
        return 0;
    kmpc_averaged_ranges((int)beams, b[0].buf, b[1].buf, n[0], n[1], n[2], b[2].buf, b[3].buf);
    return 1;
}

/* Cells of a map: width, side, column, row; whether its arrays are as large. */
static int cells_of(struct kmpc_cells *c, const double *n, const Py_buffer *state,
                    const Py_buffer *seen, const Py_buffer *extent, const Py_buffer *taken)
{
    const long cells = (long)state->len, width = (long)n[0], height = width > 0 ? cells / width : 0;
    *c = (struct kmpc_cells){(int)height, (int)width, (int)n[2], (int)n[3], n[1], 0.0, state->buf,
                             seen ? seen->buf : NULL, extent ? extent->buf : NULL,
                             taken ? taken->buf : NULL};
    return cells == height * width && (!seen || fit(seen, "f", cells)) &&
           (!extent || fit(extent, "f", 4 * cells)) && (!taken || fit(taken, "f", cells));
}

static int pass_rays(Py_buffer *b, const double *n) /* state, seen, extent, squares */
{
    const struct kmpc_rays r = {{n[4], n[5]}, {n[6], n[7]}, {n[8], n[9]}, {n[10], n[11]},
                                b[3].buf, n[12], n[13] != 0.0};
    struct kmpc_cells c;
    if (!cells_of(&c, n, b, b + 1, b + 2, NULL) || !fit(b + 3, "f", KMPC_DIRECTIONS + 1L))
        return 0;
    c.clock = n[14];
    kmpc_pass_rays(&c, &r);
    return 1;
}

static int mark(Py_buffer *b, const double *n) /* state, seen, extent, taken, points, errors */
{
    struct kmpc_cells c;
    const long count = reals(b + 5);
    if (!cells_of(&c, n, b, b + 1, b + 2, b + 3) || !fit(b + 4, "r", 2 * count))
        return 0;
    c.clock = n[5];
    kmpc_mark(&c, (int)count, b[4].buf, b[5].buf, (int)n[4]);
    return 1;
}

static int hit_boxes(Py_buffer *b, const double *n) /* state, extent, low, high, count */
{
    struct kmpc_cells c;
    const int w[4] = {(int)n[4], (int)n[5], (int)n[6], (int)n[7]};
    const long most = w[1] > w[0] && w[3] > w[2] ? (long)(w[1] - w[0]) * (w[3] - w[2]) : 0;
    if (!cells_of(&c, n, b, NULL, b + 1, NULL) || w[0] < 0 || w[1] > c.height || w[2] < 0 ||
        w[3] > c.width || !fit(b + 2, "rri", 2 * most, 2 * most, 1L))
        return 0;
    *(int *)b[4].buf = kmpc_hit_boxes(&c, w, b[2].buf, b[3].buf);
    return 1;
}

static int rectangles(Py_buffer *b, const double *n) /* cells, open, found, count */
{
    const int width = (int)n[0];
    const long height = width > 0 ? (long)b[0].len / width : 0, most = width / 2 + 1;
    if (!fit(b, "biii", height * width, 2 * most, 4 * height * most, 1L))
        return 0;
    *(int *)b[3].buf = kmpc_rectangles((int)height, width, b[0].buf, b[1].buf, b[2].buf);
    return 1;
}

/* `time` is that of either `step` or `braking`: no kernel looks at both. */
static int timed_of(struct kmpc_timed *path, const Py_buffer *b, real time)
{
    const int poses = (int)reals(b + 1), cusps = (int)reals(b + 2);
    *path = (struct kmpc_timed){poses, cusps, b[0].buf, b[1].buf, b[2].buf, time, time};
    return path->poses > 1 && fit(b, "r", 3L * poses);
}

static int locate(Py_buffer *b, const double *n) /* poses, times, cusps, pose, found */
{
    struct kmpc_timed path;
    if (!timed_of(&path, b, n[0]) || !fit(b + 3, "rr", 3L, 2L))
        return 0;
    kmpc_locate(&path, b[3].buf, n[1], n[2], b[4].buf);
    return 1;
}

static int along_path(Py_buffer *b, const double *n) /* poses, times, cusps, later, states */
{
    struct kmpc_timed path;
    const int count = (int)reals(b + 3);
    if (!timed_of(&path, b, n[0]) || !fit(b + 4, "r", 3L * count))
        return 0;
    kmpc_along_path(&path, count, b[3].buf, n[1], n[2], n[3], n[4] != 0.0, b[4].buf);
    return 1;
}

static int ways(Py_buffer *b, const double *n) /* usable, factor, cost, towards, room */
{
    const int width = (int)n[0], goal = (int)n[2];
    const long nodes = (long)b[0].len, height = width > 0 ? nodes / width : 0;
    if (goal < 0 || goal >= nodes ||
        !fit(b, "brrii", height * width, nodes, nodes, nodes, 2 * nodes))
        return 0;
    kmpc_ways((int)height, width, b[0].buf, b[1].buf, n[1], goal, b[2].buf, b[3].buf, b[4].buf);
    return 1;
}

enum { ARRAYS = 30, NUMBERS = 23 }; /* at most */

static const struct kernel {
    const char *name;
    int (*run)(Py_buffer *arrays, const double *numbers); /* whether their sizes fitted */
    const char *arrays;                                   /* r: read, w: written */
    int numbers;
} kernels[] = {
    {"rollout", rollout, "rrrrrw", 1},
    {"linearize", linearize, "rrrrrwwww", 0},
    {"distances", distances, "rrrw", 3},
    {"box_distances", box_distances, "rrrw", 0},
    {"nearest_boxes", nearest_boxes, "rrrwwww", 2},
    {"fill", fill, "rrrrrrrrrrrrrrwwwwwwrrwrrrrrrw", 23},
    {"tube_margins", tube_margins, "rrrrrrrrrw", 8},
    {"stop_errors", stop_errors, "rrrrw", 5},
    {"candidates", candidates, "rrrrrwww", 5},
    {"samples", samples, "rw", 2},
    {"between_samples", between_samples, "rrrrw", 2},
    {"surely_clear", surely_clear, "rrrrrw", 1},
    {"admissible", admissible, "rrrrrrrrrw", 2},
    {"clusters", clusters, "rrrrrwww", 3},
    {"follow", follow, "rrwwww", 8},
    {"told_beams", told_beams, "rrrrwwww", 3},
    {"averaged_ranges", averaged_ranges, "rrww", 3},
    {"pass_rays", pass_rays, "wwrr", 15},
    {"mark", mark, "wwwwrr", 6},
    {"hit_boxes", hit_boxes, "rrwww", 8},
    {"rectangles", rectangles, "rwww", 1},
    {"locate", locate, "rrrrw", 3},
    {"along_path", along_path, "rrrrw", 5},
    {"ways", ways, "rrwww", 3},
};

enum { KERNELS = sizeof(kernels) / sizeof(*kernels) };

/* Call a kernel; `self` is its number. */
static PyObject *call(PyObject *self, PyObject *args)
{
    const struct kernel *kernel = kernels + PyLong_AsLong(self);
    const int arrays = (int)strlen(kernel->arrays);
    Py_buffer b[ARRAYS];
    double n[NUMBERS];
    int held = 0, fits = 0;
    if (PyTuple_Size(args) != arrays + kernel->numbers)
        PyErr_Format(PyExc_TypeError, "%s: expected %d arrays and %d numbers", kernel->name, arrays,
                     kernel->numbers);
    for (; !PyErr_Occurred() && held < arrays; held++) {
        const int flags = kernel->arrays[held] == 'w' ? PyBUF_WRITABLE : PyBUF_SIMPLE;
        if (PyObject_GetBuffer(PyTuple_GetItem(args, held), b + held, flags))
            break;
    }
    for (int i = 0; !PyErr_Occurred() && i < kernel->numbers; i++)
        n[i] = PyFloat_AsDouble(PyTuple_GetItem(args, arrays + i));
    if (!PyErr_Occurred() && !(fits = kernel->run(b, n)))
        PyErr_SetString(PyExc_ValueError, "kernel: arrays whose sizes do not fit together");
    while (held)
        PyBuffer_Release(b + --held);
    return fits ? Py_NewRef(Py_None) : NULL;
}

static int add_kernels(PyObject *module)
{
    static PyMethodDef methods[KERNELS];
    for (int i = 0; i < KERNELS; i++) {
        methods[i] = (PyMethodDef){kernels[i].name, call, METH_VARARGS, NULL};
        PyObject *number = PyLong_FromLong(i);
        PyObject *function = number ? PyCFunction_New(methods + i, number) : NULL;
        Py_XDECREF(number);
        if (!function || PyModule_AddObjectRef(module, kernels[i].name, function))
            return -1;
        Py_DECREF(function);
    }
    return 0;
}

static PyModuleDef_Slot slots[] = {{Py_mod_exec, add_kernels}, {0, NULL}};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "_kernels", "The kernels in C; see kernels.h.", 0, NULL, slots, NULL,
    NULL,                  NULL,
};

PyMODINIT_FUNC PyInit__kernels(void)
{
    return PyModuleDef_Init(&module);
}
