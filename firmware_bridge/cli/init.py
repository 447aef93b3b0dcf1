"""`kmpc init`: write a commented robot file, and list the serial ports to put into it."""

from __future__ import annotations

import argparse
import json
import re
from importlib import resources
from pathlib import Path
from typing import NamedTuple

from firmware_bridge.link.url import LinkUrl
from firmware_bridge.messages import BridgeError, ConfigError
from firmware_bridge.robot_file import load_robot
from kmpc_lite.cli.command import Command

BUILT_IN = ("ttyAMA*", "ttyTHS*", "serial[0-9]*")  # ports of a Raspberry Pi's or a Jetson's header
PLUGGED_IN = ("ttyACM*", "ttyUSB*")


class Port(NamedTuple):
    """A serial port."""

    path: str  # what a robot file should say
    device: str  # what it is now: /dev/ttyACM0


def serial_ports(root: Path = Path("/dev")) -> list[Port]:
    """List the ports, those that are plugged in first.

    `root`: folder of devices.
    """
    found: dict[str, Port] = {}
    for link in sorted((root / "serial" / "by-id").glob("*")):
        device = str(link.resolve())
        found.setdefault(device, Port(str(link), device))
    for pattern in (*PLUGGED_IN, *BUILT_IN):
        for path in sorted(root.glob(pattern)):
            device = str(path.resolve())
            found.setdefault(device, Port(str(path), device))
    return list(found.values())


URL = re.compile(r'^url = "(.*)"$', re.MULTILINE)
TEMPLATES = Path(str(resources.files("firmware_bridge"))) / "robots"


def templates() -> list[str]:
    """Names of the robot files that come with the package."""
    return sorted(file.stem for file in TEMPLATES.glob("*.toml"))


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    names = templates()
    add("robot", choices=names, metavar="robot", help=f"one of {', '.join(names)}")
    text = "robot file to write (default: robot.toml)"
    add("-o", "--output", type=Path, default=Path("robot.toml"), metavar="FILE", help=text)
    text = "the robot's link (default: the only serial port that is plugged in, else an example)"
    add("--link", metavar="URL", help=text)
    add("--force", action="store_true", help="overwrite an existing file")


def run(options: argparse.Namespace) -> int:
    """Write the file, and say what is to do next."""
    from kmpc_lite.files import write_whole

    file: Path = options.output
    if file.exists() and not options.force:
        raise ConfigError(f"{file}: is there already: choose another --output, or --force")
    text = (TEMPLATES / f"{options.robot}.toml").read_text(encoding="utf-8")
    ports = serial_ports()
    link = _link(text, options.link, ports)
    text = URL.sub(lambda _: f"url = {json.dumps(link)}", text, count=1)
    with write_whole(file) as out:
        out.write(text.encode())
    url = load_robot(file).link.url
    if options.json:
        found = [port._asdict() for port in ports]
        told = {"written": str(file), "robot": options.robot, "link": url, "ports": found}
        print(json.dumps(told))
        return 0
    print(f"wrote  {file}, for {options.robot} at {url}")
    print("\n".join(_tell(ports, url)))
    print(f"next   measure what the file says of your robot, then: kmpc check {file}")
    return 0


def _link(text: str, given: str | None, ports: list[Port]) -> str:
    """URL as given, else of the only port that is plugged in, else the template's.

    A serial port without a baud rate gets the template's.
    """
    template = URL.search(text)
    assert template is not None
    plugged = [port.path for port in ports if "/by-id/" in port.path]
    if given is None and len(plugged) != 1:
        return template[1]
    link = LinkUrl.parse(plugged[0] if given is None else given)
    if link.kind != "serial" or link.options:
        return link.text
    _, mark, options = template[1].partition("?")
    return f"{link.text}{mark}{options}"


def _tell(ports: list[Port], url: str) -> list[str]:
    """Lines about the ports."""
    if not ports:
        return ["ports  none found: plug the board in and look again, or set [link] url yourself"]
    lines = []
    for port in ports:
        own = "  (in the file)" if f":{port.path}" in url else ""
        where = "" if port.device == port.path else f", now {port.device}"
        lines.append(f"port   {port.path}{where}{own}")
    return lines


COMMAND = Command(
    text="Write a commented robot file for your board, and list the serial ports found.",
    examples=(
        "kmpc init rover",
        "kmpc init roboclaw --link serial:/dev/ttyACM0?baud=115200 -o robot.toml",
    ),
    add_options=add_options,
    run=run,
    errors=(BridgeError,),
)
