"""A headless Chromium for tests of pages, by playwright; the browser is the machine's own.

    apt-get install chromium-headless-shell        # or any Chromium or Chrome on the PATH

A page sees nothing but this machine: what it asks for elsewhere stands in `page.requests`, and
fails.
"""

from __future__ import annotations

import json
import os
import shutil
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Self

import pytest

NAMES = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome", "chrome")
ALONE = "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE localhost, EXCLUDE 127.0.0.1"
PATIENCE = 30_000.0  # the longest that a busy machine may take for one answer [ms]


def found_browser() -> str | None:
    """Path of a Chromium; KMPC_BROWSER names another one."""
    named = os.environ.get("KMPC_BROWSER")
    return next(filter(None, map(shutil.which, (named,) if named else NAMES)), None)


needs_browser = pytest.mark.skipif(
    found_browser() is None or find_spec("playwright") is None,
    reason="no browser: apt-get install chromium-headless-shell, or set KMPC_BROWSER",
)
"""Skips a test if there is no browser."""


class Browser:
    """A Chromium of one's own, which ends with the block."""

    def __init__(self) -> None:
        from playwright.sync_api import sync_playwright

        self._driver = sync_playwright().start()
        self._browser = self._driver.chromium.launch(
            executable_path=found_browser(), args=["--no-sandbox", ALONE]
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._browser.close()
        self._driver.stop()

    def page(self, width: int = 1280, height: int = 800, **how: bool) -> Page:
        """Open an empty page of a size [CSS pixels].

        ``dark``: its user likes dark pages. ``touch``: it is on a phone. ``scripts``: whether
        JavaScript runs.
        """
        touch = how.get("touch", False)
        context = self._browser.new_context(
            viewport={"width": width, "height": height},
            color_scheme="dark" if how.get("dark") else "light",
            java_script_enabled=how.get("scripts", True),
            device_scale_factor=2 if touch else 1,
            has_touch=touch,
            is_mobile=touch,
        )
        context.set_default_timeout(PATIENCE)
        return Page(context.new_page())


class Page:
    """One page of a `Browser`."""

    def __init__(self, page: Any) -> None:
        self._page, self._session = page, page.context.new_cdp_session(page)
        self.errors: list[str] = []
        """What scripts threw, and what the console holds of errors and refusals."""
        self.requests: list[str] = []  # URLs that were asked for, but those that are data
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("console", lambda said: said.type == "error" and self.errors.append(said.text))
        page.on("request", lambda asked: self._asks(asked.url))

    def _asks(self, url: str) -> None:
        if not url.startswith(("data:", "blob:")):
            self.requests.append(url)

    def open(self, where: str | Path) -> None:
        """Load a file or a URL, and wait until it is there."""
        self._page.goto(where.resolve().as_uri() if isinstance(where, Path) else where)

    def run(self, script: str) -> Any:
        """Value of an expression, or of what a promise gives; what JSON can hold."""
        how = {"awaitPromise": True, "returnByValue": True}
        answer = self.call("Runtime.evaluate", expression=script, **how)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait(self, condition: str, seconds: float = PATIENCE / 1000.0) -> None:
        """Wait until an expression is true."""
        self._page.wait_for_function(f"() => Boolean({condition})", timeout=1000.0 * seconds)

    def text(self, selector: str) -> str:
        """Text of an element, as it is shown."""
        return str(self._page.inner_text(selector))

    def place(self, selector: str) -> tuple[float, float]:
        """Middle of an element, which is scrolled into view [CSS pixels]."""
        found = self.run(
            f"((e) => {{ e.scrollIntoView({{block: 'center', behavior: 'instant'}}); "
            "const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; "
            f"}})(document.querySelector({json.dumps(selector)}))"
        )
        return found[0], found[1]

    def click(self, selector: str) -> None:
        """Click into the middle of an element."""
        self._page.mouse.click(*self.place(selector))

    def move(self, x: float, y: float) -> None:
        """Put the mouse somewhere [CSS pixels]."""
        self._page.mouse.move(x, y)

    def tap(self, selector: str) -> None:
        """Tap on the middle of an element with a finger."""
        self._page.touchscreen.tap(*self.place(selector))

    def press(self, key: str) -> None:
        """Press a key: a letter, or its name."""
        self._page.keyboard.press(key)

    def tree(self) -> list[tuple[str, str]]:
        """Role and name of everything that a screen reader gets, in order."""
        nodes = self.call("Accessibility.getFullAXTree")["nodes"]
        return [
            (node["role"]["value"], node.get("name", {}).get("value", ""))
            for node in nodes
            if not node["ignored"]
        ]

    def call(self, method: str, **parameters: Any) -> Any:
        """Call a method of the DevTools protocol."""
        return self._session.send(method, parameters)

    def screenshot(self, path: Path, whole: bool = False) -> Path:
        """Write what is seen, or the whole page, as a PNG."""
        self._page.screenshot(path=path, full_page=whole)
        return path

    def close(self) -> None:
        """Close this page."""
        self._page.context.close()
