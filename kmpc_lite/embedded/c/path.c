/* The way along a path from a host: the reference that a plan follows. */
#include "core.h"

#include <math.h>
#include <string.h>

#define K kmpc_numbers

enum { PARTS = 8 };
static const real AHEAD = R(2.0); /* time along the path in which the robot is looked for [s] */
static const real PACE = R(0.8);  /* of the fastest speeds: some is kept to catch up with */
static const real LEAD = R(0.5);  /* most time by which the reference is ahead of the robot [s] */
static const real PI = R(3.14159265358979323846);

static real nearest_turn(real angle)
{
    return 2 * PI * M(rint)(angle / (2 * PI));
}

/* Time between two poses of a path: the slower of driving and turning. */
static real time_between(const real *a, const real *b)
{
    const real speed = PACE * K.fastest[0] * K.command[0];
    const real turning = PACE * K.fastest[1] * K.command[1];
    const real drive = M(hypot)(b[0] - a[0], b[1] - a[1]) / speed;
    const real turn = M(fabs)(b[2] - a[2]) / turning;
    return drive > turn ? drive : turn;
}

/* The pose of a path at a time. */
static void at_time(const struct kmpc_path *path, real time, real *pose)
{
    int i = 0;
    while (i + 2 < path->count && path->begins[i + 1] <= time)
        i++;
    if (i + 1 >= path->count) {
        memcpy(pose, path->pose[i], 3 * sizeof(real));
        return;
    }
    const real whole = path->begins[i + 1] - path->begins[i];
    const real share = whole > 0 ? kmpc_clip((time - path->begins[i]) / whole, 0, 1) : 1;
    for (int j = 0; j < 3; j++)
        pose[j] = path->pose[i][j] + share * (path->pose[i + 1][j] - path->pose[i][j]);
}

/* How far a robot is from the path's pose at a time; a turn counts as its rim moves. */
static real distance_at(const struct kmpc_path *path, real time, const real *here)
{
    real pose[3];
    at_time(path, time, pose);
    const real turn = here[2] - pose[2];
    return M(hypot)(here[0] - pose[0], here[1] - pose[1]) +
           KMPC_RADIUS * M(fabs)(turn - nearest_turn(turn));
}

/* Go to the nearest place within a stretch of time of both ways. */
static void find_robot(struct kmpc_path *path, const real *here)
{
    const real last = path->begins[path->count - 1];
    int parts = PARTS;
    real width = AHEAD, best = path->time;
    if (best < 0) { /* a new path: anywhere on it */
        best = width = R(0.5) * last;
        parts = KMPC_PATH;
    }
    real least = distance_at(path, best, here);
    for (int round = 0; round < 3; round++, width /= (real)parts, parts = PARTS) {
        const real middle = best;
        for (int i = -parts; i <= parts; i++) {
            const real time = kmpc_clip(middle + width * (real)i / (real)parts, 0, last);
            const real distance = distance_at(path, time, here);
            if (distance < least) {
                least = distance;
                best = time;
            }
        }
    }
    path->time = best;
}

void kmpc_follow_path(struct kmpc_path *path, const real *here, real *reference)
{
    const real before = path->time + KMPC_DT, last = path->begins[path->count - 1];
    real first[3];
    find_robot(path, here);
    /* one that stands is led on, or a short horizon would leave it where it is */
    const real ahead = path->time + LEAD < last ? path->time + LEAD : last;
    if (before > path->time)
        path->time = before < ahead ? before : ahead;
    at_time(path, path->time, first);
    const real turns = nearest_turn(here[2] - first[2]);
    for (int k = 0; k <= KMPC_N; k++) {
        real *row = reference + 3 * k;
        at_time(path, path->time + KMPC_DT * (real)k, row);
        row[2] += turns;
    }
}

int kmpc_set_path(struct kmpc *robot, int count, const real *poses)
{
    struct kmpc_path *path = &robot->path;
    if (count < 0 || count > KMPC_PATH)
        return 1;
    for (int i = 0; i < 3 * count; i++)
        if (!(M(fabs)(poses[i]) <= R(1e4))) /* also NaN */
            return 1;
    memset(path, 0, sizeof(*path));
    path->count = count;
    path->time = -1;
    for (int k = 0; k < count; k++) {
        real *pose = path->pose[k];
        memcpy(pose, poses + 3 * k, 3 * sizeof(real));
        if (k) {
            pose[2] -= nearest_turn(pose[2] - path->pose[k - 1][2]);
            path->begins[k] = path->begins[k - 1] + time_between(path->pose[k - 1], pose);
        }
    }
    return 0;
}
