/* The learned model, by the numbers of this robot. */
#include "core.h"

#include <stddef.h>

#define K kmpc_numbers

static struct kmpc_predictor predictor(void)
{
    return (struct kmpc_predictor){2, KMPC_L + 1, 1, K.terms, K.nodes, 0, K.term, K.kernel,
                                   K.smoothing, K.limits, K.motion, K.node, K.state, K.command};
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
