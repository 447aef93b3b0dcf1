/* What a model predicts of a robot that answers late and slips, alike wherever it stands and faces.
 * While commands are held the heading turns evenly: a period is the motion in the robot's frame,
 * turned by the heading at each node of the integrator. */
#include "kernels.h"

#include <math.h>

/* Factors of a speed, and those whose product each term is, as in model/dictionary/terms.py. */
enum { ONE, PLAIN, SIZE, SQUARE, CUBE, SIGNED_SQUARE, SIGN, FACTORS };
static const unsigned char OF_TWO[][KMPC_INPUTS] = {
    {PLAIN, ONE},         {ONE, PLAIN},         {PLAIN, PLAIN}, {PLAIN, SIZE},  {PLAIN, SQUARE},
    {SIGNED_SQUARE, ONE}, {ONE, SIGNED_SQUARE}, {ONE, CUBE},    {SQUARE, PLAIN}, {SIZE, ONE},
    {SIGN, PLAIN}};
static const unsigned char OF_THREE[][KMPC_INPUTS] = {
    {PLAIN, ONE, ONE},   {ONE, PLAIN, ONE},         {ONE, ONE, PLAIN},         {PLAIN, ONE, PLAIN},
    {ONE, PLAIN, PLAIN}, {SIGNED_SQUARE, ONE, ONE}, {ONE, SIGNED_SQUARE, ONE}, {ONE, ONE, SIGNED_SQUARE}};
static const real STANDS = R(1e-9); /* below, a command says nothing of how wheels are steered */

struct answer {
    real speed[KMPC_INPUTS], curvature; /* what motors make of commands; the steered wheels' */
};

/* A group's terms of an answer, how far each leads, and by how much farther for each speed. */
struct led {
    real body[3], by[3][KMPC_INPUTS];
};

/* Mean cosine and sine of the heading over a period, and how they change the way with the turn. */
struct mean {
    real c, s, dx, dy, dx_by_turn, dy_by_turn;
};

int kmpc_terms(int commands)
{
    return (int)((commands == 2 ? sizeof(OF_TWO) : sizeof(OF_THREE)) / sizeof(*OF_TWO));
}

/* The command of an age, in metres and seconds; zero before the first that is known. */
static real command_of(const struct kmpc_predictor *p, const struct kmpc_sent *sent, int age, int j)
{
    const int m = p->commands, since = age - sent->zeros, earlier = since - sent->driven;
    if (since < 0 || (earlier > 0 && !sent->past))
        return 0;
    const real *command = earlier > 0 ? sent->past + (p->ages - 1 - earlier) * m
                                      : sent->now - since * m;
    return command[j] * p->command[j];
}

/* Steered wheels that stand keep the curvature before. */
static struct answer answer_of(const struct kmpc_predictor *p, int group,
                               const struct kmpc_sent *sent)
{
    const int m = p->commands;
    const real *kernel = p->kernel + group * p->ages * m;
    struct answer out = {{0}, 0};
    real held = 0;
    for (int age = p->ages - 1; age >= 0; age--) {
        for (int j = 0; j < (p->steered ? 1 : m); j++)
            out.speed[j] += kernel[age * m + j] * command_of(p, sent, age, j);
        if (p->steered) {
            const real speed = command_of(p, sent, age, 0);
            held = M(fabs)(speed) > STANDS ? command_of(p, sent, age, 1) / speed : held;
            out.curvature += kernel[age * m + 1] * held;
        }
    }
    if (p->steered)
        out.speed[1] = out.speed[0] * out.curvature;
    return out;
}

/* Turning either way costs speed, which is predicted and not steered with: by a turn rate's size
 * and its square none changes. */
static void factors_of(real answered, real smoothing, real limit, int turns, real *value,
                       real *slope)
{
    const int beyond = M(fabs)(answered) > limit;
    const real s = beyond ? M(copysign)(limit, answered) : answered;
    const real square = s * s, soft = smoothing * smoothing, root = M(sqrt)(square + soft);
    const real size = square / root, cube = (square + soft) * root;
    const real steep = s * (square + 2 * soft) / cube;
    const real values[FACTORS] = {1, s, size, square, s * square, s * size, s / root};
    const real slopes[FACTORS] = {0,          1,    turns ? 0 : steep, turns ? 0 : 2 * s,
                                  3 * square, size + s * steep, soft / cube};
    for (int f = 0; f < FACTORS; f++) {
        value[f] = values[f];
        slope[f] = beyond ? 0 : slopes[f];
    }
}

static void lead(const struct kmpc_predictor *p, int group, const struct answer *answer,
                 struct led *out)
{
    const int m = p->commands;
    real value[KMPC_INPUTS][FACTORS], slope[KMPC_INPUTS][FACTORS];
    int curved = 0;
    for (int i = 0; i < p->terms; i++)
        curved |= p->term[i] >= m;
    for (int j = 0; curved && j < m; j++)
        factors_of(answer->speed[j], p->smoothing[j], p->limits[j], j == m - 1, value[j], slope[j]);
    for (int i = 0; i < p->terms; i++) {
        const real *motion = p->motion + 3 * (group * p->terms + i);
        const int term = p->term[i];
        real w = 1, by[KMPC_INPUTS];
        if (term < m) { /* the speeds themselves, however large */
            w = answer->speed[term];
            for (int j = 0; j < m; j++)
                by[j] = j == term;
        } else {
            const unsigned char *factor = m == 2 ? OF_TWO[term] : OF_THREE[term];
            for (int j = 0; j < m; j++) {
                w *= value[j][factor[j]];
                by[j] = slope[j][factor[j]];
                for (int other = 0; other < m; other++)
                    if (other != j)
                        by[j] *= value[other][factor[other]];
            }
        }
        for (int axis = 0; axis < 3; axis++) {
            out->body[axis] += w * motion[axis];
            for (int j = 0; j < m; j++)
                out->by[axis][j] += by[j] * motion[axis];
        }
    }
}

/* What all groups lead to, and where from a pose, in units. */
static struct mean advance(const struct kmpc_predictor *p, const real *x,
                           const struct kmpc_sent *sent, real *next)
{
    struct led all = {{0}, {{0}}};
    struct mean out = {0};
    for (int group = 0; group < p->groups; group++) {
        const struct answer answer = answer_of(p, group, sent);
        lead(p, group, &answer, &all);
    }
    for (int i = 0; i < p->nodes; i++) {
        const real node = p->node[2 * i], weight = p->node[2 * i + 1];
        const real angle = x[2] * p->state[2] + node * all.body[2];
        const real c = weight * M(cos)(angle), s = weight * M(sin)(angle);
        const real dx = all.body[0] * c - all.body[1] * s, dy = all.body[0] * s + all.body[1] * c;
        out.c += c;
        out.s += s;
        out.dx += dx;
        out.dy += dy;
        out.dx_by_turn -= node * dy;
        out.dy_by_turn += node * dx;
    }
    const real way[3] = {out.dx, out.dy, all.body[2]};
    for (int axis = 0; axis < 3; axis++)
        next[axis] = (x[axis] * p->state[axis] + way[axis]) / p->state[axis];
    return out;
}

void kmpc_rollout(const struct kmpc_predictor *p, int periods, int count, const real *x0,
                  const real *u, const real *past, real *states)
{
    for (int axis = 0; axis < 3; axis++)
        states[axis] = x0[axis];
    for (int k = 0; k < periods; k++, states += 3) {
        const int last = k < count ? k : count - 1;
        const struct kmpc_sent sent = {u + last * p->commands, past, last, k - last};
        advance(p, states, &sent, states + 3);
    }
}

void kmpc_linearize(const struct kmpc_predictor *p, const real *x, const struct kmpc_sent *sent,
                    real *value, real *by_x, real *by_u, real *by_past)
{
    const int m = p->commands;
    const struct mean mean = advance(p, x, sent, value);
    if (!by_x)
        return;
    for (int i = 0; i < 9; i++)
        by_x[i] = i % 4 == 0;
    by_x[2] = -mean.dy * p->state[2] / p->state[0];
    by_x[5] = mean.dx * p->state[2] / p->state[1];
    for (int group = 0; group < p->groups; group++) {
        const struct answer answer = answer_of(p, group, sent);
        struct led led = {{0}, {{0}}};
        real by[3][KMPC_INPUTS], held = 0;
        lead(p, group, &answer, &led);
        for (int j = 0; j < m; j++) {
            by[0][j] = mean.c * led.by[0][j] - mean.s * led.by[1][j] + mean.dx_by_turn * led.by[2][j];
            by[1][j] = mean.s * led.by[0][j] + mean.c * led.by[1][j] + mean.dy_by_turn * led.by[2][j];
            by[2][j] = led.by[2][j];
        }
        for (int age = p->ages - 1; age >= 0; age--) {
            real *out = age ? by_past + 3 * m * (age - 1) : by_u;
            const real *weight = p->kernel + (group * p->ages + age) * m;
            real across = 0, turns = weight[m - 1]; /* of the turn rate by the speed, and by itself */
            if (p->steered) {
                const real soft = p->smoothing[0] * p->smoothing[0];
                const real speed = command_of(p, sent, age, 0);
                const real share = (answer.speed[0] * speed + soft) / (speed * speed + soft);
                held = M(fabs)(speed) > STANDS ? command_of(p, sent, age, 1) / speed : held;
                across = weight[0] * answer.curvature - weight[1] * held * share;
                turns *= share;
            }
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < m; j++) {
                    const real found = by[i][j] * (j == m - 1 ? turns : weight[j]) +
                                       (j == 0 ? by[i][m - 1] * across : 0);
                    out[m * i + j] = (group ? out[m * i + j] : 0) +
                                     found * p->command[j] / p->state[i];
                }
        }
    }
}
