"""The package as a whole: its public names, and what importing it brings along."""

import inspect
import os
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import kmpc_lite as kl

ROOT = Path(__file__).parents[2]
NEEDED = "import numpy, scipy.sparse, osqp"


def run(code: str, **environment: str) -> str:
    """What a fresh interpreter prints; nothing may go to its standard error."""
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, **environment},
    )
    assert done.stderr == ""
    return done.stdout


def test_all_is_what_can_be_imported() -> None:
    assert sorted(set(kl.__all__)) == sorted(kl.__all__)
    assert all(hasattr(kl, name) for name in kl.__all__)
    assert set(kl.__all__) <= set(dir(kl))
    own = {
        name
        for name, value in vars(kl).items()
        if not name.startswith("_") and not inspect.ismodule(value)
    }
    assert own == set(kl.__all__)


@pytest.mark.parametrize("name", kl.__all__)
def test_every_public_name_has_a_docstring_of_its_own(name: str) -> None:
    value = getattr(kl, name)
    text = (value.__doc__ or "").strip()
    assert len(text.splitlines()[0]) > 10
    # dataclasses without a docstring get their signature for one
    assert not text.startswith(f"{name}(")
    if inspect.isclass(value):
        for member, function in vars(value).items():
            if not member.startswith("_") and inspect.isfunction(function):
                assert function.__doc__, f"{name}.{member}"


def test_the_version_is_that_of_the_installed_package() -> None:
    assert kl.__version__ == metadata.version("kmpc-lite")


def test_importing_brings_nothing_but_what_the_loop_needs() -> None:
    loaded = run(
        f"import sys; {NEEDED}; before = set(sys.modules); import kmpc_lite.api; "
        "print(*sorted(set(sys.modules) - before))"
    ).split()
    others = {name.split(".")[0] for name in loaded} - set(sys.stdlib_module_names) - {"kmpc_lite"}
    assert others <= {"numpy"}, f"importing kmpc_lite imports {sorted(others)} too"
    parts = set(run("import sys, kmpc_lite.api; print(*sys.modules)").split())
    for heavy in (
        "matplotlib",
        "casadi",
        "qpsolvers",
        "pymavlink",
        "serial",
        "mujoco",
        "mcap",
        "dask",
        "clarabel",
        "firmware_bridge",
        "kmpc_lab",
        "kmpc_lite.cli.main",
        "kmpc_lite.scenario.files",
    ):
        assert heavy not in parts


def test_no_step_with_a_scan_imports_anything() -> None:
    loaded = run(
        "import sys, numpy as np, kmpc_lite as kl\n"
        "controller = kl.Controller(kl.nominal_unicycle(0.1))\n"
        "ranges = np.where(np.arange(360) % 40 < 30, 0.8, np.inf)\n"
        "scan = kl.LaserScan(ranges, 0.0, np.pi / 180, range_max=4.0)\n"
        "before = set(sys.modules)\n"
        "for _ in range(3): controller.step((0, 0, 0), (1.6, 1.2, 0), [scan])\n"
        "print(*sorted(set(sys.modules) - before))"
    )
    assert loaded.split() == []


def test_the_constraints_pin_all_that_the_package_asks_for() -> None:
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pinned = dict(line.split("==") for line in lines if not line.startswith("#"))
    versions = {canonicalize_name(name): version for name, version in pinned.items()}
    robot, lab = (
        tomllib.loads((folder / "pyproject.toml").read_text())["project"]
        for folder in (ROOT, ROOT / "lab")
    )
    extras = [*robot["optional-dependencies"].values(), *lab["optional-dependencies"].values()]
    groups = [robot["dependencies"], *extras]
    for wanted in (Requirement(text) for group in groups for text in group):
        version = versions.get(canonicalize_name(wanted.name))
        assert version is not None, f"{wanted.name} is not in constraints.txt: make constraints"
        assert wanted.specifier.contains(version, prereleases=True), wanted
