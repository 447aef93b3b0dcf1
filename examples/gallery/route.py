"""A route of four goals: the next one is given when the controller holds the last.

python examples/gallery/route.py
"""

import numpy as np
from drawing import draw

import kmpc_lite as kl

GOALS = [(1.6, 0.0, np.pi / 2), (1.6, 1.6, np.pi), (0.0, 1.6, -np.pi / 2), (0.0, 0.0, 0.0)]
OBSTACLES = [kl.Circle(0.8, 0.05, 0.15), kl.Circle(0.8, 0.8, 0.3), kl.Circle(0.75, 1.65, 0.2)]


def main():
    model = kl.nominal_unicycle(0.1)
    controller = kl.Controller(model)
    poses = [np.zeros(3)]
    for goal in GOALS:
        for _ in range(200):
            plan = controller.step(poses[-1], goal, OBSTACLES)
            poses.append(model.predict(poses[-1], plan.command))
            if plan.holding:
                break
        print(f"{goal[:2]} held after {0.1 * len(poses):.1f} s")
    draw("route", controller.problem, [poses], OBSTACLES, GOALS)


if __name__ == "__main__":
    main()
