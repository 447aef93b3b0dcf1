"""What runs a study: rows are the same whatever does, and those that are done are kept."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import CancelledError
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from kmpc_lab.studies.catalogue import STUDIES
from kmpc_lab.studies.drive import DriveResult
from kmpc_lab.studies.executors import WorkerLost, executor, gather
from kmpc_lab.studies.study import Work, drive_one

SCALES = STUDIES["scales"]
ASKED = SCALES.asked([("x1", "1 s, N 10")], (3, 4))


def double(value: int) -> int:
    return 2 * value


def fail(value: int) -> int:
    raise ValueError(f"no {value}")


def die(_: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return 0


def untimed(rows: list[DriveResult]) -> list[DriveResult]:
    return [replace(row, step_p50=0.0, step_p99=0.0) for row in rows]


# -- processes of this machine


def test_an_error_comes_out_and_the_rest_is_kept() -> None:
    kept: list[int] = []
    with pytest.raises(ValueError, match="no 1"), executor(1) as runner:
        jobs = {runner.submit(fail, 1): 1}
        jobs |= {runner.submit(double, value): value for value in range(3)}
        gather(jobs, lambda _, result: kept.append(result))
    assert sorted(kept) == [0, 2, 4]


def test_a_process_that_is_killed_is_reported_with_the_way_on_and_what_is_done_is_kept() -> None:
    kept: list[int] = []
    with pytest.raises(WorkerLost, match="--resume"), executor(1) as runner:
        gather({runner.submit(double, 1): 1}, lambda _, result: kept.append(result))
        gather({runner.submit(die, 0): 0}, lambda _, result: kept.append(result))
    assert kept == [2]


def test_an_interrupt_ends_the_work_at_once() -> None:
    with pytest.raises(KeyboardInterrupt), executor(1) as runner:
        runner.submit(double, 1).result()
        workers = multiprocessing.active_children()
        sleeping, waiting = runner.submit(time.sleep, 600.0), runner.submit(double, 1)
        raise KeyboardInterrupt
    assert workers
    deadline = time.monotonic() + 60.0  # not the ten minutes that it would have slept
    while any(worker.is_alive() for worker in workers):
        assert time.monotonic() < deadline, "a worker sleeps on"
        time.sleep(0.01)
    for job in (sleeping, waiting):
        with pytest.raises((BrokenProcessPool, CancelledError)):
            job.result(timeout=60.0)


# -- a Dask cluster


@contextmanager
def running(*command: str) -> Iterator[subprocess.Popen[bytes]]:
    """Start a command of Dask's; it is ended with the block."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(
        [sys.executable, "-m", "distributed.cli." + command[0], *command[1:]],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=environment,
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def worker_command(address: str, folder: Path) -> tuple[str, ...]:
    options = ("--nworkers", "1", "--nthreads", "1", "--no-dashboard", "--no-nanny")
    return ("dask_worker", address, *options, "--local-directory", str(folder))


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a Dask scheduler with one worker, in processes of their own."""
    folder = tmp_path_factory.mktemp("dask")
    file = folder / "scheduler.json"
    with ExitStack() as stack:
        scheduling = ("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        stack.enter_context(running(*scheduling, "--scheduler-file", str(file)))
        deadline = time.monotonic() + 120.0
        address = ""
        while not address:
            assert time.monotonic() < deadline, "no scheduler"
            time.sleep(0.1)
            if file.exists() and (text := file.read_text()):
                address = text.partition('"address": "')[2].partition('"')[0]
        stack.enter_context(running(*worker_command(address, folder)))
        yield address


def test_rows_are_the_same_whatever_runs_them(scheduler: str) -> None:
    here = untimed([drive_one(SCALES, asked) for asked in ASKED])
    with executor(2) as processes:
        assert untimed(Work(processes).rows(SCALES, ASKED)) == here
    with executor(cluster=scheduler) as cluster:
        assert untimed(Work(cluster).rows(SCALES, ASKED)) == here
