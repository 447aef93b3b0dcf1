"""The list of who notices which option is whole, and true."""

from __future__ import annotations

import dataclasses
import math
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from golden_file import load
from golden_session import replay
from golden_watch import DRIVES, OPEN, OPEN_ROOMS, TESTS

import kmpc_lite as kl

CONTROL = Path(__file__).parents[1] / "control"


def defaults(options: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, Any]]:
    """Names of all options, with their rooms, and their values."""
    for field in dataclasses.fields(options):
        value = getattr(options, field.name)
        if dataclasses.is_dataclass(value):
            yield from defaults(value, (*path, field.name))
        else:
            yield ".".join((*path, field.name)), value


def changed(value: Any) -> Any:
    """Change a value by 20 %."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return max(math.ceil(1.2 * value), value + 1)
    if isinstance(value, tuple):
        return tuple(1.2 * part for part in value)
    return 1.2 * value


def test_every_option_is_on_the_list_once() -> None:
    listed = Counter([*DRIVES, *(name for names in TESTS.values() for name in names), *OPEN])
    names = {name for name, _ in defaults(kl.ControllerOptions())}
    assert set(listed) == {name for name in names if name.split(".")[0] not in OPEN_ROOMS}
    assert max(listed.values()) == 1


@pytest.mark.parametrize("test", TESTS)
def test_the_tests_on_the_list_are_there(test: str) -> None:
    file, name = test.split("::")
    assert re.search(rf"^def {name}\(", (CONTROL / file).read_text(encoding="utf-8"), re.MULTILINE)


@pytest.mark.long
def test_the_drives_on_the_list_notice_their_options() -> None:
    models, drives, _ = load()
    by_number = {drive.number: drive for drive in drives}
    values = dict(defaults(kl.ControllerOptions()))
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
