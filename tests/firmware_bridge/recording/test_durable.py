"""What a full disk, a disk that fails and a kill leave of a file that records are added to."""

import errno
import os
import signal
import subprocess
import sys
import time

from firmware_bridge.recording.durable import DurableFile
from firmware_bridge.recording.recorder import HEADER


def test_a_full_disk_ends_the_log_with_a_whole_row_is_reported_and_stops_nothing(
    tmp_path, monkeypatch
):
    room, write = [1000], os.write

    def short(descriptor, data):
        if descriptor != log._descriptor:
            return write(descriptor, data)
        if room[0] == 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        count = write(descriptor, bytes(data)[: min(room[0], 37)])
        room[0] -= count
        return count

    log = DurableFile(tmp_path / "a.csv", list, HEADER)
    monkeypatch.setattr(os, "write", short)
    for k in range(10_000):
        log.put(b"%d,0,0,0,0,0\n" % k)
        if k % 1000 == 0:
            time.sleep(0.05)
    until = time.monotonic() + 5.0
    while not log.problem and time.monotonic() < until:
        time.sleep(0.01)
    log.put(b"too late\n")
    waiting = log.problem
    log.close()
    log.close()
    content = (tmp_path / "a.csv").read_bytes()
    assert "No space left on device" in waiting and "the robot drives on" in waiting
    rows = content.count(b"\n") - 1
    assert content.endswith(b"\n") and len(content) == log.size <= 1000 + len(HEADER)
    assert rows == log.written > 50 and log.dropped == 10_001 - rows, "each is written or counted"
    assert f"{log.dropped} records are lost" in log.problem


def test_a_disk_that_fails_to_sync_is_reported(tmp_path, monkeypatch):
    def fail(descriptor):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(os, "fsync", fail)
    log = DurableFile(tmp_path / "a.csv", list)
    log.put(b"x\n")
    log.close()
    assert "Input/output error" in log.problem


def test_a_record_that_cannot_be_written_down_ends_the_log_and_not_the_drive(tmp_path):
    log = DurableFile(tmp_path / "a.csv", lambda records: [bytes(record) for record in records])
    log.put("text")  # type: ignore[arg-type]
    log.close()
    assert "TypeError" in log.problem and log.dropped == 1


def test_kill_9_leaves_whole_rows_up_to_the_last_second(tmp_path):
    path = tmp_path / "a.csv"
    code = f"""
import pathlib, time
from firmware_bridge.recording.durable import DurableFile
log = DurableFile(pathlib.Path({str(path)!r}), list)
start = time.monotonic()
while True:
    log.put(b"%.6f\\n" % time.monotonic())
    time.sleep(0.001)
"""
    child = subprocess.Popen([sys.executable, "-c", code])
    until = time.monotonic() + 20.0
    while (not path.exists() or path.stat().st_size < 10_000) and time.monotonic() < until:
        time.sleep(0.02)
    killed = time.monotonic()
    os.kill(child.pid, signal.SIGKILL)
    child.wait()
    content = path.read_bytes()
    assert content.endswith(b"\n")
    assert killed - float(content.splitlines()[-1]) < 1.0
