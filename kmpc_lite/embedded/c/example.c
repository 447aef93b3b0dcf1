/* A robot that drives to its goal past one circle: replace pose and wheels by your own. */
#include <math.h>
#include <stdio.h>

#include "kmpc.h"

int main(void)
{
    static struct kmpc robot;
    static struct kmpc_plan plan;
    const real goal_x = 12 * KMPC_RADIUS, circle[5] = {goal_x / 2, KMPC_RADIUS / 4, KMPC_RADIUS, 0, 0};
    real x = 0, y = 0, heading = 0;
    kmpc_reset(&robot);
    for (int k = 0; k < 200; k++) {
        const struct kmpc_input input = {{x, y, heading}, {goal_x, 0, 0}, 1, circle, NULL, 0};
        kmpc_step(&robot, &input, &plan);
        if (k % 10 == 0)
            printf("%5.2f s: %6.2f m %6.2f m %5.2f rad, %5.2f m/s %5.2f rad/s %s\n",
                   (double)(k * KMPC_DT), (double)x, (double)y, (double)heading,
                   (double)plan.command[0], (double)plan.command[1], plan.reason);
        heading += KMPC_DT * plan.command[1] / 2;
        x += KMPC_DT * plan.command[0] * (real)cos((double)heading);
        y += KMPC_DT * plan.command[0] * (real)sin((double)heading);
        heading += KMPC_DT * plan.command[1] / 2;
    }
    return 0;
}
