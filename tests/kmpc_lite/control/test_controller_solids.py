"""The controller among polygons, walls and grids: drives, and what must never be raised."""

import numpy as np
import pytest

import kmpc_lab
import kmpc_lite as kl

SOLIDS = [kl.Polygon([(0.5, -0.2), (0.9, -0.2), (0.8, 0.3)]), kl.Wall(-0.5, 0.6, 0.8, 0.7, 0.05)]


def cells(*occupied: tuple[int, int, int, int], size: int = 80) -> kl.OccupancyGrid:
    """Grid of the area of 4 m x 4 m with boxes of cells x0, y0, x1, y1 occupied."""
    grid = np.zeros((size, size), dtype=bool)
    for x0, y0, x1, y1 in occupied:
        grid[y0:y1, x0:x1] = True
    return kl.OccupancyGrid(grid, 4.0 / size, (-2.0, -2.0, 0.0))


def test_solids_that_cannot_be_meant_give_a_safe_plan_not_an_error(
    nominal: kl.KoopmanModel,
) -> None:
    controller = kl.Controller(nominal)
    for obstacles in (
        [kl.Wall(0.0, 1.0, 1e8, 1.0)],
        [kl.Circle(1, 1, 0.1), kl.Polygon([(1e5, 0), (1e5 + 1, 0), (1e5, 1)])],
    ):
        plan = controller.step((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), obstacles)
        assert plan.status is kl.PlanStatus.STOPPED and "obstacle not usable" in plan.reason
        assert np.isfinite(plan.command).all()
    good = controller.step((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), SOLIDS)
    assert good.status is kl.PlanStatus.SOLVED
    lost = controller.step((np.nan, 0.0, 0.0), (1.0, 0.0, 0.0), SOLIDS)
    assert lost.status is kl.PlanStatus.FALLBACK and np.isfinite(lost.command).all()
    # a robot inside of a solid, at its very middle, and a goal inside of one
    for solid in (
        kl.Polygon([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]),
        kl.Wall(-0.5, 0.0, 0.5, 0.0),
        cells((30, 30, 50, 50)),
    ):
        for pose, goal in (((0.0, 0.0, 0.0), (1.5, 0.0, 0.0)), ((1.5, 0.0, 0.0), (0.0, 0.0, 0.0))):
            plan = kl.Controller(nominal).step(pose, goal, [solid])
            assert (
                np.isfinite(plan.command).all() and (np.abs(plan.command) <= (0.6, np.pi / 4)).all()
            )
    for wrong in ([(1.0, 2.0), SOLIDS[0]], [object()], [None], ["wall"], None):
        with pytest.raises(ValueError):
            controller.step((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "options",
    [
        {"guidance": False},
        {"tightening": None},
        {"sqp_iterations": 20},
        {"guidance": False, "tightening": None},
    ],
)
def test_solids_count_with_every_option(
    learned: kl.KoopmanModel, options: dict[str, object]
) -> None:
    controller, robot, x = (
        kl.Controller(learned, **options),
        kmpc_lab.DifferentialDrive(slip=0.05, seed=3),
        np.array([-1.0, -0.3, 0.0]),
    )  # type: ignore[arg-type]
    whole = [kl.Polygon([(0.0, -0.1), (0.4, -0.1), (0.2, 0.3)]), cells((52, 10, 56, 30))]
    least = np.inf
    for _ in range(60):
        plan = controller.step(x, (1.2, -0.5, 0.0), whole)
        x = robot.step(x, plan.command, 0.1)
        least = min(least, plan.clearance)
    # without margins it cuts in by millimetres, as the paper's controller does
    assert least > (0.0 if "tightening" not in options else -0.03)
