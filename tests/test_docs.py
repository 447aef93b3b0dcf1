"""What the README and the examples say is run, as it stands there."""

from __future__ import annotations

import importlib
import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

import pytest

import kmpc_lite as kl
from firmware_bridge.cli.arguments import build_parser
from kmpc_lite.sim import Scenario

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
LONG = "<!-- long -->"
PROGRAMS = {"kmpc": "kmpc_lite.cli.main", "kmpc-bridge": "firmware_bridge.cli.main"}


class Block(NamedTuple):
    """A fenced block of the README."""

    language: str
    text: str
    line: int
    long: bool
    """Marked as too long to run: only looked at."""


def blocks(text: str, language: str) -> list[Block]:
    """Fenced blocks of a language, in order."""
    found = []
    for match in re.finditer(r"^```(\w+)[^\n]*\n(.*?)^```\s*$", text, re.MULTILINE | re.DOTALL):
        if match[1] == language:
            marked = text[: match.start()].rstrip().endswith(LONG)
            found.append(Block(match[1], match[2], text.count("\n", 0, match.start()) + 1, marked))
    return found


def command_lines(block: Block) -> list[list[str]]:
    """Words of every command of the project's own in a block of shell."""
    joined = block.text.replace("\\\n", " ")
    lines = [shlex.split(line.removeprefix("$ "), comments=True) for line in joined.splitlines()]
    return [words for words in lines if words and words[0] in PROGRAMS]


PYTHON, SHELL, SCENARIOS = blocks(README, "python"), blocks(README, "sh"), blocks(README, "toml")
COMMANDS = [(words, block) for block in SHELL for words in command_lines(block)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the README is worked through, with the log that it speaks of."""
    folder = tmp_path_factory.mktemp("readme")
    plant = kl.DifferentialDrive(0.05, seed=1)
    kl.generate_dataset(plant, episodes=20, steps=60, dt=0.1, seed=1, u_max=(0.6, 0.8)).save(
        folder / "run.csv"
    )
    return folder


def test_blocks_are_found_with_their_marks() -> None:
    text = (
        f"# a\n```python\nx = 1\n```\n\n{LONG}\n\n```sh\n$ kmpc study table1   # all "
        "night\nkmpc fit a.csv \\\n  -o b.npz\nls\n```\n"
    )
    (python,) = blocks(text, "python")
    (shell,) = blocks(text, "sh")
    assert (python.text, python.line, python.long) == ("x = 1\n", 2, False)
    assert shell.long
    assert command_lines(shell) == [
        ["kmpc", "study", "table1"],
        ["kmpc", "fit", "a.csv", "-o", "b.npz"],
    ]


def test_the_readme_has_programs_and_commands() -> None:
    assert PYTHON and COMMANDS


def test_the_readmes_programs_run_in_order(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    namespace: dict[str, Any] = {"__name__": "__readme__"}
    for block in PYTHON:
        # as many lines before it as in the README, so that a traceback points there
        exec(compile("\n" * block.line + block.text, str(ROOT / "README.md"), "exec"), namespace)


@pytest.mark.parametrize(
    ("words", "block"), COMMANDS, ids=[" ".join(words)[:60] for words, _ in COMMANDS]
)
def test_the_readmes_commands_run(
    words: list[str],
    block: Block,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(folder)
    program = importlib.import_module(PROGRAMS[words[0]])
    # argparse exits with status 2, and the test fails, where the README has a command line that is
    # none
    parser = program._parser() if words[0] == "kmpc" else build_parser(program.COMMANDS)
    assert parser.parse_args(words[1:])
    if block.long:
        return
    monkeypatch.setattr(sys, "argv", words)
    assert program.main(words[1:]) == 0, capsys.readouterr().err


@pytest.mark.parametrize("block", SCENARIOS, ids=[f"line {b.line}" for b in SCENARIOS])
def test_the_readmes_tables_are_scenarios(block: Block) -> None:
    table = tomllib.loads(block.text)
    if "map" in table:
        assert Scenario.from_table(table, "README", f"README.md, line {block.line}").problem()


def test_the_readme_lists_the_public_names() -> None:
    section = re.search(r"^## Public names\n(.*?)(?=^## |\Z)", README, re.MULTILINE | re.DOTALL)
    assert section is not None
    listed = {name for name in re.findall(r"`([^`]+)`", section[1]) if name != "kmpc_lite"}
    assert listed == set(kl.__all__)
    assert all(hasattr(kl, name) for name in kl.__all__)


def test_the_files_that_the_readme_shows_exist() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        if "://" not in target:
            assert (ROOT / target).exists(), target


@pytest.mark.parametrize("example", EXAMPLES, ids=[e.stem for e in EXAMPLES])
def test_examples_run_and_end_in_a_number_or_a_picture(example: Path, tmp_path: Path) -> None:
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    done = subprocess.run(
        [sys.executable, str(example)],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert re.search(r"\d", done.stdout) or list(tmp_path.glob("*.png"))
    assert (compile(example.read_text(), str(example), "exec").co_consts[0] or "").strip(), (
        "an example begins with what it shows"
    )


def test_the_comparison_without_casadi_says_so_and_ends_well(tmp_path: Path) -> None:
    example = str(ROOT / "examples" / "compare_with_ipopt.py")
    code = (
        f"import sys, runpy; sys.modules['casadi'] = None; runpy.run_path({example!r}, "
        "run_name='__main__')"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    assert "pip install" in done.stdout and done.stderr == ""


def test_there_are_examples() -> None:
    assert len(EXAMPLES) >= 3
