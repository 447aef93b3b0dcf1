"""The page's process: what it serves, to whom, and which watcher is dropped."""

import contextlib
import http.client
import socket
import time
from urllib.parse import urlsplit

import pytest
from browsing import Stream, ask, press, state, wait_for

from firmware_bridge.live.address import LiveAddress, LiveError, is_loopback
from firmware_bridge.live.feed import Feed
from firmware_bridge.live.server import WATCHERS as MOST


class Robot:
    """What a simulated drive leaves for the page."""

    def __init__(self) -> None:
        self.words: list[str] = []
        self.more: dict = {}

    def hear(self, word: str) -> None:
        self.words.append(word)

    def packet(self) -> dict:
        last = self.words[-1] if self.words else "enable"
        gate = {"stop": "ESTOP", "reset": "IDLE", "enable": "ACTIVE"}[last]
        return {"latched": last == "stop", "gate": gate, **self.more}


@contextlib.contextmanager
def served(host: str = "127.0.0.1"):
    robot = Robot()
    with Feed(LiveAddress(host, 0), "firmware_bridge.live", on_word=robot.hear) as feed:
        feed.start(robot.packet, {"title": "a"})
        link = feed.links[0]
        if host == "0.0.0.0":
            url = urlsplit(link)
            link = f"http://127.0.0.1:{url.port}/#{url.fragment}"
        wait_for(link, lambda shown: "gate" in shown)
        yield link, robot, feed


def test_stop_is_confirmed_and_driving_again_takes_two_actions():
    with served() as (link, robot, _):
        assert press(link, "stop")["confirmed"]
        code = press(link, "first")["code"]
        time.sleep(0.3)
        assert press(link, "second", {"code": code})["ok"]
        wait_for(link, lambda shown: shown["gate"] == "ACTIVE")
        assert robot.words == ["stop", "reset", "enable"]
        url = urlsplit(link)
        own = {"Origin": f"http://{url.netloc}"}
        for path, body, status in (("second", {"code": code}, 409), ("second", {}, 409)):
            assert ask(link, path, "POST", body, **own)[0] == status
        bare = f"http://{url.netloc}/"
        assert ask(bare, "first", "POST", {}, **own)[0] == 403  # without the token
        assert ask(bare, "first", "POST", {}, X_Kmpc="guess", **own)[0] == 403
        assert ask(f"{bare}{url.fragment}/", "first", "POST", {}, **own)[0] in (403, 405)
        assert ask(bare, "stop", "POST")[0] == 200  # anybody on this computer may stop it
        assert robot.words == ["stop", "reset", "enable", "stop"]


def test_the_page_runs_no_script_but_its_own_and_says_so_to_the_browser():
    with served() as (link, _, _):
        for path in ("", "page.js", "map.js", "page.css"):
            status, text, headers = ask(link, path)
            assert status == 200 and text
            assert "script-src 'self'" in headers["Content-Security-Policy"]
            assert headers["X-Content-Type-Options"] == "nosniff"
            assert "Access-Control-Allow-Origin" not in headers
        html = ask(link)[1]
        assert "<script>" not in html and "onclick" not in html and "style=" not in html
        script = ask(link, "page.js")[1] + ask(link, "map.js")[1]
        assert "innerHTML" not in script and "eval(" not in script
        for path, method in (
            ("../server.py", "GET"),
            ("etc", "GET"),
            ("stop", "GET"),
            ("etc", "POST"),
        ):
            assert ask(link, path, method)[0] in (403, 404, 405)


MALFORMED = [
    (b"GET", 400),
    (b"\x16\x03\x01\x02\x00", 400),
    (b"GET /state HTTP/1.1\r\nHost: 127.0.0.1\r\nHost: b", 400),
    (b"GET /state HTTP/1.1\r\nA: " + b"x" * 70_000, 431),
    (b"GET /state HTTP/1.1\r\nHost: evil.example", 403),
    (b"DELETE /state HTTP/1.1\r\nHost: 127.0.0.1", 501),
    (b"POST /stop HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 99999", 413),
    (b"POST /stop HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: -1", 400),
    (b"POST /stop HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 3\r\n\r\n[1]", 400),
    (b"POST /stop HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked", 400),
]


def test_what_is_malformed_or_too_long_is_refused():
    with served() as (link, robot, _):
        url = urlsplit(link)
        for data, status in MALFORMED:
            with socket.create_connection((url.hostname, url.port), timeout=20) as sock:
                sock.sendall(data + b"\r\n\r\n")
                assert f" {status} ".encode() in sock.recv(1000), data[:60]
        assert not robot.words


def test_on_other_interfaces_nothing_is_reported_without_the_token():
    with served("0.0.0.0") as (link, robot, _):
        url = urlsplit(link)
        for path in ("state", "events", "etc"):
            assert ask(f"http://{url.netloc}/", path)[0] == 403
        for path in ("", "page.js"):  # the same for everybody, and tells nothing
            assert ask(f"http://{url.netloc}/", path)[0] == 200
        assert "#" in link and url.fragment not in f"{url.path}{url.query}"
        assert ask(f"http://{url.netloc}/", "stop", "POST")[0] == 403 and not robot.words
        assert state(link)["title"] == "a"


def test_watchers_are_informed_when_the_drive_falls_silent_and_when_it_ends():
    with served() as (link, robot, feed):
        stream = Stream(link)
        assert "title" in stream.next()
        feed._quit.set()
        while "silence" not in (told := stream.next()):
            pass
        assert told["silence"] >= 0.5
        feed.say({"over": "reached"})
        while "over" not in stream.next():
            pass
        stream.close()


def test_a_stuck_watcher_does_not_block_others_and_too_many_are_turned_away():
    with served() as (link, robot, _):
        stuck = Stream(link)
        stuck.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        many = [Stream(link) for _ in range(MOST - 1)]
        late = Stream(link)
        assert late.next() == {"full": True} and late.next() is None
        robot.more = {"filling": "x" * 400, "numbers": [float(k) for k in range(2000)]}
        wait_for(link, lambda shown: "filling" in shown)
        for k in range(5):
            robot.more = {"k": k, "numbers": [float(k + j) for j in range(2000)]}
            wait_for(link, lambda shown, k=k: shown.get("k") == k)
        while (told := many[0].next()).get("k") != 4:
            assert told is not None
        assert press(link, "stop")["confirmed"]
        for stream in (stuck, late, *many):
            stream.close()


def line(link: str):
    """A connection that is kept, and what it is asked."""
    url = urlsplit(link)
    connection = http.client.HTTPConnection(url.hostname, url.port, timeout=20)

    def post(path: str) -> str | None:
        connection.request("POST", url.path + path)
        answer = connection.getresponse()
        answer.read()
        return answer.headers["Connection"]

    return connection, post


def test_a_page_keeps_a_connection_for_its_stop_however_many_others_come():
    with served() as (link, robot, _), contextlib.ExitStack() as crowd:
        url = urlsplit(link)
        connection, post = line(link)
        assert post("line") == "keep-alive"
        kept = connection.sock
        for _ in range(600):  # more than are served, and no more than the kernel keeps waiting
            sock = crowd.enter_context(socket.socket())
            sock.setblocking(False)
            sock.connect_ex((url.hostname, url.port))
        assert post("stop") == post("stop") == "keep-alive" and connection.sock is kept
        assert set(robot.words) == {"stop"}
        time.sleep(0.6)
        assert post("line") == "keep-alive" and connection.sock is kept
        connection.close()


def test_an_address_that_cannot_be_had_is_reported_with_its_option():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        with pytest.raises(LiveError, match="--live-port"):
            LiveAddress("127.0.0.1", taken.getsockname()[1]).bind()
    with pytest.raises(LiveError, match="--live-host"):
        LiveAddress("no such host", 0).bind()
    assert is_loopback("::1") and not is_loopback("192.168.1.4") and not is_loopback("::")
