"""Asks a live page as a browser does, without one."""

from __future__ import annotations

import http.client
import json
import socket
import time
from contextlib import closing
from typing import Any
from urllib.parse import urlsplit


def ask(link: str, path: str = "", method: str = "GET", body: Any = None, **headers: str):
    """Status, text and headers of one request below a link."""
    url = urlsplit(link)
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    if url.fragment:
        named = {"X-Kmpc": url.fragment} | named
    with closing(http.client.HTTPConnection(url.hostname, url.port, timeout=20)) as connection:
        data = None if body is None else json.dumps(body)
        connection.request(method, url.path + path, data, named)
        answer = connection.getresponse()
        return answer.status, answer.read().decode(), dict(answer.getheaders())


def press(link: str, path: str, body: Any = None) -> dict[str, Any]:
    """What our own script gets for a button."""
    url = urlsplit(link)
    own = {"Origin": f"http://{url.netloc}", "Sec-Fetch-Site": "same-origin"}
    status, text, _ = ask(link, path, "POST", body or {}, **own)
    assert status == 200, (status, text)
    return json.loads(text)


def state(link: str) -> dict[str, Any]:
    """What the page shows."""
    return json.loads(ask(link, "state")[1])


def wait_for(link: str, condition, seconds: float = 30.0) -> dict[str, Any]:
    """Wait until what the page shows fulfils a condition."""
    until = time.monotonic() + seconds
    while not condition(shown := state(link)):
        assert time.monotonic() < until, shown
        time.sleep(0.05)
    return shown


class Stream:
    """A browser that watches."""

    def __init__(self, link: str) -> None:
        url = urlsplit(link)
        self.socket = socket.create_connection((url.hostname, url.port), timeout=20)
        head = f"Host: {url.netloc}\r\nX-Kmpc: {url.fragment}\r\n\r\n"
        self.socket.sendall(f"GET {url.path}events HTTP/1.1\r\n{head}".encode())
        self._file = self.socket.makefile("rb")
        while self._file.readline().strip():
            pass

    def next(self) -> dict[str, Any] | None:
        """The next event; None at the end."""
        while line := self._file.readline():
            if line.startswith(b"data: "):
                return json.loads(line[6:])
        return None

    def close(self) -> None:
        self._file.close()
        self.socket.close()
