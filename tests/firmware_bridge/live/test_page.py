"""The page of a bridge: its STOP is the latched emergency stop, and enabling obeys the gate."""

from __future__ import annotations

import contextlib
import json
import math
import time
from array import array

import pytest
from browser import Browser, needs_browser
from browsing import ask, press, wait_for

from firmware_bridge.live.address import LiveAddress
from firmware_bridge.live.channel import LONGEST, Channel
from firmware_bridge.live.feed import Feed
from firmware_bridge.live.guard import Guard, Refused, TwoActions
from firmware_bridge.live.picture import TRAIL, Picture
from firmware_bridge.safety.estop import EmergencyStop
from firmware_bridge.safety.gate_table import GateState
from firmware_bridge.safety.places import is_latched


@contextlib.contextmanager
def bridge(folder, barred: str = ""):
    """An emergency stop with a page, and a gate that obeys it whenever it is looked at."""
    stop = EmergencyStop(folder / "sock")
    gate = [GateState.ACTIVE]
    seen = []

    def packet():
        for word in sorted(stop.take(), key=("stop", "reset", "enable").index):
            seen.append(word)
            gate[0] = {
                "stop": GateState.ESTOP,
                "reset": GateState.IDLE,
                "enable": GateState.ACTIVE,
            }[word]
        stop.tell(gate[0], (), barred)
        return {"latched": stop.latched, "gate": gate[0].name}

    stop.open()
    with Feed(LiveAddress(port=0), "firmware_bridge.live.page", {"socket": str(stop.path)}) as feed:
        feed.start(packet, {"title": "<b>bridge</b>"})
        wait_for(feed.links[0], lambda shown: "gate" in shown)
        yield feed.links[0], stop, seen
    stop.close()


def again(link: str) -> dict:
    code = press(link, "first")["code"]
    time.sleep(0.3)
    return press(link, "second", {"code": code})


def test_stop_goes_through_the_latch_of_kmpc_estop(tmp_path):
    with bridge(tmp_path) as (link, stop, seen):
        answer = press(link, "stop")
        assert answer["confirmed"] and answer["gate"] == "ESTOP" and answer["latched"]
        assert is_latched(stop.path) and stop.latched and seen == ["stop"]
        assert wait_for(link, lambda shown: shown["latched"])["gate"] == "ESTOP"
        assert again(link)["ok"]
        assert not is_latched(stop.path) and wait_for(link, lambda s: s["gate"] == "ACTIVE")
        assert seen[0] == "stop" and seen[-2:] == ["reset", "enable"]


def test_a_stop_that_no_bridge_confirms_says_so_and_is_kept_on_disk(tmp_path):
    with bridge(tmp_path) as (link, stop, _):
        stop.close()
        status, text, _ = ask(link, "stop", "POST")
        assert status == 200 and '"confirmed": false' in text and "no bridge" in text
        assert is_latched(stop.path) and "pressed all the same" in text


@contextlib.contextmanager
def map_page(folder, clicks: bool = True):
    """A page on whose map goals are clicked; gives its link and the words that came."""
    words = []

    def packet():
        heard = [words[-1], "outside" if " 9.0000 " in words[-1] else ""] if words else ["", ""]
        return {"gate": "ACTIVE", "latched": False, "pose": [0.0, 0.0, 0.0], "heard": heard}

    settings = {"socket": str(folder / "sock")}
    with Feed(LiveAddress(port=0), "firmware_bridge.live.page", settings, words.append) as feed:
        feed.start(packet, {"clicks": clicks, "bounds": [-2.0, -2.0, 2.0, 2.0], "radius": 0.15})
        wait_for(feed.links[0], lambda shown: "gate" in shown)
        yield feed.links[0], words


def test_a_goal_takes_two_actions_and_an_answer_of_the_bridge(tmp_path):
    with map_page(tmp_path) as (link, words):
        code = press(link, "first", {"goal": [1.0, -0.5, 0.25]})["code"]
        assert not words
        time.sleep(0.3)
        assert press(link, "second", {"code": code}) == {"ok": True, "why": []}
        assert words == ["goal 1.0000 -0.5000 0.2500"]
        code = press(link, "first", {"goal": [9, 9.0, 0]})["code"]
        time.sleep(0.3)
        assert press(link, "second", {"code": code}) == {"ok": False, "why": ["outside"]}


@needs_browser
def test_a_drag_on_the_map_and_a_tap_on_the_button_give_a_goal_with_its_heading(tmp_path):
    with map_page(tmp_path) as (link, words), Browser() as browser:
        page = browser.page(width=390, height=844, touch=True)
        page.open(link)
        page.wait("document.querySelector('#map').className == 'clicks'")
        assert page.run("document.querySelector('#go').disabled")
        x, y = page.place("#map")
        for kind, at in (("touchStart", (x, y)), ("touchMove", (x, y - 40)), ("touchEnd", None)):
            points = [] if at is None else [{"x": at[0], "y": at[1]}]
            page.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)
        page.wait("!document.querySelector('#go').disabled")
        assert page.text("#wish").endswith(" m, 90\u00b0") and not words
        time.sleep(0.3)
        page.tap("#go")
        page.wait("document.querySelector('#go').disabled")
        page.wait("document.querySelector('#wish').textContent.startsWith('tap the map')")
        assert len(words) == 1 and not page.errors
        assert [float(number) for number in words[0].split()[1:]] == pytest.approx(
            [0.0, 0.0, 1.5708], abs=0.02
        )


TOKEN = "abcdefghjkmn"


def enter(guard: Guard, method: str = "GET", **headers: str):
    names = {name: name.replace("_", "-").title() for name in headers}
    return guard.enter(method, {names[name]: value for name, value in headers.items()})


def refused(guard: Guard, *what: str, **headers: str) -> bool:
    try:
        enter(guard, *what, **headers)
    except Refused as error:
        return error.status == 403
    return False


def test_on_this_computer_one_may_watch_without_the_token_and_elsewhere_not():
    ours, far = Guard(TOKEN, True, ["localhost"]), Guard(TOKEN, False, ["localhost", "pi.local"])
    assert enter(ours, host="127.0.0.1:8764") is False
    assert enter(ours, host="localhost:8764", x_kmpc=TOKEN) is True
    assert enter(far, host="192.168.1.5:8764", x_kmpc=TOKEN) is True
    assert enter(far, host="pi.local:8764", x_kmpc=TOKEN) is True
    assert refused(far, host="192.168.1.5:8764")
    for shown in ("", "1", TOKEN[:-1], f"{TOKEN}x", "é"):
        assert refused(far, host="192.168.1.5:8764", x_kmpc=shown), shown


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8764", "", "127.0.0.1.evil.example"]
)
def test_a_name_of_a_stranger_that_leads_here_is_refused(host):
    """DNS rebinding: the page of evil.example suddenly speaks to this computer."""
    assert refused(Guard(TOKEN, True, ["localhost"]), host=host)
    assert refused(Guard(TOKEN, True, ["localhost"]), host=host, x_kmpc=TOKEN)


def test_what_the_page_of_another_site_sends_is_refused():
    guard, host = Guard(TOKEN, True, ["localhost"]), "localhost:8764"
    for origin in (
        "http://evil.example",
        "null",
        "http://localhost:9999",
        "https://localhost:8764",
    ):
        assert refused(guard, "POST", host=host, origin=origin), origin
        assert refused(guard, "GET", host=host, origin=origin), origin
    assert refused(guard, "POST", host=host, sec_fetch_site="cross-site")
    assert not enter(guard, "POST", host=host, origin=f"http://{host}")
    assert not enter(guard, "POST", host=host)  # curl


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


def test_only_what_has_changed_is_reported_and_newcomers_get_everything():
    picture = Picture()
    first = json.loads(picture.take({"a": 1, "b": array("d", [1.0, math.nan]).tobytes()}))
    assert first == {"a": 1, "b": [1.0, None]}
    assert json.loads(picture.take({"a": 1, "b": [2.0], "pose": [0.0, 1.0, 0.1]})) == {
        "b": [2.0],
        "pose": [0.0, 1.0, 0.1],
    }
    whole = json.loads(picture.whole())
    assert whole == {"a": 1, "b": [2.0], "pose": [0.0, 1.0, 0.1], "trail": [0.0, 1.0]}


def test_the_driven_path_does_not_grow_without_end_nor_while_the_robot_stands():
    picture = Picture()
    for k in range(TRAIL + 500):
        for _ in range(2):
            picture.take({"pose": [0.1 * k, 0.0, 0.0]})
    picture.take({"pose": [math.nan, 0.0, 0.0]})
    assert len(json.loads(picture.whole())["trail"]) == 2 * TRAIL


def test_a_channel_never_waits_and_gives_whole_packets():
    ours, theirs = Channel.pair()
    sent = 0
    while ours.send({"n": sent, "filling": bytes(8000)}):
        sent += 1
        assert sent < 10_000
    assert not ours.send({"n": bytes(LONGEST + 1)})
    got = []
    while (packet := theirs.receive()) is not None:
        got.append(packet["n"])
    assert got == list(range(sent))
    ours.close()
    try:
        theirs.receive()
    except EOFError:
        return
    raise AssertionError("the end was not told")
