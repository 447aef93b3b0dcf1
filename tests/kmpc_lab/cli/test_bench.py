"""What `kmpc bench` is asked for, and which options go with it; never how long anything takes."""

import argparse
from dataclasses import replace
from typing import Any

import pytest

from kmpc_lab.cli import bench
from kmpc_lab.cli.bench import COMPARISON, JOBS, LOOP, Job
from kmpc_lite.cli import main as cli

LINES = {
    "--drives": "--drives 3",
    "--tuning": "--tuning",
    "--only": "--only ours",
    "--seconds": "--seconds 5",
    "--no-load": "--no-load",
    "--budget": "--budget 0.01",
}
CASES = [("", COMPARISON), ("--loop 100", LOOP), *JOBS.items()]


def measured(options: argparse.Namespace) -> tuple[Any, str]:
    return {}, "measured"


@pytest.mark.parametrize(("line", "job"), CASES, ids=[line or "none" for line, _ in CASES])
def test_a_job_refuses_the_options_that_it_does_not_read(
    line: str, job: Job, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    quick = replace(job, measure=measured)
    monkeypatch.setattr(bench, "COMPARISON", quick)
    monkeypatch.setattr(bench, "LOOP", quick)
    monkeypatch.setattr(bench, "JOBS", {option: quick for option in JOBS})
    assert set(LINES) == set(bench.SHARED) >= set(job.reads)
    for option, words in LINES.items():
        status = cli.main(["bench", *line.split(), *words.split()])
        out, err = capsys.readouterr()
        if option in job.reads:
            assert (status, out, err) == (0, "measured\n", "")
        else:
            name = " ".join(["kmpc bench", *line.split()[:1]])
            assert status == 2 and not out
            assert err.startswith(f"kmpc bench: {option}: {name} does not read it")
            assert len(err.splitlines()) == 1
