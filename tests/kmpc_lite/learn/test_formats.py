"""Logs as text from outside: what is wrong is said with file, line and column, and nothing else is
raised or printed.
"""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refused_logs import GOOD, HEADER, refusal, write

import kmpc_lite as kl
from kmpc_lite.learn.cutting import period_of
from kmpc_lite.learn.formats.readers import read_log

pytestmark = pytest.mark.usefixtures("no_warnings")


# good logs of many looks


@pytest.mark.parametrize(
    "content",
    [
        "\n".join([HEADER, *GOOD]),
        "\n".join([HEADER, *GOOD, "", "", "  ", ""]),
        "\n".join([HEADER, *GOOD[:3], "", *GOOD[3:], ""]),
        "\r\n".join([HEADER, *GOOD, ""]),
        "\r".join([HEADER, *GOOD, ""]),
        "\ufeff" + "\n".join([HEADER, *GOOD, ""]),
        "\n".join([" t , x,y, theta,v,omega ", *(g.replace(",", " , ") for g in GOOD), ""]),
        "\n".join(
            [
                ",".join(f'"{name}"' for name in HEADER.split(",")),
                *(",".join(f'"{v}"' for v in g.split(",")) for g in GOOD),
                "",
            ]
        ),
        "\n".join([f"{HEADER},", *(f"{g}," for g in GOOD), ""]),
        "\n".join([f"note,{HEADER},note", *(f'"left, then right",{g},ähm #1' for g in GOOD), ""]),
        "\n".join(["omega,v,theta,y,x,t", *(",".join(reversed(g.split(","))) for g in GOOD), ""]),
        "\n".join([HEADER, *(g.replace("0.25", "+2.5E-1") for g in GOOD), ""]),
    ],
    ids=[
        "plain",
        "blank end",
        "blank within",
        "crlf",
        "cr",
        "bom",
        "spaces",
        "quotes",
        "trailing comma",
        "more columns",
        "order",
        "exponent",
    ],
)
def test_the_same_log_in_many_looks(tmp_path: Path, content: str) -> None:
    path = tmp_path / "run.csv"
    path.write_bytes(content.encode())
    (episode,) = kl.Dataset.load(path).episodes
    np.testing.assert_array_equal(
        episode.states, np.c_[np.arange(6.0), np.full(6, 2.0), np.full(6, 0.5)]
    )
    np.testing.assert_array_equal(episode.inputs, np.tile([0.25, 0.0], (5, 1)))
    assert episode.dt == 0.1


def test_upper_case_endings(tmp_path: Path) -> None:
    assert kl.Dataset.load(write(tmp_path / "RUN.CSV", HEADER, *GOOD)).steps == 5


# text that is no log


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", ["empty file", HEADER]),
        (b"\n", ["line 1 is blank"]),
        (f"\n{HEADER}\n".encode(), ["line 1 is blank"]),
        (f"{HEADER}\n".encode(), ["0 row(s)", "at least 2"]),
        (HEADER.encode(), ["0 row(s)"]),
        (f"{HEADER}\n\n  \n".encode(), ["0 row(s)"]),
        (f"{HEADER}\n{GOOD[0]}\n".encode(), ["1 row(s)"]),
        (b"t,x,y,theta,v\n0,0,0,0,0\n", ["line 1", "omega missing"]),
        (b"t,x,y,theta,v,v,omega\n", ["line 1", "v doubled"]),
        (b"time,x,y,theta,v,v,omega\n", ["v doubled"]),
        (HEADER.replace(",", ";").encode(), ["0 row(s)"]),
        (HEADER.replace(",", "/").encode(), ["line 1", "missing", "t/x/y"]),
        (GOOD[0].encode(), ["line 1", "missing"]),
        (f"{HEADER}\n{GOOD[0]}\n".encode("utf-16"), ["line 1", "missing"]),
        (bytes(range(256)) * 10, ["missing"]),
        (b"\0" * 5000, ["missing"]),
        (
            np.random.default_rng(0).bytes(100_000).replace(b"\n", b"").replace(b"\r", b""),
            ["line 1 is too long"],
        ),
        (pickle.dumps([1, 2, 3]), ["missing"]),
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
        ("0.6,1,2,0,1,1 m/s", "column omega: expected a number, got '1 m/s'"),
        ("0.6,1_0,2,0,1,1", "column x: expected a number, got '1_0'"),
        ("0.6,\u0661,2,0,1,1", "column x: expected a number"),
        (f"0.6,{'9' * 70}x,2,0,1,1", "column x: expected a number, got '999"),
        ("0.6,1,2,0,1", "expected 6 values as in the header, got 5"),
        ("0,6,1,2,0,1,1", "expected 6 values as in the header, got 7"),
        ("0.6,1,2,0,1,1,", "expected 6 values as in the header, got 7"),
        ("0.6", "expected 6 values as in the header, got 1"),
        ('0.6,"1,2",3,0,1', "expected 6 values as in the header, got 5"),
        ('0.6,1,2,0,1,"1', "a quote without its end"),
        ("0.6,1,2,0,-inf,1", "column v: expected a finite number in m/s, got -inf"),
        ("0.6,1,2,0,1,1e400", "column omega: expected a finite number in rad/s, got inf"),
        ("0.3,1,2,0,1,1", "column t: time must grow, got 0.3 s after 0.5 s"),
        ("0.5,1,2,0,1,1", "column t: time must grow, got 0.5 s after 0.5 s"),
        ("-3,1,2,0,1,1", "column t: time must grow, got -3 s after 0.5 s"),
        (
            "0.62,1,2,0,1,1",
            "column t: uneven sampling, a step of 0.12 s where the median is 0.1 s; give dt=",
        ),
        ("0.7,1,2,0,1,1", "column t: uneven sampling, a step of 0.2 s"),
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


@pytest.mark.parametrize("ending", [".csv", ".npz"])
def test_a_log_that_cannot_be_read(tmp_path: Path, ending: str) -> None:
    assert "cannot read the log: No such file" in refusal(tmp_path / f"missing{ending}")
    (tmp_path / f"folder{ending}").mkdir()
    assert "cannot read the log: Is a directory" in refusal(tmp_path / f"folder{ending}")
    write(tmp_path / f"file{ending}", HEADER)
    assert "cannot read the log: Not a directory" in refusal(
        tmp_path / f"file{ending}" / f"run{ending}"
    )
    with pytest.raises(kl.DataError, match="null byte"):
        kl.Dataset.load(f"bad\0name{ending}")


@pytest.mark.parametrize("name", ["dt", "gap"])
@pytest.mark.parametrize("value", [0.0, -0.1, float("nan"), float("inf"), "fast", [0.1, 0.2]])
def test_an_impossible_period_or_gap(tmp_path: Path, name: str, value: Any) -> None:
    path = write(tmp_path / "run.csv", HEADER, *GOOD)
    with pytest.raises(kl.DataError, match=f"^{name}: expected"):
        kl.Dataset.load(path, **{name: value})


def test_a_period_that_would_make_millions_of_steps(tmp_path: Path) -> None:
    assert "more than 10,000,000 steps" in refusal(
        write(tmp_path / "run.csv", HEADER, *GOOD), dt=1e-9
    )


def test_a_log_shorter_than_the_period_or_made_of_gaps(tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", HEADER, *GOOD)
    assert "as long as one period of 10 s" in refusal(path, dt=10.0)
    assert "no two rows closer than 0.05 s (the gap limit)" in refusal(path, gap=0.05)


def test_a_log_too_long_is_refused_before_it_fills_the_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(tmp_path / "run.csv", HEADER, *GOOD)
    kl.Dataset.load(path).save(tmp_path / "run.npz")
    for module in ("formats.tables", "formats.csv_table", "dataset"):
        monkeypatch.setattr(f"kmpc_lite.learn.{module}.MAX_ROWS", 5)
    assert "more than 5 rows" in refusal(path)
    assert "more than 5 rows" in refusal(tmp_path / "run.npz")


# the period


@pytest.mark.parametrize("since", [0.0, 1.7e9])
@pytest.mark.parametrize("dt", [0.05, 0.1, 1 / 30, 0.02, 1.0])
@pytest.mark.parametrize("rows", [2, 5, 200])
def test_the_period_is_as_exact_as_the_stamps(
    tmp_path: Path, since: float, dt: float, rows: int
) -> None:
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


def test_stamps_with_few_digits_still_give_the_mean_period(tmp_path: Path) -> None:
    path = write(
        tmp_path / "run.csv", HEADER, *(f"{k / 30:.4f},{k / 30},0,0,1,0" for k in range(301))
    )
    assert abs(kl.Dataset.load(path).dt - 1 / 30) < 1e-6


def test_the_period_of_an_uneven_log(tmp_path: Path) -> None:
    path = write(
        tmp_path / "run.csv",
        HEADER,
        *(f"{t},0,0,0,1,1" for t in (0, 0.1, 0.2, 0.25, 0.35, 5.0, 5.1)),
    )
    assert period_of(read_log(path)) == pytest.approx(0.1)
