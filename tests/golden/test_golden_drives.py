"""What the controller answers is what it answered when the golden drives were recorded."""

from __future__ import annotations

import numpy as np
import osqp
import pytest
import scipy
from golden_changes import CHANGED
from golden_file import CODES, STATUSES, Drive, first_difference, load
from golden_session import replay

import kmpc_lite as kl

CHUNKS, QUICK = 40, 9
"""Tests that the drives are spread over, and how many of them `make test` runs."""


@pytest.fixture(scope="module")
def recorded() -> tuple[list[kl.KoopmanModel], list[Drive]]:
    models, drives, about = load()
    here = {"numpy": np.__version__, "scipy": scipy.__version__, "osqp": osqp.__version__}
    other = [
        f"{name} {about[name]}, here {version}"
        for name, version in here.items()
        if minor(about[name]) != minor(version)
    ]
    if other:
        pytest.skip(
            f"recorded with {'; '.join(other)}: other versions round otherwise; "
            "tests/golden/replay.py shows by how much"
        )
    return models, drives


def minor(version: str) -> list[str]:
    return version.split(".")[:2]


def chunks() -> list[object]:
    later = (pytest.param(chunk, marks=pytest.mark.long) for chunk in range(QUICK, CHUNKS))
    return [*range(QUICK), *later]


@pytest.mark.parametrize("chunk", chunks())
def test_answers_are_those_recorded(
    recorded: tuple[list[kl.KoopmanModel], list[Drive]], chunk: int
) -> None:
    models, drives = recorded
    wrong = []
    for drive in drives[chunk::CHUNKS]:
        answers = replay(drive, models)
        difference = first_difference(drive, *answers)
        if drive.number in CHANGED:
            assert difference is not None, f"drive {drive.number} is as recorded: not changed"
        elif difference is not None:
            name = f"drive {drive.number} ({drive.setup['kind']})"
            wrong.append(f"{name}, step {difference[0]}: {difference[1]}")
    assert not wrong, "\n".join(wrong)


def test_the_drives_come_to_every_status(
    recorded: tuple[list[kl.KoopmanModel], list[Drive]],
) -> None:
    codes = np.concatenate([drive.codes for drive in recorded[1]])
    assert set(codes[:, CODES.index("status")]) == set(range(len(STATUSES)))
    for name in ("holding", "reachable"):
        assert set(codes[:, CODES.index(name)]) == {0, 1}


def test_a_change_of_a_millionth_is_seen(
    recorded: tuple[list[kl.KoopmanModel], list[Drive]],
) -> None:
    models, drives = recorded
    drive = next(d for d in drives if d.number not in CHANGED)
    values, codes = replay(drive, models)
    values[5, 1] += 1e-6
    found = first_difference(drive, values, codes)
    assert found is not None and found[0] == 5
