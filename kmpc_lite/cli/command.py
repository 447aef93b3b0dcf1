"""What a command of `kmpc` is: its help, its options, what it does, which extras it needs.

A file of this folder holds one `COMMAND`, its options and its body together, and imports NumPy and
everything else that is heavy only in the body. Every installed distribution adds its commands
through the entry points `kmpc.commands`, each ``name = "module:COMMAND"``; a group of them is one.
"""

from __future__ import annotations

import argparse
import re
from argparse import ArgumentTypeError
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module, metadata
from importlib.util import find_spec
from typing import Any, NoReturn

from kmpc_lite import __version__
from kmpc_lite.errors import KmpcError, did_you_mean

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
PARTS = "kmpc.parts"
"""Entry points of what kmpc-lab adds to a command of the robot."""
ENTRY_POINTS = "kmpc.commands"
ROBOT = (*("inspect", "fit", "init", "check", "run", "record", "replay", "estop", "ros2"), "export")
"""Commands of a robot, in the order in which the help shows them."""
LAB = ("demo", "simulate", "report", "study", "bench", "emulate")
"""Commands of a desk, which the distribution kmpc-lab brings."""
PROGRAM, SHARED = "kmpc", ("help", "json")
"""Options that every command takes: only the help of `kmpc` itself shows them."""
ON_THE_ROBOT, DESK = "commands for a robot", "commands for a desk (kmpc-lab)"
"""Headings of the two groups."""
LARGEST = 1e9
"""Beyond it a number is a slip of the pen."""


class MissingExtra(KmpcError):
    """An optional dependency is not installed."""


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


def no_options(parser: argparse.ArgumentParser) -> None:
    """Add nothing."""


def _nothing(options: argparse.Namespace) -> int:
    raise AssertionError("a group of commands does nothing itself")


@dataclass(frozen=True)
class Command:
    """One command, or a group of them."""

    text: str
    """What it does, in one sentence."""
    examples: tuple[str, ...]
    """Command lines; the first word is ``kmpc``."""
    add_options: Callable[[argparse.ArgumentParser], None] = no_options
    """Adds the command's options to its parser; ``--json`` is there already."""
    run: Callable[[argparse.Namespace], int] = _nothing
    """Does it, and returns the exit status."""
    errors: tuple[type[Exception], ...] = ()
    """Reported in one line with exit status 2, like `KmpcError`."""
    commands: Mapping[str, Command] = field(default_factory=dict)
    """Not empty: a group, whose commands these are."""


class UsageError(KmpcError):
    """A command line that cannot be understood."""

    def __init__(self, prog: str, text: str) -> None:
        super().__init__(text)
        self.prog = prog
        """Whose help explains it: ``kmpc fit``."""


def refuse_unread(
    prog: str, job: str, options: argparse.Namespace, shared: Sequence[str], reads: Sequence[str]
) -> None:
    """Refuse options that were given, and that the job that was asked for does not read.

    `prog`: whose help explains it: ``kmpc bench``. `job`: what was asked for: ``kmpc bench --fit``.
    `options`: None or False is what a command line does not name. `shared`, `reads`: options that
    not every job reads, and those that this one does: ``--drives``. Raises UsageError: in one line.
    """

    def is_given(option: str) -> bool:
        return getattr(options, option.removeprefix("--").replace("-", "_")) not in (None, False)

    given = [option for option in shared if option not in reads and is_given(option)]
    if given:
        them, those = "it" if len(given) == 1 else "them", ", ".join(reads) or "no others"
        text = f"{', '.join(given)}: {job} does not read {them}; it reads {those}"
        raise UsageError(prog, text)


class HelpFormatter(argparse.RawDescriptionHelpFormatter):
    """Keeps the line breaks of descriptions, examples and helps, and aligns lists of commands."""

    def add_argument(self, action: argparse.Action) -> None:
        """Leave out what every command takes, and make room for the indentation of commands."""
        if self._is_shared(action):
            return
        super().add_argument(action)
        if isinstance(action, argparse._SubParsersAction):
            self._action_max_length += self._indent_increment

    def _is_shared(self, action: argparse.Action) -> bool:
        return action.dest in SHARED and self._prog != PROGRAM

    def add_usage(
        self, usage: str | None, actions: Iterable[argparse.Action], *more: Any, **named: Any
    ) -> None:
        """Name what must be given; the options stand below."""
        actions = [action for action in actions if not self._is_shared(action)]
        must = [a for a in actions if a.required or not a.option_strings]
        if len(must) < len(actions):
            must.insert(0, argparse.Action([], "options", nargs="?", metavar="options"))
        super().add_usage(usage, must, (), *more[1:], **named)

    def _format_action(self, action: argparse.Action) -> str:
        text = super()._format_action(action)
        if isinstance(action, argparse._SubParsersAction):
            return text.partition("\n")[2]  # without the line of its metavar
        is_command = isinstance(action, argparse._SubParsersAction._ChoicesPseudoAction)
        if is_command and action.dest == LAB[0]:
            return f"\n{DESK}:\n{text}"
        return text

    def _split_lines(self, text: str, width: int) -> list[str]:
        split = super()._split_lines
        return [line for part in text.split("\n") for line in split(part, width)]


class Parser(argparse.ArgumentParser):
    """Raises what is wrong with a command line, and names what may have been meant.

    Options are not abbreviated: ``--arm`` must be meant.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"allow_abbrev": False, **options})
        # a value, not an option: -1.5, -2e-3, -90deg
        self._negative_number_matcher = re.compile(r"-(\d|\.\d)\S*$")

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

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is None or value in action.choices:
            return
        names = [str(choice) for choice in action.choices]
        hint = did_you_mean(str(value), names) or f"; choose from {', '.join(names)}"
        if isinstance(action, argparse._SubParsersAction):
            if action.metavar == "command" and not action.choices.keys() & LAB:
                of_lab = did_you_mean(str(value), LAB)
                hint = f"{of_lab} It comes with kmpc-lab: {LAB_LINE}" if of_lab else hint
            self.error(f"no {action.metavar} named {str(value)!r}{hint}")
        raise argparse.ArgumentError(action, f"invalid choice: {value!r}{hint}")


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
    only the command it names is imported. All of them are where it names none, or if no command
    line is given.
    """
    start = "demo" if "demo" in commands else "inspect"
    parser = Parser(
        prog=PROGRAM,
        description="Learn a robot from its log and drive it past obstacles to a pose.",
        epilog="Every command takes --help, which has examples, and --json, which prints one JSON\n"
        f"object, errors too. Start with `kmpc {start}`.",
        formatter_class=HelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"kmpc_lite {__version__}")
    typed = list(words or ())
    named = next((word for word in typed if not word.startswith("-")), "")
    if named in LAB and named not in commands:
        raise MissingExtra(f"kmpc {named} comes with kmpc-lab: {LAB_LINE}")
    if named in commands:
        chosen = [named]
    else:
        chosen = [] if typed[:1] == ["--version"] else list(commands)
    _add_commands(parser, {name: load(commands[name]) for name in chosen})
    return parser


def _add_commands(parser: argparse.ArgumentParser, commands: Mapping[str, Command]) -> None:
    """Put commands under a parser, and theirs under them."""
    what = "command" if parser.prog == PROGRAM else parser.prog.split()[-1]
    below = parser.add_subparsers(
        title={"command": ON_THE_ROBOT, "study": "studies"}.get(what, "commands"),
        required=True,
        metavar=what,
        parser_class=Parser,
    )
    for name, command in commands.items():
        sub = below.add_parser(
            name,
            help=command.text,
            description=command.text,
            epilog="example:\n" + "\n".join(f"  {line}" for line in command.examples),
            formatter_class=HelpFormatter,
        )
        if command.commands:
            _add_commands(sub, command.commands)
            continue
        sub.set_defaults(run=command.run, errors=command.errors)
        sub.add_argument("--json", action="store_true", help="print one JSON object, errors too")
        command.add_options(sub)


def positive(text: str) -> float:
    """Read a number > 0."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < LARGEST:
        raise ArgumentTypeError(f"expected a number > 0, got {text}")
    return value


def number(text: str) -> float:
    """Read a finite number."""
    try:
        value = float(text)
    except ValueError:
        value = LARGEST
    if not -LARGEST < value < LARGEST:
        raise ArgumentTypeError(f"expected a number, got {text}")
    return value


def count(text: str) -> int:
    """Read a whole number >= 1."""
    try:
        value = int(text)
    except ValueError:
        value = 0
    if not 1 <= value < LARGEST:
        raise ArgumentTypeError(f"expected a whole number >= 1, got {text}")
    return value
