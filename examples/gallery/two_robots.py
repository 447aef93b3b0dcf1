"""The ways of two robots cross: each is the other's obstacle, a circle that moves.

python examples/gallery/two_robots.py
"""

import numpy as np
from drawing import draw

import kmpc_lite as kl

PILLAR = kl.Circle(0.0, 0.8, 0.25)
STARTS = [np.array([-1.5, -0.9, 0.5]), np.array([1.5, -0.9, 2.6])]
GOALS = [(1.5, 0.9, 0.5), (-1.5, 0.9, 2.6)]


def seen(pose, speed, radius):
    """A robot as the other one's obstacle."""
    x, y, theta = pose
    return kl.Circle(x, y, radius, vx=speed * np.cos(theta), vy=speed * np.sin(theta))


def main():
    model = kl.nominal_unicycle(0.1)
    robots = [kl.Controller(model), kl.Controller(model)]
    radius = robots[0].problem.robot_radius
    drives, speeds = [[start] for start in STARTS], [0.0, 0.0]
    for _ in range(200):
        others = [seen(drives[1 - k][-1], speeds[1 - k], radius) for k in (0, 1)]
        plans = [robots[k].step(drives[k][-1], GOALS[k], [PILLAR, others[k]]) for k in (0, 1)]
        for k, plan in enumerate(plans):
            drives[k].append(model.predict(drives[k][-1], plan.command))
            speeds[k] = float(plan.command[0])
        if all(plan.holding for plan in plans):
            break
    first, second = (np.array(poses)[:, :2] for poses in drives)
    nearest = np.linalg.norm(first - second, axis=1).min() - 2 * radius
    print(f"both there after {0.1 * len(first):.1f} s, never nearer than {nearest:.2f} m")
    draw("two_robots", robots[0].problem, drives, [PILLAR], GOALS)


if __name__ == "__main__":
    main()
