"""Options of a page on which a drive is watched and stopped; several commands share them."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from firmware_bridge.live.address import LiveAddress

LAST_PORT = 65535
HOST, PORT = "127.0.0.1", 8764
"""As `firmware_bridge.live` has them: a help need not wait for that."""


def add_live_options(parser: argparse.ArgumentParser) -> None:
    """Add what `live_address` reads."""
    add = parser.add_argument_group("watch and stop it in a browser").add_argument
    text = "serve a page with map, numbers and STOP to browsers of this computer; prints its link"
    add("--live", action="store_true", help=text)
    text = f"--live at this port (default: {PORT}; 0: any that is free)"
    add("--live-port", type=port, metavar="PORT", help=text)
    text = (
        "--live at this address, 0.0.0.0 for all: other computers and phones of the network\n"
        f"then need the token in the link (default: {HOST})"
    )
    add("--live-host", metavar="HOST", help=text)


def port(text: str) -> int:
    """Read a port."""
    if not (text.isascii() and text.isdigit() and int(text) <= LAST_PORT):
        raise argparse.ArgumentTypeError(f"expected a port from 0 to {LAST_PORT}, got {text}")
    return int(text)


def live_address(options: argparse.Namespace) -> LiveAddress | None:
    """Where the page is to be served; None if none is asked for."""
    if not (options.live or options.live_port is not None or options.live_host):
        return None
    from firmware_bridge.live.address import LiveAddress

    return LiveAddress(
        options.live_host or HOST, PORT if options.live_port is None else options.live_port
    )
