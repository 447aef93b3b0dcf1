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

static PyObject *distances_and_directions(PyObject *self, PyObject *args)
{
    Py_buffer b[5]; /* things, points, times, distance, away */
    (void)self;
    if (!PyArg_ParseTuple(args, "y*y*y*w*w*", b, b + 1, b + 2, b + 3, b + 4))
        return NULL;
    const long things = reals(b) / KMPC_THING, count = reals(b + 2);
    const int fits = holds(b, KMPC_THING * things) && holds(b + 1, 2 * count) &&
                     holds(b + 2, count) && holds(b + 3, count * things) &&
                     holds(b + 4, 2 * count * things);
    if (fits)
        kmpc_distances_and_directions((int)things, b[0].buf, (int)count, b[1].buf, b[2].buf,
                                      b[3].buf, b[4].buf);
    return done(b, 5, fits);
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

static PyObject *tube_margins(PyObject *self, PyObject *args)
{
    /* white, lasting, pose, pose by speed, by_x, states, inputs, normals, path clearance, margins */
    Py_buffer b[10];
    double quantile, headway_time, touch, reach, solver_margin;
    int delay, spreads, directions;
    (void)self;
    if (!PyArg_ParseTuple(args, "y*y*y*y*y*y*y*y*y*w*iiiddddd", b, b + 1, b + 2, b + 3, b + 4,
                          b + 5, b + 6, b + 7, b + 8, b + 9, &delay, &spreads, &directions,
                          &quantile, &headway_time, &touch, &reach, &solver_margin))
        return NULL;
    const long stages = reals(b + 8), m = stages ? reals(b + 6) / stages : 0;
    const long columns = stages ? reals(b + 9) / stages : 0;
    const int fits =
        stages > 0 && stages <= KMPC_HORIZON && m > 0 && m <= KMPC_INPUTS &&
        (directions == 2 || directions == 3) && delay >= 0 && holds(b, 9 * m) &&
        (!b[1].len || holds(b + 1, 9 * m)) && holds(b + 2, 9) &&
        (!b[3].len || holds(b + 3, 9)) && holds(b + 4, 9 * stages) &&
        holds(b + 5, 3 * (stages + 1)) && holds(b + 6, m * stages) &&
        holds(b + 7, stages * columns * directions) && holds(b + 9, stages * columns);
    if (fits) {
        const struct kmpc_noise noise = {
            (int)m,           delay,    b[0].buf,     or_null(b + 1), b[2].buf, or_null(b + 3),
            quantile, headway_time, touch,    reach,        solver_margin,  spreads,
        };
        kmpc_tube_margins(&noise, (int)stages, (int)columns, directions, b[4].buf, b[5].buf,
                          b[6].buf, b[7].buf, b[8].buf, b[9].buf);
    }
    return done(b, 10, fits);
}

static PyObject *nearest_half_planes(PyObject *self, PyObject *args)
{
    Py_buffer b[5]; /* states, clearances, normals, chosen, offsets */
    int directions;
    (void)self;
    if (!PyArg_ParseTuple(args, "y*y*y*w*w*i", b, b + 1, b + 2, b + 3, b + 4, &directions))
        return NULL;
    const long stages = reals(b) / 3 - 1;
    int fits = stages > 0 && holds(b, 3 * (stages + 1)) && (directions == 2 || directions == 3);
    if (fits) {
        const long kinds = reals(b + 1) / stages, slots = reals(b + 4) / stages;
        fits = holds(b + 1, stages * kinds) && holds(b + 2, stages * kinds * directions) &&
               holds(b + 3, stages * slots * directions) && holds(b + 4, stages * slots);
        if (fits)
            kmpc_nearest_half_planes((int)stages, (int)kinds, (int)slots, directions, b[0].buf,
                                     b[1].buf, b[2].buf, b[3].buf, b[4].buf);
    }
    return done(b, 5, fits);
}

static PyObject *fill(PyObject *self, PyObject *args)
{
    /* value, by_x, by_u, by_past, x, u, normals, offsets, places, entries, lower, upper, planes */
    Py_buffer b[13];
    struct kmpc_layout size;
    double scale, open;
    (void)self;
    if (!PyArg_ParseTuple(args, "y*y*y*y*y*y*y*y*y*w*w*w*w*iiidd", b, b + 1, b + 2, b + 3, b + 4,
                          b + 5, b + 6, b + 7, b + 8, b + 9, b + 10, b + 11, b + 12, &size.stages,
                          &size.history, &size.directions, &scale, &open))
        return NULL;
    const long n = size.stages, m = n > 0 ? reals(b + 5) / n : 0;
    const long slots = n > 0 ? reals(b + 7) / n : 0, past = size.history;
    long written = 9 * (n - 1) + n * slots * size.directions;
    for (long j = 0; j <= past && j < n; j++)
        written += 3 * m * (n - j);
    int fits = n > 0 && past >= 0 && holds(b, 3 * n) && holds(b + 1, 9 * n) &&
               holds(b + 2, 3 * m * n) && holds(b + 3, 3 * m * n * past) &&
               holds(b + 4, 3 * (n + 1)) && holds(b + 5, m * n) &&
               holds(b + 6, n * slots * size.directions) && holds(b + 7, n * slots) &&
               holds_ints(b + 8, written) && holds(b + 10, 3 * n) && holds(b + 11, 3 * n) &&
               holds(b + 12, n * slots);
    const int *places = b[8].buf;
    for (long i = 0; fits && i < written; i++)
        fits = places[i] >= 0 && places[i] < reals(b + 9);
    if (fits) {
        size.inputs = (int)m;
        size.slots = (int)slots;
        size.half_plane_scale = scale;
        size.open = open;
        kmpc_fill(&size, b[0].buf, b[1].buf, b[2].buf, b[3].buf, b[4].buf, b[5].buf, b[6].buf,
                  b[7].buf, places, b[9].buf, b[10].buf, b[11].buf, b[12].buf);
    }
    return done(b, 13, fits);
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

#define KERNEL(name) {#name, name, METH_VARARGS, NULL}

static PyMethodDef kernels[] = {
    KERNEL(advance),       KERNEL(rollout),         KERNEL(linearize),
    KERNEL(distances),     KERNEL(distances_and_directions),
    KERNEL(box_distances), KERNEL(nearest_boxes),
    KERNEL(tube_margins),  KERNEL(nearest_half_planes), KERNEL(fill),
    KERNEL(stop_errors),   KERNEL(samples),         KERNEL(between_samples),
    KERNEL(surely_clear),  KERNEL(admissible),      KERNEL(clusters),        KERNEL(follow),
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
