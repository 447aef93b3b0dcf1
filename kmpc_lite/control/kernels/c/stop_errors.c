/* What the errors of single periods add up to while a robot drives. */
#include "kernels.h"

#include <math.h>

/* Running sums of one speed's errors. */
struct sums {
    real squares, rates;             /* of rate^2, and of rate */
    real constant, linear, square;   /* of white noise by the way at its begin, to powers 0 to 2 */
    real weighed;                    /* of rate times the way at its begin */
};

/* Errors (motions, periods) of what is driven [m] and turned [rad] in each period.
 *
 * `position` and `heading` are variances of one period (4,): all by v^2 and by omega^2, then what
 * lasts of them. */
void kmpc_stop_errors(int motions, int periods, real dt, const real *distances, const real *turns,
                      const real *position, const real *heading, real rare, real usual, real reach,
                      real *errors)
{
    const real rare2 = rare * rare, usual2 = usual * usual;
    for (int c = 0; c < motions; c++, distances += periods, turns += periods, errors += periods) {
        struct sums by[2] = {{0, 0, 0, 0, 0, 0}, {0, 0, 0, 0, 0, 0}};
        real way = 0, worst[2] = {0, 0};
        for (int k = 0; k < periods; k++) {
            const real rate[2] = {M(fabs)(distances[k]) / dt, M(fabs)(turns[k]) / dt};
            const real begin = way;
            real single[2] = {0, 0}, summed[2] = {0, 0}, aside = 0;
            way += rate[0] * dt;
            for (int i = 0; i < 2; i++) {
                struct sums *sum = by + i;
                const real square = rate[i] * rate[i], lasts = heading[2 + i];
                const real fresh = heading[i] > lasts ? heading[i] - lasts : 0;
                const real white = rare2 * fresh * square;
                sum->squares += square;
                sum->rates += rate[i];
                sum->constant += white;
                sum->linear += white * begin;
                sum->square += white * begin * begin;
                sum->weighed += rate[i] * begin;
                for (int part = 0; part < 2; part++) {
                    const real *variance = part ? heading : position;
                    const real alike = variance[2 + i];
                    const real other = variance[i] > alike ? variance[i] - alike : 0;
                    single[part] += rare2 * variance[i] * square;
                    summed[part] += rare2 * other * sum->squares;
                    summed[part] += usual2 * alike * sum->rates * sum->rates;
                }
                aside += way * (way * sum->constant - 2 * sum->linear) + sum->square;
                const real led = way * sum->rates - sum->weighed;
                aside += usual2 * lasts * led * led;
            }
            for (int part = 0; part < 2; part++)
                if (worst[part] < single[part])
                    worst[part] = single[part];
            const real own = worst[0] > summed[0] ? worst[0] : summed[0];
            const real turned = worst[1] > summed[1] ? worst[1] : summed[1];
            errors[k] = M(sqrt)(own + (aside > 0 ? aside : 0));
            if (reach > 0)
                errors[k] += reach * M(sqrt)(turned);
        }
    }
}
