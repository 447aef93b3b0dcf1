"""A forest that the robot does not know: it drives by the scans of a lidar that sees 2 m.

python examples/gallery/lidar.py
"""

import numpy as np
from drawing import draw

import kmpc_lite as kl

TREES = [(0.8, 0.2), (0.9, 1.1), (1.7, -0.4), (1.7, 0.6), (2.4, 1.2), (2.6, 0.1), (3.2, 0.8)]
RADIUS, REACH, BEAMS = 0.12, 2.0, 360
GOAL = (3.8, 0.3, 0.0)


def scan(pose, random):
    """Ranges of a turn of the scanner: to the nearest tree along each beam."""
    step = 2.0 * np.pi / BEAMS
    angles = pose[2] - np.pi + step * np.arange(BEAMS)
    beams = np.stack([np.cos(angles), np.sin(angles)])
    away = np.array(TREES) - pose[:2]
    along = away @ beams
    deep = RADIUS**2 - ((away**2).sum(axis=1)[:, None] - along**2)
    ranges = np.where((deep > 0) & (along > 0), along - np.sqrt(np.abs(deep)), np.inf).min(axis=0)
    ranges += 0.005 * random.normal(size=BEAMS)
    ranges[ranges > REACH] = np.inf  # nothing came back
    return kl.LaserScan(ranges, -np.pi, step, REACH, noise=0.005)


def main():
    model, random = kl.nominal_unicycle(0.1), np.random.default_rng(1)
    area = kl.NavigationProblem(x_min=(-1, -2, -np.inf), x_max=(5, 2, np.inf))
    controller = kl.Controller(model, area)
    poses = [np.zeros(3)]
    for _ in range(200):
        plan = controller.step(poses[-1], GOAL, [scan(poses[-1], random)])
        poses.append(model.predict(poses[-1], plan.command))
        if plan.holding:
            break
    trees = [kl.Circle(x, y, RADIUS) for x, y in TREES]
    print(f"through {len(trees)} unknown trees in {0.1 * len(poses):.1f} s")
    draw("lidar", controller.problem, [poses], trees, [GOAL])


if __name__ == "__main__":
    main()
