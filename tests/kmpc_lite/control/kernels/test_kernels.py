"""The kernels in C against naive references: on what drives ask, on random and hostile arrays."""

import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse.csgraph
from reference import kernels, scans

import kmpc_lite as kl
from kmpc_lite.control import kernels as package
from kmpc_lite.control.insight import insight
from kmpc_lite.control.kernels import library
from kmpc_lite.control.kernels.predictor import Predictor, motion_in_units
from kmpc_lite.control.kernels.records import Around, Brakes, Iterate, Noise, PlanMargins
from kmpc_lite.control.nmpc.qp import NavigationQP
from kmpc_lite.control.nmpc.sqp import keep_out
from kmpc_lite.control.options import TrackerOptions
from kmpc_lite.control.world.tracks import Follower, Tracks
from kmpc_lite.model.bilinear import Linearization
from kmpc_lite.model.dictionary import ResponseDictionary
from kmpc_lite.model.dictionary.response import terms_of
from kmpc_lite.model.motion import ScaledModel
from kmpc_lite.model.noise_model import NoiseModel
from kmpc_lite.model.symmetric import find_trigonometry
from kmpc_lite.scale import Scale

GRID = kl.OccupancyGrid(np.random.default_rng(2).random((12, 12)) < 0.12, 0.1, (-0.4, 0.5, 0.2))
FOLDER = Path(package.__file__).parent
REFERENCES = {**vars(scans), **vars(kernels)}
NAMES = [
    name
    for name, value in vars(library).items()
    if callable(value) and value.__module__ == library.__name__ and name in REFERENCES
]


def ours(name: str) -> Callable[..., Any]:
    return getattr(library, name)


def reference(name: str) -> Callable[..., Any]:
    return REFERENCES[name]


def copied(value: Any) -> Any:
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return type(value)(*map(copied, value))
    return value.copy() if isinstance(value, np.ndarray) else value


def arrays_of(arguments: tuple[Any, ...]) -> list[np.ndarray]:
    """All arrays, those in records included."""
    found = []
    for value in arguments:
        found += arrays_of(value) if isinstance(value, tuple) else [value]
    return [value for value in found if isinstance(value, np.ndarray)]


def answers(function: Callable[..., Any], arguments: tuple[Any, ...]) -> list[np.ndarray]:
    """What a kernel returns, and what it leaves in the arrays that it was given."""
    own = tuple(copied(a) for a in arguments)
    found = function(*own)
    results = found if isinstance(found, tuple) else (found,)
    return [np.asarray(a) for a in (*results, *arrays_of(own)) if a is not None]


def assert_alike(name: str, arguments: tuple[Any, ...]) -> None:
    with np.errstate(all="ignore"):
        expected = answers(reference(name), arguments)
        found = answers(ours(name), arguments)
    assert len(found) == len(expected)
    for own, theirs in zip(found, expected, strict=True):
        assert own.shape == theirs.shape
        if own.dtype == bool:
            np.testing.assert_array_equal(own, theirs, err_msg=name)
        else:
            size = np.abs(theirs[np.isfinite(theirs)]).max(initial=1e-9)
            np.testing.assert_allclose(
                own, theirs, rtol=1e-12, atol=1e-12 * size, err_msg=name, equal_nan=True
            )


@pytest.fixture(scope="module")
def asked() -> dict[str, list[tuple[Any, ...]]]:
    """Arguments of all kernels in drives past circles, walls and a moving circle."""
    calls: dict[str, list[tuple[Any, ...]]] = {name: [] for name in NAMES}

    def watched(name: str) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            calls[name].append(tuple(copied(a) for a in arguments))
            return own(*arguments)

        own = ours(name)
        return call

    with pytest.MonkeyPatch.context() as patch:
        for name in NAMES:
            patch.setattr(library, name, watched(name))
        for problem in (
            kl.NavigationProblem(),
            kl.NavigationProblem(horizon=8, du_max=(0.8, 3.0)),
            kl.NavigationProblem(footprint=kl.Footprint.rectangle(0.5, 0.3), sensor_range=2.0),
        ):
            noise = NoiseModel(np.diag([1e-4, 5e-5, 2e-4]) * np.ones((3, 1, 1)))
            model = replace(kl.nominal_unicycle(problem.dt), noise_model=noise)
            controller = kl.Controller(model, problem)
            pose = np.array([-1.5, -1.5, 0.0])
            for k in range(40):
                around = [
                    kl.Circle(-0.5, -0.8, 0.3),
                    kl.Circle(0.8, 0.5 - 0.02 * k, 0.2, 0.0, -0.2),
                    kl.Wall(0.4, -1.6, 0.6, -0.6),
                    GRID,
                ]
                # given to stand, and it walks: in the list, and in scans
                walker = kl.Circle(1.2 - 0.05 * k, -0.5, 0.2)
                look = np.where(np.arange(180) % 50 < 10 + k % 3, 1.0 + 0.01 * k, np.inf)
                look[::7] += 0.01
                around += [walker, kl.LaserScan(look, -np.pi, np.pi / 90, 4.0)]
                plan = controller.step(pose, (1.4, 1.4, 0.5), around)
                pose = model.predict(pose, plan.command)
            insight(controller, plan)
    return calls


@pytest.mark.parametrize("name", NAMES)
def test_alike_on_what_drives_ask(asked, name):
    assert asked[name], f"no drive asks {name}"
    for arguments in asked[name]:
        assert_alike(name, arguments)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("hostile", [np.nan, np.inf, -np.inf, 1e300, 0.0])
def test_alike_on_hostile_arrays(asked, name, hostile):
    """One number of each array is spoilt; decisions are the same, and nothing crashes."""
    random = np.random.default_rng(5)
    for arguments in asked[name][:: max(len(asked[name]) // 3, 1)]:
        for i, spoilt in enumerate(arguments):
            if not isinstance(spoilt, np.ndarray) or spoilt.dtype != float or not spoilt.size:
                continue
            if name == "fill" and np.isnan(hostile):
                continue  # where NaN sorts is no decision: the QP refuses it
            if name == "candidates" and not np.isfinite(hostile):
                continue  # nor is how such a command is braked from: no plan holds one
            bad = spoilt.copy()
            bad.flat[random.integers(bad.size)] = hostile
            changed = (*arguments[:i], bad, *arguments[i + 1 :])
            for found, expected in answers_of_both(name, changed):
                if found.dtype == bool:
                    np.testing.assert_array_equal(found, expected, err_msg=f"{name}, argument {i}")


def answers_of_both(name: str, arguments: tuple[Any, ...]) -> list[tuple[np.ndarray, np.ndarray]]:
    with np.errstate(all="ignore"):
        both = (answers(of(name), arguments) for of in (ours, reference))
        return list(zip(*both, strict=True))


@pytest.mark.parametrize("delay", [0, 1, 3, 9])
@pytest.mark.parametrize("stages", [1, 2, 7, 50, 200])
@pytest.mark.parametrize("lasts", [False, True])
def test_tubes_of_random_plans(delay, stages, lasts):
    random = np.random.default_rng([delay, stages])
    lower = np.tril(random.normal(size=(4, 3, 3)))
    covariances = lower @ lower.swapaxes(1, 2)
    noise = Noise(
        white=1e-4 * covariances[:2].reshape(2, 9),
        lasting=0.01 * lasts * random.random(size=(2, 3)),
        pose=1e-5 * covariances[2],
        pose_by_speed=lasts * 4e-6 * covariances[3],
        delay=delay,
        quantile=3.1,
        headway_time=0.05,
        touch=0.15,
        reach=0.2 * lasts,
        solver_margin=0.002,
        spreads=True,
    )
    inputs = random.uniform(-1.0, 1.0, (stages, 2))
    states = np.cumsum(random.uniform(-0.1, 0.1, (stages + 1, 3)), axis=0)
    by_x = np.eye(3) + 0.1 * random.normal(size=(stages, 3, 3))
    away = random.normal(size=(stages, 5, 3 if lasts else 2))
    lin = Linearization(
        states[1:], by_x, random.normal(size=(stages, 3, 2)), np.empty((stages, 0, 3, 2))
    )
    problem = kl.NavigationProblem(
        horizon=stages, footprint=kl.Footprint.rectangle(0.4, 0.4) if lasts else None
    )
    qp = NavigationQP(problem, 0, 9)
    kept = random.uniform(0.0, 0.1, stages)
    around = Around(np.empty((0, 7)), states[1:, :2], random.uniform(-1, 1, (stages, 5)), away)
    margins = PlanMargins(noise, 1e9, 1.0, 0.01, kept)
    plan = Iterate(states, inputs, states, inputs, True)
    assert_alike("fill", (keep_out(problem, 9), margins, qp.numbers, lin, plan, around))


@pytest.mark.parametrize("seed", range(30))
def test_motions_to_rest_of_random_plans_are_alike(seed):
    """Of cars and omnis, too, of plans that stand for a while, and of ramps of any length."""
    random, m = np.random.default_rng(seed), 2 + (seed % 3 == 0)
    steps = random.uniform(0.02, 0.3, (3, m))
    curvature = 0.3 if seed % 3 == 1 else np.inf
    brakes = Brakes(*steps[:2], steps[1:].max(axis=0), curvature, 40, seed % 4)
    inputs = np.cumsum(random.normal(size=(10, m)), axis=0) * 0.2
    inputs[random.integers(1, 10, 3)] = 0.0
    for whole, at_once in product((True, False), repeat=2):
        assert_alike("candidates", (brakes, inputs, 0.5 * inputs[0], whole, at_once))


@pytest.mark.parametrize("seed", range(6))
def test_crowds_are_followed_alike(seed):
    """Tracks and circles so near each other that the assignment is none of favourites."""
    random = np.random.default_rng(seed)
    follower, tracks = Follower(0.1, TrackerOptions(), 0.15, 0.6), Tracks()
    side = random.choice([0.1, 0.5, 3.0])
    for _ in range(8):
        count = random.integers(0, 25)
        circles = random.uniform(-side, side, (count, 5))
        sources = (random.random(count) < 0.3).astype(float)
        assert_alike("follow", (tracks.rows, circles, sources, *follower.numbers))
        tracks, _ = follower.follow(tracks, circles, sources)


@pytest.mark.parametrize("seed", range(10))
def test_clusters_of_random_scans_are_alike(seed):
    random = np.random.default_rng(seed)
    ranges = 0.5 + random.random(60).repeat(random.integers(1, 9, 60))
    ranges[random.random(len(ranges)) < 0.05] = np.nan
    ranges[random.random(len(ranges)) < 0.05 * (seed % 3)] = np.inf
    scan = kl.LaserScan(ranges, 0.0, 2.0 * np.pi / len(ranges), 4.0, mount=(0.1, 0.05, 0.3))
    beams = scan.reach, scan.ends, scan.hits, scan.clear
    assert_alike("clusters", (*beams, np.array(scan.mount[:2]), 0.01, 0.15, 0.45))


@pytest.mark.parametrize("seed", range(8))
def test_rectangles_of_random_cells_are_alike(seed):
    random = np.random.default_rng(seed)
    cells = random.random(random.integers(1, 30, 2)) < 0.2 * (seed % 6)
    assert_alike("rectangles", (cells.repeat(2, axis=0),))


LAGS = (0.2, 0.5, 0.3), (0.0, 0.6, 0.3, 0.1)
DICTIONARIES = {
    "nominal": kl.UnicycleDictionary(),
    "omni": kl.UnicycleDictionary(3),
    "lags": kl.InputHistoryDictionary(kl.UnicycleDictionary(), (0, 2, 3), product=True),
} | {
    name: ResponseDictionary(
        kl.UnicycleDictionary(m), *LAGS, terms_of(m), (0.05,) * m, (0.7,) * m, steered
    )
    for name, m, steered in (("late", 2, False), ("late omni", 3, False), ("car", 2, True))
}


@pytest.mark.parametrize("scale", [Scale(), Scale(3.0, 0.5)])
@pytest.mark.parametrize("integrator", ["midpoint", "rk4"])
@pytest.mark.parametrize("dictionary", DICTIONARIES.values(), ids=DICTIONARIES)
def test_models_predict_alike_in_c(dictionary, integrator, scale):
    random, scale = np.random.default_rng(7), replace(scale, inputs=dictionary.commands)
    motion = random.normal(size=(dictionary.input_size, 3))
    model = symmetric_model(dictionary, motion, integrator)
    found, expected = motion_in_units(model, scale), ScaledModel(model, scale)
    assert type(found) is Predictor
    m, past = dictionary.commands, (6, dictionary.history, dictionary.commands)
    x, u, before = random.normal(size=(6, 3)), random.normal(size=(6, m)), random.normal(size=past)
    u[2], before[2] = 0.0, 0.0
    slopes = zip(found.linearize(x, u, before), expected.linearize(x, u, before), strict=True)
    pairs = list(slopes)
    for history in (before, None):
        pairs.append((found.predict(x, u, history), expected.predict(x, u, history)))
        one = None if history is None else history[0]
        pairs.append((found.rollout(x[0], u, one), expected.rollout(x[0], u, one)))
        many = np.stack([u, 0.5 * u])
        pairs.append((found.rollout(x[1], many, one), expected.rollout(x[1], many, one)))
    for a, b in pairs:
        np.testing.assert_allclose(a, b, rtol=1e-11, atol=1e-12)
    assert np.isnan(found.predict(x, np.full_like(u, np.nan), before)).any(axis=1).all()


def test_inputs_of_ones_own_are_left_to_their_class():
    class Own(ResponseDictionary):
        def inputs(self, u, history=None):
            return 0.5 * super().inputs(u, history)

    model = symmetric_model(Own(kl.UnicycleDictionary()), np.eye(2, 3), "rk4")
    assert type(motion_in_units(model, Scale())) is ScaledModel


def symmetric_model(dictionary, motion, integrator) -> kl.KoopmanModel:
    """A model in which each input leads ahead, to the left and round as it is told."""
    (one, cos, sin), (ahead, left, turn) = find_trigonometry(dictionary), motion.T
    h, none = np.zeros((3, len(motion), dictionary.size)), np.zeros((3, len(motion)))
    h[0, :, cos], h[0, :, sin], h[1, :, sin], h[1, :, cos] = ahead, -left, ahead, left
    h[2, :, one] = turn
    a, h = np.zeros((3, dictionary.size)), h.reshape(3, -1)
    return kl.KoopmanModel(dictionary, 0.1, a, none, h, np.eye(3), True, integrator=integrator)


@pytest.mark.parametrize(("height", "width"), [(40, 50), (7, 1), (1, 9)])
def test_ways_on_a_grid_are_the_shortest(height, width):
    random, graph = np.random.default_rng(height), scipy.sparse.lil_matrix((height * width,) * 2)
    usable, factor = random.random((height, width)) < 0.75, 1.0 + random.random((height, width))
    known = np.pad(usable, 2)
    for row, column in np.argwhere(usable):
        for move in ((0, 1), (1, -1), (1, 0), (1, 1), (1, 2), (2, 1), (2, -1), (1, -2)):
            half = np.fix(np.divide(move, 2)).astype(int)
            # a longer move passes between two nodes
            passed = np.array((move, half, move - half)) + (row + 2, column + 2)
            if known[*passed.T].all():
                here, length = row * width + column, 0.1 * np.hypot(*move)
                graph[here, here + move[0] * width + move[1]] = length * factor[row, column]
    goal = int(random.choice(np.flatnonzero(usable)))
    expected = scipy.sparse.csgraph.dijkstra(graph.tocsr(), directed=False, indices=goal)
    cost, towards = library.ways(usable, factor, 0.1, goal)
    np.testing.assert_allclose(cost, expected, rtol=1e-12)
    nodes = np.flatnonzero(np.isfinite(cost) & (cost > 0.0))
    assert (cost[towards[nodes]] < cost[nodes]).all()


def test_arrays_that_do_not_fit_are_refused():
    import kmpc_lite.control.kernels._kernels as c

    for call in (
        lambda: c.rollout(*(np.zeros(n) for n in (6, 2, 3, 2, 0, 6)), 1),
        lambda: c.distances(np.zeros(7), np.zeros(2), np.zeros(1), np.zeros(2), 1, 1, 1),
        lambda: c.samples(np.zeros(6), np.zeros(2), 1, 1),
    ):
        with pytest.raises(ValueError, match="do not fit"):
            call()


def test_files_in_c_keep_to_the_rules():
    for path in (FOLDER / "c").glob("*.c"):
        if path.stem != "module":
            text = path.read_text()
            included = set(re.findall(r"#include (\S+)", text))
            assert included <= {'"kernels.h"', "<math.h>", "<string.h>"}
            assert not re.search(r"\b(malloc|calloc|free|printf)\b", text)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
@pytest.mark.parametrize("precision", [(), ("-DKMPC_FLOAT", "-Wdouble-promotion")])
def test_c_is_silent_c99_and_float_is_float(tmp_path, precision):
    for path in sorted((FOLDER / "c").glob("*.c")):
        if path.stem == "module":
            continue
        made = tmp_path / f"{path.stem}.o"
        flags = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic", *precision)
        subprocess.run(["gcc", *flags, "-c", str(path), "-o", str(made)], check=True)
        if precision and shutil.which("nm"):
            shown = subprocess.run(["nm", "-u", made], capture_output=True, text=True, check=True)
            called = set(re.findall(r"U (\w+)", shown.stdout))
            assert not called & {"cos", "sin", "tan", "sqrt", "hypot", "fabs"}, path.name
