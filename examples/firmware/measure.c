/* Checks the vectors on the board, and counts what steps take: instructions and stack. */
#include <math.h>
#include <stdio.h>

#include "board.h"
#include "kmpc.h"

enum { PAINT = 0xa5, HEAP = 8192 /* of printf */, SPARE = 128, TICK = 40 /* instructions */ };

int check_vectors(void); /* main of vectors.c */
void __real_kmpc_step(struct kmpc *robot, const struct kmpc_input *input, struct kmpc_plan *plan);
void __wrap_kmpc_step(struct kmpc *robot, const struct kmpc_input *input, struct kmpc_plan *plan);

static uint32_t steps, most, deepest;
static uint64_t sum;

/* Stands in for kmpc_step: linked with --wrap=kmpc_step. */
void __wrap_kmpc_step(struct kmpc *robot, const struct kmpc_input *input, struct kmpc_plan *plan)
{
    volatile unsigned char *const low = board_end_of_memory() + HEAP;
    volatile unsigned char *const here = (volatile unsigned char *)__builtin_frame_address(0) - SPARE;
    volatile unsigned char *at;
    for (at = low; at < here; at++)
        *at = PAINT;
    board_feed_watchdog();
    const uint32_t begun = board_ticks();
    __real_kmpc_step(robot, input, plan);
    const uint32_t took = TICK * (board_ticks() - begun);
    for (at = low; *at == PAINT && at < here; at++)
        ;
    deepest = (uint32_t)(here - at) + SPARE > deepest ? (uint32_t)(here - at) + SPARE : deepest;
    most = took > most ? took : most;
    sum += took;
    steps++;
}

static void report(const char *name)
{
    printf("%s %lu %lu\n", name, (unsigned long)(sum / steps), (unsigned long)most);
    steps = most = 0;
    sum = 0;
}

/* A drive along a path past four circles: at most so many passes a step. */
static void drive(int passes, const char *name)
{
    static struct kmpc robot;
    static struct kmpc_plan plan;
    const real a = KMPC_RADIUS;
    const real circle[4][5] = {
        {5 * a, a, a, 0, 0}, {9 * a, 6 * a, a, 0, 0}, {11 * a, -2 * a, a, 0, 0}, {15 * a, 3 * a, a, 0, 0}};
    const real path[4][3] = {{0, 0, R(0.6)}, {6 * a, 4 * a, R(0.6)}, {13 * a, 0, R(-0.5)}, {20 * a, 0, 0}};
    real pose[3] = {0, 0, 0};
    kmpc_reset(&robot);
    kmpc_set_path(&robot, 4, path[0]);
    for (int k = 0; k < 60; k++) {
        struct kmpc_input input = {{pose[0], pose[1], pose[2]}, {20 * a, 0, 0}, 4, circle[0], NULL, passes};
        kmpc_step(&robot, &input, &plan);
        pose[0] += KMPC_DT * plan.command[0] * M(cos)(pose[2]);
        pose[1] += KMPC_DT * plan.command[0] * M(sin)(pose[2]);
        pose[2] += KMPC_DT * plan.command[1];
    }
    report(name);
}

int main(void)
{
    board_start();
    const int wrong = check_vectors();
    report("vectors");
    drive(0, "drive");
    drive(2, "two_passes");
    drive(1, "one_pass");
    printf("stack %lu 0\n", (unsigned long)deepest);
    return wrong;
}
