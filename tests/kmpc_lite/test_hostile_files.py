"""Whatever a file holds: it is taken, or refused in one line with status 2, at once, and for good.

The corpus is made here; mutants of valid files are read by `tests/helpers/readers.py`, 300 of them
each time, KMPC_MUTANTS of them where that is set, and a million in the long run.
"""

import io
import json
import os
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from mcap_bytes import CHANNEL, CHUNK, MESSAGE, MESSAGES, METADATA, RECORD, record
from readers import MAP, MEMORY, ROBOT, SCENARIO, bounded_memory

import kmpc_lite as kl
from firmware_bridge.recording.drive.mcap_writer import McapWriter
from firmware_bridge.recording.drive.schemas import TOPICS
from kmpc_lite.cli import main as cli

HELPERS = Path(__file__).parents[1] / "helpers"
Make = Callable[[Path], object]


def text(content: str) -> Make:
    return lambda path: path.write_text(content)


def endless(path: Path) -> None:
    """A file of 10 GB that takes no place on the disk."""
    with open(path, "wb") as file:
        file.truncate(10 * 2**30)


def to_zero(path: Path) -> None:
    path.symlink_to("/dev/zero")


def map_of(image: bytes | str, change: Callable[[str], str] = str) -> Make:
    """A map.yaml with an image, or the name of one."""

    def make(path: Path) -> None:
        name = image if isinstance(image, str) else "map.pgm"
        if isinstance(image, bytes):
            (path.parent / name).write_bytes(image)
        (path.parent / "map.yaml").write_text(change(MAP.replace("map.pgm", name)))
        path.write_text(SCENARIO.replace(GRID, 'grid = "map.yaml"'))

    return make


def packed(count: int) -> bytes:
    """An array of zeros of one byte each."""
    out = io.BytesIO()
    np.save(out, np.zeros(count, np.int8))
    return out.getvalue()


def bomb(*names: str) -> Make:
    """A small archive of many small numbers, which are large ones in the end."""

    def make(path: Path) -> None:
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
            content = packed(2**24)
            for name in names:
                file.writestr(f"{name}.npy", content)

    return make


def model(**changes: object) -> Make:
    """A model with changed parts of its header."""

    def make(path: Path) -> None:
        kl.nominal_unicycle(0.1).save(path)
        with np.load(path) as archive:
            arrays = dict(archive)
        header = {**json.loads(str(arrays["header"])), **changes}
        np.savez(path, **{**arrays, "header": np.array(json.dumps(header))})

    return make


def mcap(rest: bytes) -> Make:
    """A recorded drive that begins well."""
    return lambda path: path.write_bytes(McapWriter(TOPICS).begin("a test") + rest)


def told(**changes: object) -> bytes:
    """What a drive tells of itself."""
    drive = {"name": "field", "scenario": SCENARIO, "dt": 0.1, "about": {}, **changes}
    texts = {"format": "kmpc.drive", "version": "1", "drive": json.dumps(drive)}
    return McapWriter(TOPICS).metadata("kmpc.drive", texts)


def message(topic: str, content: bytes) -> bytes:
    channel = 1 + [known.name for known in TOPICS].index(topic)
    return record(MESSAGES, MESSAGE.pack(channel, 1, 0, 0) + content)


GRID = SCENARIO[SCENARIO.index("grid =") : SCENARIO.index("[robot]")].strip()
FOUR = b"P5 2 2 255\n0000"
BLANKS = b"P5" + 300 * b" #\n " + 60 * b" "
CIRCLES = ", ".join(["[0.6, 0.6, 0.15]"] * 20_000)
ANY = {"a pipe": os.mkfifo, "a device": to_zero, "a folder": Path.mkdir}
TOML = {
    **ANY,
    "nothing but brackets": text("a = " + 100_000 * "["),
    "a number of 5,000 digits": text("a = " + 5000 * "1"),
    "a number that cannot be printed": text("[run]\nseed = 0x" + 5000 * "f"),
    "a key of 100,000 parts": text("a" + 100_000 * ".a" + " = 1"),
    "no end": endless,
}
CORPUS: dict[str, dict[str, Make]] = {
    "fit run.csv -o robot.npz": {
        **ANY,
        "one endless line": endless,
        "a header of brackets": text("t," + 9000 * "[" + "\n1,2\n"),
        "a header of blanks": text("t,a" + 9000 * " " + "b\n1,2\n"),
        "a header without an end": text("t,x,y," + 10**6 * "a"),
        "a line without an end": text("t,x,y,theta,v,omega\n" + 10**6 * "1,"),
    },
    "fit run.npz -o robot.npz": {**ANY, "a bomb": bomb("t", "x", "y", "theta", "v", "omega")},
    "simulate map.toml --model robot.npz": {
        **ANY,
        "no end": endless,
        "a bomb": bomb("header", "A", "B", "H", "C", "noise"),
        "info that is a list": model(info=[]),
        "samples that are none": model(info={"samples": "many"}),
        "a condition of 400 digits": model(info={"condition": 10**400}),
        "errors that are a text": model(info={"held_out": "small"}),
        "quantiles of no risks": model(info={"noise_quantiles": {"risks": 3}}),
        "gains that are a text": model(info={"adaptation": {"ahead": "far"}}),
        "a period of a nanosecond": model(dt=1e-9),
        "a period of ages": model(dt=1e300),
        "a header within a header": model(info={}, dictionary=json.loads(400 * "[" + 400 * "]")),
    },
    "simulate field.toml": {
        **TOML,
        "20,000 circles": text(SCENARIO.replace("[0.6, 0.6, 0.15]", CIRCLES)),
        "far away": text(SCENARIO.replace("start = [0.0", "start = [1e300")),
        "a grid from a device": text(SCENARIO.replace(GRID, 'grid = "/dev/zero"')),
        "an image from a device": map_of("/dev/zero"),
        "an image with a zero in its name": map_of("map\0"),
        "an image of blanks": map_of(BLANKS),
        "an image of 10^18 pixels": map_of(b"P5 1000000000 1000000000 255\n"),
        "an image of 5,000 digits": map_of(b"P5 " + 5000 * b"9" + b" 1 255\n"),
        "an image of one digit": map_of(b"P2 10 10 255\n" + 1000 * b"9"),
        "cells that nobody sees": map_of(FOUR, lambda told: told.replace(".05", "e-9")),
        "a list without an end": map_of(FOUR, lambda told: told[20:] + "a:" + 8000 * "\n"),
    },
    "check robot.toml": {
        **TOML,
        "a number too large": text(ROBOT.replace("0.5", 400 * "9")),
        "a section that is a list": text("[[limits]]\n" + ROBOT),
    },
    "report drive.mcap": {
        **ANY,
        "no end": endless,
        "a chunk without an end": mcap(RECORD.pack(CHUNK, 2**62)),
        "texts without an end": mcap(record(METADATA, b"\xff\xff\xff\x7f" + 1000 * b"a")),
        "a scenario of brackets": mcap(told(scenario="a = " + 100_000 * "[")),
        "a scenario of 20,000 circles": mcap(
            told(scenario=SCENARIO.replace("[0.6, 0.6, 0.15]", CIRCLES))
        ),
        "nothing but channels": mcap(70_000 * record(CHANNEL, bytes(12))),
        "brackets": mcap(told(about=json.loads(400 * "[" + 400 * "]"))),
    },
    "fit drive.mcap -o robot.npz": {
        **ANY,
        "nothing in it": mcap(b""),
        "a message of brackets": mcap(message("/pose", 900_000 * b"[")),
        "a message of 5,000 digits": mcap(message("/command", b'{"v":' + 5000 * b"9" + b"}")),
    },
    "replay drive.tlog": {**ANY, "no end": endless},
}
CASES = [(command, name) for command, makes in CORPUS.items() for name in makes]


@pytest.fixture
def in_time() -> Iterator[None]:
    """End what hangs, after a minute."""
    signal.alarm(60)
    yield
    signal.alarm(0)


def file_of(command: str) -> str:
    """The file that a command of the corpus is about."""
    words = command.split()
    return words[3] if "--model" in words else words[1]


@pytest.mark.parametrize(("command", "name"), CASES)
@pytest.mark.usefixtures("in_time")
def test_a_hostile_file_is_refused(
    command: str,
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    if "--model" in command:
        (tmp_path / "map.toml").write_text(SCENARIO.replace(GRID, ""))
    CORPUS[command][name](tmp_path / file_of(command))
    before, begun = sorted(tmp_path.iterdir()), time.process_time()
    with bounded_memory(MEMORY):
        status = cli.main(command.split())
    took, told = time.process_time() - begun, capsys.readouterr()
    assert status == 2, told
    assert told.err.startswith("kmpc: ") and told.err.count("\n") == 1 and len(told.err) < 1100
    assert told.err[:-1].isprintable()
    assert took < 5.0
    assert sorted(tmp_path.iterdir()) == before


def test_what_a_file_holds_does_not_reach_the_terminal_or_fill_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "field\x1b[2J.toml"
    path.write_text(SCENARIO.replace("ground =", f"{5000 * 'x'} ="))
    assert cli.main(["simulate", str(path)]) == 2
    told = capsys.readouterr().err
    assert "\x1b[2J" not in told and len(told) < 1100 and "field\\x1b[2J.toml: [plant] xxx" in told


def read_mutants(count: int, seed: int) -> None:
    command = [sys.executable, str(HELPERS / "readers.py")]
    paths = os.pathsep.join([str(HELPERS.parents[1]), str(HELPERS)])
    done = subprocess.run(
        [*command, "--count", str(count), "--seed", str(seed)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": paths, "OMP_NUM_THREADS": "1"},
    )
    assert done.returncode == 0, done.stdout + done.stderr[-5000:]
    assert done.stdout == f"{count} files, 0 not borne {{}}\n"


def test_mutants_of_valid_files_are_borne() -> None:
    read_mutants(int(os.environ.get("KMPC_MUTANTS", "300")), seed=0)


@pytest.mark.long
def test_a_million_mutants_are_borne() -> None:
    for seed in range(10):
        read_mutants(int(os.environ.get("KMPC_MUTANTS", "1000000")) // 10, seed=10**7 * (seed + 1))
