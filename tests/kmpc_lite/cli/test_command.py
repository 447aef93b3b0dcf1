"""Commands are found, loaded only when asked for, and what is nearly right is suggested."""

import json
import re
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

import kmpc_lab
import kmpc_lite
from kmpc_lab.studies import catalogue
from kmpc_lite.cli.command import ENTRY_POINTS, EXTRAS, LAB, ROBOT, build_parser, known_commands
from kmpc_lite.cli.main import main

ROOT = Path(__file__).parents[3]
ROBOTS, LABS = (
    tomllib.loads((folder / "pyproject.toml").read_text())["project"]
    for folder in (ROOT, ROOT / "lab")
)
COMMANDS = {**ROBOTS["entry-points"][ENTRY_POINTS], **LABS["entry-points"][ENTRY_POINTS]}
EVERY = sorted(COMMANDS)
STUDIES = (*catalogue.STUDIES, "faults")


def install(monkeypatch: pytest.MonkeyPatch, commands: dict[str, str]) -> None:
    """Let these commands be installed, and no others."""
    points = [metadata.EntryPoint(*command, ENTRY_POINTS) for command in commands.items()]
    monkeypatch.setattr(metadata, "entry_points", lambda group: points)


def run(*words: str, prelude: str = "") -> subprocess.CompletedProcess[str]:
    """Run a command line in a fresh interpreter, after a line of Python."""
    code = f"import sys\n{prelude}\nfrom kmpc_lite.cli.main import main\nsys.exit(main())"
    return subprocess.run(
        [sys.executable, "-c", code, *words], capture_output=True, text=True, check=False
    )


HELP = """
import contextlib, io, json, sys
sys.modules.update(dict.fromkeys({blocked!r}))
from kmpc_lite.cli.main import main
told = {{}}
for words in {lines!r}:
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        try:
            status = main(words)
        except SystemExit as end:
            status = end.code
    told[" ".join(words)] = [status or 0, out.getvalue()]
json.dump(told, sys.stdout)
"""


def test_help_and_version_import_nothing_heavy() -> None:
    blocked = ("numpy", "scipy", "osqp", "matplotlib", "pymavlink", "mujoco", "casadi", "shtab")
    lines = [["--help"], ["--version"], *([name, "--help"] for name in EVERY)]
    done = subprocess.run(
        [sys.executable, "-c", HELP.format(blocked=blocked, lines=lines)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    for line, (status, out) in json.loads(done.stdout).items():
        assert status == 0, line
        if line == "--version":
            assert out.strip() == f"kmpc_lite {kmpc_lite.__version__}"
        elif line == "--help":
            assert out.startswith("usage: kmpc") and "--json" in out
            robot, desk = out.split("commands for a desk")
            listed = re.compile(r"^    (\w[\w-]*) ", re.MULTILINE)
            assert set(listed.findall(robot)) == set(ROBOT)
            assert set(listed.findall(desk)) == set(LAB)
        else:
            assert out.startswith("usage: kmpc"), line
            assert not re.search(r"^  --json", out, re.MULTILINE), "kmpc --help shows it"
            examples = re.findall(r"^  kmpc (.*)$", out.partition("example:")[2], re.MULTILINE)
            assert examples, line
            for example in examples:
                words = re.split(r"\s+(?:[#>]|&&)\s", example)[0].split()
                assert build_parser(known_commands(), words).parse_args(words).run


def test_both_projects_have_one_version() -> None:
    assert LABS["version"] == ROBOTS["version"] == kmpc_lab.__version__ == kmpc_lite.__version__
    assert LABS["dependencies"][0] == f"kmpc-lite=={ROBOTS['version']}"


def test_another_package_can_add_commands(monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch, {**COMMANDS, "fly": "mine:FLY"})
    known = known_commands()
    assert known["fly"] == "mine:FLY" and known.items() >= COMMANDS.items()
    assert list(known)[: len(ROBOT) + 1] == [*ROBOT, "fly"]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        *((name, f"kmpc {name} comes with kmpc-lab: pip install kmpc-lab") for name in LAB),
        ("simulat", "did you mean 'simulate'? It comes with kmpc-lab: pip install kmpc-lab"),
        ("chekc", "did you mean 'check'?"),
        ("xyz", "choose from inspect, fit, init"),
    ],
)
def test_where_the_lab_is_not_installed_its_commands_say_so(
    line: str, words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    install(monkeypatch, ROBOTS["entry-points"][ENTRY_POINTS])
    assert main(line.split()) == 2
    out, err = capsys.readouterr()
    assert words in err and err.count("\n") == 1 and out == ""
    assert words.startswith("kmpc ") or ("kmpc-lab" in err) == ("kmpc-lab" in words)


def brought(line: str) -> str:
    """Name the module that a line of an extra brings."""
    name = re.split(r"[^\w]", line.replace("dask[", "").replace("ros-", ""))[0]
    return {"pyserial": "serial"}.get(name, name)


def test_every_extra_that_is_reported_is_one_of_its_project() -> None:
    projects = {project["name"]: project["optional-dependencies"] for project in (ROBOTS, LABS)}
    for module, wanted in EXTRAS.items():
        name, _, extra = wanted.rstrip("]").partition("[")
        if module != "PIL":  # comes with matplotlib
            assert module in map(brought, projects[name][extra])


@pytest.mark.parametrize(
    ("project", "packages"),
    [(ROBOTS, ("kmpc_lite", "firmware_bridge")), (LABS, ("lab/kmpc_lab",))],
    ids=("kmpc-lite", "kmpc-lab"),
)
def test_an_extra_exists_only_where_code_uses_it(
    project: dict[str, Any], packages: tuple[str, ...]
) -> None:
    files = [file for name in packages for file in (ROOT / name).rglob("*.py")]
    code = "\n".join(file.read_text() for file in files)
    for extra, lines in project["optional-dependencies"].items():
        for line in lines if extra not in ("clients", "docs", "dev", "ros2-test") else ():
            module = brought(line)
            assert re.search(rf"^\s*(import|from) {module}\b", code, re.MULTILINE), (extra, module)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("simulat", "no command named 'simulat'; did you mean 'simulate'?"),
        ("xyz", "choose from inspect, fit, init"),
        ("study maps --familis open", "--familis open; did you mean '--families'?"),
        ("run --driver mavlik", "invalid choice: 'mavlik' (choose from 'mavlink'"),
    ],
)
def test_a_near_miss_is_suggested(line: str, words: str, capsys: pytest.CaptureFixture[str]):
    assert main(line.split()) == 2
    out, err = capsys.readouterr()
    assert words in err and err.count("\n") == 1 and out == ""


@pytest.mark.parametrize("line", ["fly --json", "fit --json", "simulate nowhere --json"])
def test_errors_are_reported_to_machines_as_json(line: str, capsys: pytest.CaptureFixture[str]):
    assert main(line.split()) == 2
    out, err = capsys.readouterr()
    assert set(json.loads(out)) == {"error"} and err == ""


def test_colours_are_for_terminals_that_want_them(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("TERM", "xterm")
    for terminal, no_color, coloured in ((False, "", False), (True, "", True), (True, "1", False)):
        monkeypatch.setattr(sys.stderr, "isatty", lambda terminal=terminal: terminal)
        monkeypatch.setenv("NO_COLOR", no_color)
        assert main(["fly"]) == 2
        assert ("\x1b[31mkmpc:" in capsys.readouterr().err) == coloured
