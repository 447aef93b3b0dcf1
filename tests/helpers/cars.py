"""A car that is none of ours: a bicycle whose wheels steer at a rate, and its drives."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import kmpc_lite as kl


class Drive(NamedTuple):
    """How a drive went."""

    held: bool
    time: float
    error: tuple[float, float]  # distance from the goal [m], and of the heading [rad]
    commands: np.ndarray
    poses: np.ndarray
    reason: str

    @property
    def gear_changes(self) -> int:
        """How often it was commanded to change its gear."""
        gears = np.sign(self.commands[np.abs(self.commands[:, 0]) > 0.01, 0])
        return int((np.diff(gears) != 0).sum())


def drive_car(controller, start, goal, obstacles=(), seconds=60.0, steps=20, plant_rate=np.inf):
    """Drive a bicycle whose curvature changes by at most so much a second, until it holds."""
    problem = controller.problem
    dt, sharpest = problem.dt, problem.wheels.curvature
    pose, curvature = np.array(start, dtype=float), 0.0
    commands, poses = [], [pose]
    for _ in range(int(seconds / dt)):
        plan = controller.step(pose, goal, obstacles)
        speed, turn_rate = plan.command
        commands.append(plan.command)
        if plan.holding:
            break
        wanted = curvature if abs(speed) < 1e-6 else turn_rate / speed
        wanted = np.clip(wanted, -sharpest, sharpest)
        for _ in range(steps):
            h = dt / steps
            curvature += np.clip(wanted - curvature, -plant_rate * h, plant_rate * h)
            middle = pose[2] + 0.5 * h * speed * curvature
            move = speed * np.array([np.cos(middle), np.sin(middle), curvature])
            pose = pose + h * move
            poses.append(pose)
    away = pose - np.asarray(goal)
    error = float(np.hypot(*away[:2])), abs(float(np.angle(np.exp(1j * away[2]))))
    held = bool(plan.holding)
    drive = np.array(commands), np.array(poses)
    return Drive(held, len(commands) * dt, error, *drive, plan.reason)


def car_problem(**fields):
    """Give the paper's robot on steered wheels."""
    usual = {"u_min": (-0.6, -1.5), "u_max": (0.6, 1.5), "wheels": kl.Car(0.4)}
    return kl.NavigationProblem(**(usual | fields))
