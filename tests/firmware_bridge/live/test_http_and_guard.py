"""Requests of strangers, of other sites' pages, and of our own."""

import asyncio

import pytest

from firmware_bridge.live.guard import Guard, TwoActions
from firmware_bridge.live.http import LONGEST_HEAD, BadRequest, Request, read_request

TOKEN = "abcdefghjkmn"


def read(data: bytes) -> Request | None:
    async def go():
        reader = asyncio.StreamReader(limit=LONGEST_HEAD)
        reader.feed_data(data)
        reader.feed_eof()
        return await read_request(reader)

    return asyncio.run(go())


def test_a_request_is_read_with_its_body():
    found = read(b"POST /stop?x=1 HTTP/1.1\r\nHost: a\r\nContent-Length: 2\r\n\r\n{}rest")
    assert found is not None and (found.method, found.path, found.body) == ("POST", "/stop", b"{}")
    assert read(b"") is None


@pytest.mark.parametrize(
    ("data", "status"),
    [
        (b"GET", 400),
        (b"\x16\x03\x01\x02\x00\r\n\r\n", 400),
        (b"GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n", 400),
        (b"GET / HTTP/1.1\r\nA: " + b"x" * LONGEST_HEAD + b"\r\n\r\n", 431),
        (b"POST /stop HTTP/1.1\r\nContent-Length: 99999\r\n\r\n", 413),
        (b"POST /stop HTTP/1.1\r\nContent-Length: -1\r\n\r\n", 400),
        (b"POST /stop HTTP/1.1\r\nContent-Length: 5\r\n\r\nabc", 400),
        (b"POST /stop HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n", 501),
    ],
)
def test_what_is_malformed_or_too_long_is_refused(data, status):
    with pytest.raises(BadRequest) as refused:
        read(data)
    assert refused.value.status == status


def test_a_body_that_is_no_object_is_refused():
    for body in (b"[]", b"{", b"[" * 1000):
        with pytest.raises(BadRequest):
            Request("POST", "/second", {}, body).json()


def enter(guard: Guard, path: str = "/", method: str = "GET", **headers: str):
    return guard.enter(Request(method, path, {k.replace("_", "-"): v for k, v in headers.items()}))


def refused(guard: Guard, *what: str, **headers: str) -> bool:
    try:
        enter(guard, *what, **headers)
    except BadRequest as error:
        return error.status == 403
    return False


def test_on_this_computer_one_may_watch_without_the_token_and_elsewhere_not():
    ours, far = Guard(TOKEN, True, ["localhost"]), Guard(TOKEN, False, ["localhost", "pi.local"])
    assert enter(ours, "/events", host="127.0.0.1:8764") is False
    assert enter(ours, "/events", host="localhost:8764", x_kmpc=TOKEN) is True
    assert enter(far, "/events", host="192.168.1.5:8764", x_kmpc=TOKEN) is True
    assert enter(far, "/events", host="pi.local:8764", x_kmpc=TOKEN) is True
    for path in ("/", "/events", "/stop", f"/{TOKEN}/", f"/{TOKEN}/events"):
        assert refused(far, path, host="192.168.1.5:8764"), path
    for shown in ("", "1", TOKEN[:-1], f"{TOKEN}x", "é"):
        assert refused(far, "/events", host="192.168.1.5:8764", x_kmpc=shown), shown


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8764", "", "127.0.0.1.evil.example"]
)
def test_a_name_of_a_stranger_that_leads_here_is_refused(host):
    """DNS rebinding: the page of evil.example suddenly speaks to this computer."""
    assert refused(Guard(TOKEN, True, ["localhost"]), "/events", host=host)
    assert refused(Guard(TOKEN, True, ["localhost"]), "/events", host=host, x_kmpc=TOKEN)


def test_what_the_page_of_another_site_sends_is_refused():
    guard, host = Guard(TOKEN, True, ["localhost"]), "localhost:8764"
    for origin in (
        "http://evil.example",
        "null",
        "http://localhost:9999",
        "https://localhost:8764",
    ):
        assert refused(guard, "/stop", "POST", host=host, origin=origin), origin
        assert refused(guard, "/events", "GET", host=host, origin=origin), origin
    assert refused(guard, "/stop", "POST", host=host, sec_fetch_site="cross-site")
    assert not enter(guard, "/stop", "POST", host=host, origin=f"http://{host}")
    assert not enter(guard, "/stop", "POST", host=host)  # curl


def test_the_second_action_counts_once_and_within_five_seconds_of_the_first():
    now = [100.0]
    two = TwoActions(lambda: now[0])
    assert not two.second("") and not two.second(None)
    for wait, counts in ((0.1, False), (0.3, True), (4.9, True), (5.1, False)):
        code = two.first()
        now[0] += wait
        assert two.second(code) is counts, wait
        assert not two.second(code)
    code = two.first()
    now[0] += 1.0
    assert not two.second("é" * 16) and not two.second(code)  # a wrong one uses it up
