"""An exported controller: the same answers as Python's, whatever comes in; honest refusals."""

import json
import os
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.cli.main import main
from kmpc_lite.control.insight import insight
from kmpc_lite.errors import ProblemError
from kmpc_lite.model.dictionary import ResponseDictionary
from kmpc_lite.model.noise_model import NoiseModel

pytestmark = pytest.mark.skipif(
    shutil.which("cc") is None or shutil.which("make") is None, reason="no C compiler, or no make"
)
AREA = {"x_min": (-12.0, -12.0, -np.inf), "x_max": (12.0, 12.0, np.inf)}
WEIGHTS = {"Q": (1.0, 1.0, 0.3), "R": (0.1, 0.1), "Q_terminal": (8.0, 8.0, 2.0)}


def noisy(dt: float = 0.1) -> kl.KoopmanModel:
    noise = np.zeros((3, 3, 3))
    noise[0] = 1e-7 * np.eye(3)
    noise[1], noise[2] = np.diag([1e-4, 5e-5, 1e-5]), np.diag([1e-5, 1e-5, 1e-4])
    return replace(kl.nominal_unicycle(dt), noise_model=NoiseModel(noise))


def lagging(dt: float = 0.1) -> kl.KoopmanModel:
    model = noisy(dt)
    late = ResponseDictionary(model.dictionary, speed=(0.3, 0.5, 0.2), turn=(0.2, 0.8))
    return replace(model, dictionary=late)


CASES: dict[str, tuple[kl.KoopmanModel, dict[str, Any]]] = {
    "nominal": (kl.nominal_unicycle(0.1), {}),
    "lag and slow changes": (lagging(), {"du_max": (0.6, 2.0), "horizon": 12}),
    "changes weighed": (lagging(), {"R_change": [[0.08, 0.02], [0.02, 0.05]]}),
    "large": (noisy(), {"robot_radius": 0.6, "u_min": (-1.0, -1.0), "u_max": (2.0, 1.0)} | AREA),
}


@pytest.fixture(scope="module")
def export(tmp_path_factory) -> Callable[..., Path]:
    """Exports, built once each."""
    return cache(lambda m, p: kl.export(m, p, tmp_path_factory.mktemp("export") / "robot"))


@cache
def problem_of(case: str) -> kl.NavigationProblem:
    model, given = CASES[case]
    return kl.NavigationProblem(dt=model.dt, **(WEIGHTS | {"R_change": (0.0, 0.0)} | given))


@pytest.fixture(scope="module", params=CASES)
def both(request, export) -> tuple[kl.Controller, kl.CompiledController]:
    """The controller in Python, and the exported one."""
    model, problem = CASES[request.param][0], problem_of(request.param)
    python = kl.Controller(model, problem, guidance=False, adaptation=False)
    return python, kl.CompiledController(export(model, problem))


def random_scene(seed: int, radius: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    random, wide = np.random.default_rng(seed), 9.0 * radius
    circles = np.column_stack(
        [
            random.uniform(-wide, wide, (6, 2)),
            random.uniform(0.3 * radius, 1.5 * radius, 6),
            np.where(random.random((6, 2)) < 0.3, random.uniform(-0.3, 0.3, (6, 2)), 0.0),
        ]
    )
    pose, goal = (
        np.array([*random.uniform(-wide, wide, 2), random.uniform(-9.0, 9.0)]) for _ in range(2)
    )
    return pose, goal, circles


@pytest.mark.parametrize("seed", range(3))
def test_answers_as_python_does(both, seed):
    """Statuses are the same, commands within 3e-7: OSQP is built twice. Only near circles count."""
    python, exported = both
    python.reset(), exported.reset()
    pose, goal, circles = random_scene(seed, python.problem.robot_radius)
    model, past = python.model, np.zeros((python.model.history, 2))
    for k in range(40):
        now = circles.copy()
        now[:, :2] += circles[:, 3:] * k * model.dt
        crowd = np.vstack([*[now + (1e3, 0.0, 0.0, 0.0, 0.0)] * (5 * (seed == 2)), now])
        theirs, ours = python.step(pose, goal, now), exported.step(pose, goal, crowd)
        assert ours.status is theirs.status, (k, ours.reason, theirs.reason)
        np.testing.assert_allclose(ours.command, theirs.command, rtol=0, atol=3e-7)
        np.testing.assert_allclose(ours.states, theirs.states, rtol=0, atol=1e-5)
        assert ours.iterations == theirs.iterations
        pose = model.predict(pose, theirs.command, past)
        past = np.concatenate([past, theirs.command[None]])[1:] if len(past) else past


def test_nothing_that_comes_in_is_answered_by_more_than_bounds(both):
    """NaN, infinity, huge and negative numbers: a safe command and a status."""
    python, exported = both
    least, most, _, _ = python.problem.bounds
    random = np.random.default_rng(9)
    wrong = [np.nan, np.inf, -np.inf, 1e300, -1e300, 1e5, -1.0, 0.0]
    exported.reset()
    for k in range(200):
        pose, goal, circles = random_scene(k, python.problem.robot_radius)
        circles = np.repeat(circles, random.integers(0, 6), axis=0)
        sent = random.uniform(-1.0, 1.0, 2)
        for array in (pose, goal, sent, circles):
            if array.size and random.random() < 0.3:
                array.flat[random.integers(array.size)] = random.choice(wrong)
        plan = exported.step(pose, goal, circles, sent if random.random() < 0.5 else None)
        assert np.isfinite(plan.command).all()
        assert (plan.command >= least).all() and (plan.command <= most).all()
        if not all(np.isfinite(a).all() for a in (pose, goal, circles)):
            assert plan.status.name in ("FALLBACK", "STOPPED") and plan.reason


def test_wrong_shapes_are_refused(both):
    _, exported = both
    here, goal = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)
    for wrong, told in (
        (((0.0, 0.0), goal), r"x and goal: expected shape \(3,\) each, got \(2,\)"),
        ((here, goal, [(1.0, 2.0)]), r"expected circles, or an array .* got shape \(1, 2\)"),
        ((here, goal, (), (1.0,)), r"sent: expected shape \(2,\), got \(1,\)"),
        ((here, goal, [kl.Wall(0, 0, 1, 1)]), "drives past circles alone"),
    ):
        with pytest.raises(ValueError, match=told):
            exported.step(*wrong)
    around = [kl.Circle(1.0, 0.0, 0.2)]
    assert exported.step((0, 0, 0), (2, 0, 0), around).status.name in ("SOLVED", "FEASIBLE")


def test_the_example_drives_on_until_it_stands(both):
    _, exported = both
    make(exported.folder, "example")
    done = subprocess.run([exported.folder / "example"], capture_output=True, text=True, check=True)
    last = done.stdout.splitlines()[-1]
    assert re.search(r"-?0\.0\d m/s +-?0\.0\d rad/s", last), done.stdout


def make(folder: Path, *arguments: str) -> str:
    done = subprocess.run(
        ["make", "-s", "-C", str(folder), *arguments], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_float_is_float_and_loses_little(tmp_path):
    problem = kl.NavigationProblem(robot_radius=0.3)
    folder = kl.export(noisy(), problem, tmp_path / "small", float32=True)
    told = make(folder, "test")
    found = re.search(r"80 steps: commands differ by (\S+) at the most, 0 statuses", told)
    assert found and float(found[1]) < 0.02
    if shutil.which("nm"):
        objects = sorted(map(str, (folder / "src").rglob("*.o")))
        shown = subprocess.run(["nm", "-u", *objects], capture_output=True, text=True, check=True)
        called = set(re.findall(r"U (\w+)", shown.stdout))
        assert not called & {"cos", "sin", "tan", "sqrt", "hypot", "fabs", "ceil", "rint", "malloc"}
        assert called & {"cosf", "sincosf"}


def test_a_path_is_followed_past_circles(export):
    model = CASES["nominal"][0]
    python = kl.Controller(model, kl.NavigationProblem(**AREA))
    robot = kl.CompiledController(export(model, python.problem))
    circles = np.array([(0.8, 0.1, 0.2), (1.4, 0.9, 0.2), (1.6, -0.25, 0.2), (2.2, 0.35, 0.25)])
    still = np.column_stack([circles, np.zeros((4, 2))])
    path = [(0, 0, 0.65), (0.9, 0.55, 0.65), (0.9, 0.55, -0.2), (1.5, 0.4, -0.2)]
    path += [(1.9, 0.0, -0.6), (2.2, -0.2, 0.0), (2.9, -0.1, 0.1), (3.0, 0.0, 0.0)]
    robot.set_path(path)
    pose, clearance = np.array([0.0, 0.0, 4 * np.pi]), np.inf
    for k in range(280):
        pose = model.predict(pose, robot.step(pose, path[-1], still).command)
        gaps = np.hypot(*(circles[:, :2] - pose[:2]).T) - circles[:, 2] - 0.15
        clearance = min(clearance, gaps.min())
        if k == 140:
            assert abs(pose[2] - 4 * np.pi) < 0.1
            pose = pose + (0.0, 0.1, 0.0)  # pushed aside: it drives straight back
    assert np.hypot(*(pose[:2] - (3.0, 0.0))) < 0.03 and abs(np.sin(pose[2] / 2)) < 0.05
    assert clearance > 0.0
    for wrong in ([(np.nan, 0.0, 0.0)], np.zeros((65, 3)), [(0.0, 2e4, 0.0)]):
        with pytest.raises(ValueError, match="path: expected at most 64 finite poses"):
            robot.set_path(wrong)
    robot.set_path([])
    assert robot.step((0, 0, 0), (-1, 0, 0), ()).command[0] < 0.0  # the goal again
    robot.set_path(insight(python, python.step((0, 0, 0), (0, 1, 0), still)).path)
    assert robot.step((0, 0, 0), (0, 1, 0), still).command[1] > 0.1  # it turns to Python's path


class Given:
    def __init__(self, poses: Any) -> None:
        self.poses, self.asked = np.array(poses, dtype=float), 0  # how often it was asked

    def begin(self, request: kl.PathRequest) -> None:
        self.asked += 1

    def advance(self, quanta: int) -> int:
        return 0

    def path(self) -> kl.Path:
        return kl.Path(self.poses, clearance=np.inf)


WAYS = {
    "past circles": [(0, 0, 0), (0, 0, 0.6), (0.9, 0.6, 0.6), (0.9, 0.6, -0.3), (2.2, 0.2, -0.3)],
    "with a change of gear": [(0, 0, 0), (1.2, 0.0, 0), (0.4, 0.0, 0)],
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("case", CASES)
def test_a_path_is_driven_as_the_guide_drives_it(case, way, export):
    """To where it holds: place, gears, last turn, margins, weights of the goal, tolerances."""
    model, problem = CASES[case][0], problem_of(case)
    size = problem.robot_radius / 0.15
    poses = np.array(WAYS[way]) * (size, size, 1.0)
    planner = Given(poses)
    # the host looks for another path if the robot strays, not the robot
    guidance = kl.GuidanceOptions(replan_interval=1e3, free_turn=0.0)
    python = kl.Controller(model, problem, guidance=guidance, planner=planner, adaptation=False)
    exported = kl.CompiledController(export(model, problem))
    exported.set_path(poses)
    rows = [(0.4, 0.9, 0.2), (1.2, -0.35, 0.2), (1.9, 0.9, 0.25)]
    circles = np.pad(size * np.array(rows), ((0, 0), (0, 2)))
    pose, past = poses[0], np.zeros((model.history, 2))
    for k in range(250):
        told = pose, poses[-1], circles
        theirs, ours = python.step(*told), exported.step(*told)
        assert ours.status is theirs.status, (k, ours.reason, theirs.reason)
        if theirs.holding or planner.asked > 1:  # it does not get nearer, and asks for another path
            break
        np.testing.assert_allclose(ours.command, theirs.command, rtol=0, atol=1e-7, err_msg=str(k))
        pose = model.predict(pose, theirs.command, past)
        past = np.concatenate([past, theirs.command[None]])[1:] if len(past) else past
    # a circle that touches the path where its gear changes pushes the robot 5 cm aside
    assert theirs.holding or np.hypot(*(pose - poses[-1])[:2]) < 0.06 * size
    assert k > 30


def test_the_sources_alone_make_a_library(tmp_path):
    """As build systems of microcontrollers take it: all of src/, no flags; also from C++."""
    folder = kl.export(kl.nominal_unicycle(0.1), kl.NavigationProblem(horizon=5), tmp_path / "lib")
    semver = kl.__version__.replace(".dev", "-dev")
    assert json.loads((folder / "library.json").read_text())["version"] == semver
    sources = [str(path) for path in (folder / "src").rglob("*.c")]
    sketch = tmp_path / "sketch.cpp"
    sketch.write_text(
        '#include "host.h"\nstatic kmpc_host host;\nint main() { kmpc_host_reset(&host); }\n'
    )
    (objects := tmp_path / "objects").mkdir()
    ask = ["cc", "-c", "-Werror", "-I", str(folder / "src"), *sources]
    subprocess.run(ask, cwd=objects, check=True)
    if shutil.which("c++"):
        built = [str(path) for path in objects.glob("*.o")]
        ask = ["c++", "-I", str(folder / "src"), str(sketch), *built, "-lm", "-o", "sketch"]
        subprocess.run(ask, cwd=tmp_path, check=True)
        subprocess.run([tmp_path / "sketch"], check=True)


def test_sanitizers_find_nothing(tmp_path):
    folder = kl.export(lagging(), kl.NavigationProblem(du_max=(0.6, 2.0)), tmp_path / "checked")
    flags = "CFLAGS=-O1 -g -fsanitize=address,undefined -fno-sanitize-recover=all"
    told = make(folder, "vectors", flags)
    done = subprocess.run([folder / "vectors"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, told + done.stdout + done.stderr


def test_what_is_not_in_c_is_refused(tmp_path):
    model = kl.nominal_unicycle(0.1)
    for given, told in (
        ({"footprint": kl.Footprint.rectangle(0.5, 0.3)}, "export: footprint: "),
        ({"wheels": kl.Car(0.5)}, "export: wheels: "),
        ({"sensor_range": 2.0}, "export: sensor_range: "),
        ({"track": 0.3, "max_wheel_speed": 0.5}, "export: max_wheel_speed: "),
    ):
        with pytest.raises(ProblemError, match=told):
            kl.export(model, kl.NavigationProblem(**given), tmp_path / "no")
    with pytest.raises(ProblemError, match="expected a symmetric model"):
        kl.export(replace(model, continuous=False), kl.NavigationProblem(), tmp_path / "no")
    assert not (tmp_path / "no").exists()


def test_a_foreign_folder_is_left_alone(tmp_path):
    (tmp_path / "thesis.txt").write_text("all of it")
    with pytest.raises(ProblemError, match="is not empty, and no exported controller is in it"):
        kl.export(kl.nominal_unicycle(0.1), kl.NavigationProblem(), tmp_path)
    assert os.listdir(tmp_path) == ["thesis.txt"]
    with pytest.raises(ProblemError, match="no exported controller"):
        kl.CompiledController(tmp_path)


def test_the_command(tmp_path, capsys):
    model = tmp_path / "robot.npz"
    noisy().save(model)
    folder = tmp_path / "firmware"
    ask = ["export", str(model), "-o", str(folder), "--radius", "0.2", "--horizon", "8"]
    assert main(ask) == 0
    assert f"make -C {folder} test" in capsys.readouterr().out
    about = json.loads((folder / "kmpc.json").read_text())
    assert about["sizes"]["KMPC_N"] == 8 and about["robot_radius"] == 0.2
    assert main([*ask, "--float32", "--scenario", "four_circles_1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["folder"] == str(folder)
    assert json.loads((folder / "kmpc.json").read_text())["float32"]
    assert main(["export", "missing.npz", "-o", str(folder)]) == 2
    assert (folder / "kmpc.json").is_file()
