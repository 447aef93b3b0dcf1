"""The list of who notices which option is whole, and true."""

from __future__ import annotations

import dataclasses
import os
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from golden_defaults import PACKAGE, changed, copy_with, defaults
from golden_file import load
from golden_session import replay
from golden_watch import DRIVES, TESTS

import kmpc_lite as kl

ALL_TESTS = Path(__file__).parents[1]
PAIRS = [(option, test) for test, options in TESTS.items() for option in options]


def test_every_option_is_on_the_list_once() -> None:
    listed = Counter([*DRIVES, *(option for option, _ in PAIRS)])
    assert set(listed) == set(defaults())
    assert max(listed.values()) == 1


@pytest.mark.parametrize("test", TESTS)
def test_the_tests_on_the_list_are_there(test: str) -> None:
    file, name = test.split("::")
    text = (ALL_TESTS / file).read_text(encoding="utf-8")
    assert re.search(rf"^def {name}\(", text, re.MULTILINE)


def test_a_copy_differs_from_the_package_by_one_default(tmp_path: Path) -> None:
    for option, place, line in (
        ("guidance.near_goal", "control/options/guidance.py", "near_goal: float = radii(2.4)"),
        ("solver.converged.max_iter", "control/options/solver.py", "max_iter=4800,"),
        ("adaptation.worse", "adaptation/options.py", "worse: float = share(1.32, zero=False)"),
    ):
        copy_with(option, changed(defaults()[option]), tmp_path)
        before = (PACKAGE / place).read_text(encoding="utf-8").splitlines()
        after = (tmp_path / PACKAGE.name / place).read_text(encoding="utf-8").splitlines()
        others = [b for a, b in zip(before, after, strict=True) if a != b]
        assert len(others) == 1 and line in others[0].replace("1.3200000000000003", "1.32")


@pytest.mark.long
@pytest.mark.parametrize(("option", "test"), PAIRS, ids=[option for option, _ in PAIRS])
def test_the_tests_on_the_list_notice_their_options(option: str, test: str, tmp_path: Path) -> None:
    copy_with(option, changed(defaults()[option]), tmp_path)
    where = {**os.environ, "PYTHONPATH": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
    copy_first = ["-o", f"pythonpath={tmp_path} tests/helpers tests/golden"]
    command = [sys.executable, "-m", "pytest", *copy_first, "-x", "-q", "-p", "no:cacheprovider"]
    done = subprocess.run(
        [*command, str(ALL_TESTS / test)],
        env=where,
        cwd=ALL_TESTS.parent,
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    assert done.returncode == pytest.ExitCode.TESTS_FAILED, done.stdout[-2000:]


@pytest.mark.long
def test_the_drives_on_the_list_notice_their_options() -> None:
    models, drives, _ = load()
    by_number = {drive.number: drive for drive in drives}
    values = defaults()
    usual: dict[int, Any] = {}
    unseen = []
    for name, number in DRIVES.items():
        drive = by_number[number]
        table: Any = changed(values[name])
        for part in reversed(name.split(".")):
            table = {part: table}
        options = {"options": kl.ControllerOptions.from_dict(table)}
        setup = {**drive.setup, "options": {**drive.setup["options"], **options}}
        if number not in usual:
            usual[number] = replay(drive, models)
        answers = replay(dataclasses.replace(drive, setup=setup), models)
        same = np.allclose(answers[0], usual[number][0], rtol=1e-9, atol=1e-9, equal_nan=True)
        if same and np.array_equal(answers[1], usual[number][1]):
            unseen.append(name)
    assert not unseen
