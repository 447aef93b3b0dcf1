"""What runs a study: rows are the same whatever does, and those that are done are kept."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace

import pytest

from kmpc_lab.studies.catalogue import STUDIES
from kmpc_lab.studies.drive import DriveResult
from kmpc_lab.studies.study import Work, drive_one, executor
from kmpc_lite.errors import KmpcError

SCALES = STUDIES["scales"]
ASKED = SCALES.asked([("x1", "1 s, N 10")], (3, 4))


def double(value: int) -> int:
    if value < 0:
        os.kill(os.getpid(), signal.SIGKILL)
    return 2 * value


def untimed(rows: list[DriveResult]) -> list[DriveResult]:
    return [replace(row, step_p50=0.0, step_p99=0.0) for row in rows]


def test_a_process_that_is_killed_is_reported_with_the_way_on_and_what_is_done_is_kept() -> None:
    kept = []
    with pytest.raises(KmpcError, match="--resume"), executor(2) as run:
        kept += run(double, [(1,), (2,)])
        kept += run(double, [(-1,)])
    assert sorted(kept) == [2, 4]


@contextmanager
def running(*command: str) -> Iterator[subprocess.Popen[bytes]]:
    """Start a command of Dask's; it is ended with the block."""
    process = subprocess.Popen(
        [sys.executable, "-m", "distributed.cli." + command[0], *command[1:]],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a Dask scheduler with one worker, in processes of their own."""
    folder = tmp_path_factory.mktemp("dask")
    file = folder / "scheduler.json"
    with ExitStack() as stack:
        scheduling = ("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        stack.enter_context(running(*scheduling, "--scheduler-file", str(file)))
        deadline, address = time.monotonic() + 120.0, ""
        while not address:
            assert time.monotonic() < deadline, "no scheduler"
            time.sleep(0.1)
            if file.exists() and (text := file.read_text()):
                address = text.partition('"address": "')[2].partition('"')[0]
        options = ("--nworkers=1", "--nthreads=1", "--no-dashboard", "--no-nanny")
        local = f"--local-directory={folder}"
        stack.enter_context(running("dask_worker", address, *options, local))
        yield address


def test_rows_are_the_same_whatever_runs_them(scheduler: str) -> None:
    here = untimed([drive_one(SCALES, asked)[1] for asked in ASKED])
    with executor(2) as processes:
        assert untimed(Work(processes).rows(SCALES, ASKED)) == here
    with executor(cluster=scheduler) as cluster:
        assert untimed(Work(cluster).rows(SCALES, ASKED)) == here


def test_a_cluster_that_is_not_there_is_named() -> None:
    with pytest.raises(KmpcError, match="--cluster tcp://127.0.0.1:1: no Dask scheduler"):
        with executor(cluster="tcp://127.0.0.1:1"):
            pytest.fail("it began")
