"""Serves the page, the stream of what happens, and the buttons; in a process of its own.

The process that drives is never asked anything here: it sends packets through a channel. The
buttons go the way that the program has for them: `Ask`.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import os
import resource
import socket
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from http import HTTPStatus
from pathlib import Path
from typing import Any

from firmware_bridge.live.channel import Channel
from firmware_bridge.live.door import Door
from firmware_bridge.live.guard import Guard, TwoActions
from firmware_bridge.live.http import (
    LONGEST_HEAD,
    BadRequest,
    Request,
    answer,
    read_request,
    stream_head,
)
from firmware_bridge.live.watchers import Picture, Watchers

Ask = Callable[[str], dict[str, Any]]
"""Carries out "stop", "reset", "enable" or "goal X Y THETA", however long that takes; gives the
answer: ok, latched, gate, confirmed, why."""
GOAL = "goal "
CONNECTIONS = 512
"""One more closes the oldest that watches nothing."""
LINES = 64
"""Connections that are kept for a STOP."""
LINE_PACE, LINE_PATIENCE = 0.5, 30.0
"""How soon each may be used again but for that, and for how long it may say nothing [s]."""
ASKING = 4
"""Requests of people that are carried out at once; stops share one."""
SILENCE = 0.5
"""Watchers see how long nothing has come from the program that drives, so often [s]."""
OBEY = 1.0
"""How long the gate may take to carry out a reset: only then does an enable count [s]."""
STOPPED = "ESTOP"
"""State of a gate whose emergency stop is pressed."""
FAREWELL = 0.5
"""For the last words to leave [s]."""
STATIC = Path(__file__).with_name("static")
FILES = {
    "/": ("index.html", "text/html; charset=utf-8"),
    "/page.css": ("page.css", "text/css; charset=utf-8"),
    "/page.js": ("page.js", "text/javascript; charset=utf-8"),
    "/map.js": ("map.js", "text/javascript; charset=utf-8"),
}


class Server:
    """One page.

    Parameters
    ----------
    guard : Guard
        Who may come in.
    picture : Picture
        What is shown.
    ask : callable
        See `Ask`.
    """

    def __init__(self, guard: Guard, picture: Picture, ask: Ask) -> None:
        self._guard, self._picture, self._ask = guard, picture, ask
        self.watchers = Watchers(picture)
        self._two = TwoActions()
        self._goal = ""
        """What the second action carries out: a goal, else it lets the robot drive."""
        self._pool = ThreadPoolExecutor(ASKING, thread_name_prefix="live-ask")
        self._stopping: asyncio.Task[dict[str, Any]] | None = None
        self._idle: dict[asyncio.StreamWriter, None] = {}
        """Connections that watch nothing, the oldest first."""
        self._lines: dict[asyncio.StreamWriter, float] = {}
        """Those that are kept, and when each was used last [s]: a page asks for one, on which its
        STOP meets no crowd."""
        self._files = {path: (STATIC / name).read_bytes() for path, (name, _) in FILES.items()}

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer one connection, whatever it says."""
        self._idle[writer] = None
        if len(self._idle) + len(self._lines) + len(self.watchers) > CONNECTIONS:
            next(iter(self._idle)).transport.abort()
        try:
            await self._answer(reader, writer)
        except (TimeoutError, OSError):
            pass  # it said nothing in time, or has gone
        finally:
            self._idle.pop(writer, None)
            self._lines.pop(writer, None)
            with contextlib.suppress(OSError):
                writer.close()

    async def _answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            request = await read_request(reader)
            while request is not None:
                path = request.path
                public = request.method == "GET" and path in FILES
                with_token = self._guard.enter(request, public)
                if (request.method, path) == ("GET", "/events"):
                    await self._stream(reader, writer)
                    return
                keep = request.may_keep and self._keeps(path, writer)
                writer.write(await self._reply(request, path, with_token, keep))
                await asyncio.wait_for(writer.drain(), FAREWELL)
                request = await read_request(reader, LINE_PATIENCE) if keep else None
        except BadRequest as refused:
            writer.write(answer(refused.status, f"{refused}\n".encode()))
            await asyncio.wait_for(writer.drain(), FAREWELL)

    def _keeps(self, path: str, writer: asyncio.StreamWriter) -> bool:
        """Whether a connection is kept for a STOP: nothing else goes through it, nor too often."""
        now = time.monotonic()
        last = self._lines.get(writer)
        if path == "/stop":
            return last is not None
        too_soon = last is not None and now - last < LINE_PACE
        if path != "/line" or too_soon or (last is None and len(self._lines) >= LINES):
            return False
        self._idle.pop(writer, None)
        self._lines[writer] = now
        return True

    async def _reply(self, request: Request, path: str, with_token: bool, keep: bool) -> bytes:
        if request.method == "GET":
            if path in FILES:
                return answer(HTTPStatus.OK, self._files[path], FILES[path][1])
            if path == "/state":
                return _json(self._picture.whole())
            raise BadRequest(HTTPStatus.NOT_FOUND, "no such page")
        if request.method != "POST" or path not in ("/line", "/stop", "/first", "/second"):
            raise BadRequest(HTTPStatus.METHOD_NOT_ALLOWED, "no such button")
        if path == "/line":
            return _json("{}", keep)
        if path == "/stop":
            return _json(json.dumps(await self._stop()), keep)
        if not with_token:
            raise BadRequest(
                HTTPStatus.FORBIDDEN, "open the link with the token to let the robot drive"
            )
        if path == "/first":
            self._goal = _goal_of(request.json())
            return _json(json.dumps({"code": self._two.first()}))
        if not self._two.second(request.json().get("code")):
            raise BadRequest(HTTPStatus.CONFLICT, "confirm within 5 s after holding the button")
        done = self._carry_out(self._goal) if self._goal else self._enable()
        return _json(json.dumps(await done))

    async def _stop(self) -> dict[str, Any]:
        """Press the emergency stop; whoever presses while that lasts gets the same answer."""
        if self._stopping is None or self._stopping.done():
            self._stopping = asyncio.create_task(self._carry_out("stop"))
        return await asyncio.shield(self._stopping)

    async def _enable(self) -> dict[str, Any]:
        """Clear a stop if one is pressed, then let the robot drive, as `kmpc estop` does."""
        told = await self._carry_out("status")
        if told.get("latched"):
            told = await self._carry_out("reset")
            until = time.monotonic() + OBEY
            while told.get("ok") and told.get("gate") == STOPPED and time.monotonic() < until:
                await asyncio.sleep(OBEY / 20)
                told = await self._carry_out("status")
            if not told.get("ok"):
                return told
        return await self._carry_out("enable")

    async def _carry_out(self, word: str) -> dict[str, Any]:
        loop = asyncio.get_running_loop()
        try:
            return await loop.run_in_executor(self._pool, self._ask, word)
        except Exception as error:  # every error is shown on the page
            unknown = {"ok": False, "latched": False, "gate": None, "confirmed": False}
            return {**unknown, "why": [str(error)]}

    async def _stream(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Let a browser watch until it goes."""
        writer.write(stream_head())
        watcher = self.watchers.add(writer)
        if watcher is None:
            writer.write(b'data: {"full":true}\n\n')
            return
        for others in (self._idle, self._lines):
            others.pop(writer, None)
        try:
            while await reader.read(LONGEST_HEAD):  # what it says is not heard
                pass
        finally:
            self.watchers.remove(watcher)

    async def take(self, channel: Channel, doors: Sequence[Door]) -> None:
        """Take packets from the program that drives, until it ends."""
        loop, arrived = asyncio.get_running_loop(), asyncio.Event()
        loop.add_reader(channel.socket, arrived.set)
        try:
            while True:
                try:
                    await asyncio.wait_for(arrived.wait(), SILENCE)
                except TimeoutError:
                    for door in doors:
                        door.tidy()
                    self.watchers.tell(f'{{"silence":{self._picture.age:.1f}}}')
                    continue
                arrived.clear()
                for door in doors:
                    door.tidy()
                while (packet := channel.receive()) is not None:
                    self.watchers.tell(self._picture.take(packet))
        except EOFError:
            if not self._picture.over:
                self.watchers.tell(self._picture.take({"lost": True}))
        finally:
            loop.remove_reader(channel.socket)


def _goal_of(asked: dict[str, Any]) -> str:
    """Word of a goal [m, m, rad] that was clicked; empty without one.

    Raises
    ------
    BadRequest
        For what is no pose.
    """
    if (goal := asked.get("goal")) is None:
        return ""
    try:
        x, y, theta = map(float, goal)
    except (TypeError, ValueError):
        x = y = theta = math.nan
    if not all(map(math.isfinite, (x, y, theta))):
        raise BadRequest(HTTPStatus.BAD_REQUEST, "expected a goal: x, y, theta")
    return f"{GOAL}{x:.4f} {y:.4f} {theta:.4f}"


def _json(text: str, keep: bool = False) -> bytes:
    return answer(HTTPStatus.OK, text.encode(), "application/json", keep)


async def _run(channel: Channel, doors: list[socket.socket], server: Server) -> None:
    opened = [Door(listener, server.serve) for listener in doors]
    for door in opened:
        door.open()
    await server.take(channel, opened)
    await asyncio.sleep(FAREWELL)
    os._exit(0)  # remaining viewers and requests delay nothing


def serve(descriptor: int, make_ask: Callable[[Channel, Picture, dict[str, Any]], Ask]) -> None:
    """Serve a page until the program that drives ends.

    Parameters
    ----------
    descriptor : int
        Of the channel; its first packet holds the settings: token, open, names, doors, and what
        `make_ask` wants.
    make_ask : callable
        Makes the way by which the buttons go, of channel, picture and settings.
    """
    channel = Channel.inherited(descriptor)
    channel.socket.setblocking(True)
    settings = channel.receive()
    channel.socket.setblocking(False)
    assert settings is not None
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    picture = Picture()
    guard = Guard(settings["token"], settings["open"], settings["names"])
    doors = [socket.socket(fileno=number) for number in settings["doors"]]
    ask = make_ask(channel, picture, settings)
    asyncio.run(_run(channel, doors, Server(guard, picture, ask)))
