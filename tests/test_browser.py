"""The browser that tests of pages drive does what they ask of it."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from browser import Browser, BrowserError, needs_browser

pytestmark = needs_browser
PAGE = """<!doctype html><title>A page</title><style>body { background: white; }
@media (prefers-color-scheme: dark) { body { background: black; } }</style>
<button onclick="this.textContent = 'pressed'">press</button>
<p id="keys"></p><p id="taps"></p><img src="http://elsewhere.example/a.png">
<noscript>no scripts</noscript>
<script>
addEventListener("keydown", (e) => document.querySelector("#keys").textContent += e.code);
addEventListener("touchstart", () => document.querySelector("#taps").textContent = "tapped");
console.error("said");
</script>"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with Browser() as started:
        yield started


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "page.html"
    path.write_text(PAGE)
    return path


def test_a_page_is_clicked_typed_at_and_read(browser: Browser, file: Path) -> None:
    page = browser.page()
    page.open(file)
    page.click("button")
    page.press(" ")
    page.press("ArrowLeft")
    page.press("a")
    assert page.text("button") == "pressed"
    assert page.text("#keys") == "SpaceArrowLeftKeyA"
    assert ("button", "pressed") in page.tree()
    assert page.run("[innerWidth, innerHeight]") == [1280, 800]
    with pytest.raises(BrowserError, match="nothing is not defined"):
        page.run("nothing")
    with pytest.raises(BrowserError, match="not so within"):
        page.wait("false", seconds=0.0)


def test_what_a_page_asks_for_elsewhere_is_seen_and_fails(browser: Browser, file: Path) -> None:
    page = browser.page()
    page.open(file)
    assert page.requests == [file.as_uri(), "http://elsewhere.example/a.png"]
    page.wait("!document.images[0].naturalWidth && document.images[0].complete")
    assert "said" in page.errors and any("ERR_NAME_NOT_RESOLVED" in e for e in page.errors)


def test_a_phone_a_dark_page_and_one_without_scripts(browser: Browser, file: Path) -> None:
    page = browser.page(390, 844, dark=True, touch=True)
    page.open(file)
    page.tap("#keys")
    assert page.text("#taps") == "tapped"
    assert page.run("getComputedStyle(document.body).backgroundColor") == "rgb(0, 0, 0)"
    page = browser.page(scripts=False)
    page.open(file)
    assert page.text("noscript") == "no scripts"
    shot = page.screenshot(file.with_suffix(".png"), whole=True)
    assert shot.read_bytes().startswith(b"\x89PNG")
