"""One drive of a real bridge against an emulated board, with or without attackers."""

from __future__ import annotations

import math
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any
from urllib.parse import urlsplit

from firmware_bridge.live.address import LiveAddress
from firmware_bridge.live.feed import Feed
from firmware_bridge.messages import LinkError, State, VelocityCommand
from firmware_bridge.robot_file import load_robot
from firmware_bridge.runtime.session import Session
from firmware_bridge.safety.gate_settings import TICK
from firmware_bridge.safety.gate_table import GateState
from kmpc_lab.attacks.floods import Flood, Surface
from kmpc_lab.attacks.vehicle import SPEED, sections

PERIOD = 0.1
"""Of the controller [s]."""
CLEAN = 0.7
"""How long the robot drives before the attack [s]."""
HEAD_START = 0.15
"""From the beginning of the attack to the stop: the robot still moves [s]."""
PRESSED = 1.0
"""From the stop to the emergency stop [s]."""
STILL, WITHIN = 0.02, 0.05
"""A robot stands where it is slower than this [m/s] for so long [s]."""
PATIENCE = 30.0
"""For everything that must begin [s]."""


@dataclass
class Trial:
    """What was measured."""

    late: list[float] = field(default_factory=list)
    """How late each tick of the gate was while the attack lasted [s]."""
    standstill: float = math.nan
    """From the stop until the robot stands [s]; 0 if it had been stopped before."""
    press: float = math.nan
    """From the press of the emergency stop until the gate obeys [s]."""
    bytes_in: int = 0

    def late_p99(self) -> float:
        """Lateness that 99 % of the ticks do not exceed [s]."""
        return sorted(self.late)[max(0, math.ceil(0.99 * len(self.late)) - 1)]


class _Script:
    """Goes through a drive: asked once a tick whether it is over."""

    def __init__(self, session: Session, attackers: Sequence[IO[str]], presser: IO[str]) -> None:
        self._session, self._attackers, self._presser = session, attackers, presser
        self._began = time.monotonic()
        self._fast = self._attacked = self.stopped = self._pressed = math.inf
        self._last = math.nan
        self.late: list[float] = []
        self.obeyed = math.nan

    def __call__(self, seconds: float) -> bool:
        now, shot = time.monotonic(), self._session.loop.snapshot
        if self._attacked < now:
            self.late.append(max(0.0, now - self._last - TICK))
        self._last = now
        if shot is None:
            return False
        if self._attacked == math.inf:
            if shot.output.state is not GateState.ACTIVE or shot.output.v < 0.95 * SPEED:
                self._fast = now
            if now - self._fast > CLEAN:
                self._attacked = now
                tell(self._attackers, "on")
            return now - self._began > PATIENCE
        if self.stopped == math.inf and now - self._attacked > seconds:
            self.stopped = now
            self._session.gate.stop()
        elif self._pressed == math.inf and now - self.stopped > PRESSED:
            self._pressed = now
            tell([self._presser], "on")
        if math.isnan(self.obeyed) and shot.output.state is GateState.ESTOP:
            self.obeyed = shot.now
        obeyed = not math.isnan(self.obeyed)
        return now - self._pressed > (PRESSED if obeyed else PATIENCE)


def run(surface: Surface, floods: Sequence[Flood], seconds: float = HEAD_START) -> Trial:
    """Drive a robot straight ahead, attack it for `seconds` [s], and stop it while that lasts.

    Raises
    ------
    LinkError
        If the robot never drove.
    """
    with tempfile.TemporaryDirectory(prefix="kmpc-attack-") as name, ExitStack() as stack:
        folder = Path(name)
        kind = "udp" if surface.between == "udp" else "tcp"
        near, far = free_port(kind), free_port(kind)
        poses, source, station = (free_port("udp") for _ in range(3))
        relayed = any(flood.beside == "poses" for flood in floods)
        camera = f"udp:127.0.0.1:{source if relayed else poses}" if surface.poses else ""
        trace, path = folder / "trace", folder / "estop"
        served = f"{kind}:127.0.0.1:{far}"
        eye, seen = free_port("tcp"), free_port("tcp")
        where = (surface.lidar, f"tcp:127.0.0.1:{seen}" if surface.lidar else "")
        vehicle = stack.enter_context(
            child("vehicle", surface.driver, served, camera, str(trace), *where)
        )
        addresses: dict[str, tuple[object, ...]] = {
            surface.between: (near, far),
            "poses": (source, poses),
            "lidar": (eye, seen),
            "beside": (poses,),
            "hog": (path,),
            "idle": (path,),
            "station": (station,),
        }
        page = stack.enter_context(live_page(path)) if surface.page else None
        addresses["browsers"] = ("" if page is None else urlsplit(page.links[0]).port,)
        attackers = [
            stack.enter_context(attacker(folder, how, addresses[how], flood.rubbish()))
            for flood, how in ((flood, flood.beside or surface.between) for flood in floods)
        ]
        if all(flood.beside for flood in floods):  # nobody attacks the link: it is there
            stack.enter_context(attacker(folder, surface.between, (near, far), b""))
        if surface.lidar and not floods:
            stack.enter_context(attacker(folder, "lidar", addresses["lidar"], b""))
        press, where_to = ("press", path) if page is None else ("press_page", page.links[0])
        presser = stack.enter_context(attacker(folder, press, (where_to,), b""))
        table = sections(
            surface.driver,
            f"{kind}:127.0.0.1:{near}",
            f"udp:127.0.0.1:{poses}" if surface.poses else None,
            str(path),
            (surface.lidar, f"tcp:127.0.0.1:{eye}") if surface.lidar else None,
            f"udp:127.0.0.1:{station}?listen=1" if surface.shared else None,
        )
        with Session(load_robot(None, table), _ahead, PERIOD) as session:
            if page is not None:
                page.start(lambda: shown(session), {"title": "a robot under attack"})
            script = _Script(session, [input_of(a) for a in attackers], input_of(presser))
            session.drive(lambda: script(seconds))
            read = session.driver.health().counters.get("bytes_in", 0)
            tell([input_of(a) for a in attackers], "")
        if script.stopped == math.inf:
            raise LinkError(f"{surface.name}: the robot never drove: {', '.join(session.why())}")
        assert presser.stdout is not None
        pressed = float(presser.stdout.readline())
        input_of(vehicle).close()
        vehicle.wait()
        stood = standstill(trace, script.stopped)
        # in this order: where the gate never obeyed, that is no number, and stays none
        return Trial(script.late, stood, max(script.obeyed - pressed, 0.0), read)


def live_page(socket_path: Path) -> Feed:
    """Make a live page, at whatever port is free."""
    return Feed(LiveAddress(port=0), "firmware_bridge.live.page", {"socket": str(socket_path)})


def shown(session: Session) -> dict[str, Any]:
    """Give what a page shows of a session."""
    shot = session.loop.snapshot
    gate = "WAITING" if shot is None else shot.output.state.name
    pose = None if shot is None or shot.state is None else [shot.state.x, shot.state.y, 0.0]
    return {"latched": session.estop.latched, "gate": gate, "pose": pose}


def _ahead(state: State) -> VelocityCommand:
    """Drive straight ahead."""
    return VelocityCommand(SPEED, 0.0, time.monotonic())


def standstill(trace: Path, since: float) -> float:
    """How long after `since` [s] the robot of a trace stood."""
    rows = [tuple(map(float, line.split())) for line in trace.read_text().splitlines()]
    ahead = 0
    for t, x, y in rows:
        if t < since:
            continue
        while ahead < len(rows) and rows[ahead][0] < t + WITHIN:
            ahead += 1
        if ahead == len(rows):
            return math.inf
        later, x2, y2 = rows[ahead]
        if math.hypot(x2 - x, y2 - y) < STILL * (later - t):
            return t - since
    return math.inf


@contextmanager
def child(module: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run a module of this folder until the end of its standard input; it has said "ready"."""
    running = subprocess.Popen(
        [sys.executable, "-m", f"kmpc_lab.attacks.{module}", *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    try:
        assert running.stdout is not None
        if running.stdout.readline() != "ready\n":
            raise LinkError(f"{module} {' '.join(arguments)}: did not start")
        yield running
    finally:
        input_of(running).close()
        try:
            running.wait(5.0)
        except subprocess.TimeoutExpired:
            running.kill()
            running.wait()
        assert running.stdout is not None
        running.stdout.close()


@contextmanager
def attacker(
    folder: Path, kind: str, address: tuple[object, ...], rubbish: bytes
) -> Iterator[subprocess.Popen[str]]:
    """Run an attacker (attacker.KINDS) in a process of its own."""
    file = folder / f"rubbish-{kind}"
    file.write_bytes(rubbish)
    with child("attacker", kind, *map(str, address), str(file)) as running:
        yield running


def input_of(child: subprocess.Popen[str]) -> IO[str]:
    """Where a child reads."""
    assert child.stdin is not None
    return child.stdin


def tell(pipes: Sequence[IO[str]], word: str) -> None:
    """Say a word to children; an empty one ends them."""
    for pipe in pipes:
        if word:
            pipe.write(f"{word}\n")
            pipe.flush()
        else:
            pipe.close()


def free_port(kind: str) -> int:
    """Find a port of this computer that nobody uses."""
    sort = socket.SOCK_DGRAM if kind == "udp" else socket.SOCK_STREAM
    with socket.socket(socket.AF_INET, sort) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
