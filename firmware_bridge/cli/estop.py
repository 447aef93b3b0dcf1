"""`kmpc estop`: stop the robot that a running bridge drives, and keep it stopped."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from firmware_bridge.messages import BridgeError, LinkError
from firmware_bridge.safety.estop import WORDS, ask, default_socket, latch_file, set_latch
from kmpc_lite.cli.command import Command


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    what = parser.add_mutually_exclusive_group()
    for option, word, text in (
        ("--reset", "reset", "clear the stop; the robot stays still"),
        ("--enable", "enable", "let the robot drive (again)"),
        (
            "--confirm-frame",
            "confirm",
            "after a restart of the autopilot: you have seen that the robot is shown where it is",
        ),
        ("--status", "status", "say what the gate is doing"),
    ):
        what.add_argument(option, dest="word", action="store_const", const=word, help=text)
    parser.add_argument(
        "--socket", metavar="PATH", help="of the bridge, where it is not the default"
    )
    parser.set_defaults(word="stop")


def run(options: argparse.Namespace) -> int:
    """Ask the running bridge; where none runs, keep the next one from driving."""
    assert options.word in WORDS
    path = Path(options.socket) if options.socket else default_socket()
    try:
        answer = ask(path, options.word)
    except LinkError as error:
        if options.word in ("stop", "reset"):
            set_latch(path, options.word == "stop")
        latched = latch_file(path).exists()
        unknown = {"gate": None, "confirmed": False, "error": str(error)}
        answer = {"ok": False, "latched": latched, **unknown}
    print(json.dumps(answer) if options.json else _tell(answer), flush=True)
    done = answer["ok"] and (options.word != "stop" or answer["confirmed"])
    return 0 if done or (options.word == "reset" and not answer["latched"]) else 1


def _tell(answer: dict[str, Any]) -> str:
    """Put an answer into words."""
    if answer["gate"] is None:
        next_one = "the next one will not drive before a reset"
        return f"{answer['error']}; {next_one if answer['latched'] else 'no stop is pressed'}"
    pressed = "pressed" if answer["latched"] else "not pressed"
    reasons = "".join(f"\n  {why}" for why in answer.get("why", ()))
    return f"emergency stop {pressed}, gate {answer['gate']}{reasons}"


COMMAND = Command(
    text="Stop the robot that a running bridge drives, and keep it stopped.",
    examples=(
        "kmpc estop",
        "kmpc estop --reset        # then: kmpc estop --enable",
    ),
    add_options=add_options,
    run=run,
    errors=(BridgeError,),
)
