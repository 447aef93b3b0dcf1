"""Where bridges listen: a press of the stop finds them all."""

import contextlib
import os
import stat

import pytest

from firmware_bridge.messages import ConfigError
from firmware_bridge.safety import places
from firmware_bridge.safety.estop import EmergencyStop, Listener
from firmware_bridge.safety.places import NAME, default_socket, found_sockets, likely_sockets


@pytest.fixture(autouse=True)
def machine(tmp_path, monkeypatch):
    """A machine of its own: a service, a user that is logged in, root, and temporary files."""
    for name in ("RUNTIME_DIRECTORY", "XDG_RUNTIME_DIR", "SUDO_UID"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    monkeypatch.setattr(places, "SERVICES", tmp_path / "service")
    monkeypatch.setattr(places, "USERS", tmp_path / "users")
    for folder in ("tmp", "service", f"users/{os.geteuid()}", "users/1234"):
        (tmp_path / folder).mkdir(parents=True)
    return tmp_path


@contextlib.contextmanager
def bridge(path):
    stop = EmergencyStop(path)
    stop.open()
    try:
        yield stop
    finally:
        stop.close()


def test_the_default_socket_lies_where_only_the_user_may_write(machine, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(machine))
    assert default_socket() == machine / NAME
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(machine / "none"))
    monkeypatch.delenv("XDG_RUNTIME_DIR")
    private = default_socket().parent
    assert stat.S_IMODE(private.stat().st_mode) == 0o700
    private.chmod(0o777)
    with pytest.raises(ConfigError, match="0700"):
        default_socket()


def test_a_shell_finds_the_service_and_what_was_started_without_a_session(machine, monkeypatch):
    without_session = default_socket()
    session = machine / "users" / str(os.geteuid())
    with bridge(machine / "service" / NAME), bridge(without_session):
        monkeypatch.setenv("XDG_RUNTIME_DIR", str(session))
        assert set(found_sockets()) == {machine / "service" / NAME, without_session}
        assert default_socket() == session / NAME
    assert found_sockets() == []


@pytest.mark.skipif(os.geteuid() != 0, reason="sudo is for root")
def test_sudo_finds_the_bridge_of_the_user_behind_it(machine, monkeypatch):
    listener = Listener(machine / "users" / "1234" / NAME)
    assert found_sockets() == []
    monkeypatch.setenv("SUDO_UID", "1234")
    assert found_sockets() == [machine / "users" / "1234" / NAME]
    listener.close()


def test_a_bridge_that_listens_elsewhere_is_found_by_the_link_it_leaves(machine, monkeypatch):
    monkeypatch.chdir(machine)
    with bridge(machine / "robot.sock"):
        assert found_sockets() == [machine / "robot.sock"]
    assert found_sockets() == [] and not list(default_socket().parent.iterdir())


def test_a_link_that_leads_nowhere_and_other_files_are_no_bridges(machine):
    default_socket().with_name("kmpc-bridge-7.sock").symlink_to(machine / "gone")
    default_socket().with_name("kmpc-bridge-8.sock").write_text("")
    assert found_sockets() == []


def test_a_planted_folder_for_temporary_files_is_not_looked_into(machine, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(machine))
    planted = machine / "tmp" / f"kmpc-bridge-{os.geteuid()}"
    planted.mkdir()
    planted.chmod(0o777)
    assert planted / NAME not in likely_sockets()


def test_a_planted_folder_hides_no_bridge_and_stops_no_bridge_elsewhere(machine):
    """Anybody may make a folder of that name among the temporary files."""
    planted = machine / "tmp" / f"kmpc-bridge-{os.geteuid()}"
    planted.mkdir()
    planted.chmod(0o777)
    with bridge(machine / "service" / NAME):
        assert found_sockets() == [machine / "service" / NAME]
    with bridge(machine / "own.sock") as stop:
        assert f"needs --socket {machine / 'own.sock'}" in stop.problem
    for folder in (machine / "service", machine / "users" / str(os.geteuid())):
        folder.rmdir()
    with pytest.raises(ConfigError, match="0700"):
        likely_sockets()
