/* Symmetric models in closed form: the same motion wherever the robot stands and faces. */
#include "kernels.h"

#include <math.h>

/* Motion ahead, to the left and round that bilinear inputs w (nw,) command. */
static void body_motion(const struct kmpc_motion *m, const real *w, real *body)
{
    for (int axis = 0; axis < 3; axis++) {
        real sum = 0;
        for (int i = 0; i < m->inputs; i++)
            sum += w[i] * m->motion[3 * i + axis];
        body[axis] = sum;
    }
}

/* Mean cosine and sine of the heading over a period that turns. */
static void mean_heading(const struct kmpc_motion *m, real heading, real turned, real *c, real *s)
{
    *c = *s = 0;
    for (int i = 0; i < m->nodes; i++) {
        const real angle = heading + m->node[2 * i] * turned, weight = m->node[2 * i + 1];
        *c += weight * M(cos)(angle);
        *s += weight * M(sin)(angle);
    }
}

void kmpc_advance(const struct kmpc_motion *m, int count, const real *x, const real *w, real *next)
{
    for (int k = 0; k < count; k++, x += 3, w += m->inputs, next += 3) {
        real body[3], c, s;
        body_motion(m, w, body);
        mean_heading(m, x[2], body[2], &c, &s);
        next[0] = x[0] + (body[0] * c - body[1] * s);
        next[1] = x[1] + (body[0] * s + body[1] * c);
        next[2] = x[2] + body[2];
    }
}

void kmpc_rollout(const struct kmpc_motion *m, int count, int periods, const real *x0,
                  const real *w, real *states)
{
    for (int i = 0; i < count; i++, x0 += 3) {
        for (int axis = 0; axis < 3; axis++)
            states[axis] = x0[axis];
        for (int k = 0; k < periods; k++, w += m->inputs, states += 3)
            kmpc_advance(m, 1, states, w, states + 3);
        states += 3;
    }
}

void kmpc_linearize(const struct kmpc_motion *m, int count, const real *x, const real *w,
                    real *value, real *by_x, real *by_w)
{
    const int nw = m->inputs;
    for (int k = 0; k < count; k++, x += 3, w += nw, value += 3, by_x += 9, by_w += 3 * nw) {
        real body[3], c = 0, s = 0, dx = 0, dy = 0, dx_by_turn = 0, dy_by_turn = 0;
        body_motion(m, w, body);
        for (int i = 0; i < m->nodes; i++) {
            const real node = m->node[2 * i], weight = m->node[2 * i + 1];
            const real angle = x[2] + node * body[2];
            const real ci = weight * M(cos)(angle), si = weight * M(sin)(angle);
            const real dxi = body[0] * ci - body[1] * si, dyi = body[0] * si + body[1] * ci;
            c += ci;
            s += si;
            dx += dxi;
            dy += dyi;
            dx_by_turn -= node * dyi;
            dy_by_turn += node * dxi;
        }
        value[0] = x[0] + dx;
        value[1] = x[1] + dy;
        value[2] = x[2] + body[2];
        for (int i = 0; i < 9; i++)
            by_x[i] = i % 4 == 0;
        by_x[2] = -dy;
        by_x[5] = dx;
        for (int i = 0; i < nw; i++) {
            const real *lead = m->motion + 3 * i;
            by_w[i] = c * lead[0] - s * lead[1] + dx_by_turn * lead[2];
            by_w[nw + i] = s * lead[0] + c * lead[1] + dy_by_turn * lead[2];
            by_w[2 * nw + i] = lead[2];
        }
    }
}
