"""The page of a bridge: its STOP is the latched emergency stop, and enabling obeys the gate."""

import contextlib
import time

from browsing import ask, press, wait_for

from firmware_bridge.live.address import LiveAddress
from firmware_bridge.live.feed import Feed
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


def test_enabling_obeys_the_reason_that_the_gate_has(tmp_path):
    with bridge(tmp_path, "its frame may have moved") as (link, stop, seen):
        press(link, "stop")
        answer = again(link)
        assert not answer["ok"] and answer["why"] == ["its frame may have moved"]
        assert "enable" not in seen and not stop.latched  # cleared, and it stands


def test_a_stop_that_no_bridge_confirms_says_so_and_is_kept_on_disk(tmp_path):
    with bridge(tmp_path) as (link, stop, _):
        stop.close()
        status, text, _ = ask(link, "stop", "POST")
        assert status == 200 and '"confirmed": false' in text and "no bridge" in text
        assert is_latched(stop.path) and "pressed all the same" in text
