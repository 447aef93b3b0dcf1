/* Shortest ways on a grid to a goal: Dijkstra's algorithm over sixteen neighbours of each node. */
#include <math.h>

#include "kernels.h"

static const int MOVES[8][2] = {{0, 1}, {1, -1}, {1, 0}, {1, 1}, {1, 2}, {2, 1}, {2, -1}, {1, -2}};

struct heap { /* of nodes that are not settled, the nearest first; place: where each stands in it */
    int count, *node, *place;
    const real *cost;
};

static void put(struct heap *h, int node, int at)
{
    h->node[at] = node;
    h->place[node] = at;
}

static void rise(struct heap *h, int node, int at)
{
    for (; at > 0 && h->cost[node] < h->cost[h->node[(at - 1) / 2]]; at = (at - 1) / 2)
        put(h, h->node[(at - 1) / 2], at);
    put(h, node, at);
}

static int take_nearest(struct heap *h)
{
    const int nearest = h->node[0], last = h->node[--h->count];
    int at = 0;
    for (int child = 1; child < h->count; child = 2 * at + 1) {
        if (child + 1 < h->count && h->cost[h->node[child + 1]] < h->cost[h->node[child]])
            child++;
        if (h->cost[last] <= h->cost[h->node[child]])
            break;
        put(h, h->node[child], at);
        at = child;
    }
    put(h, last, at);
    return nearest;
}

void kmpc_ways(int height, int width, const unsigned char *usable, const real *factor, real step,
               int goal, real *cost, int *towards, int *room)
{
    struct heap open = {1, room, room + height * width, cost};
    struct { /* by rows and columns; a longer one passes between a node ahead and one askew */
        int down, right, there, ahead, askew;
        real length;
    } moves[16];
    for (int i = 0; i < 16; i++) {
        const int back = i < 8 ? 1 : -1;
        const int down = back * MOVES[i % 8][0], right = back * MOVES[i % 8][1];
        moves[i].down = down;
        moves[i].right = right;
        moves[i].there = down * width + right;
        moves[i].ahead = down / 2 * width + right / 2;
        moves[i].askew = moves[i].there - moves[i].ahead;
        moves[i].length = step * M(sqrt)((real)(down * down + right * right));
    }
    for (int i = 0; i < height * width; i++) {
        cost[i] = (real)INFINITY;
        towards[i] = -1;
    }
    cost[goal] = 0;
    put(&open, goal, 0);
    while (open.count) {
        const int here = take_nearest(&open), row = here / width, column = here % width;
        for (int i = 0; usable[here] && i < 16; i++) {
            const int to_row = row + moves[i].down, to_column = column + moves[i].right;
            if (to_row < 0 || to_row >= height || to_column < 0 || to_column >= width)
                continue;
            const int there = here + moves[i].there, at = towards[there];
            const real sum = cost[here] + moves[i].length * factor[i < 8 ? here : there];
            if (!(sum < cost[there]) || !usable[there] || !usable[here + moves[i].ahead] ||
                !usable[here + moves[i].askew])
                continue;
            cost[there] = sum;
            towards[there] = here;
            rise(&open, there, at < 0 ? open.count++ : open.place[there]);
        }
    }
}
