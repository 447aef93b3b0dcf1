"""CSV and link logs: what is in them, and what a full disk, a kill and a power cut leave."""

import errno
import math
import os
import random
import signal
import struct
import subprocess
import sys
import time

import numpy as np
import pytest
from robots import Clock, FakeDriver

import kmpc_lite as kl
from firmware_bridge.link import LoopbackWire
from firmware_bridge.link.log import (
    LONGEST,
    RAW_MAGIC,
    Chunk,
    RecordedTransport,
    play,
    raw_log,
    read_link_log,
    tlog,
)
from firmware_bridge.messages import ConfigError, State
from firmware_bridge.recording.durable import DurableFile
from firmware_bridge.recording.recorder import (
    HEADER,
    LATENESS,
    CsvRecorder,
    RowSampler,
    Tick,
    torn_bytes,
)
from firmware_bridge.safety.gate import GateOutput
from firmware_bridge.safety.gate_table import Action, GateState

TICK = 0.02


def drive(
    recorder,
    seconds=20.0,
    delay=0.05,
    pose_every=0.025,
    command_every=0.1,
    silent=(),
    states=None,
    seed=0,
):
    """A robot that obeys at once, told at random; poses late and uneven. Returns the path."""
    random_, clock = random.Random(seed), Clock(50.0)
    robot = FakeDriver(clock, delay)
    command, due, state, pose_due = (0.0, 0.0), 0.0, None, 0.0
    for k in range(round(seconds / TICK)):
        clock.now = 50.0 + k * TICK + random_.uniform(0.0, 0.002)
        since = clock.now - 50.0
        quiet = any(a <= since < b for a, b in silent)
        if since >= pose_due and not quiet:
            state, pose_due = robot.state(), since + pose_every * random_.uniform(0.7, 1.3)
        gate = GateState.ACTIVE if states is None else states(since)
        sent = gate is GateState.ACTIVE
        fresh = sent and since >= due
        if fresh:
            command, due = (
                (random_.uniform(-0.3, 0.3), random_.uniform(-0.8, 0.8)),
                due + command_every,
            )
        if sent:
            robot.send(*command)
        recorder.on_tick(
            clock.now,
            state,
            GateOutput(*command, Action.SEND if sent else Action.NOTHING, gate, ()),
            sent,
            fresh,
        )
    return robot.path


def test_the_csv_is_a_dataset_of_the_models_period(tmp_path):
    path = tmp_path / "drive.csv"
    recorder = CsvRecorder(path, 0.1)
    drive(recorder, command_every=0.37)
    recorder.close()
    data = kl.Dataset.load(path)
    assert (
        len(data) == 1
        and data.dt == pytest.approx(0.1, rel=1e-9)
        and recorder.rows == data.steps + 1
    )
    assert data.steps > 190
    errors = (
        kl.nominal_unicycle(0.1).predict(data.episodes[0].states[:-1], data.episodes[0].inputs)
        - data.episodes[0].states[1:]
    )
    # the robot obeys exactly, so all that is left is the interpolation between poses up to 0.04 s
    # apart, over jumps of up to 0.6 m/s
    assert np.abs(errors[:, :2]).max() < 0.6 * 0.04 / 4 and np.median(np.abs(errors[:, :2])) < 2e-5


def test_what_is_recorded_can_be_learned_from(tmp_path):
    path = tmp_path / "drive.csv"
    recorder = CsvRecorder(path, 0.1)
    drive(recorder, seconds=120.0, command_every=0.5)
    recorder.close()
    model = kl.fit(kl.Dataset.load(path))
    step = model.predict([0.2, -0.1, 0.3], [0.3, 0.5]) - kl.nominal_unicycle(0.1).predict(
        [0.2, -0.1, 0.3], [0.3, 0.5]
    )
    assert np.abs(step).max() < 1e-3


@pytest.mark.parametrize("lost", [(5.0, 5.4), (5.0, 5.9), (5.0, 9.0)])
def test_a_gap_in_the_poses_ends_an_episode(tmp_path, lost):
    path = tmp_path / "drive.csv"
    recorder = CsvRecorder(path, 0.1)
    truth = drive(recorder, silent=[lost])
    recorder.close()
    data = kl.Dataset.load(path)
    assert len(data) == 2
    stamps = np.array([s.stamp for s in truth])
    for episode in data.episodes:
        table = np.loadtxt(path, delimiter=",", skiprows=1)
        row = int(np.argmin(np.abs(table[:, 1:4] - episode.states[0]).sum(axis=1)))
        origin = 50.0 + TICK  # the first tick with a pose and a command, within a tick
        nearest = truth[int(np.argmin(np.abs(stamps - (origin + table[row, 0]))))]
        assert math.hypot(nearest.x - episode.states[0, 0], nearest.y - episode.states[0, 1]) < 0.03


def test_what_we_did_not_command_is_left_out(tmp_path):
    path = tmp_path / "drive.csv"
    recorder = CsvRecorder(path, 0.1)
    drive(
        recorder,
        states=lambda t: (
            GateState.YIELDED if 6.0 <= t < 6.1 or 12.0 < t < 15.0 else GateState.ACTIVE
        ),
    )
    recorder.close()
    data = kl.Dataset.load(path)
    assert len(data) == 3 and 15.0 < data.steps * 0.1 < 17.0


@pytest.mark.parametrize("pause", [(0.0, 0.0), (7.05, 7.33), (7.05, 10.91)])
def test_a_row_holds_one_plans_command(tmp_path, pause):
    path, clock = tmp_path / "drive.csv", Clock(50.0)
    recorder = CsvRecorder(path, 1.0)
    for k in range(1500):
        # plans begin every second, at 0.64 s past; the gate lets them pass from 0.2 s on, but for a
        # pause
        clock.now = 50.0 + k * TICK
        since = clock.now - 50.0
        plan, before = math.floor(since - 0.63), math.floor(since - TICK - 0.63)
        active = since >= 0.2 and not pause[0] <= since < pause[1]
        gate = GateState.ACTIVE if active else GateState.YIELDED
        output = GateOutput(0.01 * plan, 0.0, Action.SEND if active else Action.NOTHING, gate, ())
        recorder.on_tick(
            clock.now,
            State(0.0, 0.0, 0.0, 0.0, 0.0, clock.now),
            output,
            active,
            active and plan != before,
        )
    recorder.close()
    v = np.loadtxt(path, delimiter=",", skiprows=1)[:, 4] * 100.0
    assert len(v) > 20 and np.allclose(v, np.round(v), atol=1e-3)


def test_by_hand_the_measured_speeds_stand_in_for_commands():
    sampler = RowSampler(0.1, by_hand=True)
    rows = []
    for k in range(200):
        t = 10.0 + k * TICK
        rows += sampler.take(Tick(t, State(0.4 * t, 0.0, 0.0, 0.4, 0.1, t), None, True))
    assert len(rows) > 30
    assert np.allclose([r[4:] for r in rows], (0.4, 0.1)) and np.allclose(
        np.diff([r[0] for r in rows]), 0.1
    )


def test_a_pose_that_is_not_finite_leaves_its_rows_out():
    sampler = RowSampler(0.1)
    rows = []
    for k in range(300):
        t = 10.0 + k * TICK
        x = math.nan if 150 <= k < 155 else 0.1 * t
        rows += sampler.take(Tick(t, State(x, 0.0, 0.0, 0.1, 0.0, t), (0.1, 0.0), True, fresh=True))
    rows += sampler.finish(t)
    assert np.isfinite(rows).all()
    steps = np.diff([r[0] for r in rows])
    assert (steps > 0.29).sum() == 1 and np.allclose(steps[steps < 0.29], 0.1)


def test_the_heading_is_interpolated_the_short_way_round():
    sampler = RowSampler(0.1)
    rows = []
    for k in range(100):
        t = 10.0 + k * TICK
        theta = math.remainder(3.0 + 1.0 * t, math.tau)
        rows += sampler.take(
            Tick(t, State(0.0, 0.0, theta, 0.0, 1.0, t), (0.0, 1.0), True, fresh=True)
        )
    turns = np.remainder(np.diff([r[3] for r in rows]) + math.pi, math.tau) - math.pi
    assert np.allclose(turns, 0.1, atol=1e-9)


def test_rows_are_late_by_no_more_than_promised(tmp_path):
    recorder = CsvRecorder(tmp_path / "a.csv", 0.1)
    drive(recorder, seconds=3.0)
    until = time.monotonic() + 5.0
    while recorder.rows < 25 and time.monotonic() < until:
        time.sleep(0.01)
    assert recorder.rows >= int((3.0 - LATENESS) / 0.1) - 2
    recorder.close()


def test_a_log_is_never_written_over(tmp_path):
    (tmp_path / "a.csv").write_text("precious")
    with pytest.raises(ConfigError, match="exists already"):
        CsvRecorder(tmp_path / "a.csv", 0.1)
    with pytest.raises(ConfigError, match="cannot write"):
        CsvRecorder(tmp_path / "no" / "a.csv", 0.1)
    assert (tmp_path / "a.csv").read_text() == "precious"


def test_a_full_disk_ends_the_log_with_a_whole_row_is_told_and_stops_nothing(tmp_path, monkeypatch):
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


def test_records_wait_for_a_disk_that_has_room_again(tmp_path, monkeypatch):
    """A whole batch was lost, and one record of it told."""
    full, write = [True], os.write

    def short(descriptor, data):
        if descriptor == log._descriptor and full[0]:
            if len(data) > 100:
                return write(descriptor, bytes(data)[:100])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(descriptor, data)

    log = DurableFile(tmp_path / "a.csv", list, HEADER)
    monkeypatch.setattr(os, "write", short)
    for k in range(3000):
        log.put(b"%d,0,0,0,0,0\n" % k)
    until = time.monotonic() + 5.0
    while not log.problem and time.monotonic() < until:
        time.sleep(0.01)
    assert "wait for room" in log.problem and log.dropped == 0
    full[0] = False
    log.close()
    lines = (tmp_path / "a.csv").read_bytes().splitlines()
    assert [int(line.partition(b",")[0]) for line in lines[1:]] == list(range(3000))
    assert (log.problem, log.dropped, log.written) == ("", 0, 3000)


def test_a_disk_that_fails_to_sync_is_told(tmp_path, monkeypatch):
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


def test_a_real_file_size_limit_is_a_full_disk(tmp_path):
    code = f"""
import resource, signal, pathlib
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (5000, 5000))
from firmware_bridge.recording.durable import DurableFile
log = DurableFile(pathlib.Path({str(tmp_path / "a.csv")!r}), list)
for k in range(2000):
    log.put(b"%05d\\n" % k)
log.close()
print(log.problem)
"""
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "File too large" in out.stdout
    lines = (tmp_path / "a.csv").read_bytes()
    assert lines.endswith(b"\n") or lines == b""


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


def test_a_torn_row_is_mended_wherever_it_tore(tmp_path):
    path = tmp_path / "a.csv"
    recorder = CsvRecorder(path, 0.1)
    drive(recorder, seconds=3.0)
    recorder.close()
    whole = path.read_bytes()
    for cut in range(len(whole) - 150, len(whole) + 1):
        for tail in (b"", b"\0" * 300):
            path.write_bytes(whole[:cut] + tail)
            torn = torn_bytes(path)
            assert path.read_bytes() == whole[:cut] + tail
            removed = torn_bytes(path, mend=True)
            assert removed == torn and torn_bytes(path) == 0
            assert path.read_bytes() == whole[: whole[:cut].rfind(b"\n") + 1]
            assert removed == cut + len(tail) - path.stat().st_size
    assert kl.Dataset.load(path).steps > 10


def frame(k: int) -> bytes:
    from pymavlink.dialects.v20 import ardupilotmega as dialect

    mav = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    mav.seq = k % 256
    return bytes(dialect.MAVLink_attitude_message(k, 0.0, 0.0, 0.1, 0.0, 0.0, 0.2).pack(mav))


def recorded_link(log):
    """A wire whose bridge end is recorded."""
    wire = LoopbackWire(manual=True)
    heard = []
    transport = RecordedTransport(wire.bridge, log.put)
    transport.start(lambda data, stamp: heard.append(data))
    wire.board.start(lambda data, stamp: None)
    return wire, transport, heard


def test_a_tlog_holds_both_ways_and_only_whole_frames(tmp_path):
    path = tmp_path / "a.tlog"
    log = tlog(path)
    wire, transport, heard = recorded_link(log)
    before = time.time()
    for k in range(50):
        wire.board.write(b"boot text" + frame(k)[:7])
        wire.board.write(frame(k)[7:] + b"\xfd\x03noise")
        transport.write(frame(1000 + k))
        wire.pump()
    assert (
        transport.connected
        and transport.counters["bytes_out"] == 50 * len(frame(0))
        and transport.last_error == ""
    )
    transport.close()
    log.close()
    from pymavlink import mavutil

    reader = mavutil.mavlogfile(str(path))
    messages = []
    while (message := reader.recv_match()) is not None:
        messages.append(message)
    reader.close()
    assert {m.get_type() for m in messages} == {"ATTITUDE"}
    assert sorted(m.time_boot_ms for m in messages) == [*range(50), *range(1000, 1050)]
    assert all(before - 1.0 < m._timestamp < time.time() + 1.0 for m in messages)
    assert len(list(read_link_log(path))) == 100 and b"".join(heard).count(b"boot text") == 50


def test_a_raw_log_gives_back_what_passed(tmp_path):
    log = raw_log(tmp_path / "a.raw")
    wire, transport, _ = recorded_link(log)
    random_ = random.Random(1)
    said = []
    for _ in range(30):
        said.append((True, random_.randbytes(random_.randint(1, 40))))
        wire.board.write(said[-1][1])
        wire.pump()
        said.append((False, random_.randbytes(10)))
        transport.write(said[-1][1])
    log.put(Chunk(time.monotonic(), True, bytes(LONGEST + 10)))
    log.close()
    chunks = list(read_link_log(tmp_path / "a.raw"))
    assert [(c.incoming, c.data) for c in chunks[:-2]] == said
    assert [len(c.data) for c in chunks[-2:]] == [LONGEST, 10]
    assert all(b.time >= a.time for a, b in zip(chunks, chunks[1:], strict=False))


def test_what_the_link_did_not_take_is_not_in_the_log(tmp_path):
    log = raw_log(tmp_path / "a.raw")
    wire, transport, _ = recorded_link(log)
    wire.cut()
    assert not transport.write(b"lost")
    log.close()
    assert list(read_link_log(tmp_path / "a.raw")) == []


@pytest.mark.parametrize("make", ["raw", "tlog"])
def test_a_log_cut_anywhere_gives_its_whole_records(tmp_path, make):
    path = tmp_path / f"a.{make}"
    log = raw_log(path) if make == "raw" else tlog(path)
    for k in range(5):
        log.put(Chunk(100.0 + k, True, frame(k)))
    log.close()
    whole = path.read_bytes()
    complete = [c.data for c in read_link_log(path)]
    assert len(complete) == 5
    for cut in range(40, len(whole)):
        path.write_bytes(whole[:cut])
        found = [c.data for c in read_link_log(path)]
        assert found == complete[: len(found)]
        assert len(found) >= (cut - len(RAW_MAGIC)) // (len(whole) // 5 + 1)


def test_files_that_are_no_log_are_refused(tmp_path):
    path = tmp_path / "a.log"
    with pytest.raises(ConfigError, match="cannot read"):
        list(read_link_log(path))
    for content in (b"", b"t,x,y\n1,2,3\n"):
        path.write_bytes(content)
        with pytest.raises(ConfigError, match="neither a tlog nor"):
            list(read_link_log(path))
    path.write_bytes(struct.pack(">Q", 1) + frame(1) + struct.pack(">Q", 2) + b"garbage" * 5)
    with pytest.raises(ConfigError, match="damaged"):
        list(read_link_log(path))


def test_replay_keeps_the_pace_and_cuts_long_pauses():
    clock = Clock()
    chunks = [
        Chunk(5.0, True, b"a"),
        Chunk(7.0, None, b"b"),
        Chunk(6.0, None, b"late"),
        Chunk(106.0, True, b"c"),
    ]
    times = [(c.data, clock() - 1000.0) for c in play(chunks, 2.0, clock, clock.sleep)]
    assert times == [(b"a", 0.0), (b"b", 1.0), (b"late", 1.0), (b"c", 3.5)]
