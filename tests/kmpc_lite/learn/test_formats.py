"""Logs as text from outside: what is wrong is said with file, line and column, and nothing else is
raised or printed.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refused_logs import GOOD, HEADER, refusal, write

import kmpc_lite as kl
from kmpc_lite.learn.cutting import period_of
from kmpc_lite.learn.formats.readers import read_log

pytestmark = pytest.mark.usefixtures("no_warnings")


@pytest.mark.parametrize(
    "content",
    [
        "\n".join([HEADER, *GOOD[:3], "", *GOOD[3:], ""]),
        "\r\n".join([HEADER, *GOOD, ""]),
        "\r".join([HEADER, *GOOD, ""]),
        "\ufeff" + "\n".join([HEADER, *GOOD, ""]),
        "\n".join([HEADER, "s,m,m,rad,m/s,rad/s", *GOOD, ""]),
        "\n".join([" t , x,y, theta,v,omega ", *(g.replace(",", " , ") for g in GOOD), ""]),
        "\n".join(
            [
                ",".join(f'"{name}"' for name in HEADER.split(",")),
                *(",".join(f'"{v}"' for v in g.split(",")) for g in GOOD),
                "",
            ]
        ),
        "\n".join([f"note,{HEADER},note", *(f'"left, then right",{g},ähm #1' for g in GOOD), ""]),
    ],
    ids=["blank within", "crlf", "cr", "bom", "units", "spaces", "quotes", "more columns"],
)
def test_the_same_log_in_many_looks(tmp_path: Path, content: str) -> None:
    path = tmp_path / "run.csv"
    path.write_bytes(content.encode("utf-16" if "left" in content else "utf-8"))
    (episode,) = kl.Dataset.load(path).episodes
    np.testing.assert_array_equal(
        episode.states, np.c_[np.arange(6.0), np.full(6, 2.0), np.full(6, 0.5)]
    )
    np.testing.assert_array_equal(episode.inputs, np.tile([0.25, 0.0], (5, 1)))
    assert episode.dt == 0.1


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", ["empty file", HEADER]),
        (HEADER.encode(), ["0 row(s)"]),
        (b"time,x,y,theta,v,v,omega\n", ["v doubled"]),
        (bytes(range(256)) * 10, ["missing"]),
        (b"PK\x03\x04" + b"\0" * 100, ["missing"]),
    ],
)
def test_text_that_is_no_log(tmp_path: Path, content: bytes, words: list[str]) -> None:
    path = tmp_path / "run.csv"
    path.write_bytes(content)
    text = refusal(path)
    assert all(word in text for word in ["run.csv", *words]), text


@pytest.mark.parametrize("blank", [[], [""], ["", "   ", ""]])
@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("0.6,1,2,left,1,1", "column theta: expected a number, got 'left'"),
        ("0.6,1_0,2,0,1,1", "column x: expected a number, got '1_0'"),
        (f"0.6,{'9' * 70}x,2,0,1,1", "column x: expected a number, got '999"),
        ("0.6", "expected 6 values as in the header, got 1"),
        ('0.6,1,2,0,1,"1', "a quote without its end"),
        ("0.6,1,2,0,-inf,1", "column v: expected a finite number in m/s, got -inf"),
        ("0.5,1,2,0,1,1", "column t: time must grow, got 0.5 s after 0.5 s"),
        (
            "0.62,1,2,0,1,1",
            "column t: uneven sampling, a step of 0.12 s where the median is 0.1 s; give dt=",
        ),
    ],
)
def test_a_bad_row_is_named_by_its_line_in_the_file(
    tmp_path: Path, row: str, words: str, blank: list[str]
) -> None:
    path = write(tmp_path / "run.csv", HEADER, *GOOD[:2], *blank, *GOOD[2:], *blank, row, *blank)
    line = 1 + len(GOOD) + 2 * len(blank) + 1
    text = refusal(path)
    assert f"run.csv: line {line}" in text and words in text, text
    # the same where windows end lines their own way
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    assert refusal(path) == text


def test_steps_that_drift_are_uneven(tmp_path: Path) -> None:
    time = np.cumsum([0.0, *[0.1, 0.1, 0.108] * 20])
    path = write(tmp_path / "run.csv", HEADER, *(f"{t:.4f},{t:.4f},0,0,1,0" for t in time))
    assert "uneven sampling, steps of 0.102667 s in the mean but 0.1 s in the median" in refusal(
        path
    )
    assert kl.Dataset.load(path, dt=0.1).dt == 0.1


@pytest.mark.parametrize("name", ["run", "run.doc", "run.csv.gz", "", "."])
def test_an_unknown_ending(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.chdir(tmp_path)
    assert "expected .csv, .npz" in refusal(name)


@pytest.mark.parametrize("name", ["dt", "gap"])
@pytest.mark.parametrize("value", [0.0, -0.1, float("nan"), float("inf"), "fast", [0.1, 0.2]])
def test_an_impossible_period_or_gap(tmp_path: Path, name: str, value: Any) -> None:
    path = write(tmp_path / "run.csv", HEADER, *GOOD)
    with pytest.raises(kl.DataError, match=f"^{name}: expected"):
        kl.Dataset.load(path, **{name: value})


def test_a_log_too_long_is_refused_before_it_fills_the_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(tmp_path / "run.csv", HEADER, *GOOD)
    kl.Dataset.load(path).save(tmp_path / "run.npz")
    for module in ("formats.tables", "dataset"):
        monkeypatch.setattr(f"kmpc_lite.learn.{module}.MAX_ROWS", 5)
    assert "more than 5 rows" in refusal(path)
    assert "more than 5 rows" in refusal(tmp_path / "run.npz")


@pytest.mark.parametrize("since", [0.0, 1.7e9])
@pytest.mark.parametrize("dt", [0.05, 0.1, 1 / 30, 0.02, 1.0])
@pytest.mark.parametrize("rows", [2, 5, 200])
def test_the_period_is_as_exact_as_the_stamps(tmp_path: Path, since: float, dt: float, rows: int):
    time = since + dt * np.arange(rows)
    np.savez(
        tmp_path / "run.npz",
        **{name: time if name == "t" else np.zeros(rows) for name in HEADER.split(",")},
    )
    data = kl.Dataset.load(tmp_path / "run.npz", force=True)
    resolution = 2 * np.spacing(time[-1]) / (rows - 1)
    assert abs(data.dt - dt) <= max(1e-9 * dt, 2 * resolution)
    if dt != 1 / 30:
        assert data.dt == dt == period_of(read_log(tmp_path / "run.npz"))
