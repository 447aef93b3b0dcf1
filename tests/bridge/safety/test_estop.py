"""The emergency stop's socket and latch."""

import os
import signal
import socket
import stat
import subprocess
import sys
import threading
import time

import pytest

from firmware_bridge.messages import ConfigError, LinkError
from firmware_bridge.safety.estop import EmergencyStop, ask, default_socket, latch_file, set_latch
from firmware_bridge.safety.gate_table import GateState


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
    assert ask(stop.path, "enable")["latched"] and stop.latched
    assert not ask(stop.path, "reset")["latched"]
    assert stop.take() == {"enable", "reset"} and not stop.latch_path.exists()


def test_enable_is_refused_with_the_reason_while_it_is_barred(stop):
    stop.tell(GateState.RELEASED, ("board not ready",), "restarted: look first")
    answer = ask(stop.path, "enable")
    assert not answer["ok"] and answer["why"] == ["restarted: look first"]
    assert stop.take() == set()
    assert ask(stop.path, "status")["why"] == ["board not ready"]
    assert ask(stop.path, "confirm")["ok"] and stop.take() == {"confirm"}
    stop.tell(GateState.RELEASED)
    assert ask(stop.path, "enable")["ok"] and stop.take() == {"enable"}


def test_the_answer_tells_whether_the_gate_has_obeyed(stop):
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


def test_an_unknown_word_and_a_silent_client_do_nothing_and_hold_up_nobody(stop):
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


def test_without_a_bridge_there_is_one_clear_line(tmp_path):
    with pytest.raises(LinkError, match="no bridge is running there"):
        ask(tmp_path / "none.sock", "stop")


def test_whoever_is_no_bridge_is_told_apart(tmp_path):
    path = tmp_path / "other.sock"
    with socket.socket(socket.AF_UNIX) as other:
        other.bind(str(path))
        other.listen()

        def chatter() -> None:
            for word in (b"[1]\n", b"hello\n"):
                client, _ = other.accept()
                client.recv(100)
                client.sendall(word)
                client.close()

        thread = threading.Thread(target=chatter)
        thread.start()
        with pytest.raises(LinkError, match="no bridge"):
            ask(path, "status")
        with pytest.raises(LinkError, match="no answer"):
            ask(path, "status")
        thread.join()


def test_a_latch_that_cannot_be_written_still_holds_and_is_told(tmp_path):
    folder = tmp_path / "gone"
    folder.mkdir()
    stop = EmergencyStop(folder / "b.sock")
    stop.open()
    stop.path.unlink()
    folder.rmdir()
    stop.press()
    stop.close()
    assert stop.latched and "cannot keep the emergency stop on disk" in stop.problem


def test_where_a_socket_cannot_be_made(tmp_path):
    with pytest.raises(LinkError, match="cannot listen"):
        EmergencyStop(tmp_path / "no" / "b.sock").open()
    with pytest.raises(ConfigError, match="107 bytes"):
        EmergencyStop(tmp_path / ("x" * 200))


def test_the_default_socket_lies_where_only_the_user_may_write(tmp_path, monkeypatch):
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    assert default_socket() == tmp_path / "kmpc-bridge.sock"
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(tmp_path / "none"))
    monkeypatch.delenv("XDG_RUNTIME_DIR")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    private = default_socket().parent
    assert stat.S_IMODE(private.stat().st_mode) == 0o700
    private.chmod(0o777)
    with pytest.raises(ConfigError, match="0700"):
        default_socket()
