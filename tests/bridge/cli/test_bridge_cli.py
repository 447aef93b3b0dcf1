"""kmpc-bridge as a user meets it: every command, on emulated robots over real links."""

import contextlib
import json
import math
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from courses import COURSE, PATIENT

import kmpc_lite as kl
from firmware_bridge.cli.course import course
from firmware_bridge.cli.emulate import build_emulator
from firmware_bridge.cli.emulated_board import BOARDS, robot_text
from firmware_bridge.cli.latency import table
from firmware_bridge.cli.main import main
from firmware_bridge.link import open_transport
from firmware_bridge.messages import LinkError
from firmware_bridge.robot_file import load_robot
from firmware_bridge.runtime.session import open_driver
from firmware_bridge.safety.estop_client import ask
from firmware_bridge.safety.latch import latch_file
from kmpc_lite.cli.fit import make_dictionary
from kmpc_lite.recording.drive_file import load_drive

ROBOTS = Path(__file__).parents[3] / "docs" / "robots"
FAR = COURSE.replace("goal = [0.7, 0.15, 0.0]", "goal = [1.8, -0.3, 0.0]")
FAST = ["--v-max", "0.5", "--omega-max", "1.5", "--settle", "0.3", "--seconds", "60"]


@pytest.fixture
def desk(tmp_path, monkeypatch):
    """A folder of its own, with a course and no emergency stop from elsewhere."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    for name in ("SERVICES", "USERS"):  # no robot of this machine's is ours to stop
        monkeypatch.setattr(f"firmware_bridge.safety.places.{name}", tmp_path / "none")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    (tmp_path / "course.toml").write_text(COURSE)
    return tmp_path


@contextlib.contextmanager
def emulated(name: str, url: str = "pty:link", start=(0.0, 0.0, 0.0), arm_after: float = 0.1):
    robot = load_robot(ROBOTS / f"{name}.toml", {"link": {"url": url}})
    emulator = build_emulator(robot, start, 0.0, 1.0, 0, arm_after)
    emulator.start(url)
    try:
        yield emulator
    finally:
        emulator.close()


def robot_options(name: str) -> list[str]:
    quick = ["--set", "safety.hold=0.3", "--set", "safety.settle=0.2"]
    return [
        str(ROBOTS / f"{name}.toml"),
        "--link",
        "pty:link",
        *quick,
        *PATIENT,
        *(["--arm"] if name == "rover" else []),
    ]


def wait_for(condition, seconds: float = 20.0) -> bool:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if condition():
            return True
        time.sleep(0.01)
    return False


@contextlib.contextmanager
def meanwhile(action):
    """Run `action` in another thread, since commands want the main one."""
    problems = []

    def guarded():
        try:
            action()
        except BaseException as error:
            problems.append(error)

    thread = threading.Thread(target=guarded)
    thread.start()
    yield
    thread.join(30.0)
    assert not thread.is_alive() and not problems, problems


def start_command(*arguments: str) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-m", "firmware_bridge.cli.main", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def look_at_the_states(states):
    """It drove and held its goal; where the machine is busy it may have braked and gone on."""
    assert states[:2] == ["WAITING", "ACTIVE"] and states[-2:] == ["HOLDING", "RELEASED"]
    assert set(states[2:-2]) <= {"WAITING", "ACTIVE", "HOLDING"}


def look_at_the_recording(run, report):
    """What a drive recorded of itself is what was driven."""
    details, outcome = run.details, report["arrived_after_s"]
    assert run.outcome.value == "reached" and run.duration == outcome
    assert run.info["kind"] == "driven" and run.info["ended"] == "arrived"
    states = [state for _, state, _ in details.gates if state not in ("IDLE", "STOPPING")]
    changes = [b for a, b in zip(["", *states], states, strict=False) if a != b]
    look_at_the_states(changes)
    assert abs(next(t for t, state, _ in details.gates if state == "ACTIVE")) < 1e-9
    assert details.times[-1] > outcome and (np.diff(details.times) > 0.0).all()
    assert np.nanmax(details.pose_ages) < 5.0 and (details.step_times > 0.0).all()
    assert len(details.sent) == report["loop"]["commands_sent"]
    assert len(details.measured) > 20 and details.health[-1][1]["connected"]
    assert np.hypot(*(run.states[-1, :2] - (0.7, 0.15))) < 0.08
    assert details.margins.min() >= 0.05, "the scenario asks for so much"


SLOW = [pytest.param(name, marks=pytest.mark.long) for name in ("odrive", "vesc")]


@pytest.mark.parametrize("name", ["rover", "roboclaw", *SLOW])
def test_run_drives_past_the_obstacle_to_the_goal_and_records_it(desk, capsys, name):
    options = [
        *robot_options(name),
        "--scenario",
        "course.toml",
        "--record",
        "drive",
        "--json",
        *FAST,
    ]
    # where the machine is busy for a moment, the robot brakes and goes on: it is not given up
    options += ["--set", "safety.hold=3"]
    if name == "roboclaw":  # with a learned model, twenty times a second
        kl.fit(
            kl.generate_dataset(kl.DifferentialDrive(), episodes=10, steps=60, dt=0.1, seed=0)
        ).save("robot.npz")
        options += ["--model", "robot.npz", "--period", "0.05", "--trust-model"]
        options += ["--command-period", "0.1"]
    with emulated(name) as robot:
        assert main(["run", *options]) == 0
        assert wait_for(lambda: robot.stopped)
        x, y, theta = robot.pose
    report = json.loads(capsys.readouterr().out)
    assert report["outcome"] == "arrived" and report["arrived"] and report["scenario"] == "course"
    assert math.hypot(x - 0.7, y - 0.15) < 0.08 and abs(math.remainder(theta, math.tau)) < 0.3
    # the goal was held within 5 cm; the last pose may be one of parking, or of a braking rover
    assert report["clearance_m"] > 0.0 and report["position_error_m"] <= 0.08
    states = [
        c["to"] for c in report["loop"]["changes"] if c["to"] != "STOPPING"
    ]  # a robot that stands at its goal needs no ramp
    look_at_the_states(states)
    assert set(report["loop"]["times_ms"]["controller"]) == {
        "count",
        "mean",
        "p50",
        "p99",
        "p99.9",
        "max",
    }
    data = kl.Dataset.load("drive/drive.csv")
    assert data.dt == pytest.approx(0.05 if name == "roboclaw" else 0.1) and data.steps > 10
    log = "drive/drive.tlog" if name == "rover" else "drive/drive.raw"
    assert report["files"] == ["drive/drive.csv", log, "drive/drive.mcap"]
    look_at_the_recording(load_drive(Path("drive")), report)
    assert kl.Dataset.load("drive", dt=0.1).steps > 10
    assert main(["replay", log, "--json"]) == 0
    replayed = json.loads(capsys.readouterr().out)
    assert replayed["seconds"] > 2.0
    if name == "rover":
        assert (
            replayed["messages"]["SET_POSITION_TARGET_LOCAL_NED"] > 50 and replayed["poses"] > 100
        )
        assert 0.7 < replayed["distance"] < 1.5
    else:
        assert replayed["bytes_in"] > 1000 and replayed["bytes_out"] > 1000


def test_a_drive_that_does_not_arrive_is_exit_status_1_and_people_are_told_what_was_measured(
    desk, capsys
):
    with emulated("roboclaw"):
        Path("far.toml").write_text(FAR)
        assert (
            main(["run", *robot_options("roboclaw"), "--scenario", "far.toml", "--seconds", "1"])
            == 1
        )
    out = capsys.readouterr().out
    for words in (
        "IDLE -> WAITING",
        "ACTIVE -> STOPPING",
        "time is up: after -",
        "pose to command on the wire",
        "p99.9",
        "command spacing, off by",
    ):
        assert words in out
    assert "\x1b" not in out  # no terminal, no picture


def test_ctrl_c_brakes_holds_and_releases(desk):
    with emulated("rover") as rover:
        Path("far.toml").write_text(FAR)
        child = start_command("run", *robot_options("rover"), "--scenario", "far.toml", "--json")
        assert wait_for(lambda: not rover.stopped and rover.pose[0] > 0.1)
        child.send_signal(signal.SIGINT)
        out, err = child.communicate(timeout=20.0)
        assert (
            child.returncode == 130
            and err.startswith("kmpc: control.latency: not given")
            and err.count("\n") == 1
        )
        assert wait_for(lambda: rover.stopped) and rover.mode == "HOLD"
    report = json.loads(out)
    assert (
        report["outcome"] == "stopped by SIGINT"
        and report["loop"]["changes"][-1]["to"] == "RELEASED"
    )


def test_kill_9_leaves_the_robot_to_the_boards_own_watchdog(desk):
    with emulated("roboclaw") as board:
        Path("far.toml").write_text(FAR)
        child = start_command("run", *robot_options("roboclaw"), "--scenario", "far.toml")
        assert wait_for(lambda: not board.stopped and board.pose[0] > 0.1)
        child.kill()
        child.communicate()
        assert wait_for(lambda: board.stopped)  # nobody else is there to do it


def test_the_emergency_stop_stops_a_running_robot_and_outlives_the_run(desk, capsys):
    Path("far.toml").write_text(FAR)
    with emulated("roboclaw") as board:
        child = start_command("run", *robot_options("roboclaw"), "--scenario", "far.toml", "--json")
        assert wait_for(lambda: not board.stopped and board.pose[0] > 0.1)
        assert main(["estop", "--json"]) == 0
        answer = json.loads(capsys.readouterr().out)
        assert {
            "ok": True,
            "latched": True,
            "gate": "ESTOP",
            "confirmed": True,
        }.items() <= answer.items()
        assert wait_for(lambda: board.stopped)
        assert main(["estop", "--enable"]) == 0
        time.sleep(0.6)  # longer than it brakes before it releases
        assert board.stopped and "pressed, gate ESTOP" in capsys.readouterr().out
        assert main(["estop", "--reset"]) == 0 and main(["estop", "--enable"]) == 0
        assert wait_for(lambda: not board.stopped)
        child.send_signal(signal.SIGUSR1)
        assert wait_for(lambda: ask(Path("kmpc-bridge.sock"), "status")["gate"] == "ESTOP")
        child.send_signal(signal.SIGTERM)
        report = json.loads(child.communicate(timeout=20.0)[0])
        assert child.returncode == 130 and report["outcome"] == "stopped by SIGTERM"
        # the next run refuses, until somebody resets
        capsys.readouterr()
        command = ["run", *robot_options("roboclaw"), "--scenario", "course.toml", *FAST]
        assert main(command) == 2
        assert "the emergency stop is pressed" in capsys.readouterr().err
        assert main(["estop", "--reset"]) == 0 and not latch_file(Path("kmpc-bridge.sock")).exists()


def test_the_emergency_stop_without_a_bridge_keeps_the_next_one_still(desk, capsys):
    assert main(["estop", "--status"]) == 1
    assert main(["estop"]) == 1
    assert (
        "no bridge is running" in capsys.readouterr().out
        and latch_file(Path("kmpc-bridge.sock")).exists()
    )
    assert main(["estop", "--enable"]) == 1
    assert (
        main(
            [
                "check",
                "--driver",
                "mavlink",
                "--link",
                "tcp:127.0.0.1:9",
                "--timeout",
                "0.2",
                "--json",
            ]
        )
        == 1
    )
    texts = [f["text"] for f in json.loads(capsys.readouterr().out.splitlines()[-1])["findings"]]
    assert any("the emergency stop is pressed" in t for t in texts)
    assert main(["estop", "--reset", "--socket", "kmpc-bridge.sock"]) == 0
    assert not latch_file(Path("kmpc-bridge.sock")).exists()


def test_a_pilot_who_takes_over_keeps_the_rover_until_it_is_enabled_again(desk, capsys):
    seen = {}
    with emulated("rover") as rover:

        def pilot():
            assert wait_for(lambda: rover.pose[0] > 0.1)
            rover.pilot_mode(0)  # MANUAL
            assert wait_for(lambda: ask(Path("kmpc-bridge.sock"), "status")["gate"] == "YIELDED")
            time.sleep(0.5)
            seen["mode"] = rover.mode
            ask(Path("kmpc-bridge.sock"), "enable")

        with meanwhile(pilot):
            assert (
                main(["run", *robot_options("rover"), "--scenario", "course.toml", "--json", *FAST])
                == 0
            )
    report = json.loads(capsys.readouterr().out)
    assert seen["mode"] == "MANUAL"
    assert [c["to"] for c in report["loop"]["changes"]][2:5] == ["YIELDED", "WAITING", "ACTIVE"]


def test_record_at_random_stays_inside_and_can_be_learned_from(desk, capsys):
    with emulated("roboclaw") as board:
        fence = ["--geofence", "-1.3", "-1.3", "1.3", "1.3"]
        outside = []
        with meanwhile(
            lambda: outside.extend(p for p in watch(board, 4.5) if max(abs(p[0]), abs(p[1])) > 1.3)
        ):
            command = [
                "record",
                *robot_options("roboclaw"),
                "--excite",
                "--seconds",
                "3",
                "--hold",
                "0.3",
                "--output",
                "drive",
                "--json",
                *fence,
            ]
            assert main(command) == 0
    report = json.loads(capsys.readouterr().out)
    assert outside == [] and report["rows"] > 25 and report["problems"] == []
    assert report["outcome"] == "recorded" and not report["coverage"]["complete"]
    assert 0.0 < report["coverage"]["parts"]["length"] < 0.1
    assert any(line.startswith("reverse: ") for line in report["coverage"]["missing"])
    data = kl.Dataset.load("drive.csv")
    assert data.dt == pytest.approx(0.1) and data.steps > 25


def watch(board, seconds: float) -> list[tuple[float, float, float]]:
    poses, until = [], time.monotonic() + seconds
    while time.monotonic() < until:
        poses.append(board.pose)
        time.sleep(0.02)
    return poses


def test_record_by_hand_sends_nothing_and_its_tlog_gives_the_same_csv(desk, capsys):
    with emulated("rover") as rover:
        rover.pilot_mode(0)

        def pilot():
            assert wait_for(
                lambda: Path("hand.csv").exists() and Path("hand.csv").stat().st_size > 500
            )
            os.kill(os.getpid(), signal.SIGINT)

        with meanwhile(pilot):
            command = [
                "record",
                str(ROBOTS / "rover.toml"),
                "--link",
                "pty:link",
                "--by-hand",
                "--output",
                "hand",
                "--json",
            ]
            assert main(command) == 0
        assert rover.mode == "MANUAL"
    report = json.loads(capsys.readouterr().out)
    assert report["rows"] > 5 and report["loop"]["commands_sent"] == 0
    assert {c["to"] for c in report["loop"]["changes"]} <= {"IDLE"}
    assert main(["replay", "hand.tlog", "--csv", "again.csv", "--json"]) == 0
    replayed = json.loads(capsys.readouterr().out)
    assert replayed["rows"] > 5 and "SET_POSITION_TARGET_LOCAL_NED" not in replayed["messages"]
    # a period is the median of stamps that are written with six digits
    again, hand = kl.Dataset.load("again.csv").dt, kl.Dataset.load("hand.csv").dt
    assert again == pytest.approx(hand, rel=1e-3)
    assert main(["replay", "hand.tlog", "--csv", "again.csv"]) == 2
    assert "exists already" in capsys.readouterr().err


def test_replay_serves_a_log_to_whoever_listens(desk, capsys):
    from firmware_bridge.link.log import Chunk, raw_log

    log = raw_log(Path("a.raw"))
    for k in range(20):
        log.put(Chunk(100.0 + 0.01 * k, True, b"in%02d" % k))
        log.put(Chunk(100.0 + 0.01 * k, False, b"out"))
    log.close()
    heard = bytearray()
    with socket.create_server(("127.0.0.1", 0)) as free:
        url = f"tcp:127.0.0.1:{free.getsockname()[1]}"

    def listener():
        def start():
            transport = open_transport(url)
            try:
                transport.start(lambda data, stamp: heard.extend(data))
            except LinkError:
                return False
            return True

        assert wait_for(start) and wait_for(lambda: len(heard) >= 80)

    with meanwhile(listener):
        assert main(["replay", "a.raw", "--link", url, "--speed", "2"]) == 0
    assert bytes(heard) == b"".join(b"in%02d" % k for k in range(20))
    assert main(["replay", "a.raw", "--csv", "x.csv"]) == 2


def test_check_says_what_is_missing_and_moves_nothing(desk, capsys):
    with emulated("rover") as rover:
        assert (
            main(
                [
                    "check",
                    str(ROBOTS / "rover.toml"),
                    "--link",
                    "pty:link",
                    "--seconds",
                    "0.5",
                    *PATIENT,
                ]
            )
            == 0
        )
        out = capsys.readouterr().out
        assert "pose: x " in out and "MISSING" not in out
        assert "ok       not given to us yet: MANUAL, not armed; run --arm takes it" in out
        assert rover.pose == (0.0, 0.0, 0.0) and rover.mode == "MANUAL"
    with emulated("roboclaw"):
        assert (
            main(
                [
                    "check",
                    str(ROBOTS / "roboclaw.toml"),
                    "--link",
                    "pty:link",
                    "--seconds",
                    "0.5",
                    *PATIENT,
                    "--json",
                ]
            )
            == 0
        )
        report = json.loads(capsys.readouterr().out)
        assert (
            report["ok"]
            and "the safety gate would let it drive now" in report["findings"][-1]["text"]
        )


def test_emulate_serves_until_it_is_ended_and_tells_where_the_robot_is(desk):
    child = start_command(
        "emulate", "mavlink", "--link", "pty:rover", "--start", "0.5", "0.25", "0.1", "--json"
    )
    assert wait_for(lambda: Path("rover").is_symlink())
    child.send_signal(signal.SIGTERM)
    out, err = child.communicate(timeout=20.0)
    assert (child.returncode, err) == (0, "") and json.loads(out)["pose"] == [0.5, 0.25, 0.1]
    assert not Path("rover").is_symlink()


@pytest.mark.parametrize("command", ["check", "run", "record", "replay", "emulate", "estop"])
def test_every_command_has_help_with_an_example_and_json(command, capsys):
    with pytest.raises(SystemExit) as caught:
        main([command, "--help"])
    out = capsys.readouterr().out
    assert caught.value.code == 0 and f"example:\n  kmpc {command}" in out and "--json" in out


MAVLINK = ["--driver", "mavlink", "--link", "pty:link"]


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (["run"], "link.url: missing"),
        (["run", "none.toml"], "none.toml: cannot read the robot file"),
        (["run", *MAVLINK], "control.scenario: missing: give --scenario NAME"),
        (["run", *MAVLINK, "--scenario", "nowhere"], "no scenario named 'nowhere'"),
        (["run", *MAVLINK, "--scenario", "course.toml", "--model", "none.npz"], "none.npz"),
        (
            ["run", *MAVLINK, "--scenario", "course.toml", "--period", "0.2"],
            "control.period: 0.2 s is too long",
        ),
        (["run", *MAVLINK, "--scenario", "course.toml", "--timeout", "0.2"], "link: no such port"),
        (
            ["run", "--driver", "vesc", "--link", "pty:link", "--scenario", "course.toml", "--arm"],
            "--arm: only an autopilot is armed",
        ),
        (
            ["run", "--driver", "vesc", "--link", "pty:link", "--scenario", "course.toml"],
            "geometry.wheel_radius: missing",
        ),
        (
            ["run", *MAVLINK, "--scenario", "course.toml", "--set", "board.system"],
            "--set board.system: expected SECTION.KEY=VALUE",
        ),
        (
            ["run", *MAVLINK, "--scenario", "course.toml", "--set", "board.system=one"],
            "--set board.system=one: expected",
        ),
        (
            ["run", *MAVLINK, "--scenario", "course.toml", "--set", "board.system=300"],
            "board.system: expected a MAVLink id",
        ),
        (
            ["run", *MAVLINK, "--scenario", "course.toml", "--v-max", "-1"],
            "limits.v_max: expected a number > 0",
        ),
        (
            ["run", "--driver", "mavlink", "--link", "smoke:signals", "--scenario", "course.toml"],
            "link: expected serial:",
        ),
        (
            ["run", *MAVLINK, "--scenario", "course.toml", "--socket", "no/such/dir/s"],
            "cannot listen",
        ),
        (
            ["run", *MAVLINK, "--scenario", "course.toml", "--rehearse"],
            "--rehearse: goes with a learned model",
        ),
        (
            ["record", *MAVLINK, "--excite", "--output", "a"],
            "safety.geofence: missing: random driving needs",
        ),
        (
            ["record", *MAVLINK, "--excite", "--output", "a", "--geofence", "0", "0", ".1", "1"],
            "too small to drive in at random",
        ),
        (
            ["record", *MAVLINK, "--by-hand", "--until-covered", "--output", "a"],
            "--until-covered: goes with --excite",
        ),
        (["record", *MAVLINK, "--by-hand", "--arm", "--output", "a"], "--by-hand: the pilot arms"),
        (
            ["record", *MAVLINK, "--by-hand", "--output", "course.toml/a"],
            "cannot write: Not a directory",
        ),
        (["replay", "none.tlog"], "none.tlog: cannot read"),
        (["replay", "course.toml"], "neither a tlog nor a raw log"),
        (["emulate", "none.toml"], "none.toml: cannot read"),
        (["emulate", "mavlink", "--link", "serial:/dev/null"], "an emulator serves pty:"),
        (["emulate", "mavlink", "--link", "pty:x", "--scenario", "nowhere"], "no scenario named"),
        (["emulate", "mavlink", "--link", "pty:x", "--slip", "-1"], "slip"),
        (["emulate", "mavlink"], "link.url: missing"),
    ],
)
def test_bad_input_is_one_line_and_exit_status_2(desk, capsys, command, words):
    assert main(command) == 2
    captured = capsys.readouterr()
    assert (
        words in captured.err
        and captured.err.startswith("kmpc: ")
        and captured.err.count("\n") == 1
    )
    assert captured.out == "" and not list(desk.glob("a.*"))


@pytest.mark.parametrize(
    "command",
    [
        [],
        ["fly"],
        ["run", "--seconds", "0"],
        ["run", "--seconds", "soon"],
        ["record", "--output", "a"],
    ],
)
def test_a_command_line_that_cannot_be_understood_is_exit_status_2_too(command, capsys):
    assert main(command) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("driver", BOARDS)
def test_the_robots_of_the_latency_table_can_be_built(desk, driver):
    Path("robot.toml").write_text(robot_text(driver, desk, 0.02))
    robot = load_robot("robot.toml")
    assert (
        robot.link.driver == driver and robot.control.period == robot.control.command_period == 0.02
    )
    open_driver(robot, open_transport(robot.link.url)).close()


@pytest.mark.long
def test_the_latency_table_has_a_row_for_each_driver_and_rate(desk, capsys):
    assert main(["latency", "--seconds", "2", "--drivers", "mavlink", "vesc", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [(r["driver"], r["rate_hz"]) for r in rows] == [
        ("mavlink", 10.0),
        ("mavlink", 50.0),
        ("vesc", 10.0),
        ("vesc", 50.0),
    ]
    assert all(r["times_ms"]["pose to command on the wire"]["count"] > 5 for r in rows)
    assert [line.split()[:2] for line in table(rows).splitlines()[2:]] == [
        [r["driver"], f"{r['rate_hz']:g}"] for r in rows
    ]


def test_a_csv_that_a_power_cut_tore_is_told_and_mended(desk, capsys):
    rows = b"".join(b"%.6f,0.1,0.2,0.3,0.4,0.5\n" % (0.1 * k) for k in range(20))
    (desk / "drive.csv").write_bytes(
        b"t,x,y,theta,v,omega\n" + rows + b"2.000000,0.1,0.2,0.3,0.4,0."
    )
    assert main(["replay", "drive.csv", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {
        "log": "drive.csv",
        "rows": 20,
        "torn_bytes": 27,
        "mended": False,
    }
    assert main(["replay", "drive.csv", "--mend"]) == 0
    assert (desk / "drive.csv").read_bytes().endswith(rows)
    (desk / "other.csv").write_bytes(b"name,phone\nA,1")
    for words in (
        ["other.csv", "--mend"],
        ["drive.tlog", "--mend"],
        ["drive.csv", "--csv", "b.csv"],
    ):
        capsys.readouterr()
        assert main(["replay", *words]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert (desk / "other.csv").read_bytes() == b"name,phone\nA,1"


@pytest.mark.parametrize(
    ("name", "model", "given", "expected"),
    [
        ("mavlink", None, None, 0.2),
        ("mavlink", None, 0.0, 0.0),
        ("mavlink", None, 0.35, 0.35),
        ("mavlink", (0,), None, 0.2),
        ("mavlink", (0, 1), None, 0.0),
        ("roboclaw", None, None, 0.0),
        ("vesc", None, 0.1, 0.1),
    ],
)
def test_a_model_without_lags_gets_a_latency_that_suits_the_driver_and_the_user_is_told(
    desk, name, model, given, expected
):
    control = {"scenario": "course.toml", "latency": given}
    if model is not None:
        data = kl.generate_dataset(kl.DifferentialDrive(), episodes=6, steps=60, dt=0.1, seed=0)
        kl.fit(data, make_dictionary("unicycle", list(model), False)).save("robot.npz")
        control["model"] = "robot.npz"
    drive = course(
        load_robot(None, {"link": {"url": "pty:x", "driver": name}, "control": control}), 1.0, 10.0
    )
    assert drive.robot.control.latency == expected
    told = [note for note in drive.notes if "control.latency" in note]
    assert bool(told) == (given is None and expected > 0.0) and "\n" not in "".join(told)
