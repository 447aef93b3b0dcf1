/* The learned model: a symmetric form whose inputs are terms of filtered commands. */
#include "core.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#define K kmpc_numbers
#define L kmpc_model

/* Terms of a filtered command (KMPC_TERMS,), and their derivatives (KMPC_TERMS, 2). Turning either
 * way costs speed, which is predicted and not steered with: by a turn rate's size and its square
 * none changes. */
static void terms_of(const real *answered, real *out, real *slope)
{
    real inside[2];
    int within[2];
    for (int i = 0; i < 2; i++) {
        within[i] = M(fabs)(answered[i]) <= L.limits[i];
        inside[i] = within[i] ? answered[i] : M(copysign)(L.limits[i], answered[i]);
    }
    const real v = inside[0], o = inside[1], vv = v * v, oo = o * o;
    const real vs = L.smoothing[0] * L.smoothing[0], os = L.smoothing[1] * L.smoothing[1];
    const real v_root = vv + vs, o_root = oo + os;
    const real v_size = vv / M(sqrt)(v_root), size = oo / M(sqrt)(o_root);
    const real size_slope = o * (oo + 2 * os) / (o_root * M(sqrt)(o_root));
    const real v_slope = v * (vv + 2 * vs) / (v_root * M(sqrt)(v_root));
    const real sign = v / M(sqrt)(v_root), sign_slope = vs / (v_root * M(sqrt)(v_root));
    const real found[KMPC_TERMS] = {answered[0], answered[1], v * o,     v * size, v * oo,
                                    v * v_size,  o * size,    o * oo,    vv * o,   v_size,
                                    o * sign};
    const real by[KMPC_TERMS][2] = {
        {1, 0},
        {0, 1},
        {o, v},
        {size, 0},
        {oo, 0},
        {v_size + v * v_slope, 0},
        {0, size + o * size_slope},
        {0, 3 * oo},
        {2 * v * o, vv},
        {v_slope, 0},
        {o * sign_slope, sign},
    };
    for (int i = 0; i < KMPC_TERMS; i++) {
        out[i] = found[i];
        for (int j = 0; j < 2; j++)
            slope[2 * i + j] = i < 2 || within[j] ? by[i][j] : 0;
    }
}

/* Bilinear inputs (terms,) of the L + 1 commands up to one, and derivatives (terms, 2) by what the
 * motors make of them; `newest` points at that command, in units. */
static void inputs_of(const real *newest, real *w, real *slope)
{
    real answered[2] = {0, 0}, all[KMPC_TERMS], by[2 * KMPC_TERMS];
    for (int age = 0; age <= KMPC_L; age++)
        for (int i = 0; i < 2; i++)
            answered[i] += L.kernel[2 * age + i] * newest[i - 2 * age] * K.command[i];
    terms_of(answered, all, by);
    for (int i = 0; i < L.terms; i++) {
        w[i] = all[L.term[i]];
        slope[2 * i] = by[2 * L.term[i]];
        slope[2 * i + 1] = by[2 * L.term[i] + 1];
    }
}

static struct kmpc_motion form(void)
{
    const struct kmpc_motion motion = {L.terms, L.nodes, L.motion, L.node};
    return motion;
}

void kmpc_model_linearize(const real *states, const real *window, int count, real *value,
                          real *by_x, real *by_u, real *by_past)
{
    const struct kmpc_motion motion = form();
    for (int k = 0; k < count; k++, value += 3, by_x += 9, by_u += 6, by_past += 6 * KMPC_L) {
        real x[3], w[KMPC_TERMS], slope[2 * KMPC_TERMS], by_w[3 * KMPC_TERMS];
        for (int i = 0; i < 3; i++)
            x[i] = states[3 * k + i] * K.state[i];
        inputs_of(window + 2 * (KMPC_L + k), w, slope);
        kmpc_linearize(&motion, 1, x, w, value, by_x, by_w);
        for (int i = 0; i < 3; i++) {
            value[i] /= K.state[i];
            for (int j = 0; j < 3; j++)
                by_x[3 * i + j] *= K.state[j] / K.state[i];
            for (int j = 0; j < 2; j++) {
                real by_answered = 0;
                for (int t = 0; t < L.terms; t++)
                    by_answered += by_w[i * L.terms + t] * slope[2 * t + j];
                by_answered *= K.command[j] / K.state[i];
                by_u[2 * i + j] = by_answered * L.kernel[j];
                for (int age = 1; age <= KMPC_L; age++)
                    by_past[6 * (age - 1) + 2 * i + j] = by_answered * L.kernel[2 * age + j];
            }
        }
    }
}

void kmpc_model_predict(const real *states, const real *window, int count, real *next)
{
    const struct kmpc_motion motion = form();
    for (int k = 0; k < count; k++, next += 3) {
        real x[3], w[KMPC_TERMS], slope[2 * KMPC_TERMS];
        for (int i = 0; i < 3; i++)
            x[i] = states[3 * k + i] * K.state[i];
        inputs_of(window + 2 * (KMPC_L + k), w, slope);
        kmpc_advance(&motion, 1, x, w, next);
        for (int i = 0; i < 3; i++)
            next[i] /= K.state[i];
    }
}

void kmpc_model_rollout(const real *here, const real *past, const real *commands, int count,
                        int periods, real *states)
{
    real window[2 * (KMPC_L + 1)] = {0}; /* the commands that act in a period, oldest first */
    memcpy(window, past + 2 * (KMPC_PAST - KMPC_L), 2 * KMPC_L * sizeof(real));
    memcpy(states, here, 3 * sizeof(real));
    for (int k = 0; k < periods; k++, states += 3) {
        for (int i = 0; i < 2; i++)
            window[2 * KMPC_L + i] = k < count ? commands[2 * k + i] : 0;
        kmpc_model_predict(states, window, 1, states + 3);
        memmove(window, window + 2, 2 * KMPC_L * sizeof(real));
    }
}

int kmpc_set_model(const struct kmpc_model *model)
{
    const size_t begins = offsetof(struct kmpc_model, kernel);
    if (model->terms < 2 || model->terms > KMPC_TERMS || model->nodes < 1 || model->nodes > 4 ||
        model->delay < 0 || model->delay > KMPC_N)
        return 1;
    for (int i = 0; i < model->terms; i++)
        if (model->term[i] < 0 || model->term[i] >= KMPC_TERMS)
            return 1;
    for (size_t at = begins; at < sizeof(*model); at += sizeof(real)) {
        real number;
        memcpy(&number, (const char *)model + at, sizeof(number));
        if (!(M(fabs)(number) < INFINITY)) /* also NaN */
            return 1;
    }
    kmpc_model = *model;
    return 0;
}
