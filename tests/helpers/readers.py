"""Every reader of files, with files that it takes: `python readers.py --count 300 --seed 0`.

Mutants of these files are read in a process of bounded memory: a file is taken, or refused with one
of the project's own errors, in one line, within two seconds of the processor's time, and nothing is
written.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import foreign_logs
import numpy as np
from mcap_bytes import CHUNK, RECORD
from mutants import Mutator

import kmpc_lab
import kmpc_lite as kl
from firmware_bridge.drivers.mavlink.options import MavlinkOptions
from firmware_bridge.messages import BridgeError
from firmware_bridge.robot_file import load_robot
from kmpc_lab import drive
from kmpc_lab.recording.drive_file import load_drive
from kmpc_lab.recording.simulated import SimulationRecorder
from kmpc_lab.studies.drive import DriveResult
from kmpc_lab.studies.study import read_records
from kmpc_lite.errors import KmpcError
from kmpc_lite.learn.formats.mcap import MAGIC
from kmpc_lite.learn.formats.readers import read_log
from kmpc_lite.learn.logs import ReadOptions
from kmpc_lite.reading import parse_toml
from kmpc_lite.scenario.files import Scenario

MEMORY = 500 * 2**20  # what reading a file may take [bytes]
SECONDS = 2.0  # of the processor, for one file
CSV = "t,x,y,theta,v,omega\n" + "".join(f"{0.1 * k:.1f},{k},2,0.5,1,0.25\n" for k in range(20))
SCENARIO = """\
[map]
bounds = [-2.0, -2.0, 2.0, 2.0]
circles = [[0.6, 0.6, 0.15], [-1.0, 1.0, 0.1, 0.1, 0.0]]
polygons = [[[1.0, -1.0], [1.5, -1.0], [1.2, -0.5]]]
walls = [[-1.5, -1.5, -1.0, -1.5, 0.1]]
grid = {resolution = 0.1, origin = [-1.0, -1.0, 0.3], rows = ["..#", "?.#"]}
[robot]
radius = 0.15
start = [0.0, 0.0, 0.0]
goal = [1.5, 1.5, 0.0]
[plant]
slip = 0.05
floors = [[1.0, 0.1, 0.9]]
ground = "tile"
ground_changes = [[2.0, "carpet"]]
[controller.guidance]
lead_time = 0.3
[controller.solver.real_time]
max_iter = 80
[controller.moving_obstacles]
speed_scales = [0.5, 0.0]
[run]
seed = 3
"""
MAP = "image: map.pgm\nresolution: 0.05\norigin: [-1.0, -1.0, 0.0]\nnegate: 0\n"
ROBOT = """\
[link]
url = "tcp:127.0.0.1:5760"
driver = "roboclaw"
[geometry]
track = 0.3
[limits]
v_max = 0.5
[safety]
geofence = [-1.0, -1.0, 2.0, 2.0]
[frame]
origin = [0.0, 0.0, 0.0]
[control]
period = 0.1
"""


@dataclass(frozen=True)
class Reader:
    """What reads a kind of files."""

    files: dict[str, bytes]  # their names and contents; the first is the one that is opened
    read: Callable[[Path], Any]  # reads it, and uses what it has read


def _log(path: Path) -> None:
    for episode in kl.Dataset.load(path, dt=0.1).episodes:
        assert np.isfinite(episode.states).all() and np.isfinite(episode.inputs).all()


def _scenario(path: Path) -> None:
    scenario = Scenario.load(path)
    scenario.problem()
    again = Scenario.from_table(parse_toml(scenario.to_toml()), scenario.name, "again")
    assert again.to_toml() == scenario.to_toml()


def _model(path: Path) -> None:
    model = kl.KoopmanModel.load(path)
    plan = kl.Controller(model, kl.NavigationProblem(dt=model.dt)).step((0, 0, 0), (1, 1, 0))
    assert np.isfinite(plan.command).all()


def _drive(path: Path) -> None:
    run = load_drive(path)
    run.summary()
    assert np.isfinite(run.path).all() and run.details is not None
    assert np.isfinite(run.details.plans).all() and (np.diff(run.details.times) >= 0.0).all()


def _robot(path: Path) -> None:
    load_robot(path).driver_table()


def _records(path: Path) -> None:
    text = path.read_bytes()
    try:
        read_records(path, "jumps")
    finally:
        path.write_bytes(text)  # what was torn off its end is cut off on purpose


def _record() -> bytes:
    """A line of a study's records."""
    names = [f.name for f in fields(DriveResult) if f.name not in ("axes", "more", "trace")]
    row = {**dict.fromkeys(names, 1.0), "axes": ["heading"], "more": {"jumps": 2.0}}
    line = {"study": "jumps", "asked": ["heading", 0.3, 1], "row": row}
    return json.dumps(line).encode() + b"\n"


def _key(path: Path) -> None:
    path.chmod(0o600)
    MavlinkOptions(key_file=str(path)).read_key()


def _foreign(folder: Path) -> dict[str, Reader]:
    """Logs as other tools write them."""
    ride = foreign_logs.drive(seconds=3.0, rate=10.0)
    written = [foreign_logs.write_dataflash(folder / "drive.bin", ride)]
    if find_spec("rosbags"):
        kinds = (("one.bag", "ros1"), ("one.mcap", "mcap"), ("one.db3", "sqlite3"))
        written += [foreign_logs.write_bag(folder / name, ride, kind) for name, kind in kinds]
    if find_spec("pyulog"):
        written.append(foreign_logs.write_ulog(folder / "drive.ulg", ride))
    if find_spec("pymavlink"):
        written.append(foreign_logs.write_tlog(folder / "rover.tlog", ride))
    single = [f for path in written for f in ([path] if path.is_file() else path.rglob("*.*"))]
    found = {
        f"log {path.suffix}": Reader({f"drive{path.suffix}": path.read_bytes()}, read_log)
        for path in single
        if path.suffix != ".yaml"
    }
    aliases = CSV.replace("t,x,y,theta,v,omega", "stamp,pos_x,pos_y,yaw,cmd_v,cmd_w")
    tum = "".join(f"{0.1 * k:.1f} {k} 2 0 0 0 0.1 0.9\n" for k in range(20))
    commands = CSV.replace("t,x,y,theta,v,omega", "t,a,b,c,v,omega")
    return {
        **found,
        "other names": Reader({"log.csv": aliases.replace(",", ";").encode()}, read_log),
        "TUM": Reader(
            {"log.tum": tum.encode(), "commands.csv": commands.encode()},
            lambda path: read_log(path, ReadOptions(commands=path.parent / "commands.csv")),
        ),
    }


def without_checksums(content: bytes) -> bytes:
    """An MCAP file whose chunks are not compared with their checksums: mutants are read, too."""
    out, place = bytearray(content), len(MAGIC)
    while place + RECORD.size < len(content):
        op, length = RECORD.unpack_from(content, place)
        if op == CHUNK:
            out[place + RECORD.size + 24 : place + RECORD.size + 28] = bytes(4)
        place += RECORD.size + length
    return bytes(out)


def make_readers(folder: Path) -> dict[str, Reader]:
    """All readers; files that are not text are made in a folder."""
    (folder / "scenario.toml").write_text(SCENARIO + "timeout = 0.3\n")
    data = kmpc_lab.generate_dataset(
        kmpc_lab.DifferentialDrive(0.05, seed=1), episodes=4, steps=60, dt=0.1, seed=1
    )
    kl.Dataset(data.episodes[:1]).save(folder / "log.npz")
    model = kl.fit(data, kl.InputHistoryDictionary(kl.UnicycleDictionary(), (0, 1)))
    kl.with_quantiles(model, data).save(folder / "model.npz")
    scenario = Scenario.load(folder / "scenario.toml")
    controller = kl.Controller(kl.nominal_unicycle(0.1), scenario.problem())
    recorder = SimulationRecorder(controller)
    recorder.write(folder, drive(controller, scenario, watch=recorder))
    recorded = {"drive.mcap": (folder / "drive.mcap").read_bytes()}
    made = {name: (folder / f"{name}.npz").read_bytes() for name in ("log", "model")}
    pixels = bytes(range(0, 250, 2))[:120]
    plain = " ".join(map(str, pixels)).encode()
    return {
        **_foreign(folder),
        "csv": Reader({"log.csv": CSV.encode()}, _log),
        "npz": Reader({"log.npz": made["log"]}, _log),
        "model": Reader({"model.npz": made["model"]}, _model),
        "drive": Reader(recorded, _drive),
        "drive without checksums": Reader(
            {"drive.mcap": without_checksums(recorded["drive.mcap"])}, _drive
        ),
        "drive to learn from": Reader(recorded, read_log),
        "scenario": Reader({"scenario.toml": SCENARIO.encode()}, _scenario),
        "map": Reader(
            {"map.yaml": MAP.encode(), "map.pgm": b"P5\n# made\n12 10\n255\n" + pixels},
            kl.OccupancyGrid.load,
        ),
        "plain map": Reader(
            {"map.yaml": MAP.encode(), "map.pgm": b"P2\n12 10 255\n" + plain}, kl.OccupancyGrid.load
        ),
        "robot": Reader({"robot.toml": ROBOT.encode()}, _robot),
        "records": Reader({"records.jsonl": 3 * _record()}, _records),
        "key": Reader({"signing.key": 32 * b"ab" + b"\n"}, _key),
    }


@contextmanager
def bounded_memory(more: int) -> Iterator[None]:
    """Let this process take so many bytes more than it has."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + more, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def _peak() -> int:
    """Largest memory that this process has really used [bytes]."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def judge(reader: Reader, files: dict[str, bytes], folder: Path) -> str:
    """Read files in an empty folder; what is wrong with how that went, or nothing."""
    for name, content in files.items():
        (folder / name).write_bytes(content)
    begun, refused, before = time.process_time(), "", _peak()
    try:
        with bounded_memory(MEMORY), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            reader.read(folder / next(iter(files)))
    except (KmpcError, BridgeError) as error:
        refused = str(error)
    except BaseException:  # it is reported, and the next file is read
        return traceback.format_exc()
    took = time.process_time() - begun
    if took > SECONDS:
        return f"{took:.1f} s; {refused[:200]}"
    if _peak() - before > MEMORY // 2:
        return f"{_peak() - before:,} bytes; {refused[:200]}"
    if "\n" in refused:
        return f"more than one line: {refused[:500]!r}"
    left = {path.name: path.read_bytes() for path in folder.iterdir()}
    return "" if left == files else f"files were changed: {sorted(left)}"


def main() -> int:
    """Read mutants of all readers' files in turn; status 1 where one is not borne."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="name of a reader")
    parser.add_argument("--keep", type=Path, help="folder for what is not borne")
    given = parser.parse_args()
    bad: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as scratch:
        readers = make_readers(Path(scratch))
    for name, reader in readers.items():
        with tempfile.TemporaryDirectory() as folder:
            if wrong := judge(reader, reader.files, Path(folder)):
                sys.stderr.write(f"{name}: as it is: {wrong}\n")
                return 1
    names = [name for name in readers if given.only in name]
    for number in range(given.count):
        name = names[number % len(names)]
        reader, mutator = readers[name], Mutator(given.seed + number)
        changed = mutator.one_of(list(reader.files))
        files = {**reader.files, changed: mutator.file(reader.files[changed])}
        with tempfile.TemporaryDirectory() as folder:
            if wrong := judge(reader, files, Path(folder)):
                bad[name] += 1
                sys.stderr.write(f"{name}, seed {given.seed + number}, {changed}: {wrong}\n")
                if given.keep:
                    given.keep.mkdir(exist_ok=True)
                    (given.keep / f"{given.seed + number}_{changed}").write_bytes(files[changed])
    sys.stdout.write(f"{given.count} files, {sum(bad.values())} not borne {dict(bad)}\n")
    return 1 if bad else 0


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    sys.exit(main())
