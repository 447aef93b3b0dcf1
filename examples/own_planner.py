"""Plug in a planner of your own: this one drives straight to the goal, whatever is in the way.

python examples/own_planner.py
"""

import math

import numpy as np

import kmpc_lite as kl


class StraightLine:
    """Turn to the goal, drive there, and turn to its heading."""

    def begin(self, request: kl.PathRequest) -> None:
        """Find the path at once: nothing is left for `advance`."""
        (x, y, heading), (x_goal, y_goal, _) = request.start, request.goal
        course = math.atan2(y_goal - y, x_goal - x)
        first, last = (math.remainder(a - course, math.tau) for a in (heading, request.goal[2]))
        headings = heading + np.array([0.0, -first, -first, last - first])
        places = np.stack([request.start, request.start, request.goal, request.goal])
        self._path = kl.Path(np.column_stack([places[:, :2], headings]))
        line = np.linspace(request.start[:2], request.goal[:2], 50)
        self._is_free = bool((request.distances(line) > request.inflation).all())

    def advance(self, quanta: int) -> int:
        """Nothing to do."""
        return 0

    def path(self) -> kl.Path | str:
        """The path, or why there is none."""
        return self._path if self._is_free else "something stands in the straight way"


def main() -> None:
    model = kl.nominal_unicycle(0.1)
    controller = kl.Controller(model, planner=StraightLine())
    pose, goal = np.array([0.0, 0.0, 0.5]), (1.5, 1.0, 0.0)
    steps = 0
    while not (plan := controller.step(pose, goal, [kl.Circle(1.0, -0.5, 0.3)])).holding:
        pose, steps = model.predict(pose, plan.command), steps + 1
    missed = math.dist(pose[:2], goal[:2])
    print(f"at the goal after {0.1 * steps:.1f} s, {1000 * missed:.0f} mm from it")

    plan = controller.step(pose, (0.0, 0.0, 0.0), [kl.Circle(0.8, 0.5, 0.2)])
    print(f"back: {plan.progress.value}, {plan.reason}")


if __name__ == "__main__":
    main()
