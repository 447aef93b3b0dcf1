"""Step times of this version and of another commit, in turns, on the same recorded inputs.

Each version runs in a process of its own and steps when the other one has answered: caches are as
cold as on a robot, and what slows the machine slows both.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, cast

import numpy as np

import kmpc_lite
from kmpc_lab.bench.lidar import Step, make_controller, record_turn
from kmpc_lab.bench.measure import HEAD, QUANTILES, format_times, in_ms
from kmpc_lab.studies.any_robot import STANDARD
from kmpc_lab.studies.sight.worlds import SIDE
from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.errors import ProblemError

WORKER = Path(__file__).with_name("step_worker.py")
PACKAGE = "kmpc_lite"
FIELDS = ("horizon", "dt", "u_min", "u_max", "x_min", "x_max", "robot_radius")
"""Of the problem that both versions solve."""


class _Version:
    """A process that steps the controller of one version."""

    def __init__(self, folder: Path, problem: dict[str, Any]) -> None:
        paths = [str(folder), os.environ.get("PYTHONPATH", "")]
        self._process = subprocess.Popen(
            [sys.executable, str(WORKER)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
        )
        where = Path(self._ask({"problem": problem})).resolve()
        if not where.is_relative_to(folder.resolve()):
            raise ProblemError(f"expected {PACKAGE} from {folder}, but {where} was imported")

    def _ask(self, question: dict[str, Any]) -> str:
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write(json.dumps(question) + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline().strip()
        if not answer:
            raise ProblemError(
                f"the controller of the other version ended ({self._process.wait()})"
            )
        return answer

    def step(self, question: dict[str, Any]) -> float:
        """Time of a step [s]."""
        return float(self._ask(question))

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def against(
    commit: str,
    drives: int,
    seed: int,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[dict[str, Any]]:
    """Time the steps of this version and of a commit, in turns.

    Parameters
    ----------
    commit : str
        As git names it; the package's checkout must be a repository.
    drives : int
        Past four circles, and by each lidar of ``kmpc bench --lidar``.
    seed : int
        Of the first; the others follow.
    progress : callable
        Called as drives finish.

    Returns
    -------
    list of dict
        For each kind of drive ``name``, ``steps``, ``ms`` and ``other_ms`` (p50, p99, p99.9 and max
        of a step), and ``ratio`` of this version to the other one (p50, p99, p99.9).

    Raises
    ------
    ProblemError
        If the checkout does not know the commit, or if its controller ends.
    """
    here = Path(kmpc_lite.__file__).parents[1]
    problem = _problem()
    times: dict[str, tuple[list[float], list[float]]] = {}
    with _exported(here, commit) as folder:
        versions = _Version(here, problem), _Version(folder, problem)
        controller = make_controller()
        for i in range(drives):
            for name, recorded in record_turn(controller, i, seed + i).items():
                laps = times.setdefault(name, ([], []))
                for k, step in enumerate(recorded):
                    question = {**_plain(step), "first": k == 0}
                    # the order changes from step to step
                    for which in (0, 1) if k % 2 else (1, 0):
                        seconds = versions[which].step(question)
                        if k:
                            laps[which].append(seconds)
            progress(i + 1, drives)
        for version in versions:
            version.close()
    return [_row(name, *laps) for name, laps in times.items()]


def _problem() -> dict[str, Any]:
    """The problem's fields, as JSON can hold them."""
    problem = STANDARD.problem(SIDE)
    values = {name: getattr(problem, name) for name in FIELDS}
    return {name: np.asarray(value).tolist() for name, value in values.items()}


def _plain(step: Step) -> dict[str, Any]:
    """A recorded step, as JSON can hold it."""
    pose, goal, obstacles, sent = step
    plain = {"pose": pose.tolist(), "goal": np.asarray(goal).tolist()}
    # else a version that commands otherwise takes the poses for jumps, and refuses to plan
    plain["sent"] = None if sent is None else sent.tolist()
    if isinstance(obstacles, np.ndarray):
        return {**plain, "circles": obstacles.tolist()}
    names = ("angle_min", "angle_increment", "range_max", "range_min", "mount", "noise")
    scans = [
        {"ranges": scan.ranges.tolist(), **{name: getattr(scan, name) for name in names}}
        for scan in cast("Sequence[LaserScan]", obstacles)
    ]
    return {**plain, "scans": scans}


@contextmanager
def _exported(here: Path, commit: str) -> Iterator[Path]:
    """Write a commit's package into a folder that is removed afterwards."""
    asked = ["git", "-C", str(here), "archive", "--format=tar", commit, PACKAGE]
    archive = subprocess.run(asked, capture_output=True)
    if archive.returncode:
        said = archive.stderr.decode(errors="replace").strip().splitlines()
        raise ProblemError(f"--against {commit}: git archive in {here}: {said[-1] if said else ''}")
    with tempfile.TemporaryDirectory() as name:
        with tarfile.open(fileobj=BytesIO(archive.stdout)) as tar:
            tar.extractall(name, filter="data")
        yield Path(name)


def _row(name: str, ours: Sequence[float], others: Sequence[float]) -> dict[str, Any]:
    """Plain values, for JSON."""
    ms, other_ms = in_ms(ours), in_ms(others)
    ratio = {quantile: ms[quantile] / other_ms[quantile] for quantile in QUANTILES}
    return {"name": name, "steps": len(ours), "ms": ms, "other_ms": other_ms, "ratio": ratio}


def format_against(rows: Sequence[dict[str, Any]], commit: str) -> str:
    """Render `against` as a table: each kind of drive for both versions, and their ratio."""
    width = max(18, len(commit) + 2)
    lines = [f"{'':<18}{'':<{width}}{'steps':>7}{HEAD}"]
    for row in rows:
        lines.append(
            f"{row['name']:<18}{'this':<{width}}{row['steps']:>7}{format_times(row['ms'])}"
        )
        lines.append(f"{'':<18}{commit:<{width}}{row['steps']:>7}{format_times(row['other_ms'])}")
        ratios = "".join(f"{row['ratio'][quantile]:9.2f}" for quantile in QUANTILES)
        lines.append(f"{'':<18}{'this / other':<{width}}{'':>7}{ratios}")
    return "\n".join(lines)
