"""What watchers are shown."""

import json
import math
from array import array

from firmware_bridge.live.channel import LONGEST, Channel
from firmware_bridge.live.picture import TRAIL, Picture


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
