"""Commands are found, loaded only when asked for, and what is nearly right is suggested."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest

from firmware_bridge.cli import COMMANDS as BRIDGE
from kmpc_lite.cli.command import ENTRY_POINTS, LAST, OWN, Command, known_commands, load
from kmpc_lite.cli.extras import EXTRAS
from kmpc_lite.cli.main import main
from kmpc_lite.cli.study import maps

PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
EVERY = sorted({*OWN, *BRIDGE, *LAST})
STUDIES = ("table1", *maps.STUDIES, "faults")


def run(*words: str, prelude: str = "") -> subprocess.CompletedProcess[str]:
    """Run a command line in a fresh interpreter, after a line of Python."""
    code = f"import sys\n{prelude}\nfrom firmware_bridge.cli.main import main\nsys.exit(main())"
    return subprocess.run(
        [sys.executable, "-c", code, *words], capture_output=True, text=True, check=False
    )


HELP = """
import contextlib, io, json, sys
sys.modules.update(dict.fromkeys({blocked!r}))
from firmware_bridge.cli.main import main
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
        assert out.startswith("kmpc_lite" if line == "--version" else "usage: kmpc"), line


@pytest.mark.parametrize("study", STUDIES)
def test_each_study_has_a_help_of_its_own(study: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["study", study, "--help"])
    out = capsys.readouterr().out
    assert ended.value.code == 0 and f"example:\n  kmpc study {study}" in out and "--json" in out


def test_a_command_line_imports_its_own_command_only() -> None:
    done = run(
        "estop",
        "--help",
        prelude="import atexit; atexit.register(lambda: print([m for m in sys.modules "
        "if '.cli.' in m and m.endswith(('fit', 'bench', 'check'))]))",
    )
    assert done.stdout.splitlines()[-1] == "[]"


def test_python_dash_m_is_the_same_command() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "kmpc_lite", "--version"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "") and done.stdout.startswith("kmpc_lite ")


def test_the_bridges_entry_points_are_those_of_the_project_and_of_this_installation() -> None:
    assert PROJECT["entry-points"][ENTRY_POINTS] == BRIDGE
    installed = {point.name: point.value for point in metadata.entry_points(group=ENTRY_POINTS)}
    assert installed.items() >= BRIDGE.items()


def test_another_package_can_add_and_replace_commands(monkeypatch: pytest.MonkeyPatch) -> None:
    points = [metadata.EntryPoint("fit", "mine:FIT", ENTRY_POINTS)]
    monkeypatch.setattr(metadata, "entry_points", lambda group: points)
    known = known_commands({"fly": "mine:FLY"})
    assert known["fit"] == "mine:FIT" and known["fly"] == "mine:FLY"
    assert known["bench"] == OWN["bench"] and list(known)[-1] == "completion"


@pytest.mark.parametrize("where", [*OWN.values(), *BRIDGE.values(), *LAST.values()])
def test_every_command_can_be_loaded(where: str) -> None:
    command = load(where)
    assert isinstance(command, Command)
    assert len(command.text) > 20 and command.examples


def test_the_tables_of_names_are_those_of_the_sources() -> None:
    from firmware_bridge.cli import experiments
    from firmware_bridge.experiments import study
    from kmpc_lite.sim.maps.families import FAMILIES
    from kmpc_lite.studies.catalogue import STUDIES as CATALOGUE

    assert list(maps.FAMILIES) == list(FAMILIES)
    assert set(maps.STUDIES) == set(CATALOGUE)
    assert list(experiments.EXPERIMENTS) == list(study.EXPERIMENTS)


def test_every_extra_that_is_told_is_one_of_the_project() -> None:
    extras = PROJECT["optional-dependencies"]
    assert set(EXTRAS.values()) <= set(extras)
    for module, extra in EXTRAS.items():
        if module != "PIL":  # comes with matplotlib
            lines = [line.removeprefix("eclipse-") for line in extras[extra]]
            assert any(line.startswith(module) for line in lines), module


def test_an_extra_exists_only_where_code_uses_it() -> None:
    packages = [Path(__file__).parents[2] / name for name in ("kmpc_lite", "firmware_bridge")]
    code = "\n".join(file.read_text() for folder in packages for file in folder.rglob("*.py"))
    for extra, lines in PROJECT["optional-dependencies"].items():
        for line in lines if extra not in ("clients", "docs", "dev") else ():
            module = re.split(r"[^\w]", line.replace("dask[", "").replace("eclipse-", ""))[0]
            assert re.search(rf"^\s*(import|from) {module}\b", code, re.MULTILINE), (extra, module)


def test_options_are_not_abbreviated(capsys: pytest.CaptureFixture[str]) -> None:
    for line in ("run robot.toml --ar", "bench --install-acado"):
        assert main(line.split()) == 2
        assert "unrecognized arguments" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("simulat", "no command named 'simulat'; did you mean 'simulate'?"),
        ("chekc", "did you mean 'check'?"),
        ("xyz", "choose from demo, inspect, fit, simulate"),
        ("study mapps", "no study named 'mapps'; did you mean 'maps'?"),
        ("study maps --families opn", "did you mean 'open'?"),
        ("study maps --familis open", "--familis open; did you mean '--families'?"),
        ("simulate four_circle_1", "no scenario named 'four_circle_1'; did you mean 'four_circl"),
        ("simulate --plant slipp", "did you mean 'slip'?"),
        ("run --driver mavlik", "did you mean 'mavlink'?"),
        ("init rovr", "did you mean 'rover'?"),
        ("experiments modell", "did you mean 'model'?"),
    ],
)
def test_a_near_miss_is_suggested(
    line: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(line.split()) == 2
    out, err = capsys.readouterr()
    assert words in err and err.count("\n") == 1 and out == ""


@pytest.mark.parametrize("line", ["fly --json", "fit --json", "simulate nowhere --json"])
def test_machines_are_told_errors_as_json(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(line.split()) == 2
    out, err = capsys.readouterr()
    assert set(json.loads(out)) == {"error"} and err == ""


def test_colours_are_for_terminals_that_want_them(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("TERM", "xterm")
    for terminal, no_color, coloured in (
        (False, "", False),
        (True, "", True),
        (True, "1", False),
    ):
        monkeypatch.setattr(sys.stderr, "isatty", lambda terminal=terminal: terminal)
        monkeypatch.setenv("NO_COLOR", no_color)
        assert main(["fly"]) == 2
        assert ("\x1b[31mkmpc:" in capsys.readouterr().err) == coloured


def test_completion_knows_commands_options_and_choices(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("shtab")
    for shell in ("bash", "zsh"):
        assert main(["completion", shell]) == 0
        script = capsys.readouterr().out
        for word in ("simulate", "estop", "--families", "narrow", "roboclaw", "turning"):
            assert word in script, (shell, word)
