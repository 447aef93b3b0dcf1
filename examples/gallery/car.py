"""A car parks backwards between two others: it cannot turn on the spot.

python examples/gallery/car.py
"""

import numpy as np
from drawing import draw

import kmpc_lite as kl

PARKED = [
    kl.Polygon([(-1.0, -0.15), (-0.5, -0.15), (-0.5, 0.15), (-1.0, 0.15)]),
    kl.Polygon([(0.5, -0.15), (1.0, -0.15), (1.0, 0.15), (0.5, 0.15)]),
]
GOAL = (-0.14, 0.0, 0.0)


def main():
    model = kl.nominal_unicycle(0.1)
    problem = kl.NavigationProblem(
        footprint=kl.Footprint.rectangle(length=0.5, width=0.26, ahead=-0.14),
        wheels=kl.Car(turning_radius=0.35),  # of the middle of the rear axle
        u_min=(-0.4, -1.0),
        u_max=(0.4, 1.0),
    )
    controller = kl.Controller(model, problem)
    poses, speeds = [np.array([0.9, 0.6, 0.0])], []
    for _ in range(400):
        plan = controller.step(poses[-1], GOAL, PARKED)
        poses.append(model.predict(poses[-1], plan.command))
        speeds.append(plan.command[0])
        if plan.holding:
            break
    back = sum(speed < 0 for speed in speeds)
    print(f"parked after {0.1 * len(poses):.1f} s, {0.1 * back:.1f} s of them backwards")
    draw("car", controller.problem, [poses], PARKED, [GOAL])


if __name__ == "__main__":
    main()
