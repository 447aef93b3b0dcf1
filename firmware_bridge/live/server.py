"""Serves the page, the stream of what happens, and the buttons; in a process of its own.

The process that drives is never asked anything here: it sends packets through a channel. The
buttons go the way that the program has for them: `Ask`. Each connection has a thread; who floods
the port makes us close its oldest connections, but none that watches or is kept for a STOP.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import select
import socket
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from firmware_bridge.live.channel import Channel
from firmware_bridge.live.guard import Guard, Refused, TwoActions
from firmware_bridge.live.picture import Picture

Ask = Callable[[str], dict[str, Any]]
"""Carries out "stop", "reset", "enable" or "goal X Y THETA", however long that takes; gives the
answer: ok, latched, gate, confirmed, why."""
GOAL = "goal "
STOPPED = "ESTOP"  # state of a gate whose emergency stop is pressed
CONNECTIONS, LINES, WATCHERS, ASKING = 256, 64, 128, 4
"""At once: those that have asked for nothing lasting, those that are kept for a STOP, those that
watch, and requests of people that are carried out; stops share one."""
PATIENCE, LINE_PATIENCE = 5.0, 30.0
"""How long a client may say or take nothing, and how long on a line that is kept [s]."""
LONGEST_BODY = 1024  # [bytes]
BUFFER = 65536  # of the kernel's, for one watcher [bytes]: what waits there is old
SILENCE = 0.5  # watchers see how long nothing has come from the program that drives, so often [s]
OBEY = 1.0  # how long the gate may take to carry out a reset: only then does an enable count [s]
FAREWELL = 0.5  # for the last words to leave [s]
STATIC = Path(__file__).with_name("static")
FILES = {
    "/": ("index.html", "text/html; charset=utf-8"),
    "/page.css": ("page.css", "text/css; charset=utf-8"),
    "/page.js": ("page.js", "text/javascript; charset=utf-8"),
    "/map.js": ("map.js", "text/javascript; charset=utf-8"),
}
JSON = "application/json"
SAFETY = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; "
    "img-src 'self'; connect-src 'self'; form-action 'self'; frame-ancestors 'none'; "
    "base-uri 'none'",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "same-origin",  # with no-referrer a form would not tell its origin either
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
"""Headers of every answer."""


class Buttons:
    """What the page's buttons do.

    `ask`: see `Ask`.
    """

    def __init__(self, ask: Ask) -> None:
        self._ask = ask
        self._two = TwoActions()
        self._goal = ""  # what the second action carries out: a goal, else it lets the robot drive
        self._few, self._lock = threading.Semaphore(ASKING), threading.Lock()
        self._stopping: Future[dict[str, Any]] = Future()
        self._stopping.set_result({})

    def stop(self) -> dict[str, Any]:
        """Press the emergency stop; whoever presses while that lasts gets the same answer."""
        with self._lock:
            if mine := self._stopping.done():
                self._stopping = Future()
            running = self._stopping
        if mine:
            running.set_result(self._carry_out("stop"))
        return running.result()

    def first(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Take the first of two actions; its goal [m, m, rad] may have been clicked."""
        goal = ""
        if (pose := asked.get("goal")) is not None:
            try:
                x, y, theta = map(float, pose)
            except (TypeError, ValueError):
                x = y = theta = math.nan
            if not all(map(math.isfinite, (x, y, theta))):
                raise Refused(HTTPStatus.BAD_REQUEST, "expected a goal: x, y, theta")
            goal = f"{GOAL}{x:.4f} {y:.4f} {theta:.4f}"
        with self._lock:
            self._goal = goal
            return {"code": self._two.first()}

    def second(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Carry out what two actions asked for."""
        with self._lock:
            goal, counts = self._goal, self._two.second(asked.get("code"))
        if not counts:
            raise Refused(HTTPStatus.CONFLICT, "confirm within 5 s after holding the button")
        with self._few:
            return self._carry_out(goal) if goal else self._enable()

    def _enable(self) -> dict[str, Any]:
        """Clear a stop if one is pressed, then let the robot drive, as `kmpc estop` does."""
        if self._carry_out("status").get("latched"):
            told = self._carry_out("reset")
            until = time.monotonic() + OBEY
            while told.get("ok") and told.get("gate") == STOPPED and time.monotonic() < until:
                time.sleep(OBEY / 20)
                told = self._carry_out("status")
            if not told.get("ok"):
                return told
        return self._carry_out("enable")

    def _carry_out(self, word: str) -> dict[str, Any]:
        try:
            return self._ask(word)
        except Exception as error:  # every error is shown on the page
            unknown = {"ok": False, "latched": False, "gate": None, "confirmed": False}
            return {**unknown, "why": [str(error)]}


class Server(ThreadingHTTPServer):
    """One page behind one listening socket.

    `listener`: listens already. `guard`: who may come in. `picture`: what is shown. `buttons`: what
    can be asked for.
    """

    def __init__(
        self, listener: socket.socket, guard: Guard, picture: Picture, buttons: Buttons
    ) -> None:
        super().__init__(("", 0), Handler, bind_and_activate=False)
        self.socket.close()
        self.socket = listener
        listener.listen(CONNECTIONS)
        self.guard, self.picture, self.buttons = guard, picture, buttons
        self.files = {path: (STATIC / name).read_bytes() for path, (name, _) in FILES.items()}
        self.watchers, self.lines = threading.Semaphore(WATCHERS), threading.Semaphore(LINES)
        self.idle: dict[Any, None] = {}
        """Connections that neither watch nor are kept, the oldest first."""

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer one more connection; the oldest idle one goes where there are too many."""
        self.idle[request] = None
        for oldest in list(self.idle)[:-CONNECTIONS]:
            self.idle.pop(oldest, None)
            with contextlib.suppress(OSError):  # it may have gone already
                oldest.shutdown(socket.SHUT_RDWR)
        super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        """Forget a connection."""
        self.idle.pop(request, None)
        super().shutdown_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that has gone is no news; what else fails is said on stderr."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class Handler(BaseHTTPRequestHandler):
    """Answers one connection, whatever it says."""

    server: Server
    protocol_version = "HTTP/1.1"
    timeout = PATIENCE
    disable_nagle_algorithm = True
    is_line = False  # kept for a STOP: a page asks for one, on which its STOP meets no crowd

    def do_GET(self) -> None:
        """Give a file, the picture, or the stream of its changes."""
        self._answer(self._get)

    def do_POST(self) -> None:
        """Obey a button."""
        self._answer(self._post)

    def end_headers(self) -> None:
        """Say what the browser may do with the answer."""
        for name, value in SAFETY.items():
            self.send_header(name, value)
        super().end_headers()

    def version_string(self) -> str:
        """Tell nobody which Python this is."""
        return "kmpc"

    def log_message(self, format: str, *args: Any) -> None:
        """Requests are no news."""

    def finish(self) -> None:
        """Give a line back."""
        if self.is_line:
            self.server.lines.release()
        super().finish()

    def _answer(self, answer: Callable[[str, bool], None]) -> None:
        path = self.path.partition("?")[0]
        public = self.command == "GET" and path in FILES
        try:
            names = [name.lower() for name in self.headers]
            if len(set(names)) < len(names) or "transfer-encoding" in names:
                raise Refused(HTTPStatus.BAD_REQUEST, "malformed headers")
            answer(path, self.server.guard.enter(self.command, self.headers, public))
        except Refused as refused:
            self._send(f"{refused}\n".encode(), "text/plain; charset=utf-8", refused.status)

    def _send(self, body: bytes, kind: str, status: HTTPStatus = HTTPStatus.OK) -> None:
        keep = self.is_line and status == HTTPStatus.OK
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Connection", "keep-alive" if keep else "close")
        self.end_headers()
        self.wfile.write(body)

    def _get(self, path: str, with_token: bool) -> None:
        if path in FILES:
            self._send(self.server.files[path], FILES[path][1])
        elif path == "/state":
            self._send(self.server.picture.whole().encode(), JSON)
        elif path == "/events":
            self._watch()
        else:
            raise Refused(HTTPStatus.NOT_FOUND, "no such page")

    def _post(self, path: str, with_token: bool) -> None:
        asked, buttons = self._body(), self.server.buttons
        answer: dict[str, Any] = {}
        if path == "/line":
            self._keep()
        elif path == "/stop":
            answer = buttons.stop()
        elif path not in ("/first", "/second"):
            raise Refused(HTTPStatus.METHOD_NOT_ALLOWED, "no such button")
        elif not with_token:
            raise Refused(
                HTTPStatus.FORBIDDEN, "open the link with the token to let the robot drive"
            )
        else:
            answer = (buttons.first if path == "/first" else buttons.second)(asked)
        self._send(json.dumps(answer).encode(), JSON)

    def _body(self) -> dict[str, Any]:
        text = self.headers.get("Content-Length", "0")
        if not (text.isascii() and text.isdigit() and len(text) < 10):
            raise Refused(HTTPStatus.BAD_REQUEST, "malformed Content-Length")
        if int(text) > LONGEST_BODY:
            raise Refused(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "the body is too long")
        try:
            value = json.loads(self.rfile.read(int(text)) or b"{}")
        except (ValueError, RecursionError):
            value = None
        if not isinstance(value, dict):
            raise Refused(HTTPStatus.BAD_REQUEST, "expected an object of JSON")
        return value

    def _keep(self) -> None:
        if self.is_line or not self.server.lines.acquire(blocking=False):
            return
        self.is_line = True
        self.server.idle.pop(self.connection, None)
        self.connection.settimeout(LINE_PATIENCE)

    def _watch(self) -> None:
        """Send what is new as fast as the browser takes it, until it goes or is stuck."""
        self.close_connection = True
        admitted = self.server.watchers.acquire(blocking=False)
        try:
            self.send_response(HTTPStatus.OK)
            self.send_header("Content-Type", "text/event-stream")
            self.send_header("X-Accel-Buffering", "no")
            self.end_headers()
            if not admitted:
                self.wfile.write(b'data: {"full":true}\n\n')
                return
            self.server.idle.pop(self.connection, None)
            self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER)
            version = 0
            while True:
                text, version = self.server.picture.since(version, SILENCE)
                self.wfile.write(f"data: {text}\n\n".encode())
        finally:
            if admitted:
                self.server.watchers.release()


def serve(descriptor: int, make_ask: Callable[[Channel, Picture, dict[str, Any]], Ask]) -> None:
    """Serve a page until the program that drives ends.

    `descriptor`: of the channel; its first packet holds the settings: token, open, names, doors,
    and what `make_ask` wants. `make_ask`: makes the way by which the buttons go, of channel,
    picture and settings.
    """
    channel, picture = Channel.inherited(descriptor), Picture()
    select.select([channel.socket], [], [])
    settings = channel.receive()
    assert settings is not None
    guard = Guard(settings["token"], settings["open"], settings["names"])
    buttons = Buttons(make_ask(channel, picture, settings))
    for number in settings["doors"]:
        server = Server(socket.socket(fileno=number), guard, picture, buttons)
        threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        while True:
            select.select([channel.socket], [], [])
            while (packet := channel.receive()) is not None:
                picture.take(packet)
    except EOFError:
        if not picture.over:
            picture.take({"lost": True})
    time.sleep(FAREWELL)
    os._exit(0)  # remaining viewers and requests delay nothing
