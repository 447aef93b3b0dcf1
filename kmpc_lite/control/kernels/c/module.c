/* The kernels as a Python module: buffers in, numbers written in place.
 *
 * kernels/compiled.py calls these; it makes the arrays that are written. Sizes are checked here, so
 * that no kernel ever leaves an array. The limited API keeps one build good for all Pythons.
 */
#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030b0000
#include <Python.h>

#include "kernels.h"

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

/* Let go of buffers; None if the sizes fitted, else an error. */
static PyObject *done(Py_buffer *buffers, int count, int fits)
{
    for (int i = 0; i < count; i++)
        PyBuffer_Release(buffers + i);
    if (!fits) {
        PyErr_SetString(PyExc_ValueError, "kernel: arrays whose sizes do not fit together");
        return NULL;
    }
    Py_RETURN_NONE;
}

static int motion_of(struct kmpc_motion *m, const Py_buffer *motion, const Py_buffer *nodes)
{
    m->inputs = (int)(reals(motion) / 3);
    m->nodes = (int)(reals(nodes) / 2);
    m->motion = motion->buf;
    m->node = nodes->buf;
    return holds(motion, 3L * m->inputs) && holds(nodes, 2L * m->nodes);
}

static PyObject *advance(PyObject *self, PyObject *args)
{
    Py_buffer b[5]; /* motion, nodes, x, w, next */
    struct kmpc_motion m;
    (void)self;
    if (!PyArg_ParseTuple(args, "y*y*y*y*w*", b, b + 1, b + 2, b + 3, b + 4))
        return NULL;
    const long count = reals(b + 2) / 3;
    const int fits = motion_of(&m, b, b + 1) && holds(b + 2, 3 * count) &&
                     holds(b + 3, m.inputs * count) && holds(b + 4, 3 * count);
    if (fits)
        kmpc_advance(&m, (int)count, b[2].buf, b[3].buf, b[4].buf);
    return done(b, 5, fits);
}

static PyObject *rollout(PyObject *self, PyObject *args)
{
    Py_buffer b[5]; /* motion, nodes, x0, w, states */
    struct kmpc_motion m;
    (void)self;
    if (!PyArg_ParseTuple(args, "y*y*y*y*w*", b, b + 1, b + 2, b + 3, b + 4))
        return NULL;
    const long count = reals(b + 2) / 3;
    int fits = motion_of(&m, b, b + 1) && count > 0 && holds(b + 2, 3 * count);
    if (fits) {
        const long periods = reals(b + 4) / (3 * count) - 1;
        fits = periods >= 0 && holds(b + 3, m.inputs * count * periods) &&
               holds(b + 4, 3 * count * (periods + 1));
        if (fits)
            kmpc_rollout(&m, (int)count, (int)periods, b[2].buf, b[3].buf, b[4].buf);
    }
    return done(b, 5, fits);
}

static PyObject *linearize(PyObject *self, PyObject *args)
{
    Py_buffer b[7]; /* motion, nodes, x, w, value, by_x, by_w */
    struct kmpc_motion m;
    (void)self;
    if (!PyArg_ParseTuple(args, "y*y*y*y*w*w*w*", b, b + 1, b + 2, b + 3, b + 4, b + 5, b + 6))
        return NULL;
    const long count = reals(b + 2) / 3;
    const int fits = motion_of(&m, b, b + 1) && holds(b + 2, 3 * count) &&
                     holds(b + 3, m.inputs * count) && holds(b + 4, 3 * count) &&
                     holds(b + 5, 9 * count) && holds(b + 6, 3 * m.inputs * count);
    if (fits)
        kmpc_linearize(&m, (int)count, b[2].buf, b[3].buf, b[4].buf, b[5].buf, b[6].buf);
    return done(b, 7, fits);
}

static PyObject *distances(PyObject *self, PyObject *args)
{
    Py_buffer b[4]; /* things, points, times, distance */
    int motions, sampled, places;
    (void)self;
    if (!PyArg_ParseTuple(args, "y*y*y*w*iii", b, b + 1, b + 2, b + 3, &motions, &sampled, &places))
        return NULL;
    const long things = reals(b) / KMPC_THING, samples = reals(b + 2);
    const long cells = (long)motions * places;
    const int fits = holds(b, KMPC_THING * things) && holds(b + 2, samples) &&
                     (sampled == 1 || sampled == samples) &&
                     holds(b + 1, 2 * cells * sampled) && holds(b + 3, cells * samples * things);
    if (fits)
        kmpc_distances((int)things, b[0].buf, motions, (int)samples, places, sampled, b[1].buf,
                       b[2].buf, b[3].buf);
    return done(b, 4, fits);
}

static PyObject *box_distances(PyObject *self, PyObject *args)
{
    Py_buffer b[4]; /* low, high, points, least */
    (void)self;
    if (!PyArg_ParseTuple(args, "y*y*y*w*", b, b + 1, b + 2, b + 3))
        return NULL;
    const long boxes = reals(b) / 2, count = reals(b + 3);
    const int fits = boxes > 0 && holds(b, 2 * boxes) && holds(b + 1, 2 * boxes) &&
                     holds(b + 2, 2 * count) && holds(b + 3, count);
    if (fits)
        kmpc_box_distances((int)boxes, b[0].buf, b[1].buf, (int)count, b[2].buf, b[3].buf);
    return done(b, 4, fits);
}

static PyObject *nearest_boxes(PyObject *self, PyObject *args)
{
    Py_buffer b[7]; /* low, high, points, room, chosen, distance, normals */
    double behind;
    int columns;
    (void)self;
    if (!PyArg_ParseTuple(args, "y*y*y*w*w*w*w*di", b, b + 1, b + 2, b + 3, b + 4, b + 5, b + 6,
                          &behind, &columns))
        return NULL;
    const long boxes = reals(b) / 2, count = reals(b + 2) / 2, cells = count * columns;
    const int fits = boxes > 0 && columns > 0 && columns <= boxes && holds(b, 2 * boxes) &&
                     holds(b + 1, 2 * boxes) && holds(b + 2, 2 * count) &&
                     holds(b + 3, 4 * boxes) && holds(b + 5, cells) && holds(b + 6, 2 * cells) &&
                     b[4].len == (Py_ssize_t)sizeof(long) * cells;
    if (fits)
        kmpc_nearest_boxes((int)boxes, b[0].buf, b[1].buf, (int)count, b[2].buf, behind, columns,
                           b[3].buf, b[4].buf, b[5].buf, b[6].buf);
    return done(b, 7, fits);
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
               holds(b + 20, 9) && holds(b + 21, 9) &&
               holds(b + 29, n - 1) &&
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

static PyObject *fill(PyObject *self, PyObject *args)
{
    enum { ARRAYS = 30 }; /* in the order of kernels/library.py */
    Py_buffer b[ARRAYS];
    struct kmpc_layout size;
    struct kmpc_keep_out keep;
    struct kmpc_plan_margins tight;
    struct kmpc_noise *noise = &tight.noise;
    double scale, open, distance, dt, range, numbers[9];
    int tightens, to_goal;
    (void)self;
    if (!PyArg_ParseTuple(
            args, "y*y*y*y*y*y*y*y*y*y*y*y*y*y*w*w*w*w*w*w*y*y*w*y*y*y*y*y*y*w*iiiiidddddpiidddddddddp", b,
            b + 1, b + 2, b + 3, b + 4, b + 5, b + 6, b + 7, b + 8, b + 9, b + 10, b + 11, b + 12,
            b + 13, b + 14, b + 15, b + 16, b + 17, b + 18, b + 19, b + 20, b + 21, b + 22, b + 23,
            b + 24, b + 25, b + 26, b + 27, b + 28, b + 29, &size.stages, &size.history, &size.slots,
            &size.directions, &keep.places, &scale, &open, &distance, &dt, &range, &tightens,
            &noise->delay, &noise->spreads, numbers, numbers + 1, numbers + 2, numbers + 3,
            numbers + 4, numbers + 5, numbers + 6, numbers + 7, numbers + 8, &to_goal))
        return NULL;
    const long n = size.stages;
    int fits = n > 0 && keep.places > 0 && size.history >= 0 && size.slots > 0 &&
               (size.directions == 2 || size.directions == 3);
    if (fits) {
        size.inputs = (int)(reals(b + 5) / n);
        size.half_plane_scale = scale;
        size.open = open;
        keep.things = (int)(reals(b + 7) / KMPC_THING);
        keep.solids = (int)(reals(b + 9) / (n * keep.places));
        keep.sides = (int)reals(b + 12);
        keep.directions = size.directions;
        keep.thing = b[7].buf;
        keep.points = b[8].buf;
        keep.gaps = b[9].buf;
        keep.away = b[10].buf;
        keep.side_normal = b[11].buf;
        keep.side_offset = b[12].buf;
        keep.distance = distance;
        keep.dt = dt;
        keep.range = range;
        fits = pass_fits(b, &size, &keep, tightens);
    }
    if (fits) {
        const struct kmpc_pass plan = {b[4].buf, b[5].buf, b[6].buf,  b[0].buf, b[1].buf,
                                       b[2].buf, b[3].buf, b[20].buf, b[21].buf,
                                       numbers[8],  to_goal};
        const struct kmpc_qp qp = {b[13].buf, b[14].buf, b[15].buf, b[16].buf,
                                   b[17].buf, b[18].buf, b[19].buf, b[29].buf};
        if (tightens) {
            noise->inputs = 2;
            noise->white = b[25].buf;
            noise->lasting = or_null(b + 26);
            noise->pose = b[27].buf;
            noise->pose_speed = or_null(b + 28);
            noise->quantile = numbers[0];
            noise->headway_time = numbers[1];
            noise->touch = numbers[2];
            noise->reach = numbers[3];
            noise->solver_margin = numbers[4];
            tight.speeds = b[23].buf;
            tight.path_clearance = b[24].buf;
            tight.widest = numbers[5];
            tight.far_clearance = numbers[6];
            tight.side_margin = numbers[7];
        }
        kmpc_fill(&size, &keep, tightens ? &tight : NULL, &plan, &qp, b[22].buf);
    }
    return done(b, ARRAYS, fits);
}

static PyObject *stop_errors(PyObject *self, PyObject *args)
{
    Py_buffer b[5]; /* distances, turns, position, heading, errors */
    double dt, rare, usual, reach;
    int periods;
    (void)self;
    if (!PyArg_ParseTuple(args, "y*y*y*y*w*idddd", b, b + 1, b + 2, b + 3, b + 4, &periods, &dt,
                          &rare, &usual, &reach))
        return NULL;
    const long motions = periods > 0 ? reals(b) / periods : 0;
    const int fits = holds(b, motions * periods) && holds(b + 1, motions * periods) &&
                     holds(b + 2, 4) && holds(b + 3, 4) && holds(b + 4, motions * periods);
    if (fits)
        kmpc_stop_errors((int)motions, periods, dt, b[0].buf, b[1].buf, b[2].buf, b[3].buf, rare,
                         usual, reach, b[4].buf);
    return done(b, 5, fits);
}

static PyObject *samples(PyObject *self, PyObject *args)
{
    Py_buffer b[2]; /* states, poses */
    int motions, count;
    (void)self;
    if (!PyArg_ParseTuple(args, "y*w*ii", b, b + 1, &motions, &count))
        return NULL;
    const long periods = motions > 0 ? reals(b) / (3L * motions) - 1 : -1;
    const int fits = periods >= 0 && count > 0 && holds(b, 3 * motions * (periods + 1)) &&
                     holds(b + 1, 3 * motions * periods * count);
    if (fits)
        kmpc_samples(motions, (int)periods, count, b[0].buf, b[1].buf);
    return done(b, 2, fits);
}

static PyObject *between_samples(PyObject *self, PyObject *args)
{
    Py_buffer b[5]; /* clearance, standing, at, begin, out */
    double radius;
    int motions;
    (void)self;
    if (!PyArg_ParseTuple(args, "y*y*y*y*w*id", b, b + 1, b + 2, b + 3, b + 4, &motions, &radius))
        return NULL;
    const long places = reals(b + 3) / 2;
    const long samples = motions > 0 && places ? reals(b + 2) / (2L * motions * places) : 0;
    const long things = samples ? reals(b + 1) / (samples * places) : 0;
    const long cells = motions * samples * places * things;
    const int fits = holds(b, cells) && holds(b + 1, samples * places * things) &&
                     holds(b + 2, 2 * motions * samples * places) && holds(b + 3, 2 * places) &&
                     holds(b + 4, cells);
    if (fits)
        kmpc_between_samples(motions, (int)samples, (int)places, (int)things, b[0].buf, b[1].buf,
                             b[2].buf, b[3].buf, radius, b[4].buf);
    return done(b, 5, fits);
}

static PyObject *surely_clear(PyObject *self, PyObject *args)
{
    Py_buffer b[6]; /* clearance, margins, error, travel, ends, clear */
    double lost;
    (void)self;
    if (!PyArg_ParseTuple(args, "y*y*y*y*y*w*d", b, b + 1, b + 2, b + 3, b + 4, b + 5, &lost))
        return NULL;
    const long motions = reals(b + 2), samples = motions ? reals(b + 1) / motions : 0;
    const long rows = motions * samples, cells = rows ? reals(b) / rows : 0;
    const int fits = holds(b, motions * samples * cells) && holds(b + 1, motions * samples) &&
                     holds(b + 3, motions) && holds_ints(b + 4, motions) && b[5].len == motions;
    if (fits)
        kmpc_surely_clear((int)motions, (int)samples, (int)cells, b[0].buf, b[1].buf, b[2].buf,
                          b[3].buf, b[4].buf, lost, b[5].buf);
    return done(b, 6, fits);
}

static PyObject *admissible(PyObject *self, PyObject *args)
{
    /* clearance, standing, spend, margins, driven, error, turns, strict, ends, clear */
    Py_buffer b[10];
    double unsure;
    int first;
    (void)self;
    if (!PyArg_ParseTuple(args, "y*y*y*y*y*y*y*y*y*w*id", b, b + 1, b + 2, b + 3, b + 4, b + 5,
                          b + 6, b + 7, b + 8, b + 9, &first, &unsure))
        return NULL;
    const long motions = (long)b[7].len, things = (long)b[6].len;
    const long samples = motions ? reals(b + 3) / motions : 0;
    const long rows = motions * samples, places = rows ? reals(b + 4) / rows : 0;
    const long row = places * things;
    const int fits = holds(b, motions * samples * row) && holds(b + 1, samples * row) &&
                     holds(b + 2, samples * row) && holds(b + 3, motions * samples) &&
                     holds(b + 4, motions * samples * places) && holds(b + 5, motions * row) &&
                     holds_ints(b + 8, motions) && b[9].len == motions;
    if (fits)
        kmpc_admissible((int)motions, (int)samples, (int)places, (int)things, first, b[0].buf,
                        b[1].buf, b[2].buf, b[3].buf, b[4].buf, b[5].buf, b[6].buf, b[7].buf,
                        b[8].buf, unsure, b[9].buf);
    return done(b, 10, fits);
}

static PyObject *clusters(PyObject *self, PyObject *args)
{
    Py_buffer b[8]; /* reach, ends, hits, clear, mount, ring, circles, count */
    struct kmpc_ring s;
    double step, gap, largest;
    (void)self;
    if (!PyArg_ParseTuple(args, "y*y*y*y*y*w*w*w*ddd", b, b + 1, b + 2, b + 3, b + 4, b + 5, b + 6,
                          b + 7, &step, &gap, &largest))
        return NULL;
    const long beams = reals(b);
    const int fits = holds(b + 1, 2 * beams) && b[2].len == beams && b[3].len == beams &&
                     holds(b + 4, 2) && holds_ints(b + 5, beams) &&
                     holds(b + 6, 3 * (beams / 3 + 1)) && holds_ints(b + 7, 1);
    if (fits) {
        s = (struct kmpc_ring){(int)beams, b[0].buf, b[1].buf, b[2].buf, b[3].buf,
                               b[4].buf,   step,     gap,      largest};
        *(int *)b[7].buf = kmpc_clusters(&s, b[5].buf, b[6].buf);
    }
    return done(b, 8, fits);
}

static PyObject *follow(PyObject *self, PyObject *args)
{
    Py_buffer b[6]; /* circles, sources, after, found, room, room for indices */
    double dt, memory, acceleration, turning, noise, other, gate, chance;
    (void)self;
    if (!PyArg_ParseTuple(args, "y*y*w*w*w*w*dddddddd", b, b + 1, b + 2, b + 3, b + 4, b + 5, &dt,
                          &memory, &acceleration, &turning, &noise, &other, &gate, &chance))
        return NULL;
    const struct kmpc_walk walk = {dt, memory, acceleration, turning, noise, other, gate, chance};
    const long circles = reals(b + 1), tracks = reals(b + 2) / KMPC_TRACK, all = tracks + circles;
    const int fits = holds(b, KMPC_CIRCLE * circles) && holds(b + 2, KMPC_TRACK * tracks) &&
                     holds_ints(b + 3, circles) &&
                     holds(b + 4, tracks * circles + tracks + 2 * all) &&
                     holds_ints(b + 5, tracks + 3 * all);
    if (fits) {
        real *costs = b[4].buf, *room = costs + tracks * circles;
        int *indices = b[5].buf;
        struct kmpc_pairs pairs = {indices,
                                   indices + tracks,
                                   indices + tracks + all,
                                   indices + tracks + 2 * all,
                                   room,
                                   room + tracks,
                                   room + tracks + all};
        kmpc_follow(&walk, (int)tracks, (int)circles, b[0].buf, b[1].buf, &pairs, costs, b[2].buf,
                    b[3].buf);
    }
    return done(b, 6, fits);
}

static PyObject *told_beams(PyObject *self, PyObject *args)
{
    Py_buffer b[8]; /* ranges, along, counts, mount, hits, clear, reach, ends */
    double least, most, own;
    (void)self;
    if (!PyArg_ParseTuple(args, "y*y*y*y*w*w*w*w*ddd", b, b + 1, b + 2, b + 3, b + 4, b + 5, b + 6,
                          b + 7, &least, &most, &own))
        return NULL;
    const long beams = reals(b);
    const int fits = holds(b + 1, 2 * beams) && b[2].len == beams && holds(b + 3, 2) &&
                     b[4].len == beams && b[5].len == beams && holds(b + 6, beams) &&
                     holds(b + 7, 2 * beams);
    if (fits)
        kmpc_told_beams((int)beams, b[0].buf, b[1].buf, b[2].buf, b[3].buf, least, most, own,
                        b[4].buf, b[5].buf, b[6].buf, b[7].buf);
    return done(b, 8, fits);
}

static PyObject *averaged_ranges(PyObject *self, PyObject *args)
{
    Py_buffer b[4]; /* ranges, hits, averaged, deviations */
    double step, noise, half;
    (void)self;
    if (!PyArg_ParseTuple(args, "y*y*w*w*ddd", b, b + 1, b + 2, b + 3, &step, &noise, &half))
        return NULL;
    const long beams = reals(b);
    const int fits = b[1].len == beams && holds(b + 2, beams) && holds(b + 3, beams);
    if (fits)
        kmpc_averaged_ranges((int)beams, b[0].buf, b[1].buf, step, noise, half, b[2].buf, b[3].buf);
    return done(b, 4, fits);
}

/* Cells of a map with a width; whether all of its arrays are as large, and a window lies on it. */
static int cells_of(struct kmpc_cells *c, const Py_buffer *state, const Py_buffer *seen,
                    const Py_buffer *extent, const Py_buffer *taken, const int *window)
{
    const long cells = (long)state->len, single = (long)sizeof(float);
    if (c->width < 1 || cells % c->width)
        return 0;
    c->height = (int)(cells / c->width);
    c->state = state->buf;
    c->seen = seen ? seen->buf : NULL;
    c->extent = extent ? extent->buf : NULL;
    c->taken = taken ? taken->buf : NULL;
    return (!seen || seen->len == single * cells) && (!extent || extent->len == 4 * single * cells) &&
           (!taken || taken->len == single * cells) &&
           (!window || (window[0] >= 0 && window[1] <= c->height && window[2] >= 0 &&
                        window[3] <= c->width));
}

static PyObject *pass_rays(PyObject *self, PyObject *args)
{
    Py_buffer b[4]; /* state, seen, extent, squares */
    struct kmpc_cells c = {0};
    struct kmpc_rays r = {0};
    (void)self;
    if (!PyArg_ParseTuple(args, "w*w*y*y*i(dii)(dd)(dd)(dd)(dd)dpd", b, b + 1, b + 2, b + 3,
                          &c.width, &c.cell, &c.column, &c.row, r.low, r.low + 1, r.high,
                          r.high + 1, r.origin, r.origin + 1, r.turn, r.turn + 1, &r.distance,
                          &r.farther, &c.clock))
        return NULL;
    const int fits = cells_of(&c, b, b + 1, b + 2, NULL, NULL) &&
                     b[3].len == (Py_ssize_t)sizeof(float) * (KMPC_DIRECTIONS + 1);
    r.squares = b[3].buf;
    if (fits)
        kmpc_pass_rays(&c, &r);
    return done(b, 4, fits);
}

static PyObject *mark(PyObject *self, PyObject *args)
{
    Py_buffer b[6]; /* state, seen, extent, taken, points, errors */
    struct kmpc_cells c = {0};
    int level;
    (void)self;
    if (!PyArg_ParseTuple(args, "w*w*w*w*y*y*i(dii)id", b, b + 1, b + 2, b + 3, b + 4, b + 5,
                          &c.width, &c.cell, &c.column, &c.row, &level, &c.clock))
        return NULL;
    const long count = reals(b + 5);
    const int fits = cells_of(&c, b, b + 1, b + 2, b + 3, NULL) && holds(b + 4, 2 * count);
    if (fits)
        kmpc_mark(&c, (int)count, b[4].buf, b[5].buf, level);
    return done(b, 6, fits);
}

static PyObject *hit_boxes(PyObject *self, PyObject *args)
{
    Py_buffer b[5]; /* state, extent, low, high, count */
    struct kmpc_cells c = {0};
    int w[4];
    (void)self;
    if (!PyArg_ParseTuple(args, "y*y*w*w*w*i(iiii)(dii)", b, b + 1, b + 2, b + 3, b + 4, &c.width,
                          w, w + 1, w + 2, w + 3, &c.cell, &c.column, &c.row))
        return NULL;
    int fits = cells_of(&c, b, NULL, b + 1, NULL, w);
    const long most = fits && w[1] > w[0] && w[3] > w[2] ? (long)(w[1] - w[0]) * (w[3] - w[2]) : 0;
    fits = fits && holds(b + 2, 2 * most) && holds(b + 3, 2 * most) && holds_ints(b + 4, 1);
    if (fits)
        *(int *)b[4].buf = kmpc_hit_boxes(&c, w, b[2].buf, b[3].buf);
    return done(b, 5, fits);
}

static PyObject *rectangles(PyObject *self, PyObject *args)
{
    Py_buffer b[4]; /* cells, open, found, count */
    int width;
    (void)self;
    if (!PyArg_ParseTuple(args, "y*w*w*w*i", b, b + 1, b + 2, b + 3, &width))
        return NULL;
    const long height = width > 0 ? (long)b[0].len / width : 0, most = width / 2 + 1;
    const int fits = (long)b[0].len == height * width && holds_ints(b + 1, 2 * most) &&
                     holds_ints(b + 2, 4 * height * most) && holds_ints(b + 3, 1);
    if (fits)
        *(int *)b[3].buf = kmpc_rectangles((int)height, width, b[0].buf, b[1].buf, b[2].buf);
    return done(b, 4, fits);
}

static int timed_of(struct kmpc_timed *path, const Py_buffer *b)
{
    path->poses = (int)reals(b + 1);
    path->cusps = (int)reals(b + 2);
    path->pose = b[0].buf;
    path->time = b[1].buf;
    path->cusp = b[2].buf;
    return path->poses > 1 && holds(b, 3L * path->poses);
}

static PyObject *locate(PyObject *self, PyObject *args)
{
    Py_buffer b[5]; /* poses, times, cusps, pose, found */
    struct kmpc_timed path = {0};
    double place, least;
    (void)self;
    if (!PyArg_ParseTuple(args, "y*y*y*y*w*ddd", b, b + 1, b + 2, b + 3, b + 4, &path.step, &place,
                          &least))
        return NULL;
    const int fits = timed_of(&path, b) && holds(b + 3, 3) && holds(b + 4, 2);
    if (fits)
        kmpc_locate(&path, b[3].buf, place, least, b[4].buf);
    return done(b, 5, fits);
}

static PyObject *along_path(PyObject *self, PyObject *args)
{
    Py_buffer b[5]; /* poses, times, cusps, later, states */
    struct kmpc_timed path = {0};
    double place, leg, heading;
    int turning;
    (void)self;
    if (!PyArg_ParseTuple(args, "y*y*y*y*w*ddddp", b, b + 1, b + 2, b + 3, b + 4, &path.braking,
                          &place, &leg, &heading, &turning))
        return NULL;
    const int count = (int)reals(b + 3), fits = timed_of(&path, b) && holds(b + 4, 3L * count);
    if (fits)
        kmpc_along_path(&path, count, b[3].buf, place, leg, heading, turning, b[4].buf);
    return done(b, 5, fits);
}

#define KERNEL(name) {#name, name, METH_VARARGS, NULL}

static PyMethodDef kernels[] = {
    KERNEL(advance),       KERNEL(rollout),         KERNEL(linearize),
    KERNEL(distances),     KERNEL(box_distances),   KERNEL(nearest_boxes),
    KERNEL(fill),
    KERNEL(stop_errors),   KERNEL(samples),         KERNEL(between_samples),
    KERNEL(surely_clear),  KERNEL(admissible),      KERNEL(clusters),        KERNEL(follow),
    KERNEL(told_beams),    KERNEL(averaged_ranges), KERNEL(pass_rays),
    KERNEL(mark),          KERNEL(hit_boxes),       KERNEL(rectangles),
    KERNEL(locate),        KERNEL(along_path),
    {NULL, NULL, 0, NULL},
};

static PyModuleDef_Slot slots[] = {{0, NULL}};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "_kernels", "The kernels in C; see kernels.h.", 0, kernels, slots, NULL,
    NULL,                  NULL,
};

PyMODINIT_FUNC PyInit__kernels(void)
{
    return PyModuleDef_Init(&module);
}
