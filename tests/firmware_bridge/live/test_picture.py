"""What watchers are shown."""

import json
import math
from array import array

from firmware_bridge.live.channel import LONGEST, Channel
from firmware_bridge.live.watchers import LONGEST_TEXT, TRAIL, Picture


def test_only_what_has_changed_is_told_and_newcomers_get_everything():
    picture = Picture(lambda: 0.0)
    first = json.loads(picture.take({"a": 1, "b": array("d", [1.0, math.nan]).tobytes()}))
    assert first == {"a": 1, "b": [1.0, None]}
    assert json.loads(picture.take({"a": 1, "b": [2.0], "pose": [0.0, 1.0, 0.1]})) == {
        "b": [2.0],
        "pose": [0.0, 1.0, 0.1],
    }
    whole = json.loads(picture.whole())
    assert whole == {"a": 1, "b": [2.0], "pose": [0.0, 1.0, 0.1], "trail": [0.0, 1.0]}


def test_the_driven_path_does_not_grow_without_end_nor_while_the_robot_stands():
    picture = Picture(lambda: 0.0)
    for k in range(TRAIL + 500):
        for _ in range(2):
            picture.take({"pose": [0.1 * k, 0.0, 0.0]})
    picture.take({"pose": [math.nan, 0.0, 0.0]})
    assert len(json.loads(picture.whole())["trail"]) == 2 * TRAIL


def test_words_of_a_vehicle_stay_words():
    hostile = '</script><img src=x onerror=alert(1)>\n\ndata: {"gate":"ACTIVE"}\r\x1b[2J\u2028'
    text = Picture(lambda: 0.0).take({"wrong": [hostile, "x" * 5000]})
    assert "\n" not in text and "\x1b" not in text
    shown = json.loads(text)["wrong"]
    assert shown[0].startswith("</script>") and len(shown[1]) < LONGEST_TEXT + 10


def test_the_cells_of_a_map_come_whole():
    """A text that is cut is no base64 any more, and the page would draw nothing."""
    told = json.loads(
        Picture(lambda: 0.0).take({"grid": {"cells": "A" * 20_000, "name": "B" * 900}})
    )
    assert told["grid"]["cells"] == "A" * 20_000 and len(told["grid"]["name"]) < LONGEST_TEXT + 10


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
