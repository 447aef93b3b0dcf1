/* A step: take in, solve, verify, command; or drive the last way to a stop on, or brake. */
#include "core.h"

#include <math.h>
#include <string.h>

#define K kmpc_numbers

static const real PI = R(3.14159265358979323846), LIMIT = R(1e4), ROUNDING = R(1e-9);
static const real HUGE_NUMBER = R(1e30);

/* What a step sees, in the robot's units, its heading within one turn. */
struct seen {
    real pose[3], goal[3], turns;
    real thing[KMPC_THINGS * KMPC_THING];
    int things, pose_is_known;
    const char *refusal; /* null if it can be planned */
};

/* The nearest circles, as many as are looked at; whether all that are given are usable. */
static int take_circles(const struct kmpc_input *input, const real *here, struct seen *seen)
{
    real far[KMPC_THINGS];
    seen->things = 0;
    for (int i = 0; i < input->circles; i++) {
        const real *circle = input->circle + 5 * i;
        real row[KMPC_THING] = {0};
        if (!kmpc_all_within(circle, 5, LIMIT) || circle[2] < 0)
            return 0;
        for (int j = 0; j < 5; j++)
            row[j] = circle[j] / K.circle[j];
        const real away = M(hypot)(row[0] - here[0], row[1] - here[1]) - row[2];
        int at = seen->things < KMPC_THINGS ? seen->things++ : 0;
        for (int j = 1; j < KMPC_THINGS && i >= KMPC_THINGS; j++)
            at = far[j] > far[at] ? j : at;
        if (i >= KMPC_THINGS && !(away < far[at]))
            continue;
        far[at] = away;
        memcpy(seen->thing + KMPC_THING * at, row, sizeof(row));
    }
    return input->circles >= 0;
}

static void take_in(const struct kmpc *robot, const struct kmpc_input *input, struct seen *seen)
{
    seen->pose_is_known = kmpc_all_within(input->pose, 3, LIMIT);
    for (int i = 0; i < 3; i++) {
        seen->pose[i] = input->pose[i] / K.state[i];
        seen->goal[i] = input->goal[i] / K.state[i];
    }
    const real *here = seen->pose_is_known ? seen->pose : robot->expected;
    seen->refusal = take_circles(input, here, seen) ? NULL : "obstacle not usable";
    if (seen->refusal)
        seen->things = 0;
    if (!seen->refusal && !seen->pose_is_known)
        seen->refusal = "pose not usable";
    if (!seen->refusal && !kmpc_all_within(input->goal, 3, LIMIT))
        seen->refusal = "goal not usable";
    seen->turns = seen->pose_is_known ? kmpc_nearest_turn(seen->pose[2]) : 0;
    seen->pose[2] -= seen->turns;
    if (!seen->refusal)
        seen->goal[2] -= kmpc_nearest_turn(seen->goal[2]);
}

/* The goal as the reference; near a half turn the side of the step before is kept. */
static void towards_goal(struct kmpc *robot, const struct seen *seen, struct kmpc_way *way)
{
    real turn = seen->goal[2] - seen->pose[2];
    turn -= kmpc_nearest_turn(turn);
    if (M(fabs)(turn) > R(0.75) * PI && turn * robot->turn < 0 &&
        M(fabs)(robot->turn) > R(0.5) * PI)
        turn -= M(copysign)(2 * PI, turn);
    robot->turn = turn;
    for (int k = 0; k <= KMPC_N; k++) {
        way->reference[3 * k] = seen->goal[0];
        way->reference[3 * k + 1] = seen->goal[1];
        way->reference[3 * k + 2] = seen->pose[2] + turn;
    }
    for (int k = 0; k < KMPC_N; k++)
        way->clearance[k] = R(1e20);
    way->share_at_goal = way->to_goal = 1;
    way->holds = 0;
}

/* The last plan one period later, if the robot is where that put it; whether it is. */
static int one_period_later(const struct kmpc *robot, const real *here, struct kmpc_iterate *out)
{
    if (!robot->planned)
        return 0;
    const real off[3] = {robot->states[1][0] - here[0], robot->states[1][1] - here[1],
                         robot->states[1][2] - here[2]};
    const real turns = M(fabs)(off[2]) <= LIMIT ? kmpc_nearest_turn(off[2]) : 0;
    /* also false for NaN */
    if (!(M(fabs)(off[0]) <= K.lost && M(fabs)(off[1]) <= K.lost && M(fabs)(off[2] - turns) <= 1))
        return 0;
    for (int k = 0; k <= KMPC_N; k++) {
        const int from = k + 1 < KMPC_N ? k + 1 : KMPC_N;
        for (int i = 0; i < 3; i++) {
            out->states[k][i] = k ? robot->states[from][i] : here[i];
            if (!(M(fabs)(out->states[k][i] - here[i]) <= 2 * LIMIT))
                return 0;
        }
        if (k)
            out->states[k][2] -= turns;
    }
    for (int k = 0; k < KMPC_N; k++)
        for (int i = 0; i < 2; i++)
            out->inputs[k][i] = robot->inputs[k + 1 < KMPC_N ? k + 1 : KMPC_N - 1][i];
    for (int i = 0; i < KMPC_ROWS; i++)
        out->duals[i] = robot->duals[K.next_stage[i]];
    return 1;
}

/* A robot that follows a reference as fast as it can, whatever its wheels can. */
static void along(const real *reference, const real *here, struct kmpc_iterate *out)
{
    for (int k = 0; k <= KMPC_N; k++) {
        const real *to = reference + 3 * k;
        const real far = M(hypot)(to[0] - here[0], to[1] - here[1]);
        const real share = K.fastest[0] * K.dt * (real)k / (far > ROUNDING ? far : ROUNDING);
        for (int i = 0; i < 3; i++)
            out->states[k][i] = here[i] + (share < 1 ? share : 1) * (to[i] - here[i]);
    }
    for (int k = 0; k < KMPC_N; k++) {
        const real *a = out->states[k], *b = out->states[k + 1];
        const real ahead = M(cos)(a[2]) * (b[0] - a[0]) + M(sin)(a[2]) * (b[1] - a[1]);
        out->inputs[k][0] = kmpc_clip(ahead / K.dt, K.u_min[0], K.u_max[0]);
        out->inputs[k][1] = kmpc_clip((b[2] - a[2]) / K.dt, K.u_min[1], K.u_max[1]);
    }
    kmpc_duals_in_the_open(out->duals);
}

static void remember(struct kmpc *robot, const real *command)
{
    memmove(robot->past[0], robot->past[KMPC_PAST > 1 ? 1 : 0],
            2 * (KMPC_PAST - 1) * sizeof(real));
    memcpy(robot->past[KMPC_PAST - 1], command, 2 * sizeof(real));
}

static void answer(const struct seen *seen, const real *states, const real *inputs,
                   struct kmpc_plan *plan)
{
    for (int k = 0; k <= KMPC_N; k++)
        for (int i = 0; i < 3; i++)
            plan->states[k][i] = (states[3 * k + i] + (i == 2 ? seen->turns : 0)) * K.state[i];
    for (int k = 0; k < KMPC_N; k++)
        for (int i = 0; i < 2; i++)
            plan->inputs[k][i] = inputs[2 * k + i] * K.command[i];
    for (int i = 0; i < 2; i++) {
        const real least = K.u_min[i] * K.command[i], most = K.u_max[i] * K.command[i];
        const real asked = plan->inputs[0][i];
        plan->command[i] = asked == asked ? kmpc_clip(asked, least, most) : 0; /* never NaN */
    }
}

/* Without a plan: the last way to a stop while it is clear, else brake. */
static void stop(struct kmpc *robot, const struct seen *seen, const char *reason, int passes,
                 struct kmpc_plan *plan)
{
    static real states[3 * (KMPC_T + KMPC_L + 1)], shown[3 * (KMPC_N + 1)], inputs[2 * KMPC_N];
    static real ramp[2 * KMPC_T];
    const real *here = seen->pose_is_known ? seen->pose : robot->expected;
    int blocked = 0;
    plan->passes = passes;
    plan->reason = reason;
    memset(inputs, 0, sizeof(inputs));
    if (robot->resting && (seen->pose_is_known || robot->expects)) {
        const int periods = robot->resting + KMPC_L;
        kmpc_model_rollout(here, robot->past[0], robot->rest[0], robot->resting, periods, states);
        blocked = !(kmpc_clearance_along(states, periods + 1, seen->things, seen->thing) >= 0);
        if (!blocked && kmpc_all_within(states, 3 * (periods + 1), HUGE_NUMBER)) {
            real command[2] = {robot->rest[0][0], robot->rest[0][1]};
            kmpc_rate_limit(robot->past[KMPC_PAST - 1], command);
            for (int k = 0; k < KMPC_N && k < KMPC_T && k < robot->resting; k++)
                for (int i = 0; i < 2; i++)
                    inputs[2 * k + i] = k ? robot->rest[k][i] : command[i];
            for (int k = 0; k <= KMPC_N; k++)
                memcpy(shown + 3 * k, states + 3 * (k < periods ? k : periods), 3 * sizeof(real));
            robot->resting--;
            memmove(robot->rest[0], robot->rest[1], 2 * (size_t)robot->resting * sizeof(real));
            memcpy(robot->expected, states + 3, 3 * sizeof(real));
            robot->expects = 1;
            remember(robot, command);
            plan->status = KMPC_FALLBACK;
            answer(seen, shown, inputs, plan);
            return;
        }
    }
    robot->planned = 0;
    if (!blocked) {
        kmpc_braking(robot->past[KMPC_PAST - 1], ramp);
        memcpy(inputs, ramp, 2 * sizeof(real));
    }
    kmpc_rate_limit(robot->past[KMPC_PAST - 1], inputs);
    robot->resting = robot->expects = 0;
    remember(robot, inputs);
    for (int k = 0; k <= KMPC_N; k++)
        for (int i = 0; i < 3; i++)
            shown[3 * k + i] = kmpc_all_within(seen->pose + i, 1, HUGE_NUMBER) ? seen->pose[i] : 0;
    plan->status = KMPC_STOPPED;
    answer(seen, shown, inputs, plan);
}

const int kmpc_bytes = sizeof(struct kmpc);

void kmpc_reset(struct kmpc *robot)
{
    memset(robot, 0, sizeof(*robot));
}

/* Whether what a solver found may be driven, slowed where that makes it safe; why not fully. */
static int verify(const struct kmpc *robot, const struct seen *seen, struct kmpc_iterate *plan,
                  struct kmpc_result *result, struct kmpc_motion_to_rest *motion)
{
    int slowed;
    if (result->failed)
        return 0;
    if (!(result->defect < INFINITY)) {
        result->reason = "the model's prediction is not finite";
        result->failed = 1;
        return 0;
    }
    const int contradicted = !(result->defect <= K.accepted_defect);
    real here[3], command[2] = {plan->inputs[0][0], plan->inputs[0][1]};
    if (contradicted)
        result->reason = "rolled out anew: the model contradicted the plan";
    kmpc_rate_limit(robot->past[KMPC_PAST - 1], command);
    if (contradicted || command[0] != plan->inputs[0][0] || command[1] != plan->inputs[0][1]) {
        memcpy(plan->inputs[0], command, sizeof(command));
        memcpy(here, plan->states[0], sizeof(here));
        kmpc_model_rollout(here, robot->past[0], plan->inputs[0], KMPC_N, KMPC_N, plan->states[0]);
        if (!kmpc_all_within(plan->states[0], 3 * (KMPC_N + 1), HUGE_NUMBER))
            return 0;
        memcpy(result->next_state, plan->states[1], 3 * sizeof(real));
    }
    if (contradicted && !K.tightens &&
        !(kmpc_clearance_along(plan->states[0], KMPC_N + 1, seen->things, seen->thing) >=
          -K.accepted_depth))
        return 0;
    if (!kmpc_find_motion(plan->states[0], plan->inputs[0], robot->past[0], seen->things,
                          seen->thing, motion, &slowed)) {
        result->reason = "no way to a stop is clear";
        return 0;
    }
    if (slowed)
        memcpy(result->next_state, plan->states[1], 3 * sizeof(real));
    return 1;
}

/* What the next step starts from. */
static void keep(struct kmpc *robot, const struct kmpc_iterate *found)
{
    robot->planned = 1;
    memcpy(robot->states, found->states, sizeof(found->states));
    memcpy(robot->inputs, found->inputs, sizeof(found->inputs));
    memcpy(robot->duals, found->duals, sizeof(found->duals));
}

/* Stand at the end of the path. */
static void hold(struct kmpc *robot, const struct seen *seen, struct kmpc_plan *plan)
{
    static struct kmpc_iterate still;
    memset(&still, 0, sizeof(still));
    kmpc_rate_limit(robot->past[KMPC_PAST - 1], still.inputs[0]);
    kmpc_duals_in_the_open(still.duals);
    kmpc_model_rollout(seen->pose, robot->past[0], still.inputs[0], KMPC_N, KMPC_N, still.states[0]);
    keep(robot, &still);
    robot->resting = kmpc_braking(still.inputs[0], robot->rest[0]);
    memcpy(robot->expected, still.states[1], 3 * sizeof(real));
    robot->expects = 1;
    remember(robot, still.inputs[0]);
    plan->status = KMPC_SOLVED;
    plan->passes = 0;
    plan->reason = "";
    answer(seen, still.states[0], still.inputs[0], plan);
}

void kmpc_step(struct kmpc *robot, const struct kmpc_input *input, struct kmpc_plan *plan)
{
    static struct seen seen;
    static struct kmpc_iterate found;
    static struct kmpc_motion_to_rest motion;
    static struct kmpc_way way;
    struct kmpc_result result;
    take_in(robot, input, &seen);
    if (input->sent && kmpc_all_within(input->sent, 2, LIMIT))
        for (int i = 0; i < 2; i++)
            robot->past[KMPC_PAST - 1][i] = kmpc_clip(input->sent[i] / K.command[i], K.u_min[i], K.u_max[i]);
    if (seen.refusal) {
        stop(robot, &seen, seen.refusal, 0, plan);
        return;
    }
    if (robot->path.count)
        kmpc_follow_path(&robot->path, seen.pose, robot->past[0],
                         robot->planned ? robot->inputs[1] : NULL, seen.things, seen.thing, &way);
    else
        towards_goal(robot, &seen, &way);
    if (way.holds) {
        hold(robot, &seen, plan);
        return;
    }
    int least = 1, most = K.most_passes;
    if (input->passes > 0 && input->passes < most)
        most = input->passes;
    if (!one_period_later(robot, seen.pose, &found)) {
        along(way.reference, seen.pose, &found);
        least = most > 1 ? 2 : 1;
    }
    kmpc_solve(&found, robot->past[0], &way, seen.things, seen.thing, least, most, &result);
    const int good = verify(robot, &seen, &found, &result, &motion);
    robot->planned = 0;
    if (!result.failed)
        keep(robot, &found);
    if (!good) {
        stop(robot, &seen, result.reason, result.passes, plan);
        return;
    }
    robot->resting = motion.length - 1;
    memcpy(robot->rest[0], motion.commands[1], 2 * (size_t)robot->resting * sizeof(real));
    memcpy(robot->expected, found.states[1], 3 * sizeof(real));
    robot->expects = 1;
    remember(robot, found.inputs[0]);
    plan->status = result.reason[0] ? KMPC_FEASIBLE : KMPC_SOLVED;
    plan->passes = result.passes;
    plan->reason = result.reason;
    answer(&seen, found.states[0], found.inputs[0], plan);
}
