"""`kmpc estop`: which bridges it finds, and what it says where it finds none."""

import contextlib
import json
import threading
import time
from pathlib import Path

import pytest

from firmware_bridge.safety.estop import EmergencyStop, Listener
from firmware_bridge.safety.gate_table import GateState
from firmware_bridge.safety.places import is_latched
from kmpc_lite.cli.main import main

pytestmark = pytest.mark.usefixtures("desk")


@contextlib.contextmanager
def bridge(name):
    """A bridge whose gate obeys at once; gives what was asked of it."""
    stop, done, asked = EmergencyStop(Path(name)), threading.Event(), []

    def gate():
        while not done.wait(0.001):
            words = stop.take()
            # a stop comes by its latch, and by its word
            asked.extend(word for word in sorted(words) if asked[-1:] != [word])
            if "stop" in words:
                stop.tell(GateState.ESTOP)
            elif "reset" in words:
                stop.tell(GateState.IDLE)

    stop.open()
    thread = threading.Thread(target=gate)
    thread.start()
    try:
        yield asked
    finally:
        done.set()
        thread.join()
        stop.close()


def comes_to(asked, *words, seconds=10.0):
    """Whether the gate takes these requests and no more; it looks a thousand times a second."""
    end = time.monotonic() + seconds
    while asked != list(words) and time.monotonic() < end:
        time.sleep(0.001)
    return asked == list(words)


def robot_file(socket):
    Path("robot.toml").write_text(
        f'[link]\nurl = "tcp:127.0.0.1:9"\ndriver = "mavlink"\n[safety]\nsocket = "{socket}"\n'
    )


def test_a_bridge_with_a_socket_of_its_own_is_found_and_so_is_its_robot_file(capsys):
    robot_file("own.sock")
    with bridge("own.sock") as asked:
        assert main(["estop"]) == 0 and asked == ["stop"]
        assert main(["estop", "robot.toml", "--status", "--json"]) == 0
        answer = json.loads(capsys.readouterr().out.splitlines()[-1])
        assert answer["gate"] == "ESTOP" and answer["latched"]
        assert main(["estop", "--reset"]) == 0 and comes_to(asked, "stop", "reset")
    assert main(["estop", "robot.toml", "--status"]) == 1
    assert "own.sock: no bridge is running there; no stop is pressed" in capsys.readouterr().out


def test_all_bridges_are_stopped_and_none_is_enabled_by_mistake(capsys):
    with bridge("one.sock") as one, bridge("run/kmpc-bridge.sock") as two:
        assert main(["estop"]) == 0
        assert comes_to(one, "stop") and comes_to(two, "stop")
        assert capsys.readouterr().out.count("emergency stop pressed, gate ESTOP") == 2
        assert main(["estop", "--enable"]) == 2
        assert "2 bridges may run: give --socket PATH" in capsys.readouterr().err
        assert main(["estop", "--reset"]) == 0
        assert comes_to(one, "stop", "reset") and comes_to(two, "stop", "reset")
        assert main(["estop", "--enable", "--socket", "one.sock"]) == 0
        assert comes_to(one, "stop", "reset", "enable") and two == ["stop", "reset"]


def test_a_bridge_that_does_not_answer_is_stopped_by_its_latch_and_not_reset(monkeypatch, capsys):
    monkeypatch.setattr("firmware_bridge.safety.estop_client.press.__defaults__", (0.1,))
    monkeypatch.setattr("firmware_bridge.safety.estop_client.ask.__defaults__", (0.1,))
    path = Path("run/kmpc-bridge.sock")
    busy = Listener(path)
    assert main(["estop"]) == 1 and is_latched(path)
    assert "no answer" in capsys.readouterr().out
    assert main(["estop", "--reset"]) == 1 and is_latched(path)
    busy.close()
