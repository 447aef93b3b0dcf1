"""Help with examples that can be parsed, and the version."""

from __future__ import annotations

import re

import pytest

import kmpc_lite as kl
from kmpc_lite.cli import main as cli
from kmpc_lite.cli.command import build_parser, known_commands

COMMANDS = ("demo", "fit", "simulate", "report", "study", "bench")


@pytest.mark.parametrize("name", ["", *COMMANDS])
def test_help_shows_an_example(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main([*name.split(), "--help"])
    assert ended.value.code == 0
    out = capsys.readouterr().out
    if name:
        assert f"example:\n  kmpc {name}" in out and "--json" in out
    else:
        assert all(command in out for command in COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_the_examples_of_the_help_can_be_parsed(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        cli.main([name, "--help"])
    lines = re.findall(
        r"^  kmpc (.*)$", capsys.readouterr().out.partition("example:")[2], re.MULTILINE
    )
    assert lines
    for line in lines:
        words = re.split(r"\s+[#>]\s", line)[0].split()
        assert build_parser(known_commands(), words).parse_args(words).run


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out.strip() == f"kmpc_lite {kl.__version__}"
