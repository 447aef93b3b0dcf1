"""Every way in which OSQP is known to answer wrongly."""

import os
import signal
import threading

import numpy as np
import pytest
from osqp_box import EXACT, Box, assert_failed
from scipy import sparse

from kmpc_lite.control.nmpc.qp_solvers import OSQPWorkspace, QPData, QPStatus


def test_infeasible_problem_fails_rather_than_returning_garbage() -> None:
    box = Box()
    assert_failed(box.solve(Ax=np.zeros(3), lower=np.full(3, 0.5)))  # 0 x >= 0.5
    box.assert_well()


def test_crossed_bounds_are_refused_and_old_data_is_not_used_instead(
    capfd: pytest.CaptureFixture[str],
) -> None:
    box = Box()
    assert box.solve().status is QPStatus.SOLVED
    assert_failed(box.solve(q=np.full(3, 0.5), lower=np.array([-1.0, 2.0, -1.0])))
    box.assert_well()
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("bound", [np.inf, 1e30, 1e50, 1e300])
def test_bounds_that_nothing_can_meet_are_refused_without_a_word_on_stderr(
    bound: float, capfd: pytest.CaptureFixture[str]
) -> None:
    box = Box()
    assert_failed(box.solve(lower=np.array([-1.0, bound, -1.0]), upper=np.array([1.0, bound, 1.0])))
    assert_failed(
        box.solve(lower=np.array([-1.0, -bound, -1.0]), upper=np.array([1.0, -bound, 1.0]))
    )
    box.assert_well()
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["q", "lower", "upper", "Ax"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_data_that_is_not_finite_fails_and_leaves_no_trace(name: str, value: float) -> None:
    box = Box()
    bad = box.data[name].copy()
    bad[1] = value
    answer = box.solve(**{name: bad})
    if (name, value) in (("lower", -np.inf), ("upper", np.inf)):
        assert answer.status is QPStatus.SOLVED  # an open bound is data like any other
    else:
        assert_failed(answer)
    box.assert_well()


@pytest.mark.parametrize("name", ["x", "y"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_warm_start_that_is_not_finite_is_replaced(name: str, value: float) -> None:
    box = Box()
    bad = np.array([0.0, value, 0.0])
    answer = box.solve(q=np.array([-0.5, 0.25, -3.0]), **{name: bad})
    assert answer.status is QPStatus.SOLVED
    np.testing.assert_allclose(answer.x, [0.5, -0.25, 1.0], atol=1e-6)
    assert np.isnan(bad[1]) or np.isinf(bad[1])  # the caller's array is left alone


@pytest.mark.parametrize("name", ["q", "lower", "upper", "Ax", "x", "y"])
@pytest.mark.parametrize("shape", [(2,), (4,), (0,), (3, 1), (1, 3)])
def test_arrays_of_another_shape_are_refused(name: str, shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="expected shape"):
        Box().solve(**{name: np.zeros(shape)})


def test_strided_and_reversed_views_and_other_types_are_read_rightly() -> None:
    q, upper = np.array([-5.0, 0.25, -0.125]), np.array([1.0, 2.0, 3.0])
    wide = np.full((3, 2), 99.0)
    wide[:, 0] = q
    expected = [1.0, -0.25, 0.125]
    for views in (
        {"q": wide[:, 0], "upper": upper},
        {"q": q[::-1].copy()[::-1], "upper": upper[::-1].copy()[::-1]},
        {"q": q.astype(np.float32), "upper": upper.astype(np.float32)},
        {"q": q, "upper": upper.astype(int), "Ax": np.ones(3, dtype=int)},
        {"q": q, "upper": upper, "x": np.zeros((3, 2))[:, 1], "y": np.zeros(3, dtype=np.float32)},
    ):
        answer = Box().solve(**views)
        assert answer.status is QPStatus.SOLVED
        np.testing.assert_allclose(answer.x, expected, atol=1e-6)


def test_solutions_are_copies_and_arguments_are_left_alone() -> None:
    box = Box()
    box.data["q"] = np.array([-0.5, 0.0, 0.5])
    before = {name: array.copy() for name, array in box.data.items()}
    answer = box.solve()
    x, y = answer.x.copy(), answer.y.copy()
    box.solve(q=np.array([0.5, 0.5, -3.0]), x=answer.x, y=answer.y)
    np.testing.assert_array_equal(answer.x, x)
    np.testing.assert_array_equal(answer.y, y)
    for name, array in box.data.items():
        np.testing.assert_array_equal(array, before[name])


def test_iteration_limit_returns_an_iterate_that_is_reported_as_early() -> None:
    box = Box(eps_abs=1e-14, eps_rel=1e-14, max_iter=2, check_termination=1)
    answer = box.solve(q=np.array([-5.0, 0.25, -0.125]))
    assert answer.status is QPStatus.STOPPED_EARLY
    assert answer.iterations == 2
    assert "iterations" in answer.reason
    assert np.isfinite(answer.x).all()


def test_time_limit_stops_a_solve_and_can_be_lifted() -> None:
    random = np.random.default_rng(0)
    n = 60
    root, a = random.normal(size=(n, n)), random.normal(size=(n, n))
    dense = sparse.csc_matrix(np.triu(root @ root.T + np.eye(n)))
    q, lower, upper, zeros = random.normal(size=n), -0.1 * np.ones(n), 0.1 * np.ones(n), np.zeros(n)
    workspace = OSQPWorkspace(dense, q, sparse.csc_matrix(a), lower, upper, **EXACT)
    entries = a.ravel(order="F")
    data = QPData(q, lower, upper, entries, zeros, zeros)
    hurried = workspace.solve(data, time_limit=1e-9)
    assert hurried.status is QPStatus.STOPPED_EARLY
    assert "time" in hurried.reason
    assert np.isfinite(hurried.x).all()
    # the next solve has no limit any more
    assert workspace.solve(data).status is QPStatus.SOLVED


@pytest.mark.parametrize("scaling", [10, 0])
def test_where_osqp_learns_a_restart_makes_it_forget_to_the_last_bit(scaling: int) -> None:
    random = np.random.default_rng(4)
    settings = {"adaptive_rho": 1, "adaptive_rho_interval": 10, "scaling": scaling}
    first, second = Box(n=6, **settings), Box(n=6, **settings)
    for _ in range(5):
        second.solve(q=random.normal(size=6), Ax=10.0 ** random.uniform(-3, 3, 6))
    assert second.workspace._adapted
    first.workspace.restart()
    second.workspace.restart()
    q, scale = random.normal(size=6), 10.0 ** random.uniform(-1, 1, 6)
    np.testing.assert_array_equal(first.solve(q=q, Ax=scale).x, second.solve(q=q, Ax=scale).x)


def test_ctrl_c_in_the_middle_of_a_solve_reaches_the_program() -> None:
    """OSQP catches the signal itself; the program went on as if nothing had been pressed."""
    heard: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: heard.append(number))
    random = np.random.default_rng(0)
    n = 60
    identity, row = sparse.csc_matrix(np.eye(n)), sparse.csc_matrix(random.normal(size=(n, n)))
    # ends for no other reason: no iterate is as exact as is asked for here
    endless = OSQPWorkspace(
        identity,
        np.ones(n),
        row,
        -np.ones(n),
        np.ones(n),
        eps_abs=1e-300,
        eps_rel=1e-300,
        max_iter=2_000_000_000,
    )
    over = threading.Event()

    def press() -> None:
        while not over.wait(0.2):
            os.kill(os.getpid(), signal.SIGINT)

    pressing = threading.Thread(target=press)
    pressing.start()
    try:
        zeros, ones = np.zeros(n), np.ones(n)
        answer = endless.solve(QPData(random.normal(size=n), -ones, ones, row.data, zeros, zeros))
    finally:
        over.set()
        pressing.join()
        signal.signal(signal.SIGINT, before)
    assert_failed(answer)
    assert heard
