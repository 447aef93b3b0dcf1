"""A headless Chromium for tests of pages, over the pipe of its DevTools protocol: no other library.

    apt-get install chromium-headless-shell        # or any Chromium or Chrome on the PATH

    with Browser() as browser:
        page = browser.page(width=390, height=844, dark=True, touch=True)
        page.open("http://127.0.0.1:8080/")        # or a Path
        page.wait("document.querySelector('#stop')")
        page.click("#stop")
        assert page.text("#state") == "stopped" and not page.errors
        page.screenshot(Path("stop.png"))

A page sees nothing but this machine: what it asks for elsewhere stands in `page.requests`, and
fails.
"""

from __future__ import annotations

import base64
import itertools
import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from queue import Empty, Queue
from types import TracebackType
from typing import Any, Self

import pytest

NAMES = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome", "chrome")
OPTIONS = (
    "--headless",
    "--no-sandbox",  # tests run as root in containers
    "--no-first-run",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-default-apps",
    "--disable-extensions",
    "--hide-scrollbars",
    "--mute-audio",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE localhost, EXCLUDE 127.0.0.1",
    "--remote-debugging-pipe",
)
START = """
import fcntl, os, sys
ends = [fcntl.fcntl(int(fd), fcntl.F_DUPFD, 10) for fd in sys.argv[1:3]]
os.dup2(ends[0], 3)
os.dup2(ends[1], 4)
os.execv(sys.argv[3], sys.argv[3:])
"""
"""Puts the pipe where Chromium looks for it, and becomes Chromium."""
PATIENCE = 30.0
"""The longest that a busy machine may take for one answer [s]."""
KEYS = {
    " ": ("Space", 32),
    "Enter": ("Enter", 13),
    "Escape": ("Escape", 27),
    "Tab": ("Tab", 9),
    "ArrowLeft": ("ArrowLeft", 37),
    "ArrowUp": ("ArrowUp", 38),
    "ArrowRight": ("ArrowRight", 39),
    "ArrowDown": ("ArrowDown", 40),
    "Home": ("Home", 36),
    "End": ("End", 35),
    "PageUp": ("PageUp", 33),
    "PageDown": ("PageDown", 34),
}
"""Codes of keys that type no letter."""


def found_browser() -> str | None:
    """Path of a Chromium; KMPC_BROWSER names another one."""
    named = os.environ.get("KMPC_BROWSER")
    return next(filter(None, map(shutil.which, (named,) if named else NAMES)), None)


needs_browser = pytest.mark.skipif(
    found_browser() is None,
    reason="no browser: apt-get install chromium-headless-shell, or set KMPC_BROWSER",
)
"""Skips a test if there is no browser."""


class BrowserError(AssertionError):
    """The browser refused, or a page threw."""


class Browser:
    """A Chromium of one's own, which ends with the block."""

    def __init__(self) -> None:
        program = found_browser()
        assert program is not None, "no browser on the PATH"
        self._home = tempfile.TemporaryDirectory(prefix="kmpc-browser-", ignore_cleanup_errors=True)
        from_us, self._out = os.pipe()
        self._in, to_us = os.pipe()
        words = [program, *OPTIONS, f"--user-data-dir={self._home.name}", "about:blank"]
        self._process = subprocess.Popen(
            [sys.executable, "-c", START, str(from_us), str(to_us), *words],
            pass_fds=(from_us, to_us),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(from_us)
        os.close(to_us)
        self._numbers = itertools.count(1)
        self._answers: dict[int, Queue[dict[str, Any]]] = {}
        self._pages: dict[str, Page] = {}
        self._reader = threading.Thread(target=self._read, name="browser", daemon=True)
        self._reader.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the browser; idempotent."""
        if self._process.poll() is None:
            try:
                self.call("Browser.close", wait=5.0)
                self._process.wait(5.0)
            except (BrowserError, OSError, subprocess.TimeoutExpired):
                self._process.kill()
                self._process.wait()
        self._reader.join(5.0)
        self._home.cleanup()

    def page(
        self,
        width: int = 1280,
        height: int = 800,
        *,
        dark: bool = False,
        touch: bool = False,
        scripts: bool = True,
    ) -> Page:
        """Open an empty page.

        Parameters
        ----------
        width, height : int
            What it shows [CSS pixels].
        dark : bool
            Its user likes dark pages.
        touch : bool
            It is on a phone.
        scripts : bool
            Whether JavaScript runs.
        """
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        page = self._pages[session] = Page(self, session, target)
        for domain in ("Page", "Runtime", "Network", "Log"):
            page.call(f"{domain}.enable")
        page.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=2 if touch else 1,
            mobile=touch,
        )
        page.call("Emulation.setTouchEmulationEnabled", enabled=touch)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        page.call("Emulation.setEmulatedMedia", features=[scheme])
        if not scripts:
            page.call("Emulation.setScriptExecutionDisabled", value=True)
        return page

    def call(
        self, method: str, session: str | None = None, wait: float = PATIENCE, **parameters: Any
    ) -> dict[str, Any]:
        """Call a method of the DevTools protocol."""
        number = next(self._numbers)
        answer = self._answers[number] = Queue()
        message: dict[str, Any] = {"id": number, "method": method, "params": parameters}
        if session is not None:
            message["sessionId"] = session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self._out, data) :]
        try:
            found = answer.get(timeout=wait)
        except Empty:
            raise BrowserError(f"{method}: no answer within {wait:g} s") from None
        finally:
            del self._answers[number]
        if "error" in found:
            raise BrowserError(f"{method}: {found['error']['message']}")
        result: dict[str, Any] = found["result"]
        return result

    def _read(self) -> None:
        rest = b""
        while data := os.read(self._in, 2**16):
            *whole, rest = (rest + data).split(b"\0")
            for message in map(json.loads, whole):
                if "id" in message:
                    if (waiting := self._answers.get(message["id"])) is not None:
                        waiting.put(message)
                elif (page := self._pages.get(message.get("sessionId", ""))) is not None:
                    page.heard(message["method"], message["params"])


class Page:
    """One page of a `Browser`."""

    def __init__(self, browser: Browser, session: str, target: str) -> None:
        self._browser, self._session, self._target = browser, session, target
        self.errors: list[str] = []
        """What scripts threw, and what the console holds of errors and refusals."""
        self.requests: list[str] = []
        """URLs that were asked for, but those that are data."""
        self._loaded = threading.Event()

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method of the DevTools protocol on this page."""
        return self._browser.call(method, self._session, **parameters)

    def heard(self, method: str, told: dict[str, Any]) -> None:
        """Take in an event of the protocol."""
        match method:
            case "Page.loadEventFired":
                self._loaded.set()
            case "Network.requestWillBeSent":
                if not told["request"]["url"].startswith(("data:", "blob:")):
                    self.requests.append(told["request"]["url"])
            case "Runtime.exceptionThrown":
                self.errors.append(_thrown(told["exceptionDetails"]))
            case "Log.entryAdded" if told["entry"]["level"] == "error":
                self.errors.append(told["entry"]["text"])
            case "Runtime.consoleAPICalled" if told["type"] in ("error", "assert"):
                words = (str(a.get("value", a.get("description", ""))) for a in told["args"])
                self.errors.append(" ".join(words))

    def open(self, where: str | Path) -> None:
        """Load a file or a URL, and wait until it is there."""
        url = where.resolve().as_uri() if isinstance(where, Path) else where
        self._loaded.clear()
        answer = self.call("Page.navigate", url=url)
        if answer.get("errorText"):
            raise BrowserError(f"{url}: {answer['errorText']}")
        if not self._loaded.wait(PATIENCE):
            raise BrowserError(f"{url}: not loaded within {PATIENCE:g} s")

    def run(self, script: str) -> Any:
        """Value of an expression, or of what a promise gives; what JSON can hold."""
        answer = self.call(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        if "exceptionDetails" in answer:
            raise BrowserError(_thrown(answer["exceptionDetails"]))
        return answer["result"].get("value")

    def wait(self, condition: str, seconds: float = PATIENCE) -> None:
        """Wait until an expression is true."""
        until = time.monotonic() + seconds
        while not self.run(f"Boolean({condition})"):
            if time.monotonic() > until:
                raise BrowserError(f"{condition}: not so within {seconds:g} s")
            time.sleep(0.02)

    def text(self, selector: str) -> str:
        """Text of an element, as it is shown."""
        return str(self.run(f"document.querySelector({json.dumps(selector)}).innerText"))

    def place(self, selector: str) -> tuple[float, float]:
        """Middle of an element, which is scrolled into view [CSS pixels]."""
        found = self.run(
            f"(() => {{ const e = document.querySelector({json.dumps(selector)}); "
            "e.scrollIntoView({block: 'center', behavior: 'instant'}); "
            "const b = e.getBoundingClientRect(); "
            "return [b.x + b.width / 2, b.y + b.height / 2]; })()"
        )
        return found[0], found[1]

    def click(self, selector: str) -> None:
        """Click into the middle of an element."""
        x, y = self.place(selector)
        self.move(x, y)
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def move(self, x: float, y: float) -> None:
        """Put the mouse somewhere [CSS pixels]."""
        self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)

    def tap(self, selector: str) -> None:
        """Tap on the middle of an element with a finger."""
        x, y = self.place(selector)
        self.call("Input.dispatchTouchEvent", type="touchStart", touchPoints=[{"x": x, "y": y}])
        self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def press(self, key: str) -> None:
        """Press a key: a letter, or one of `KEYS`."""
        code, number = KEYS.get(key, (f"Key{key.upper()}", ord(key.upper()[0])))
        typed = {" ": " ", "Enter": "\r"}.get(key, key if len(key) == 1 else "")
        told = {"key": key, "code": code, "windowsVirtualKeyCode": number}
        down = {"type": "keyDown", "text": typed} if typed else {"type": "rawKeyDown"}
        self.call("Input.dispatchKeyEvent", **told, **down)
        self.call("Input.dispatchKeyEvent", **told, type="keyUp")

    def tree(self) -> list[tuple[str, str]]:
        """Role and name of everything that a screen reader gets, in order."""
        nodes = self.call("Accessibility.getFullAXTree")["nodes"]
        return [
            (node["role"]["value"], node.get("name", {}).get("value", ""))
            for node in nodes
            if not node["ignored"]
        ]

    def screenshot(self, path: Path, whole: bool = False) -> Path:
        """Write what is seen, or the whole page, as a PNG."""
        shot = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        if whole:
            size = self.call("Page.getLayoutMetrics")["cssContentSize"]
            shot = self.call(
                "Page.captureScreenshot",
                format="png",
                captureBeyondViewport=True,
                clip={"x": 0, "y": 0, **{k: size[k] for k in ("width", "height")}, "scale": 1},
            )
        path.write_bytes(base64.b64decode(shot["data"]))
        return path

    def close(self) -> None:
        """Close this page."""
        self._browser.call("Target.closeTarget", targetId=self._target)


def _thrown(details: dict[str, Any]) -> str:
    return str(details.get("exception", {}).get("description", details["text"]))
