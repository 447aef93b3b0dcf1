/* Where on a timed path a robot is, and the reference that it follows from there. */
#include "kernels.h"

#include <math.h>
#include <string.h>

static const real TURN_LENGTH = R(0.3), BACK = R(0.5), AHEAD = R(1.5), GOAL_STRETCH = R(0.5);
static const real TURN = R(6.28318530717958647692);

real kmpc_nearest_turn(real angle)
{
    return TURN * M(rint)(angle / TURN);
}

/* The pose at a time; the ends are held. */
void kmpc_pose_at(const struct kmpc_timed *path, real time, real *pose)
{
    int low = 0, high = path->poses - 1;
    if (!(time > path->time[low]) || time >= path->time[high]) {
        memcpy(pose, path->pose + 3 * (time >= path->time[high] ? high : low), 3 * sizeof(real));
        return;
    }
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        if (path->time[middle] <= time)
            low = middle;
        else
            high = middle;
    }
    const real *a = path->pose + 3 * low, *b = a + 3;
    const real whole = path->time[high] - path->time[low], late = time - path->time[low];
    const real rate = 1 / whole;
    pose[0] = (b[0] - a[0]) * rate * late + a[0];
    pose[1] = (b[1] - a[1]) * rate * late + a[1];
    pose[2] = (b[2] - a[2]) / whole * late + a[2];
}

real kmpc_leg_end(const struct kmpc_timed *path, real begin)
{
    for (int i = 0; i < path->cusps; i++)
        if (path->cusp[i] > begin)
            return path->cusp[i];
    return INFINITY;
}

void kmpc_locate(const struct kmpc_timed *path, const real *pose, real place, real least,
                 real *found)
{
    const real last = M(fmax)(place, least), duration = path->time[path->poses - 1];
    const real from = M(fmax)(place - BACK, least), to = M(fmin)(last + AHEAD, kmpc_leg_end(path, least));
    const long begin = (long)(from / path->step) + (path->cusps > 0);
    const long end = (long)(to / path->step) + 2;
    real at[3], best = INFINITY;
    kmpc_pose_at(path, M(fmin)((real)(long)(last / path->step) * path->step, duration), at);
    const real heading = pose[2] - kmpc_nearest_turn(pose[2] - at[2]);
    for (long i = begin; i == begin || i < end; i++) {
        const real time = M(fmin)(path->step * (real)i, duration);
        kmpc_pose_at(path, time, at);
        const real x = at[0] - pose[0], y = at[1] - pose[1];
        const real turn = TURN_LENGTH * (at[2] - heading), square = x * x + y * y + turn * turn;
        if (square < best || i == begin) {
            best = square;
            found[0] = time;
            found[1] = M(hypot)(x, y);
        }
        if (!(time < duration))
            break; /* the end is held */
    }
}

/* The time on the path of a robot that drives on from a place, braking where its leg ends. */
static real time_after(const struct kmpc_timed *path, real place, real leg, real later)
{
    const real end = M(fmin)(kmpc_leg_end(path, leg), path->time[path->poses - 2]), left = end - place;
    const real half = R(0.5) * path->braking;
    if (left <= 0 || path->braking == 0) /* evenly */
        return place + later;
    const real root = M(sqrt)(M(fmin)(left, half)), rate = 1 / M(sqrt)(2 * path->braking);
    const real slowed = later - M(fmax)(left - half, 0), rest = M(fmax)(root - rate * slowed, 0);
    const real time = slowed <= 0 ? place + later : end - rest * rest;
    return time + M(fmax)(slowed - root / rate, 0);
}

void kmpc_along_path(const struct kmpc_timed *path, int count, const real *later, real place,
                     real leg, real heading, int turning, real *states)
{
    const real drive_end = path->time[path->poses - 2], leg_ends = kmpc_leg_end(path, leg);
    real here[3];
    kmpc_pose_at(path, place, here);
    const real turns = kmpc_nearest_turn(heading - here[2]);
    for (int k = 0; k < count; k++, states += 3) {
        real time = turning ? place + later[k] : time_after(path, place, leg, later[k]);
        if (!turning && place > drive_end - GOAL_STRETCH)
            time = M(fmin)(time, drive_end);
        kmpc_pose_at(path, M(fmin)(time, leg_ends), states);
        states[2] += turns;
    }
}
