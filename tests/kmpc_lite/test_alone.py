"""The robot's distribution alone: its wheel is built and installed without the lab, and drives."""

import json
import shutil
import subprocess
import sys
import venv
import zipfile
from importlib import metadata
from pathlib import Path

import pytest

from kmpc_lab import DifferentialDrive, generate_dataset
from kmpc_lab.cli.demo import emulator

ROOT = Path(__file__).parents[2]
PACKAGES = ("kmpc_lite", "firmware_bridge")
COURSE = """
[map]
bounds = [-2.0, -2.0, 2.0, 2.0]
circles = [[0.4, 0.5, 0.1]]
[robot]
radius = 0.15
start = [0.0, 0.0, 0.0]
goal = [0.6, 0.0, 0.0]
"""


def pip(*words: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "pip", "--disable-pip-version-check", *words],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of kmpc-lite, built from a copy of its sources."""
    sources = tmp_path_factory.mktemp("sources")
    for name in PACKAGES:
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, sources / name, ignore=ignored)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, sources)
    # only where the setuptools that is installed is too old does pip fetch one
    found = [d.version for d in metadata.distributions(name="setuptools")]
    recent = bool(found) and int(found[0].split(".")[0]) >= 77
    here = ["--no-build-isolation"] if recent else []
    pip("wheel", "--quiet", "--no-deps", *here, "--wheel-dir", str(sources), str(sources))
    (built,) = sources.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def kmpc(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The command kmpc of an environment with the wheel and what it needs, but no lab."""
    folder = tmp_path_factory.mktemp("alone")
    venv.create(folder / "venv", with_pip=False)
    others = folder / "others"
    others.mkdir()
    for site in (Path(path) for path in sys.path if path.endswith("site-packages")):
        for entry in site.iterdir():
            ours = entry.name.startswith(("kmpc", "__editable__", "firmware_bridge"))
            if not (ours or entry.suffix == ".pth" or (others / entry.name).exists()):
                (others / entry.name).symlink_to(entry)
    (site,) = (folder / "venv").glob("lib/python*/site-packages")
    (site / "others.pth").write_text(f"{others}\n")
    python = str(folder / "venv" / "bin" / "python")
    pip("--python", python, "install", "--quiet", "--no-deps", "--no-index", str(wheel))
    return folder / "venv" / "bin" / "kmpc"


def run(kmpc: Path, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(kmpc), *words], cwd=folder, capture_output=True, text=True, timeout=60, check=False
    )


def test_the_wheel_holds_every_file_of_the_robot_and_none_of_the_lab(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as opened:
        inside = {name for name in opened.namelist() if ".dist-info/" not in name}
    files = (path for name in PACKAGES for path in (ROOT / name).rglob("*") if path.is_file())
    known = {path.relative_to(ROOT).as_posix() for path in files if "__pycache__" not in str(path)}
    assert inside == known
    assert not any("kmpc_lab" in name for name in inside) and len(inside) > 300


def test_without_the_lab_a_robot_learns_and_drives(kmpc: Path, tmp_path: Path) -> None:
    python = str(kmpc.with_name("python"))
    for module, status in (("kmpc_lite", 0), ("firmware_bridge", 0), ("kmpc_lab", 1)):
        done = subprocess.run(
            [python, "-c", f"import {module}"], cwd=tmp_path, capture_output=True, check=False
        )
        assert done.returncode == status, module
    done = run(kmpc, tmp_path, "simulate")
    assert done.returncode == 2
    assert done.stderr == "kmpc: kmpc simulate comes with kmpc-lab: pip install kmpc-lab\n"

    robot = DifferentialDrive(0.05, seed=1)
    generate_dataset(robot, episodes=20, steps=60, dt=0.1, seed=1).save(tmp_path / "run.csv")
    done = run(kmpc, tmp_path, "fit", "run.csv", "-o", "robot.npz")
    assert done.returncode == 0, done.stderr

    link = tmp_path / "roboclaw"
    done = run(kmpc, tmp_path, "init", "roboclaw", "--link", f"pty:{link}")
    assert done.returncode == 0, done.stderr
    (tmp_path / "course.toml").write_text(COURSE)
    with emulator(link, tmp_path / "robot.toml"):
        words = ("--scenario", "course.toml", "--model", "robot.npz", "--trust-model", "--json")
        done = run(kmpc, tmp_path, "run", "robot.toml", *words, "--socket", "estop")
    assert done.returncode == 0, done.stderr + done.stdout
    assert json.loads(done.stdout)["outcome"] == "arrived"
