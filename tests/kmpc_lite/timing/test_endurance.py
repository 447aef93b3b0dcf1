"""What only shows after many steps."""

import resource

import numpy as np
import pytest

import kmpc_lab
import kmpc_lite as kl


def endure(steps: int) -> float:
    """Growth of the process [MB] over drives from goal to goal, with dropped poses and changing
    maps.
    """
    random = np.random.default_rng(5)
    controller, plant = (
        kl.Controller(kl.nominal_unicycle(0.1)),
        kmpc_lab.DifferentialDrive(0.05, seed=1),
    )
    x, goal, circles = np.zeros(3), np.array([1.5, 1.5, 0.0]), np.array([[0.6, 0.6, 0.15]])
    before = 0
    for k in range(steps):
        measured = np.full(3, np.nan) if random.random() < 0.01 else x
        plan = controller.step(measured, goal, circles)
        assert np.isfinite(plan.command).all()
        x = plant.step(x, plan.command, 0.1)
        if k % 100 == 0:
            goal = np.array([*random.uniform(-1.8, 1.8, 2), random.uniform(-3, 3)])
            circles = np.column_stack([random.uniform(-1.5, 1.5, (4, 2)), np.full(4, 0.15)])
        if k == steps // 10:
            before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024


def test_memory_is_flat() -> None:
    assert endure(1_000) < 5.0


@pytest.mark.long
def test_memory_is_flat_over_100_000_steps() -> None:
    assert endure(100_000) < 5.0
