"""A long robot that is driven from its rear axle passes a gap that its circle would not fit.

python examples/gallery/footprint.py
"""

import numpy as np
from drawing import draw

import kmpc_lite as kl

WALLS = [
    kl.Polygon([(0.9, -2.0), (1.2, -2.0), (1.2, -0.27), (0.9, -0.27)]),
    kl.Polygon([(0.9, 0.27), (1.2, 0.27), (1.2, 2.0), (0.9, 2.0)]),
]
GOAL = (2.0, 0.6, np.pi / 2)


def main():
    model = kl.nominal_unicycle(0.1)
    cart = kl.Footprint.rectangle(length=0.6, width=0.34, ahead=-0.15)
    problem = kl.NavigationProblem(
        footprint=cart, x_min=(-1.0, -2.0, -np.inf), x_max=(3.0, 2.0, np.inf)
    )
    controller = kl.Controller(model, problem)
    poses = [np.array([0.0, -0.8, 0.5])]
    for _ in range(250):
        plan = controller.step(poses[-1], GOAL, WALLS)
        poses.append(model.predict(poses[-1], plan.command))
        if plan.holding:
            break
    around = 2 * controller.problem.robot_radius
    print(f"a gap of 0.54 m, a circle of {around:.2f} m, there after {0.1 * len(poses):.1f} s")
    draw("footprint", controller.problem, [poses], WALLS, [GOAL])


if __name__ == "__main__":
    main()
