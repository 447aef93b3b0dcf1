/* Safe motions: which of them stay clear until they end. */
#include "kernels.h"

#include <math.h>

static const real TINY = R(1e-9), LEAVES = R(0.5);

/* Both give NaN if either is. */
static real smaller(real a, real b)
{
    return a < b || a != a ? a : b;
}

static real larger(real a, real b)
{
    return a > b || a != a ? a : b;
}

/* Poses (motions, periods count, 3) on the arcs between states (motions, periods + 1, 3). */
void kmpc_samples(int motions, int periods, int count, const real *states, real *poses)
{
    for (int c = 0; c < motions; c++, states += 3)
        for (int k = 0; k < periods; k++, states += 3) {
            const real dx = states[3] - states[0], dy = states[4] - states[1];
            const real turn = states[5] - states[2], lean = M(tan)(R(0.25) * turn);
            for (int i = 1; i <= count; i++, poses += 3) {
                const real share = (real)i / (real)count;
                const real bulge = 2 * (share * (1 - share)) * lean;
                poses[0] = states[0] + share * dx + bulge * dy;
                poses[1] = states[1] + share * dy - bulge * dx;
                poses[2] = states[2] + share * turn;
            }
        }
}

/* Clearance (motions, samples, places, things) less what chords between samples at (motions,
 * samples, places, 2) may cut off; `standing` (samples, places, things) is that of a robot that
 * stays where it begins (places, 2). */
void kmpc_between_samples(int motions, int samples, int places, int things, const real *clearance,
                          const real *standing, const real *at, const real *begin, real radius,
                          real *out)
{
    const int row = places * things;
    for (int c = 0; c < motions; c++)
        for (int q = 0; q < samples; q++)
            for (int e = 0; e < places; e++, at += 2) {
                const real *from = q ? at - 2 * places : begin + 2 * e;
                const real dx = at[0] - from[0], dy = at[1] - from[1];
                const real lost = (dx * dx + dy * dy) / (8 * radius);
                for (int k = 0; k < things; k++, clearance++) {
                    const real before = q ? clearance[-row] : standing[e * things + k];
                    const real ends = *clearance - lost;
                    /* a chord that leads away begins at its nearest */
                    *out++ = *clearance - before < lost ? smaller(ends, before - lost) : ends;
                }
            }
}

/* Which motions keep more than `kmpc_admissible` can ask of them. */
void kmpc_surely_clear(int motions, int samples, int cells, const real *clearance,
                       const real *margins, const real *error, const real *travel, const int *ends,
                       real lost, unsigned char *clear)
{
    for (int c = 0; c < motions; c++) {
        const real coming = error[c] + LEAVES * travel[c];
        clear[c] = 1;
        for (int q = 0; q < samples; q++, margins++)
            for (int i = 0; i < cells; i++, clearance++)
                /* also false for NaN */
                if (q < ends[c] && !(*clearance >= larger(*margins, coming) + lost))
                    clear[c] = 0;
    }
}

/* Which motions stay clear until they end. Sizes as in the Python kernel; `margins` (motions,
 * samples), `driven` (motions, samples, places), `error` (motions, places, things). */
void kmpc_admissible(int motions, int samples, int places, int things, int first,
                     const real *clearance, const real *standing, const real *spend,
                     const real *margins, const real *driven, const real *error,
                     const unsigned char *turns, const unsigned char *strict, const int *ends,
                     real unsure, unsigned char *clear)
{
    const int row = places * things;
    for (int c = 0; c < motions; c++) {
        clear[c] = 1;
        for (int q = 0; q < samples; q++)
            for (int i = 0; i < row; i++) {
                const int e = i / things;
                const real have = clearance[(c * samples + q) * row + i];
                const real stands = standing[q * row + i];
                const real left = stands - spend[q * row + i];
                real needed = smaller(margins[c * samples + q], left);
                if (q < first) {
                    const real half = LEAVES * driven[(c * samples + q) * places + e];
                    const real own = error[c * row + i], gain = have - stands;
                    const real kept =
                        smaller(left, unsure) + (turns[i % things] ? larger(half, own) : own);
                    needed = gain > 0 && gain >= half ? left : larger(needed, kept);
                }
                if (strict[c])
                    needed = margins[c * samples + q];
                /* also false for NaN */
                if (q < ends[c] && !(have >= needed - TINY))
                    clear[c] = 0;
            }
    }
}
