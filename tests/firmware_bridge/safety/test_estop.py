"""The emergency stop's socket and latch."""

import contextlib
import os
import shutil
import signal
import socket
import stat
import subprocess
import sys
import threading
import time

import pytest
from waiting import until

from firmware_bridge.messages import ConfigError, LinkError
from firmware_bridge.safety.estop import CLIENTS, EmergencyStop, Listener
from firmware_bridge.safety.estop_client import ask, press
from firmware_bridge.safety.gate_table import GateState
from firmware_bridge.safety.places import latch_file, set_latch

pytestmark = pytest.mark.usefixtures("no_other_bridge")


@pytest.fixture
def stop(tmp_path):
    made = EmergencyStop(tmp_path / "b.sock")
    made.open()
    yield made
    made.close()


def test_the_socket_is_the_users_own(stop):
    mode = stop.path.stat().st_mode
    assert stat.S_ISSOCK(mode) and stat.S_IMODE(mode) == 0o600


def test_a_stop_is_latched_in_memory_and_on_disk_until_reset(stop):
    answer = ask(stop.path, "stop")
    assert answer["ok"] and answer["latched"] and not answer["confirmed"]
    assert stop.take() == {"stop"} and stop.take() == set()
    assert stop.latched and stop.latch_path.exists()
    refused = ask(stop.path, "enable")
    assert refused["latched"] and stop.latched
    assert not refused["ok"] and "--reset first" in refused["why"][0]
    assert not ask(stop.path, "reset")["latched"]
    assert stop.take() == {"reset"} and not stop.latch_path.exists()


def test_enable_is_refused_with_the_reason_while_it_is_barred(stop):
    stop.tell(GateState.RELEASED, ("board not ready",), "restarted: look first")
    answer = ask(stop.path, "enable")
    assert not answer["ok"] and answer["why"] == ["restarted: look first"]
    assert stop.take() == set()
    assert ask(stop.path, "status")["why"] == ["board not ready"]
    assert ask(stop.path, "confirm")["ok"] and stop.take() == {"confirm"}
    stop.tell(GateState.RELEASED)
    assert ask(stop.path, "enable")["ok"] and stop.take() == {"enable"}


def test_the_answer_reports_whether_the_gate_has_obeyed(stop):
    def gate() -> None:
        while not stop.take():
            time.sleep(0.001)
        stop.tell(GateState.ESTOP)

    thread = threading.Thread(target=gate)
    thread.start()
    answer = ask(stop.path, "stop")
    thread.join()
    assert answer["confirmed"] and answer["gate"] == "ESTOP"
    stop.tell(GateState.IDLE)
    assert ask(stop.path, "status") == {
        "ok": True,
        "latched": True,
        "gate": "IDLE",
        "confirmed": False,
        "why": [],
    }


class Ticking:
    """A gate that looks at what is asked for every 20 ms, as the control loop does."""

    def __init__(self, stop):
        self.stop, self.state, self.doubt = stop, GateState.ESTOP, "the autopilot was restarted"
        self.quit = threading.Event()
        self.thread = threading.Thread(target=self.run)

    def __enter__(self):
        self.thread.start()
        assert until(lambda: ask(self.stop.path, "status")["gate"] == "ESTOP")
        return self

    def __exit__(self, *_):
        self.quit.set()
        self.thread.join()

    def run(self):
        shown = self.doubt
        while not self.quit.wait(0.02):
            self.stop.tell(self.state, tuple(filter(None, (shown,))), self.doubt)
            shown = self.doubt  # of the last tick
            for word in self.stop.take():
                self.state = {"reset": GateState.IDLE, "enable": GateState.WAITING}.get(
                    word, self.state
                )
                self.doubt = "" if word == "confirm" else self.doubt


def test_the_answer_reports_what_came_of_the_request_and_not_what_was_before(stop):
    """`reset` was answered "not pressed, gate ESTOP", `confirm` with the doubt that it ended."""
    stop.press()
    with Ticking(stop) as gate:
        stop.take()
        assert ask(stop.path, "reset")["gate"] == "IDLE"
        refused = ask(stop.path, "enable")
        assert not refused["ok"] and refused["why"] == [gate.doubt]
        confirmed = ask(stop.path, "confirm")
        assert confirmed["ok"] and confirmed["why"] == []
        enabled = ask(stop.path, "enable")
        assert enabled["ok"] and enabled["gate"] == "WAITING"


def test_the_latch_outlives_the_process(tmp_path):
    path = tmp_path / "b.sock"
    first = EmergencyStop(path)
    first.open()
    first.press()
    first.close()
    assert not path.exists() and latch_file(path).exists()
    assert EmergencyStop(path).latched
    set_latch(path, False)
    assert not EmergencyStop(path).latched


def test_a_press_in_a_signal_handler_reaches_the_disk(stop):
    before = signal.signal(signal.SIGUSR1, lambda *_: stop.press())
    try:
        os.kill(os.getpid(), signal.SIGUSR1)
        until = time.monotonic() + 5.0
        while not stop.latch_path.exists() and time.monotonic() < until:
            time.sleep(0.01)
        assert stop.latch_path.exists() and stop.take() == {"stop"}
    finally:
        signal.signal(signal.SIGUSR1, before)


def test_an_unknown_word_and_a_silent_client_do_nothing_and_block_no_client(stop):
    silent = socket.socket(socket.AF_UNIX)
    silent.connect(str(stop.path))
    endless = socket.socket(socket.AF_UNIX)
    endless.connect(str(stop.path))
    endless.sendall(b"x" * 5000)
    assert not ask(stop.path, "drive")["ok"]
    assert stop.take() == set() and not stop.latched
    assert ask(stop.path, "stop")["latched"]
    silent.close()
    endless.close()


def test_a_client_that_trickles_is_cut_short(stop):
    with socket.socket(socket.AF_UNIX) as slow:
        slow.connect(str(stop.path))
        with pytest.raises(BrokenPipeError):
            for _ in range(100):
                slow.sendall(b"s")
                time.sleep(0.05)


def connections(path, count):
    """Connections that say nothing."""
    made = []
    for _ in range(count):
        client = socket.socket(socket.AF_UNIX)
        client.settimeout(5.0)
        client.connect(str(path))
        made.append(client)
    return made


def is_open(client):
    client.setblocking(False)
    try:
        return client.recv(1) != b""
    except BlockingIOError:
        return True


@pytest.mark.parametrize("idle", [9, CLIENTS - 1])
def test_idle_connections_and_one_that_trickles_do_not_delay_a_stop(stop, idle):
    with contextlib.ExitStack() as stack:
        silent = [stack.enter_context(client) for client in connections(stop.path, idle)]
        silent[-1].sendall(b"st")
        stopper = stack.enter_context(socket.socket(socket.AF_UNIX))
        stopper.connect(str(stop.path))
        stopper.sendall(b"stop\n")
        assert until(lambda: stop.take() == {"stop"})
        assert any(map(is_open, silent)), "it was served while the others were waited for"


def test_more_connections_than_are_kept_close_the_oldest_and_a_stop_acts(stop):
    silent = connections(stop.path, CLIENTS + 5)
    assert press(stop.path)["latched"] and stop.take() == {"stop"}
    for client in silent:
        client.close()


def test_endless_connections_do_not_keep_a_stop_away(stop):
    """A process of its own: it is as fast as this machine lets it be."""
    code = (
        "import socket, sys\n"
        "print('on', flush=True)\n"
        "while True:\n"
        "    with socket.socket(socket.AF_UNIX) as s:\n"
        "        s.setblocking(False)\n"
        "        try: s.connect(sys.argv[1]); s.send(b'x')\n"
        "        except OSError: pass\n"
    )
    hog = subprocess.Popen([sys.executable, "-c", code, str(stop.path)], stdout=subprocess.PIPE)
    try:
        assert hog.stdout is not None and hog.stdout.readline() == b"on\n"
        with contextlib.suppress(LinkError):  # whether it hears the answer or not, it acts
            press(stop.path, timeout=0.5)
        assert until(lambda: "stop" in stop.take()) and stop.latched
    finally:
        hog.kill()
        hog.communicate()


def test_a_latch_written_by_another_process_is_a_stop_and_only_a_reset_removes_it(stop):
    set_latch(stop.path, True)
    assert until(lambda: stop.take() == {"stop"})
    time.sleep(0.1)  # several looks at it
    assert stop.latched and stop.latch_path.exists() and stop.take() == set()
    assert ask(stop.path, "reset")["ok"] and stop.take() == {"reset"}
    time.sleep(0.1)
    assert not stop.latched and not stop.latch_path.exists() and stop.take() == set()


def test_a_stop_outlives_a_bridge_that_does_not_answer(tmp_path):
    path = tmp_path / "b.sock"
    busy = Listener(path)  # listens, and serves no client
    with pytest.raises(LinkError, match="no answer"):
        press(path, timeout=0.1)
    busy.close()
    assert EmergencyStop(path).latched


def test_a_stop_that_cannot_be_kept_on_disk_is_asked_for_and_reported(tmp_path):
    with pytest.raises(LinkError, match=r"no bridge is running there; .*not be kept on disk"):
        press(tmp_path / "no" / "b.sock")


def test_a_latch_that_cannot_be_removed_is_not_reset(stop, monkeypatch):
    stop.press()
    assert until(stop.latch_path.exists)

    def refuse(path, latched):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr("firmware_bridge.safety.estop.set_latch", refuse)
    answer = ask(stop.path, "reset")
    assert not answer["ok"] and answer["latched"] and stop.take() == {"stop"}


def test_a_second_bridge_is_refused_and_a_dead_ones_socket_is_taken_over(stop, tmp_path):
    with pytest.raises(LinkError, match="another bridge is running"):
        EmergencyStop(stop.path).open()
    assert ask(stop.path, "status")["ok"]
    dead = tmp_path / "dead.sock"
    code = (
        f"import os, socket; s = socket.socket(socket.AF_UNIX); s.bind({str(dead)!r}); "
        "s.listen(); os._exit(0)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    assert dead.exists()
    heir = EmergencyStop(dead)
    heir.open()
    assert ask(dead, "status")["ok"]
    heir.close()


def test_a_file_that_is_no_socket_is_left_alone(tmp_path):
    for name in ("file", "folder", "link"):
        path = tmp_path / name
        if name == "file":
            path.write_text("robot = 1")
        elif name == "folder":
            path.mkdir()
        else:
            path.symlink_to(tmp_path / "file")
        with pytest.raises(ConfigError, match="left alone"):
            EmergencyStop(path).open()
    assert (tmp_path / "file").read_text() == "robot = 1" and (tmp_path / "link").is_symlink()
    assert not list(tmp_path.glob("*.lock"))


def test_a_bridge_removes_its_own_socket_only(stop, tmp_path):
    stop.path.rename(tmp_path / "moved")
    with socket.socket(socket.AF_UNIX) as other:
        other.bind(str(stop.path))
        stop.close()
        assert stop.path.exists()


def test_a_latch_that_cannot_be_written_still_holds_and_is_reported(tmp_path):
    folder = tmp_path / "gone"
    folder.mkdir()
    stop = EmergencyStop(folder / "b.sock")
    stop.open()
    shutil.rmtree(folder)
    stop.press()
    stop.close()
    assert stop.latched and "cannot keep the emergency stop on disk" in stop.problem


def test_where_a_socket_cannot_be_made(tmp_path):
    with pytest.raises(LinkError, match="cannot listen"):
        EmergencyStop(tmp_path / "no" / "b.sock").open()
    with pytest.raises(ConfigError, match="107 bytes"):
        EmergencyStop(tmp_path / ("x" * 200))
