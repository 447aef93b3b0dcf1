/* The learned model, by the numbers of this robot. */
#include "core.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#define K kmpc_numbers
#define L kmpc_model

static struct kmpc_predictor predictor(void)
{
    return (struct kmpc_predictor){2, KMPC_L + 1, 1, L.terms, L.nodes, 0, L.term, L.kernel,
                                   L.smoothing, L.limits, L.motion, L.node, K.state, K.command};
}

void kmpc_model_linearize(const real *states, const real *window, real *value, real *by_x,
                          real *by_u, real *by_past)
{
    const struct kmpc_predictor p = predictor();
    for (int k = 0; k < KMPC_N; k++, states += 3, value += 3) {
        const struct kmpc_sent sent = {window + 2 * (KMPC_L + k), NULL, KMPC_L, 0};
        const int at = by_x ? k : 0;
        kmpc_linearize(&p, states, &sent, value, by_x + 9 * at, by_u + 6 * at,
                       by_past + 6 * KMPC_L * at);
    }
}

void kmpc_model_rollout(const real *here, const real *past, const real *commands, int count,
                        int periods, real *states)
{
    const struct kmpc_predictor p = predictor();
    kmpc_rollout(&p, periods, count, here, commands, past + 2 * (KMPC_PAST - KMPC_L), states);
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
