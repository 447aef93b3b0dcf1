"""As much of HTTP/1.1 as a page needs: bounded requests and their answers."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Mapping
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any

LONGEST_HEAD, LONGEST_BODY = 8192, 1024
"""Of a request [bytes]."""
PATIENCE = 5.0
"""How long a client may take to say what it wants [s]."""
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


class BadRequest(Exception):
    """What came is no request that is served."""

    def __init__(self, status: HTTPStatus, text: str) -> None:
        super().__init__(text)
        self.status = status


@dataclass(frozen=True)
class Request:
    """What a client asks for."""

    method: str
    path: str
    """Without what stands behind a question mark."""
    headers: Mapping[str, str]
    """Names in lower case."""
    body: bytes = b""

    @property
    def may_keep(self) -> bool:
        """Whether the client would send more on the same connection."""
        return self.headers.get("connection", "keep-alive").lower() == "keep-alive"

    def json(self) -> dict[str, Any]:
        """Give the body as an object; BadRequest where it is none."""
        try:
            value = json.loads(self.body or b"{}")
        except (ValueError, RecursionError):
            value = None
        if not isinstance(value, dict):
            raise BadRequest(HTTPStatus.BAD_REQUEST, "expected a JSON object")
        return value


async def read_request(reader: asyncio.StreamReader, patience: float = PATIENCE) -> Request | None:
    """Read one request within so long [s]; None if the client left without a word.

    Raises
    ------
    BadRequest
        For anything that is malformed, too long, or of another protocol.
    TimeoutError
        If it takes too long.
    """
    async with asyncio.timeout(patience):
        try:
            head = await reader.readuntil(b"\r\n\r\n")
        except asyncio.IncompleteReadError as error:
            if not error.partial:
                return None
            raise BadRequest(HTTPStatus.BAD_REQUEST, "half a request") from error
        except asyncio.LimitOverrunError as error:
            raise BadRequest(
                HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE, "the request is too long"
            ) from error
        request = _parse(head)
        size = _body_size(request.headers)
        if not size:
            return request
        try:
            body = await reader.readexactly(size)
        except asyncio.IncompleteReadError as error:
            raise BadRequest(HTTPStatus.BAD_REQUEST, "half a body") from error
    return Request(request.method, request.path, request.headers, body)


def _parse(head: bytes) -> Request:
    r"""Take the head of a request apart.

    Examples
    --------
    >>> _parse(b"GET /x?a=1 HTTP/1.1\r\nHost: a:1\r\n\r\n")
    Request(method='GET', path='/x', headers={'host': 'a:1'}, body=b'')
    """
    first, *lines = head[:-4].decode("latin-1").split("\r\n")
    words = first.split(" ")
    if len(words) != 3 or not words[1].startswith("/") or not words[2].startswith("HTTP/1."):
        raise BadRequest(HTTPStatus.BAD_REQUEST, "expected an HTTP/1.1 request")
    headers: dict[str, str] = {}
    for line in lines:
        name, colon, value = line.partition(":")
        name = name.lower()
        if not colon or not name or name != name.strip() or name in headers:
            # a header that is folded, or given twice, is read differently by different programs
            raise BadRequest(HTTPStatus.BAD_REQUEST, "malformed headers")
        headers[name] = value.strip()
    return Request(words[0], words[1].partition("?")[0], headers)


def _body_size(headers: Mapping[str, str]) -> int:
    """Bytes of the body that follow."""
    if "transfer-encoding" in headers:
        raise BadRequest(HTTPStatus.NOT_IMPLEMENTED, "expected a Content-Length")
    text = headers.get("content-length", "0")
    if not (text.isascii() and text.isdigit() and len(text) < 10):
        raise BadRequest(HTTPStatus.BAD_REQUEST, "malformed Content-Length")
    if int(text) > LONGEST_BODY:
        raise BadRequest(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "the body is too long")
    return int(text)


def answer(
    status: HTTPStatus, body: bytes, kind: str = "text/plain; charset=utf-8", keep: bool = False
) -> bytes:
    """Write an answer, after which the connection is closed but where it is kept."""
    headers = {
        "Content-Type": kind,
        "Content-Length": str(len(body)),
        "Connection": "keep-alive" if keep else "close",
        **SAFETY,
    }
    return _head(status, headers) + body


def stream_head() -> bytes:
    """Write the beginning of a stream of events."""
    kind = {"Content-Type": "text/event-stream", "Connection": "close", "X-Accel-Buffering": "no"}
    return _head(HTTPStatus.OK, {**kind, **SAFETY})


def _head(status: HTTPStatus, headers: Mapping[str, str]) -> bytes:
    lines = [f"HTTP/1.1 {status.value} {status.phrase}"]
    lines += [f"{name}: {value}" for name, value in headers.items()]
    return ("\r\n".join(lines) + "\r\n\r\n").encode("latin-1")
