"""`kmpc onboard`: ask a microcontroller what controller it runs, and whether it is an export's."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from firmware_bridge.messages import BridgeError, ConfigError
from kmpc_lite.cli.command import Command
from kmpc_lite.cli.numbers import positive

if TYPE_CHECKING:
    from firmware_bridge.drivers.onboard.messages import About

TIMEOUT = 5.0
"""How long an answer may take [s]."""
ROUNDING = 1e-6
"""Relative difference of numbers that a board holds in float."""
SIZES = {"horizon": "KMPC_N", "history": "KMPC_L", "circles": "KMPC_THINGS"}
"""What a board says of itself, and the same in an export."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add("link", help="URL of the board's line, as serial:/dev/ttyACM0 or tcp:HOST:PORT")
    add("--export", type=Path, metavar="DIR", help="folder of kmpc export that it is to run")
    add("--timeout", type=positive, default=TIMEOUT, metavar="S", help="for an answer [s] (5)")


def run(options: argparse.Namespace) -> int:
    """Ask, and compare; 1 if the board runs something else."""
    wanted = None if options.export is None else _exported(options.export)
    about = _asked(options.link, options.timeout)
    wrong = [] if wanted is None else _differences(about, wanted)
    if options.json:
        print(json.dumps({"board": asdict(about), "differences": wrong}))
        return 1 if wrong else 0
    print(
        f"board  {about.horizon} stages of {about.dt:g} s, radius {about.radius:g} m, up to "
        f"{about.circles} circles and paths of {about.poses} poses; it looks back on "
        f"{about.history} commands"
    )
    least, most = about.u_min, about.u_max
    print(f"       {least[0]:g} to {most[0]:g} m/s, {least[1]:g} to {most[1]:g} rad/s")
    for line in wrong:
        print(f"wrong  {line}")
    if wanted is not None and not wrong:
        print(f"same   as {options.export} in sizes, period and radius")
    return 1 if wrong else 0


def _exported(folder: Path) -> dict[str, float]:
    """What a board that runs an export says of itself."""
    from kmpc_lite.embedded.folder import ABOUT

    try:
        about: dict[str, Any] = json.loads((folder / ABOUT).read_text())
        sizes = {name: about["sizes"][word] for name, word in SIZES.items()}
        return sizes | {"dt": about["dt"], "radius": about["robot_radius"]}
    except (OSError, ValueError, KeyError) as error:
        raise ConfigError(f"--export {folder}: no exported controller: {error}") from error


def _asked(link: str, timeout: float) -> About:
    """Let a board say what it is; nothing that could move it is sent."""
    from firmware_bridge.drivers.onboard import OnboardDriver
    from firmware_bridge.link import open_transport

    # no speeds are sent that wheels would matter for
    geometry = {"wheel_radius": 0.05, "track": 0.3, "max_wheel_speed": 1.0}
    driver = OnboardDriver.from_options(open_transport(link), {"geometry": geometry})
    try:
        driver.connect(timeout)
        assert driver.about is not None
        return driver.about
    finally:
        driver.close()


def _differences(about: About, wanted: dict[str, float]) -> list[str]:
    """What a board holds otherwise than an export."""
    found = ((name, value, getattr(about, name)) for name, value in wanted.items())
    return [
        f"{name}: expected {value:g}, the board has {has:g}: flash it again"
        for name, value, has in found
        if not abs(has - value) <= ROUNDING * abs(value)
    ]


COMMAND = Command(
    text="Ask a microcontroller what controller it runs, and whether it is the exported one.",
    examples=(
        "kmpc onboard serial:/dev/ttyACM0 --export firmware",
        "kmpc onboard tcp:127.0.0.1:5760",
    ),
    add_options=add_options,
    run=run,
    errors=(BridgeError,),
)
