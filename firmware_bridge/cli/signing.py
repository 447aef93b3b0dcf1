"""`kmpc signing`: keys for MAVLink signing, made and given to the autopilot."""

from __future__ import annotations

import argparse
import getpass
import json
import os
import secrets
import sys
from pathlib import Path

from firmware_bridge.cli.options import add_robot_options, read_robot
from firmware_bridge.messages import BridgeError, ConfigError
from kmpc_lite.cli.command import Command

TOLD = (
    "the vehicle signs with this key, and accepts what is signed with it",
    "give board.key_file from now on",
    "ArduPilot's first port (SERIAL0, USB) still takes unsigned frames, whatever the key",
)


def _add_key(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", help="file to write the key to; only its owner can read it")
    parser.add_argument(
        "--passphrase",
        action="store_true",
        help="derive the key from a passphrase, as ground stations do; it is prompted "
        "for, or read from a pipe",
    )


def _key(options: argparse.Namespace) -> int:
    from firmware_bridge.drivers.mavlink.signing import passphrase_key

    path = Path(options.file)
    key = secrets.token_bytes(32)
    if options.passphrase:
        words = getpass.getpass("passphrase: ") if sys.stdin.isatty() else sys.stdin.readline()
        if not words.strip("\n"):
            raise ConfigError("--passphrase: expected words, got none")
        key = passphrase_key(words.rstrip("\n"))
    try:
        descriptor = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600)
    except FileExistsError:
        raise ConfigError(f"{path}: there is a file already; a key is never overwritten") from None
    with os.fdopen(descriptor, "w", encoding="ascii") as file:
        file.write(key.hex() + "\n")
    print(json.dumps({"file": str(path)}) if options.json else f"a key is in {path}")
    return 0


def _add_setup(parser: argparse.ArgumentParser) -> None:
    add_robot_options(parser)
    parser.add_argument(
        "--key", required=True, metavar="FILE", help="key file that `kmpc signing key` wrote"
    )
    parser.add_argument("--yes", action="store_true", help="do not ask for confirmation")
    parser.add_argument(
        "--over-network",
        action="store_true",
        help="send it over a network, where others may read it",
    )


def _setup(options: argparse.Namespace) -> int:
    from firmware_bridge.drivers.mavlink.options import MavlinkOptions
    from firmware_bridge.drivers.mavlink.signing import give_key, others_may_listen
    from firmware_bridge.link import open_transport

    robot = read_robot(options)
    if not robot.is_autopilot:
        raise ConfigError(f"signing: only an autopilot signs, not {robot.link.driver}")
    key = MavlinkOptions(key_file=options.key).read_key()
    assert key is not None
    url = robot.link.url
    if others_may_listen(url) and not options.over_network:
        raise ConfigError(
            f"{url}: the key would travel unencrypted, and whoever reads it drives the robot: "
            "use a cable, or --over-network"
        )
    if not options.yes and not _confirmed(f"send the key of {options.key} over {url}? [y/N] "):
        raise ConfigError("signing: not confirmed; --yes does not ask")
    board = MavlinkOptions.from_table(robot.sections.get("board", {}))
    give_key(open_transport(url), board, key, robot.link.timeout)
    print(json.dumps({"ok": True}) if options.json else "\n".join(TOLD))
    return 0


def _confirmed(question: str) -> bool:
    return sys.stdin.isatty() and input(question).strip().lower() in ("y", "yes")


COMMAND = Command(
    text="Make keys for MAVLink signing, and give them to the autopilot.",
    examples=(
        "kmpc signing key signing.key --passphrase",
        "kmpc signing setup robot.toml --key signing.key",
    ),
    commands={
        "key": Command(
            text="Make a key.",
            examples=("kmpc signing key signing.key",),
            add_options=_add_key,
            run=_key,
            errors=(BridgeError,),
        ),
        "setup": Command(
            text="Give the autopilot a key, and check that it signs with it.",
            examples=("kmpc signing setup robot.toml --key signing.key",),
            add_options=_add_setup,
            run=_setup,
            errors=(BridgeError,),
        ),
    },
)
