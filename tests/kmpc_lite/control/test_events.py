"""What a controller logs: each event once; and nothing is printed unasked."""

import logging

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.peers.paper import AREA


def test_events_are_reported_once_each(caplog: pytest.LogCaptureFixture) -> None:
    controller = kl.Controller(kl.nominal_unicycle(0.1), kl.NavigationProblem(**AREA))
    lost, near, far = (np.nan, 0.0, 0.0), (1.0, 0.0, 0.0), (5.0, 0.0, 0.0)

    def told(level: int, goal: tuple[float, ...], pose: tuple[float, ...] | None = None):
        nonlocal here
        caplog.clear()
        for _ in range(3):
            plan = controller.step(here if pose is None else pose, goal)
            here = controller.model.predict(here, plan.command)
        return [r.getMessage() for r in caplog.records if r.levelno >= level]

    here = np.zeros(3)
    with caplog.at_level(logging.INFO, "kmpc_lite"):
        assert told(logging.INFO, near) == ["path changed"]
        assert told(logging.INFO, near) == []
        (refused,) = told(logging.WARNING, near, lost)
        assert refused.startswith("refused: ")
        assert "driving again" in told(logging.INFO, near)
        assert told(logging.WARNING, far) == ["unreachable: the goal lies outside the area"]


def test_the_library_configures_no_logging() -> None:
    kl.Controller(kl.nominal_unicycle(0.1))
    logger = logging.getLogger("kmpc_lite")
    assert [type(h) for h in logger.handlers] == [logging.NullHandler]
    assert logger.level == logging.NOTSET and logger.propagate


def test_what_is_no_problem_is_reported() -> None:
    with pytest.raises(kl.ProblemError, match="expected a NavigationProblem, got dict"):
        kl.Controller(kl.nominal_unicycle(0.1), {"horizon": 20})  # type: ignore[arg-type]
    with pytest.raises(kl.ProblemError, match="expected a NavigationProblem, got int"):
        kl.Controller(kl.nominal_unicycle(0.1), 20)  # type: ignore[arg-type]


def test_a_radius_in_centimetres_is_refused() -> None:
    for area in ({}, AREA):
        with pytest.raises(kl.ProblemError, match="metres, not in centimetres"):
            kl.NavigationProblem(robot_radius=15.0, **area)
    fast = {"u_min": (-2.0, -1.0), "u_max": (2.0, 1.0)}
    assert kl.NavigationProblem(robot_radius=15.0, **fast).robot_radius == 15.0


def test_a_model_is_shown_in_one_line() -> None:
    shown = repr(kl.nominal_unicycle(0.1))
    assert "\n" not in shown and "dt 0.1 s" in shown and len(shown) < 100
