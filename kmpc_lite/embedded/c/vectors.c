/* Checks this build against the answers of the controller in Python on a recorded drive. */
#include <math.h>
#include <stdio.h>

#include "kmpc.h"
#include "vectors.h"

#ifdef KMPC_FLOAT
static const double NEAR = 2e-2; /* of the fastest command: float rounds, and plans go on from there */
#else
static const double NEAR = 1e-7;
#endif

int main(void)
{
    static struct kmpc robot;
    static struct kmpc_plan plan;
    double largest = 0;
    int other = 0;
    kmpc_reset(&robot);
    for (int i = 0; i < VECTORS; i++) {
        struct kmpc_input input = {{0, 0, 0}, {0, 0, 0}, CIRCLES, vector_circle[i], NULL, 0};
        for (int j = 0; j < 3; j++) {
            input.pose[j] = vector_pose[i][j];
            input.goal[j] = vector_goal[i][j];
        }
        kmpc_step(&robot, &input, &plan);
        other += (int)plan.status != vector_status[i];
        for (int j = 0; j < 2; j++) {
            const double apart = fabs((double)plan.command[j] - (double)vector_command[i][j]);
            if (!(apart <= largest))
                largest = apart;
        }
    }
    printf("%d steps: commands differ by %.2g at the most, %d statuses differ\n", (int)VECTORS, largest,
           other);
    return largest <= NEAR && (other == 0 || NEAR > 1e-3) ? 0 : 1;
}
