/* The kernels as a Python module: buffers in, numbers written in place.
 *
 * kernels/library.py and scan_library.py call these, with the arrays first, those that are written
 * made there; then the numbers. Sizes are checked here, so that no kernel ever leaves an array. The
 * limited API keeps one build good for all Pythons.
 */
#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030b0000
#include <Python.h>
#include <string.h>

#include "kernels.h"

#pragma GCC diagnostic ignored "-Wunused-parameter" /* some kernels take no numbers */

static long reals(const Py_buffer *buffer)
{
    return (long)(buffer->len / (Py_ssize_t)sizeof(real));
}

static int holds(const Py_buffer *buffer, long count)
{
    return buffer->len == (Py_ssize_t)sizeof(real) * count;
}

static int holds_ints(const Py_buffer *buffer, long count)
{
    return buffer->len == (Py_ssize_t)sizeof(int) * count;
}

static const real *or_null(const Py_buffer *buffer)
{
    return buffer->len ? buffer->buf : NULL;
}

static int motion_of(struct kmpc_motion *m, const Py_buffer *motion, const Py_buffer *nodes)
{
    const int inputs = (int)(reals(motion) / 3), stages = (int)(reals(nodes) / 2);
    *m = (struct kmpc_motion){inputs, stages, motion->buf, nodes->buf};
    return holds(motion, 3L * m->inputs) && holds(nodes, 2L * m->nodes);
}

static int advance(Py_buffer *b, const double *n) /* motion, nodes, x, w, next */
{
    struct kmpc_motion m;
    const long count = reals(b + 2) / 3;
    const int fits = motion_of(&m, b, b + 1) && holds(b + 2, 3 * count) &&
                     holds(b + 3, m.inputs * count) && holds(b + 4, 3 * count);
    if (fits)
        kmpc_advance(&m, (int)count, b[2].buf, b[3].buf, b[4].buf);
    return fits;
}

static int rollout(Py_buffer *b, const double *n) /* motion, nodes, x0, w, states */
{
    struct kmpc_motion m;
    const long count = reals(b + 2) / 3;
    int fits = motion_of(&m, b, b + 1) && count > 0 && holds(b + 2, 3 * count);
    if (fits) {
        const long periods = reals(b + 4) / (3 * count) - 1;
        fits = periods >= 0 && holds(b + 3, m.inputs * count * periods) &&
               holds(b + 4, 3 * count * (periods + 1));
        if (fits)
            kmpc_rollout(&m, (int)count, (int)periods, b[2].buf, b[3].buf, b[4].buf);
    }
    return fits;
}

static int linearize(Py_buffer *b, const double *n) /* motion, nodes, x, w, value, by_x, by_w */
{
    struct kmpc_motion m;
    const long count = reals(b + 2) / 3;
    const int fits = motion_of(&m, b, b + 1) && holds(b + 2, 3 * count) &&
                     holds(b + 3, m.inputs * count) && holds(b + 4, 3 * count) &&
                     holds(b + 5, 9 * count) && holds(b + 6, 3 * m.inputs * count);
    if (fits)
        kmpc_linearize(&m, (int)count, b[2].buf, b[3].buf, b[4].buf, b[5].buf, b[6].buf);
    return fits;
}

static int distances(Py_buffer *b, const double *n) /* things, points, times, distance */
{
    const int motions = (int)n[0], sampled = (int)n[1], places = (int)n[2];
    const long things = reals(b) / KMPC_THING, samples = reals(b + 2);
    const long cells = (long)motions * places;
    const int fits = holds(b, KMPC_THING * things) && holds(b + 2, samples) &&
                     (sampled == 1 || sampled == samples) &&
                     holds(b + 1, 2 * cells * sampled) && holds(b + 3, cells * samples * things);
    if (fits)
        kmpc_distances((int)things, b[0].buf, motions, (int)samples, places, sampled, b[1].buf,
                       b[2].buf, b[3].buf);
    return fits;
}

static int box_distances(Py_buffer *b, const double *n) /* low, high, points, least */
{
    const long boxes = reals(b) / 2, count = reals(b + 3);
    const int fits = boxes > 0 && holds(b, 2 * boxes) && holds(b + 1, 2 * boxes) &&
                     holds(b + 2, 2 * count) && holds(b + 3, count);
    if (fits)
        kmpc_box_distances((int)boxes, b[0].buf, b[1].buf, (int)count, b[2].buf, b[3].buf);
    return fits;
}

/* low, high, points, room, chosen, distance, normals */
static int nearest_boxes(Py_buffer *b, const double *n)
{
    const int columns = (int)n[1];
    const long boxes = reals(b) / 2, count = reals(b + 2) / 2, cells = count * columns;
    const int fits = boxes > 0 && columns > 0 && columns <= boxes && holds(b, 2 * boxes) &&
                     holds(b + 1, 2 * boxes) && holds(b + 2, 2 * count) &&
                     holds(b + 3, 4 * boxes) && holds(b + 5, cells) && holds(b + 6, 2 * cells) &&
                     b[4].len == (Py_ssize_t)sizeof(long) * cells;
    if (fits)
        kmpc_nearest_boxes((int)boxes, b[0].buf, b[1].buf, (int)count, b[2].buf, n[0], columns,
                           b[3].buf, b[4].buf, b[5].buf, b[6].buf);
    return fits;
}

/* Whether the arrays of a pass have the sizes that go with each other. */
static int pass_fits(const Py_buffer *b, const struct kmpc_layout *size,
                     const struct kmpc_keep_out *keep, int tightens)
{
    const long n = size->stages, m = size->inputs, slots = size->slots, past = size->history;
    const long points = n * keep->places, cells = points * keep->solids;
    long written = 9 * (n - 1) + n * slots * size->directions;
    for (long j = 0; j <= past && j < n; j++)
        written += 3 * m * (n - j);
    int fits = holds(b, 3 * n) && holds(b + 1, 9 * n) && holds(b + 2, 3 * m * n) &&
               holds(b + 3, 3 * m * n * past) && holds(b + 4, 3 * (n + 1)) && holds(b + 5, m * n) &&
               holds(b + 6, 3 * (n + 1)) && holds(b + 7, KMPC_THING * (long)keep->things) &&
               holds(b + 8, 2 * points) && holds(b + 9, cells) && holds(b + 10, keep->directions * cells) &&
               holds(b + 11, 2L * keep->sides) && holds(b + 12, keep->sides) &&
               holds_ints(b + 13, written) && holds(b + 15, 3 * n) && holds(b + 16, 3 * n) &&
               holds(b + 17, n * slots) && holds(b + 18, 3 * n) && holds(b + 19, (3 + m + 1) * n) &&
               holds(b + 20, 9) && holds(b + 21, 9) && holds(b + 29, n - 1) &&
               reals(b + 22) >= kmpc_fill_room(size, kmpc_kinds(keep));
    if (tightens) /* speeds, path clearance, white, lasting, pose, pose by speed */
        fits = fits && n <= KMPC_HORIZON && holds(b + 23, 2 * n) && holds(b + 24, n) &&
               holds(b + 25, 18) && (!b[26].len || holds(b + 26, 18)) && holds(b + 27, 9) &&
               (!b[28].len || holds(b + 28, 9));
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
    const struct kmpc_plan_margins tight = {
        {2, (int)n[11], b[25].buf, or_null(b + 26), b[27].buf, or_null(b + 28), n[13], n[14], n[15],
         n[16], n[17], (int)n[12]},
        b[23].buf, b[24].buf, n[18], n[19], n[20]};
    kmpc_fill(&size, &keep, tightens ? &tight : NULL, &plan, &qp, b[22].buf);
    return 1;
}

/* distances, turns, position, heading, errors */
static int stop_errors(Py_buffer *b, const double *n)
{
    const int periods = (int)n[0];
    const long motions = periods > 0 ? reals(b) / periods : 0;
    const int fits = holds(b, motions * periods) && holds(b + 1, motions * periods) &&
                     holds(b + 2, 4) && holds(b + 3, 4) && holds(b + 4, motions * periods);
    if (fits)
        kmpc_stop_errors((int)motions, periods, n[1], b[0].buf, b[1].buf, b[2].buf, b[3].buf, n[2],
                         n[3], n[4], b[4].buf);
    return fits;
}

static int samples(Py_buffer *b, const double *n) /* states, poses */
{
    const int motions = (int)n[0], count = (int)n[1];
    const long periods = motions > 0 ? reals(b) / (3L * motions) - 1 : -1;
    const int fits = periods >= 0 && count > 0 && holds(b, 3 * motions * (periods + 1)) &&
                     holds(b + 1, 3 * motions * periods * count);
    if (fits)
        kmpc_samples(motions, (int)periods, count, b[0].buf, b[1].buf);
    return fits;
}

static int between_samples(Py_buffer *b, const double *n) /* clearance, standing, at, begin, out */
{
    const int motions = (int)n[0];
    const long places = reals(b + 3) / 2;
    const long samples = motions > 0 && places ? reals(b + 2) / (2L * motions * places) : 0;
    const long things = samples ? reals(b + 1) / (samples * places) : 0;
    const long cells = motions * samples * places * things;
    const int fits = holds(b, cells) && holds(b + 1, samples * places * things) &&
                     holds(b + 2, 2 * motions * samples * places) && holds(b + 3, 2 * places) &&
                     holds(b + 4, cells);
    if (fits)
        kmpc_between_samples(motions, (int)samples, (int)places, (int)things, b[0].buf, b[1].buf,
                             b[2].buf, b[3].buf, n[1], b[4].buf);
    return fits;
}

/* clearance, margins, error, travel, ends, clear */
static int surely_clear(Py_buffer *b, const double *n)
{
    const long motions = reals(b + 2), samples = motions ? reals(b + 1) / motions : 0;
    const long rows = motions * samples, cells = rows ? reals(b) / rows : 0;
    const int fits = holds(b, motions * samples * cells) && holds(b + 1, motions * samples) &&
                     holds(b + 3, motions) && holds_ints(b + 4, motions) && b[5].len == motions;
    if (fits)
        kmpc_surely_clear((int)motions, (int)samples, (int)cells, b[0].buf, b[1].buf, b[2].buf,
                          b[3].buf, b[4].buf, n[0], b[5].buf);
    return fits;
}

/* clearance, standing, spend, margins, driven, error, turns, strict, ends, clear */
static int admissible(Py_buffer *b, const double *n)
{
    const long motions = (long)b[7].len, things = (long)b[6].len;
    const long samples = motions ? reals(b + 3) / motions : 0;
    const long rows = motions * samples, places = rows ? reals(b + 4) / rows : 0;
    const long row = places * things;
    const int fits = holds(b, motions * samples * row) && holds(b + 1, samples * row) &&
                     holds(b + 2, samples * row) && holds(b + 3, motions * samples) &&
                     holds(b + 4, motions * samples * places) && holds(b + 5, motions * row) &&
                     holds_ints(b + 8, motions) && b[9].len == motions;
    if (fits)
        kmpc_admissible((int)motions, (int)samples, (int)places, (int)things, (int)n[0], b[0].buf,
                        b[1].buf, b[2].buf, b[3].buf, b[4].buf, b[5].buf, b[6].buf, b[7].buf,
                        b[8].buf, n[1], b[9].buf);
    return fits;
}

/* reach, ends, hits, clear, mount, ring, circles, count */
static int clusters(Py_buffer *b, const double *n)
{
    const long beams = reals(b);
    const int fits = holds(b + 1, 2 * beams) && b[2].len == beams && b[3].len == beams &&
                     holds(b + 4, 2) && holds_ints(b + 5, beams) &&
                     holds(b + 6, 3 * (beams / 3 + 1)) && holds_ints(b + 7, 1);
    if (fits) {
        const struct kmpc_ring s = {(int)beams, b[0].buf, b[1].buf, b[2].buf, b[3].buf,
                                    b[4].buf, n[0], n[1], n[2]};
        *(int *)b[7].buf = kmpc_clusters(&s, b[5].buf, b[6].buf);
    }
    return fits;
}

/* circles, sources, after, found, room, room for indices */
static int follow(Py_buffer *b, const double *n)
{
    const struct kmpc_walk walk = {n[0], n[1], n[2], n[3], n[4], n[5], n[6], n[7]};
    const long circles = reals(b + 1), tracks = reals(b + 2) / KMPC_TRACK, all = tracks + circles;
    const int fits = holds(b, KMPC_CIRCLE * circles) && holds(b + 2, KMPC_TRACK * tracks) &&
                     holds_ints(b + 3, circles) &&
                     holds(b + 4, tracks * circles + tracks + 2 * all) &&
                     holds_ints(b + 5, tracks + 3 * all);
    if (fits) {
        real *costs = b[4].buf, *room = costs + tracks * circles;
        int *indices = b[5].buf;
        int *more = indices + tracks;
        struct kmpc_pairs pairs = {
            indices, more, more + all, more + 2 * all, room, room + tracks, room + tracks + all};
        kmpc_follow(&walk, (int)tracks, (int)circles, b[0].buf, b[1].buf, &pairs, costs, b[2].buf,
                    b[3].buf);
    }
    return fits;
}

/* ranges, along, counts, mount, hits, clear, reach, ends */
static int told_beams(Py_buffer *b, const double *n)
{
    const long beams = reals(b);
    const int fits = holds(b + 1, 2 * beams) && b[2].len == beams && holds(b + 3, 2) &&
                     b[4].len == beams && b[5].len == beams && holds(b + 6, beams) &&
                     holds(b + 7, 2 * beams);
    if (fits)
        kmpc_told_beams((int)beams, b[0].buf, b[1].buf, b[2].buf, b[3].buf, n[0], n[1], n[2],
                        b[4].buf, b[5].buf, b[6].buf, b[7].buf);
    return fits;
}

static int averaged_ranges(Py_buffer *b, const double *n) /* ranges, hits, averaged, deviations */
{
    const long beams = reals(b);
    const int fits = b[1].len == beams && holds(b + 2, beams) && holds(b + 3, beams);
    if (fits)
        kmpc_averaged_ranges((int)beams, b[0].buf, b[1].buf, n[0], n[1], n[2], b[2].buf, b[3].buf);
    return fits;
}

/* Cells of a map: width, side, column, row; whether its arrays are as large, and hold a window. */
static int cells_of(struct kmpc_cells *c, const double *n, const Py_buffer *state,
                    const Py_buffer *seen, const Py_buffer *extent, const Py_buffer *taken,
                    const int *window)
{
    const long cells = (long)state->len, single = (long)sizeof(float);
    const int width = (int)n[0], height = width > 0 ? (int)(cells / width) : 0;
    *c = (struct kmpc_cells){height, width, (int)n[2], (int)n[3], n[1], 0.0, state->buf,
                             seen ? seen->buf : NULL, extent ? extent->buf : NULL,
                             taken ? taken->buf : NULL};
    return cells == (long)height * width && (!seen || seen->len == single * cells) &&
           (!extent || extent->len == 4 * single * cells) &&
           (!taken || taken->len == single * cells) &&
           (!window || (window[0] >= 0 && window[1] <= height && window[2] >= 0 &&
                        window[3] <= width));
}

static int pass_rays(Py_buffer *b, const double *n) /* state, seen, extent, squares */
{
    const struct kmpc_rays r = {{n[4], n[5]}, {n[6], n[7]}, {n[8], n[9]}, {n[10], n[11]},
                                b[3].buf, n[12], n[13] != 0.0};
    struct kmpc_cells c;
    const int fits = cells_of(&c, n, b, b + 1, b + 2, NULL, NULL) &&
                     b[3].len == (Py_ssize_t)sizeof(float) * (KMPC_DIRECTIONS + 1);
    c.clock = n[14];
    if (fits)
        kmpc_pass_rays(&c, &r);
    return fits;
}

static int mark(Py_buffer *b, const double *n) /* state, seen, extent, taken, points, errors */
{
    struct kmpc_cells c;
    const long count = reals(b + 5);
    const int fits = cells_of(&c, n, b, b + 1, b + 2, b + 3, NULL) && holds(b + 4, 2 * count);
    c.clock = n[5];
    if (fits)
        kmpc_mark(&c, (int)count, b[4].buf, b[5].buf, (int)n[4]);
    return fits;
}

static int hit_boxes(Py_buffer *b, const double *n) /* state, extent, low, high, count */
{
    struct kmpc_cells c;
    const int w[4] = {(int)n[4], (int)n[5], (int)n[6], (int)n[7]};
    int fits = cells_of(&c, n, b, NULL, b + 1, NULL, w);
    const long most = fits && w[1] > w[0] && w[3] > w[2] ? (long)(w[1] - w[0]) * (w[3] - w[2]) : 0;
    fits = fits && holds(b + 2, 2 * most) && holds(b + 3, 2 * most) && holds_ints(b + 4, 1);
    if (fits)
        *(int *)b[4].buf = kmpc_hit_boxes(&c, w, b[2].buf, b[3].buf);
    return fits;
}

static int rectangles(Py_buffer *b, const double *n) /* cells, open, found, count */
{
    const int width = (int)n[0];
    const long height = width > 0 ? (long)b[0].len / width : 0, most = width / 2 + 1;
    const int fits = (long)b[0].len == height * width && holds_ints(b + 1, 2 * most) &&
                     holds_ints(b + 2, 4 * height * most) && holds_ints(b + 3, 1);
    if (fits)
        *(int *)b[3].buf = kmpc_rectangles((int)height, width, b[0].buf, b[1].buf, b[2].buf);
    return fits;
}

/* `time` is that of either `step` or `braking`: no kernel looks at both. */
static int timed_of(struct kmpc_timed *path, const Py_buffer *b, real time)
{
    const int poses = (int)reals(b + 1), cusps = (int)reals(b + 2);
    *path = (struct kmpc_timed){poses, cusps, b[0].buf, b[1].buf, b[2].buf, time, time};
    return path->poses > 1 && holds(b, 3L * path->poses);
}

static int locate(Py_buffer *b, const double *n) /* poses, times, cusps, pose, found */
{
    struct kmpc_timed path;
    const int fits = timed_of(&path, b, n[0]) && holds(b + 3, 3) && holds(b + 4, 2);
    if (fits)
        kmpc_locate(&path, b[3].buf, n[1], n[2], b[4].buf);
    return fits;
}

static int along_path(Py_buffer *b, const double *n) /* poses, times, cusps, later, states */
{
    struct kmpc_timed path;
    const int count = (int)reals(b + 3), fits = timed_of(&path, b, n[0]) && holds(b + 4, 3L * count);
    if (fits)
        kmpc_along_path(&path, count, b[3].buf, n[1], n[2], n[3], n[4] != 0.0, b[4].buf);
    return fits;
}

static int ways(Py_buffer *b, const double *n) /* usable, factor, cost, towards, room */
{
    const int width = (int)n[0], goal = (int)n[2];
    const long nodes = (long)b[0].len, height = width > 0 ? nodes / width : 0;
    const int fits = nodes == height * width && holds(b + 1, nodes) && holds(b + 2, nodes) &&
                     holds_ints(b + 3, nodes) && holds_ints(b + 4, 2 * nodes) && goal >= 0 &&
                     goal < nodes;
    if (fits)
        kmpc_ways((int)height, width, b[0].buf, b[1].buf, n[1], goal, b[2].buf, b[3].buf, b[4].buf);
    return fits;
}

enum { ARRAYS = 30, NUMBERS = 23 }; /* at most */

static const struct kernel {
    const char *name;
    int (*run)(Py_buffer *arrays, const double *numbers); /* whether their sizes fitted */
    const char *arrays;                                   /* r: read, w: written */
    int numbers;
} kernels[] = {
    {"advance", advance, "rrrrw", 0},
    {"rollout", rollout, "rrrrw", 0},
    {"linearize", linearize, "rrrrwww", 0},
    {"distances", distances, "rrrw", 3},
    {"box_distances", box_distances, "rrrw", 0},
    {"nearest_boxes", nearest_boxes, "rrrwwww", 2},
    {"fill", fill, "rrrrrrrrrrrrrrwwwwwwrrwrrrrrrw", 23},
    {"stop_errors", stop_errors, "rrrrw", 5},
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
