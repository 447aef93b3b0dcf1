"""`kmpc estop`: stop the robot that a running bridge drives, and keep it stopped."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from firmware_bridge.messages import BridgeError, ConfigError, LinkError
from firmware_bridge.safety.estop import WORDS
from firmware_bridge.safety.estop_client import NoBridge, ask, press
from firmware_bridge.safety.places import (
    default_socket,
    found_sockets,
    is_latched,
    latch_file,
    likely_sockets,
    set_latch,
)
from kmpc_lite.cli.command import Command


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    text = (
        "robot file whose safety.socket names the bridge (default: every bridge of "
        "yours and of the service)"
    )
    parser.add_argument("robot", nargs="?", help=text)
    what = parser.add_mutually_exclusive_group()
    for option, word, text in (
        ("--reset", "reset", "clear the stop; the robot stays still"),
        ("--enable", "enable", "let the robot drive (again)"),
        (
            "--confirm-frame",
            "confirm",
            "after a restart of the autopilot: confirm that the map shows the robot where it is",
        ),
        ("--status", "status", "print the state of the safety gate"),
    ):
        what.add_argument(option, dest="word", action="store_const", const=word, help=text)
    parser.add_argument(
        "--socket", metavar="PATH", help="ask only the bridge that listens at this socket"
    )
    parser.set_defaults(word="stop")


def run(options: argparse.Namespace) -> int:
    """Ask the running bridges; if none runs, keep the next one from driving."""
    assert options.word in WORDS
    answers = [_ask(path, options.word) for path in _sockets(options)]
    heard = any(answer["gate"] is not None for answer in answers)
    answers = [a for a in answers if a["gate"] or a["latched"]] if heard else answers[:1]
    for answer in answers:
        print(json.dumps(answer) if options.json else _tell(answer, len(answers) > 1), flush=True)
    return 0 if all(_is_done(options.word, answer) for answer in answers) else 1


def _sockets(options: argparse.Namespace) -> list[Path]:
    """Whom to ask: one where it is named; all that are found for a stop; else the only one."""
    if options.socket:
        return [Path(options.socket)]
    if options.robot:
        from firmware_bridge.robot_file import load_robot

        return [load_robot(options.robot).socket or default_socket()]
    found = found_sockets()
    if options.word == "stop":
        return found or likely_sockets()
    if options.word == "reset":  # whatever `stop` may have pressed
        return found + [path for path in likely_sockets() if path.resolve() not in found]
    if options.word in ("enable", "confirm") and len(found) > 1:
        places = ", ".join(map(str, found))
        raise ConfigError(f"{len(found)} bridges may run: give --socket PATH, one of {places}")
    return found or [default_socket()]


def _ask(path: Path, word: str) -> dict[str, Any]:
    """One bridge's answer, or what is known without it."""
    try:
        return {**(press(path) if word == "stop" else ask(path, word)), "socket": str(path)}
    except LinkError as error:
        told = str(error)
        if word == "reset" and isinstance(error, NoBridge):
            try:
                set_latch(path, False)
            except OSError as disk:
                told += f"; {latch_file(path)}: cannot remove: {disk.strerror or disk}"
        unknown = {"gate": None, "confirmed": False, "error": told}
        return {"ok": False, "latched": is_latched(path), **unknown, "socket": str(path)}


def _is_done(word: str, answer: dict[str, Any]) -> bool:
    done: bool = answer["ok"] and (word != "stop" or answer["confirmed"])
    return done or (word == "reset" and answer["gate"] is None and not answer["latched"])


def _tell(answer: dict[str, Any], several: bool) -> str:
    """Put an answer into words."""
    if answer["gate"] is None:
        holds = "the stop is pressed: no bridge drives before a reset"
        return f"{answer['error']}; {holds if answer['latched'] else 'no stop is pressed'}"
    pressed = "pressed" if answer["latched"] else "not pressed"
    reasons = "".join(f"\n  {why}" for why in answer.get("why", ()))
    where = f"{answer['socket']}: " if several else ""
    return f"{where}emergency stop {pressed}, gate {answer['gate']}{reasons}"


COMMAND = Command(
    text="Stop the robot that a running bridge drives, and keep it stopped.",
    examples=(
        "kmpc estop",
        "kmpc estop --reset        # then: kmpc estop --enable",
        "kmpc estop robot.toml     # only the bridge of this robot file",
    ),
    add_options=add_options,
    run=run,
    errors=(BridgeError,),
)
