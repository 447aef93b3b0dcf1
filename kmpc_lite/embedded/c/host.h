/* A robot that a host sends poses, goals, obstacles and paths to, and that stops without them.
 *
 * Feed it every byte that comes (`kmpc_host_take`), and ask it for a command on a timer
 * (`kmpc_host_tick`, at least every KMPC_DT): it plans when a period has passed. Times are those of
 * one clock of yours that counts milliseconds and may wrap.
 */
#ifndef KMPC_HOST_H
#define KMPC_HOST_H

#include "kmpc.h"
#include "messages.h"

#ifdef __cplusplus
extern "C" {
#endif

/* How long what was said holds [ms]: then the robot comes to rest, until it is said again. */
enum {
    KMPC_POSE_LASTS = 200,
    KMPC_VELOCITY_LASTS = 250,
    KMPC_HEARTBEAT_LASTS = 500,
    KMPC_OBSTACLES_LAST = 1000,
    KMPC_PATH_LASTS = 2000,
    KMPC_AHEAD = 50 /* what seems to be of a later time by more is not believed */
};

enum kmpc_standing { /* why the robot stands, or comes to rest */
    KMPC_DRIVES,
    KMPC_NO_GOAL,
    KMPC_ESTOPPED,
    KMPC_HOST_SILENT,
    KMPC_POSE_OLD,
    KMPC_OBSTACLES_OLD, /* or never said: none must be said, too */
    KMPC_PATH_OLD
};

struct kmpc_host {
    struct kmpc robot;
    struct kmpc_plan plan;
    struct kmpc_decoder decoder;
    int passes; /* most passes of a step; 0: as many as Python */
    /* what was said, and when [ms]; `said` has a bit for each kind */
    uint32_t said, heard[16];
    uint32_t sequence, due;
    uint32_t measured[16]; /* the robot's time of what was said, of a pose and a velocity [ms] */
    real pose[3], goal[3], velocity[2], circle[5 * KMPC_THINGS], path[3 * KMPC_PATH];
    int circles, poses;
    enum kmpc_standing standing;
    int asked; /* who is there? */
};

/* A robot that stands, and has heard nothing. */
void kmpc_host_reset(struct kmpc_host *host);

/* Take a byte that came. */
void kmpc_host_take(struct kmpc_host *host, uint32_t now, unsigned char byte);

/* The command to drive now: speed [m/s] and turn rate [rad/s], always within bounds. */
void kmpc_host_tick(struct kmpc_host *host, uint32_t now, real *command);

/* What the host is told, into KMPC_FRAME bytes; how many. */
int kmpc_host_report(struct kmpc_host *host, uint32_t now, unsigned char *frame);

#ifdef __cplusplus
}
#endif
#endif
