/* What a host says, how long it holds, and what the robot does about it. */
#include "host.h"

#include <math.h>
#include <string.h>

#include "core.h"

#define K kmpc_numbers

enum { FLOAT = 4 };

void kmpc_host_reset(struct kmpc_host *host)
{
    memset(host, 0, sizeof(*host));
    kmpc_reset(&host->robot);
    host->standing = KMPC_NO_GOAL;
}

static int was_said(const struct kmpc_host *host, int kind)
{
    return (int)(host->said >> kind & 1);
}

static void forget(struct kmpc_host *host, int kind)
{
    host->said &= ~((uint32_t)1 << kind);
}

static uint32_t age_of(const struct kmpc_host *host, uint32_t now, int kind)
{
    return now - host->heard[kind];
}

/* Floats of a payload; zero, or nonzero if one is not finite. */
static int floats_of(const unsigned char *payload, int count, real *out)
{
    for (int i = 0; i < count; i++, payload += FLOAT) {
        out[i] = (real)kmpc_get_float(payload);
        if (!(M(fabs)(out[i]) < INFINITY)) /* also NaN */
            return 1;
    }
    return 0;
}

/* Time since a pose or a velocity was true [ms]. */
static uint32_t measured_age(const struct kmpc_host *host, uint32_t now, int kind)
{
    const uint32_t age = now - host->measured[kind];
    return age > (uint32_t)-KMPC_AHEAD ? 0 : age;
}

static int take_pose(struct kmpc_host *host, const unsigned char *payload, int size)
{
    real pose[3];
    if (size != 3 * FLOAT + 4 || floats_of(payload, 3, pose))
        return 1;
    memcpy(host->pose, pose, sizeof(pose));
    host->measured[KMPC_SAY_POSE] = kmpc_get(payload + 3 * FLOAT, 4);
    return 0;
}

static int take_obstacles(struct kmpc_host *host, const unsigned char *payload, int size)
{
    real circle[5 * KMPC_THINGS];
    const int count = size / (5 * FLOAT);
    if (size % (5 * FLOAT) || count > KMPC_THINGS || floats_of(payload, 5 * count, circle))
        return 1;
    memcpy(host->circle, circle, 5 * (size_t)count * sizeof(real));
    host->circles = count;
    return 0;
}

/* A path that is said again is followed on from where the robot is on it. */
static int take_path(struct kmpc_host *host, const unsigned char *payload, int size)
{
    real path[3 * KMPC_PATH];
    const int count = size / (3 * FLOAT);
    const size_t bytes = 3 * (size_t)count * sizeof(real);
    if (size % (3 * FLOAT) || count > KMPC_PATH || floats_of(payload, 3 * count, path))
        return 1;
    if (count == host->poses && !memcmp(path, host->path, bytes))
        return 0;
    if (kmpc_set_path(&host->robot, count, path))
        return 1;
    memcpy(host->path, path, bytes);
    host->poses = count;
    return 0;
}

/* Where to: a goal, or nothing, which is none. */
static int take_goal(struct kmpc_host *host, const unsigned char *payload, int size)
{
    real goal[3];
    if ((size && size != 3 * FLOAT) || floats_of(payload, size / FLOAT, goal))
        return 1;
    forget(host, KMPC_SAY_VELOCITY);
    forget(host, KMPC_SAY_GOAL);
    if (size)
        memcpy(host->goal, goal, sizeof(goal));
    return !size;
}

static int take_velocity(struct kmpc_host *host, const unsigned char *payload, int size)
{
    real velocity[2];
    if (size != 2 * FLOAT + 4 || floats_of(payload, 2, velocity))
        return 1;
    forget(host, KMPC_SAY_GOAL);
    memcpy(host->velocity, velocity, sizeof(velocity));
    host->measured[KMPC_SAY_VELOCITY] = kmpc_get(payload + 2 * FLOAT, 4);
    return 0;
}

/* Take a message; nonzero if it says nothing. */
static int take_message(struct kmpc_host *host, int kind, const unsigned char *payload, int size)
{
    switch (kind) {
    case KMPC_SAY_HEARTBEAT:
        host->sequence = size == 4 ? kmpc_get(payload, 4) : host->sequence;
        return size != 4;
    case KMPC_SAY_POSE:
        return take_pose(host, payload, size);
    case KMPC_SAY_GOAL:
        return take_goal(host, payload, size);
    case KMPC_SAY_VELOCITY:
        return take_velocity(host, payload, size);
    case KMPC_SAY_OBSTACLES:
        return take_obstacles(host, payload, size);
    case KMPC_SAY_PATH:
        return take_path(host, payload, size);
    case KMPC_SAY_ESTOP:
        return size != 0;
    case KMPC_SAY_RELEASE:
        if (!size) {
            host->said = 0;
            host->poses = 0;
            kmpc_reset(&host->robot);
        }
        return 1;
    case KMPC_SAY_ASK:
        host->asked = !size;
        return 1;
    default:
        return 1;
    }
}

void kmpc_host_take(struct kmpc_host *host, uint32_t now, unsigned char byte)
{
    const int kind = kmpc_decode(&host->decoder, byte);
    if (kind && !take_message(host, kind, kmpc_payload(&host->decoder), host->decoder.size)) {
        host->said |= (uint32_t)1 << kind;
        host->heard[kind] = now;
    }
}

/* Whether it was said lately; what was not is forgotten, before the clock wraps. */
static int holds(struct kmpc_host *host, uint32_t now, int kind, uint32_t longest)
{
    const int dated = kind == KMPC_SAY_POSE || kind == KMPC_SAY_VELOCITY;
    if (age_of(host, now, kind) > longest || (dated && measured_age(host, now, kind) > longest))
        forget(host, kind);
    return was_said(host, kind);
}

static enum kmpc_standing why_not(struct kmpc_host *host, uint32_t now)
{
    if (was_said(host, KMPC_SAY_ESTOP))
        return KMPC_ESTOPPED;
    if (was_said(host, KMPC_SAY_VELOCITY))
        return holds(host, now, KMPC_SAY_VELOCITY, KMPC_VELOCITY_LASTS) ? KMPC_DRIVES
                                                                        : KMPC_HOST_SILENT;
    if (!was_said(host, KMPC_SAY_GOAL))
        return KMPC_NO_GOAL;
    if (!holds(host, now, KMPC_SAY_HEARTBEAT, KMPC_HEARTBEAT_LASTS))
        return KMPC_HOST_SILENT;
    if (!holds(host, now, KMPC_SAY_POSE, KMPC_POSE_LASTS))
        return KMPC_POSE_OLD;
    if (!holds(host, now, KMPC_SAY_OBSTACLES, KMPC_OBSTACLES_LAST))
        return KMPC_OBSTACLES_OLD;
    if (host->poses && !holds(host, now, KMPC_SAY_PATH, KMPC_PATH_LASTS))
        return KMPC_PATH_OLD;
    return KMPC_DRIVES;
}

/* The pose, moved on by its age at the last command. */
static void pose_now(const struct kmpc_host *host, uint32_t now, real *pose)
{
    const real age = (real)measured_age(host, now, KMPC_SAY_POSE) / 1000;
    const real turned = age * host->plan.command[1], middle = host->pose[2] + turned / 2;
    pose[0] = host->pose[0] + age * host->plan.command[0] * M(cos)(middle);
    pose[1] = host->pose[1] + age * host->plan.command[0] * M(sin)(middle);
    pose[2] = host->pose[2] + turned;
}

/* Plan a period; without a pose that is known, the last way to a stop is driven on. */
static void plan(struct kmpc_host *host, uint32_t now)
{
    real circle[5 * KMPC_THINGS];
    struct kmpc_input input = {{NAN, NAN, NAN}, {0, 0, 0}, host->circles, circle, NULL, host->passes};
    const real age = (real)age_of(host, now, KMPC_SAY_OBSTACLES) / 1000;
    memcpy(circle, host->circle, sizeof(circle));
    for (int i = 0; i < host->circles; i++)
        for (int j = 0; j < 2; j++)
            circle[5 * i + j] += age * circle[5 * i + 3 + j];
    if (host->standing == KMPC_DRIVES) {
        pose_now(host, now, input.pose);
        memcpy(input.goal, host->goal, sizeof(input.goal));
    } else if (host->standing == KMPC_OBSTACLES_OLD) {
        input.circles = 0;
    }
    kmpc_step(&host->robot, &input, &host->plan);
}

void kmpc_host_tick(struct kmpc_host *host, uint32_t now, real *command)
{
    const int32_t period = (int32_t)(KMPC_DT * 1000 + R(0.5)), left = (int32_t)(host->due - now);
    host->standing = why_not(host, now);
    if (host->standing == KMPC_ESTOPPED || was_said(host, KMPC_SAY_VELOCITY)) {
        const int drives = host->standing == KMPC_DRIVES;
        kmpc_reset(&host->robot);
        host->poses = 0;
        memset(&host->plan, 0, sizeof(host->plan));
        host->plan.status = KMPC_STOPPED;
        for (int i = 0; i < 2 && drives; i++)
            host->plan.command[i] = kmpc_clip(host->velocity[i], K.u_min[i] * K.command[i],
                                              K.u_max[i] * K.command[i]);
        host->due = now;
    } else if (left <= 0 || left > period) {
        host->due = (left > -period && left <= 0 ? host->due : now) + (uint32_t)period;
        plan(host, now);
    }
    memcpy(command, host->plan.command, sizeof(host->plan.command));
}

int kmpc_host_report(struct kmpc_host *host, uint32_t now, unsigned char *frame)
{
    unsigned char payload[64], *at = payload;
    if (host->asked) { /* stages, past commands, circles, poses of a path, period, radius, bounds */
        host->asked = 0;
        at = kmpc_put(at, KMPC_N, 1);
        at = kmpc_put(at, KMPC_L, 1);
        at = kmpc_put(at, KMPC_THINGS, 1);
        at = kmpc_put(at, KMPC_PATH, 1);
        at = kmpc_put_float(at, (float)KMPC_DT);
        at = kmpc_put_float(at, (float)KMPC_RADIUS);
        for (int i = 0; i < 2; i++) {
            at = kmpc_put_float(at, (float)(K.u_min[i] * K.command[i]));
            at = kmpc_put_float(at, (float)(K.u_max[i] * K.command[i]));
        }
        return kmpc_encode(KMPC_TELL_ABOUT, payload, (int)(at - payload), frame);
    }
    uint32_t age = 0xffff; /* of the pose [ms], as far as two bytes go */
    if (was_said(host, KMPC_SAY_POSE) && measured_age(host, now, KMPC_SAY_POSE) < age)
        age = measured_age(host, now, KMPC_SAY_POSE);
    at = kmpc_put(at, now, 4);
    at = kmpc_put(at, host->sequence, 4);
    at = kmpc_put(at, host->decoder.good, 4);
    at = kmpc_put(at, host->decoder.bad, 4);
    at = kmpc_put(at, (uint32_t)host->standing, 1);
    at = kmpc_put(at, (uint32_t)host->plan.status, 1);
    at = kmpc_put(at, (uint32_t)host->plan.passes, 1);
    at = kmpc_put(at, (uint32_t)host->poses, 1);
    at = kmpc_put(at, age, 2);
    for (int i = 0; i < 2; i++)
        at = kmpc_put_float(at, (float)host->plan.command[i]);
    for (int i = 0; i < 3; i++)
        at = kmpc_put_float(at, (float)host->pose[i]);
    return kmpc_encode(KMPC_TELL_STATE, payload, (int)(at - payload), frame);
}
