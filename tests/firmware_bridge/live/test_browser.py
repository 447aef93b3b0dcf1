"""The page in a browser, on a phone: what a finger does, and what is shown."""

import contextlib
import os
import re
import signal
import subprocess
import sys
import time

import pytest
from browser import Browser, needs_browser
from waiting import until

pytestmark = needs_browser
SIMULATED = ("simulate", "walls_door", "--live-port", "0")
KMPC = [sys.executable, "-m", "kmpc_lite.cli.main"]


@contextlib.contextmanager
def kmpc(*words: str):
    """A command that serves a page, and the page's link."""
    process = subprocess.Popen([*KMPC, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    try:
        assert process.stderr is not None
        while not (found := re.search(rb"live\s+(http\S+)", process.stderr.readline())):
            assert process.poll() is None
        yield process, found.group(1).decode()
    finally:
        process.kill()
        process.communicate()


def phone(browser: Browser, link: str):
    page = browser.page(width=390, height=844, touch=True)
    page.open(link)
    page.wait("document.querySelector('#gate').textContent == 'ACTIVE'")
    return page


def hold_and_confirm(page) -> None:
    x, y = page.place("#hold")
    page.call("Input.dispatchTouchEvent", type="touchStart", touchPoints=[{"x": x, "y": y}])
    page.wait("!document.querySelector('#confirm').disabled")
    page.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
    time.sleep(0.3)
    page.tap("#confirm")


def test_one_tap_stops_a_simulated_robot_and_driving_again_takes_two(tmp_path):
    with (
        kmpc("simulate", "walls_door", "--live-port", "0") as (process, link),
        Browser() as browser,
    ):
        page = phone(browser, link)
        assert page.run("document.documentElement.scrollWidth") == 390
        assert page.run("document.querySelector('#stop').getBoundingClientRect().height") >= 88
        assert not page.run("document.querySelector('#again').offsetParent")
        page.tap("#stop")
        page.wait("document.querySelector('#stop').className == 'held'")
        assert "STOPPED" in page.text("#stop") and "confirmed" in page.text("#stop")
        page.tap("#confirm")  # not before the other was held
        page.tap("#hold")  # and a tap is no hold
        time.sleep(0.3)
        assert page.text("#gate") == "ESTOP"
        hold_and_confirm(page)
        page.wait("document.querySelector('#gate').textContent == 'ACTIVE'")
        ours, _, token = link.partition("#")
        assert not page.errors and all(r.startswith(ours) for r in page.requests)
        assert not any(token in request for request in page.requests)


def test_pictures_are_drawn_when_there_is_news_and_keep_no_finger_waiting():
    """A page that draws all the time handles a tap late, by half a second on a busy machine."""
    with kmpc(*SIMULATED) as (process, link), Browser() as browser:
        page = phone(browser, link)
        page.run(
            "const ask = requestAnimationFrame.bind(window); window.pictures = 0;"
            "window.requestAnimationFrame = (draw) => { window.pictures++; return ask(draw); }, 0"
        )
        page.wait("window.pictures >= 3")
        os.kill(process.pid, signal.SIGSTOP)
        page.wait("!document.querySelector('#lost').hidden")
        before = page.run("window.pictures")
        time.sleep(0.5)
        assert page.run("window.pictures") == before


@pytest.mark.long
def test_a_bridge_that_is_not_heard_is_reported_loudly_and_stop_is_sent_until_it_hears():
    with kmpc(*SIMULATED) as (process, link), Browser() as browser:
        page = phone(browser, link)
        os.kill(process.pid, signal.SIGSTOP)
        page.wait("!document.querySelector('#lost').hidden")
        assert "NOT HEARD" in page.text("#lost") and "switch on the robot" in page.text("#lost")
        page.tap("#stop")
        page.wait("document.querySelector('#stop').className == 'failed'")
        assert "NOT CONFIRMED" in page.text("#stop")
        os.kill(process.pid, signal.SIGCONT)  # it was sent again until it was heard
        page.wait("document.querySelector('#stop').className == 'held'")
        assert page.run("document.querySelector('#lost').hidden")


@pytest.mark.long
def test_without_scripts_stop_still_stops():
    with kmpc(*SIMULATED) as (_, link), Browser() as browser:
        page = browser.page(width=390, height=844, scripts=False)
        page.open(link)
        page.click("#stop")
        assert until(lambda: '"confirmed": true' in page.text("body"), 20.0)


@pytest.mark.long
def test_a_tap_stops_the_emulated_rover_within_its_ramp(tmp_path):
    url, where = "tcp:127.0.0.1:5797", ("--scenario", "four_circles_1")
    rover = subprocess.Popen([*KMPC, "emulate", "mavlink", "--link", url, *where])
    try:
        words = ("run", "--driver", "mavlink", "--link", url, *where, "--arm", "--live-port", "0")
        more = ("--socket", str(tmp_path / "estop"), "--seconds", "60", "--json")
        with kmpc(*words, *more) as (_, link), Browser() as browser:
            page = phone(browser, link)
            page.run(
                "new EventSource('events').onmessage = (e) => { const n = JSON.parse(e.data); if"
                " (n.pose) window.now = n.pose; }, 0"
            )
            time.sleep(2.0)
            page.tap("#stop")
            page.wait("document.querySelector('#stop').className == 'held'")
            before = page.run("window.now")
            time.sleep(1.0)  # 0.3 m/s takes 0.6 s at most to come to rest
            there = page.run("window.now")
            time.sleep(1.0)
            assert page.run("window.now") == pytest.approx(there, abs=0.01)
            assert ((there[0] - before[0]) ** 2 + (there[1] - before[1]) ** 2) ** 0.5 < 0.3
            assert page.text("#gate") == "ESTOP"
    finally:
        rover.terminate()
        rover.wait()
