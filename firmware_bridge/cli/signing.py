"""`kmpc signing`: keys for MAVLink signing, as ground stations make and give them."""

from __future__ import annotations

import argparse
import getpass
import json
import os
import secrets
import sys
from pathlib import Path

from firmware_bridge.messages import BridgeError, ConfigError
from kmpc_lite.cli.command import Command


def _add_key(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", help="file to write the key to; only its owner can read it")
    text = (
        "derive the key from a passphrase, as ground stations do; it is prompted "
        "for, or read from a pipe"
    )
    parser.add_argument("--passphrase", action="store_true", help=text)


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


COMMAND = Command(
    text="Make keys for MAVLink signing; a ground station gives them to the autopilot.",
    examples=("kmpc signing key signing.key --passphrase",),
    commands={
        "key": Command(
            text="Make a key.",
            examples=("kmpc signing key signing.key",),
            add_options=_add_key,
            run=_key,
            errors=(BridgeError,),
        )
    },
)
