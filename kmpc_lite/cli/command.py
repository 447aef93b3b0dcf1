"""What a command of `kmpc` is: its help, its options, what it does, which extras it needs.

A file of this folder holds one `COMMAND`, its options and its body together, and imports NumPy and
everything else that is heavy only in the body. Every installed distribution adds its commands
through the entry points `kmpc.commands`, each ``name = "module:COMMAND"``; a group of them is one.

What all commands print alike, and which files they may write, stands here, too.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import time
from argparse import SUPPRESS, ArgumentTypeError
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module, metadata
from importlib.util import find_spec
from pathlib import Path
from textwrap import fill
from typing import Any, NoReturn, TextIO

from kmpc_lite import __version__
from kmpc_lite.errors import DataError, KmpcError, did_you_mean

BRIDGE, LOGS, PLOT = "kmpc-lite[bridge]", "kmpc-lite[logs]", "kmpc-lab[plot]"
EXTRAS = {
    "PIL": PLOT,
    "casadi": "kmpc-lab[peers]",
    "jinja2": PLOT,
    "matplotlib": PLOT,
    "mujoco": "kmpc-lab[twin]",
    "mcap": BRIDGE,
    "pymavlink": BRIDGE,
    "pyulog": LOGS,
    "rclpy": "kmpc-lite[ros2-test]",
    "serial": BRIDGE,
    "rosbags": LOGS,
}
"""Distribution and extra of it that bring a module."""
LAB_LINE = "pip install kmpc-lab"
ENTRY_POINTS, PARTS = "kmpc.commands", "kmpc.parts"
"""Entry points of commands, and of what kmpc-lab adds to a command of the robot."""
ROBOT = (*("inspect", "fit", "init", "check", "run", "record", "estop", "ros2"), "export")
LAB = ("demo", "simulate", "report", "study", "bench", "emulate")
"""Commands of a robot, and of a desk, which kmpc-lab brings; the help shows them in this order."""
PROGRAM = "kmpc"
LARGEST = 1e9  # beyond it a number is a slip of the pen


class MissingExtra(KmpcError):
    """An optional dependency is not installed."""


class UsageError(KmpcError):
    """A command line that cannot be understood; `prog` is whose help explains it."""

    def __init__(self, prog: str, text: str) -> None:
        super().__init__(text)
        self.prog = prog


def is_installed(module: str) -> bool:
    """Whether a module can be imported; it is not."""
    try:
        return find_spec(module) is not None
    except (ImportError, ValueError):
        return False


def need(what: str, *modules: str) -> None:
    """Refuse where a module is missing.

    `what`: which needs it: "a report". `modules`: names of `EXTRAS`. Raises MissingExtra with the
    line that installs it.
    """
    for module in modules:
        if not is_installed(module):
            raise MissingExtra(f"{what} needs {module}: {pip_line(module)}")


def missing_extra(error: ModuleNotFoundError) -> str | None:
    """What to say of a module that was not found; None if it belongs to no extra."""
    module = (error.name or "").partition(".")[0]
    return f"{module} is not installed: {pip_line(module)}" if module in EXTRAS else None


def pip_line(module: str) -> str:
    """Command that installs the extra of a module."""
    return f"pip install '{EXTRAS[module]}'"


def part(what: str, name: str) -> Any:
    """Load what kmpc-lab adds to a command.

    `what`: which needs it: "--plot". `name`: of its entry point among `PARTS`. Raises MissingExtra
    where kmpc-lab is not installed, with the line that installs it.
    """
    for point in metadata.entry_points(group=PARTS, name=name):
        return point.load()
    raise MissingExtra(f"{what} comes with kmpc-lab: {LAB_LINE}")


def _nothing(options: argparse.Namespace) -> int:
    raise AssertionError("a group of commands does nothing itself")


@dataclass(frozen=True)
class Command:
    """One command, or a group of them."""

    text: str  # what it does, in one sentence
    examples: tuple[str, ...]  # command lines; the first word is ``kmpc``
    add_options: Callable[[argparse.ArgumentParser], None] = lambda parser: None
    """Adds the command's options to its parser; ``--json`` is there already."""
    run: Callable[[argparse.Namespace], int] = _nothing  # does it, and returns the exit status
    errors: tuple[type[Exception], ...] = ()
    """Reported in one line with exit status 2, like `KmpcError`."""
    commands: Mapping[str, Command] = field(default_factory=dict)
    """Not empty: a group, whose commands these are."""


def refuse_unread(
    prog: str, job: str, options: argparse.Namespace, shared: Sequence[str], reads: Sequence[str]
) -> None:
    """Refuse options that were given, and that the job that was asked for does not read.

    `prog`: whose help explains it: ``kmpc bench``. `job`: what was asked for. `shared`, `reads`:
    options that not every job reads, and those that this one does. Raises UsageError: in one line.
    """
    names = {option: option.removeprefix("--").replace("-", "_") for option in shared}
    given = [o for o, n in names.items() if getattr(options, n) not in (None, False)]
    if unread := [option for option in given if option not in reads]:
        them, those = "it" if len(unread) == 1 else "them", ", ".join(reads) or "no others"
        told = f"{', '.join(unread)}: {job} does not read {them}; it reads {those}"
        raise UsageError(prog, told)


class HelpFormatter(argparse.RawDescriptionHelpFormatter):
    """Wraps the lines of a help by themselves, so that it may have several."""

    def _split_lines(self, text: str, width: int) -> list[str]:
        split = super()._split_lines
        return [line for part in text.split("\n") for line in split(part, width)]


class Parser(argparse.ArgumentParser):
    """Raises what is wrong with a command line, and names the option that may have been meant.

    Options are not abbreviated: ``--arm`` must be meant.
    """

    def __init__(self, **options: Any) -> None:
        how = {"allow_abbrev": False, "add_help": False, "formatter_class": HelpFormatter}
        super().__init__(**{**how, **options})
        # a value, not an option: -1.5, -2e-3, -90deg
        self._negative_number_matcher = re.compile(r"-(\d|\.\d)\S*$")
        self.add_argument("-h", "--help", action="help", help=SUPPRESS)

    def format_help(self) -> str:
        """Name in the usage what must be given; the options stand below."""
        if self.usage is None:
            must = [a for a in self._actions if a.required or not a.option_strings]
            told = (f"{(a.option_strings or [''])[0]} {_metavar(a)}".strip() for a in must)
            self.usage = " ".join(("%(prog)s [options]", *told))
        return super().format_help()

    def error(self, message: str) -> NoReturn:
        """Raise UsageError."""
        raise UsageError(self.prog, f"{message} (see {self.prog} --help)")

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Refuse unknown options here, so that the command's own can be suggested."""
        known, rest = super().parse_known_args(args, namespace)
        if rest:
            own = [name for action in self._actions for name in action.option_strings]
            word = rest[0].partition("=")[0]
            hint = did_you_mean(word, own) if word.startswith("-") else ""
            self.error(f"unrecognized arguments: {' '.join(rest)}{hint}")
        return known, rest


def _metavar(action: argparse.Action) -> str:
    name = action.metavar or action.dest.upper()
    text = name if isinstance(name, str) else " ".join(name)
    return {"?": f"[{text}]", "*": f"[{text} ...]", "+": f"{text} ..."}.get(str(action.nargs), text)


def known_commands() -> dict[str, str]:
    """Names of all commands that are installed, and where they stand as ``module:name``."""
    found = {point.name: point.value for point in metadata.entry_points(group=ENTRY_POINTS)}
    others = (name for name in found if name not in LAB)
    names = dict.fromkeys((*ROBOT, *others, *LAB))
    return {name: found[name] for name in names if name in found}


def load(where: str) -> Command:
    """Import a command that stands at ``module:name``."""
    module, _, name = where.partition(":")
    command: Command = getattr(import_module(module), name)
    return command


def build_parser(commands: Mapping[str, str], words: Iterable[str] | None = None) -> Parser:
    """Build the parser of `kmpc`.

    `commands`: as `known_commands` gives them. `words`: command line that is going to be parsed:
    only the command it names is imported; all of them if it names none. Raises UsageError for a
    command that nobody knows, MissingExtra for one that comes with kmpc-lab.
    """
    typed = list(words or ())
    named = next((word for word in typed if not word.startswith("-")), "")
    if named in LAB and named not in commands:
        raise MissingExtra(f"kmpc {named} comes with kmpc-lab: {LAB_LINE}")
    if named and named not in commands:
        of_lab = "" if commands.keys() & set(LAB) else did_you_mean(named, LAB)
        hint = f"{of_lab} It comes with kmpc-lab: {LAB_LINE}" if of_lab else ""
        hint = hint or did_you_mean(named, commands) or f"; choose from {', '.join(commands)}"
        raise UsageError(PROGRAM, f"no command named {named!r}{hint} (see kmpc --help)")
    chosen = [named] if named else [] if typed[:1] == ["--version"] else list(commands)
    loaded = {name: load(commands[name]) for name in chosen}
    start = "demo" if "demo" in commands else "inspect"
    parser = Parser(
        prog=PROGRAM,
        usage=f"{PROGRAM} [options] command ...",
        description="Learn a robot from its log and drive it past obstacles to a pose."
        + _listed("commands for a robot", {n: c for n, c in loaded.items() if n not in LAB})
        + _listed("commands for a desk (kmpc-lab)", {n: c for n, c in loaded.items() if n in LAB}),
        epilog="Every command takes --help, which has examples, and --json, which prints one JSON\n"
        f"object, errors too. Start with `kmpc {start}`.",
    )
    parser.add_argument("--version", action="version", version=f"kmpc_lite {__version__}")
    _add_commands(parser, loaded)
    return parser


def _listed(title: str, commands: Mapping[str, Command]) -> str:
    """Commands and what they do, below a title."""
    wide = 4 + max(map(len, commands), default=0)
    lines = [
        fill(f"    {name:<{wide - 3}} {command.text}", 100, subsequent_indent=" " * (wide + 2))
        for name, command in commands.items()
    ]
    return "\n".join(["\n", f"{title}:", *lines]) if lines else ""


def _add_commands(parser: argparse.ArgumentParser, commands: Mapping[str, Command]) -> None:
    """Put commands under a parser, and theirs under them."""
    what = "command" if parser.prog == PROGRAM else parser.prog.split()[-1]
    below = parser.add_subparsers(
        required=True, prog=parser.prog, metavar=what, help=SUPPRESS, parser_class=Parser
    )
    for name, command in commands.items():
        sub = below.add_parser(
            name,
            usage=f"{parser.prog} {name} {name} ..." if command.commands else None,
            description=command.text + _listed("studies", command.commands),
            epilog="example:\n" + "\n".join(f"  {line}" for line in command.examples),
        )
        if command.commands:
            _add_commands(sub, command.commands)
            continue
        sub.set_defaults(run=command.run, errors=command.errors)
        sub.add_argument("--json", action="store_true", help=SUPPRESS)
        command.add_options(sub)


def _read(kind: Callable[[str], float], text: str, least: float, expected: str) -> float:
    """Read a number from a least to below the largest one."""
    try:
        value = kind(text)
    except ValueError:
        value = LARGEST
    if not least <= value < LARGEST:
        raise ArgumentTypeError(f"expected {expected}, got {text}")
    return value


def positive(text: str) -> float:
    """Read a number > 0."""
    return _read(float, text, 1e-300, "a number > 0")


def number(text: str) -> float:
    """Read a finite number."""
    return _read(float, text, -LARGEST, "a number")


def count(text: str) -> int:
    """Read a whole number >= 1."""
    return int(_read(int, text, 1, "a whole number >= 1"))


COLOURS = {"red": "31", "green": "32", "yellow": "33"}
WIDTH = 30  # of the bar [characters]


def paint(text: str, colour: str, stream: TextIO) -> str:
    """Colour a text where `stream` is a terminal that shows colours and NO_COLOR is not set."""
    plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb" or not stream.isatty()
    return text if plain else f"\x1b[{COLOURS[colour]}m{text}\x1b[0m"


def clear_line(stream: TextIO) -> None:
    """Wipe a progress bar that was left unfinished, on a terminal."""
    if stream.isatty():
        stream.write("\r\x1b[2K")


def command_line() -> str:
    """What the user typed, for reports."""
    return "kmpc " + " ".join(sys.argv[1:])


def keep_inputs(output: Path | None, *inputs: Path | None) -> None:
    """Refuse to write over a file that is read, or into a folder that cannot be written to.

    A command calls it before its work: learning may take minutes.
    """
    if output is not None:
        folder = output.parent
        if not folder.is_dir():
            raise DataError(f"{output}: cannot be written: there is no folder {folder}")
        if output.is_dir() or not os.access(folder, os.W_OK):
            reason = "it is a folder" if output.is_dir() else f"{folder} is write-protected"
            raise DataError(f"{output}: cannot be written: {reason}")
    for file in inputs:
        if output is not None and file is not None and output.resolve() == file.resolve():
            raise DataError(
                f"{output}: would be written over, but is read too; "
                "choose another name for what is written"
            )


class ProgressBar:
    """Bar with an estimate of the time left, once there is something to estimate it from.

    `label`: what is under way. `quiet`: draw nothing, even on a terminal.
    """

    def __init__(self, label: str, quiet: bool = False) -> None:
        self.label = label
        self.shown = sys.stderr.isatty() and not quiet
        self._first: tuple[float, int] | None = None
        """When the bar was first drawn [s], and how much was done then: by an earlier run."""

    def __call__(self, done: int, total: int) -> None:
        """Draw `done` of `total`."""
        if not self.shown:
            return
        now = time.monotonic()
        if self._first is None:
            self._first = now, done
        begin, before = self._first
        left = (now - begin) / (done - before) * (total - done) if done > before else None
        told = "" if done == total else f"  {remaining(left)}"
        filled = WIDTH * done // max(total, 1)
        print(
            f"\r\x1b[2K{self.label} [{'#' * filled}{'.' * (WIDTH - filled)}] {done}/{total}{told}",
            end="\n" if done == total else "",
            file=sys.stderr,
            flush=True,
        )


def remaining(seconds: float | None) -> str:
    """Put an estimate [s] into words; None if there is none yet."""
    if seconds is None:
        return "time left not known yet"
    if seconds < 60.0:
        return f"about {max(1.0, seconds):.0f} s left"
    minutes = round(seconds / 60.0)
    if minutes < 60:
        return f"about {minutes} min left"
    return f"about {minutes // 60} h {minutes % 60:02d} min left"
