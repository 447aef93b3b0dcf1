"""A control loop of your own: measure the pose, ask for a command, send it.

python examples/gallery/own_loop.py
"""

import numpy as np
from drawing import draw

import kmpc_lite as kl

OBSTACLES = [kl.Circle(0.6, 0.5, 0.2), kl.Polygon([(1.0, 0.9), (1.5, 0.8), (1.3, 1.4)])]
GOAL = (1.8, 1.6, 0.0)


def main():
    model = kl.nominal_unicycle(0.1)  # or kl.KoopmanModel.load("robot.npz")
    controller = kl.Controller(model)
    poses = [np.zeros(3)]
    for _ in range(100):
        plan = controller.step(poses[-1], GOAL, OBSTACLES)
        poses.append(model.predict(poses[-1], plan.command))  # on a robot: send, wait, measure
        if plan.holding:
            break
    print(f"there after {0.1 * len(poses):.1f} s")
    draw("own_loop", controller.problem, [poses], OBSTACLES, [GOAL])


if __name__ == "__main__":
    main()
