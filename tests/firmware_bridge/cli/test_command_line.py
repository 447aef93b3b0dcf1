"""Command lines of the bridge: help with an example, and one line for what is wrong."""

from __future__ import annotations

import json

import pytest
from courses import PATIENT
from emulated_robots import ROBOTS, emulated

from kmpc_lite.cli.main import main


@pytest.mark.parametrize("command", ["check", "run", "record", "emulate", "estop"])
def test_every_command_has_help_with_an_example(command, capsys):
    with pytest.raises(SystemExit) as caught:
        main([command, "--help"])
    out = capsys.readouterr().out
    assert caught.value.code == 0 and f"example:\n  kmpc {command}" in out


ROVER = "--driver mavlink --link pty:link"
COURSE = f"{ROVER} --scenario course.toml"
FENCE = "--geofence -.5 -.5 .5 .5"
WRONG = [
    ("run", "link.url: missing"),
    ("run none.toml", "none.toml: cannot read the robot file"),
    (f"run {ROVER}", "control.scenario: missing: give --scenario NAME"),
    (f"run {ROVER} --scenario nowhere", "no scenario named 'nowhere'"),
    (f"run {ROVER} --goal 9 0 0 --scenario course.toml", "outside the bounds"),
    (f"run {ROVER} {FENCE} --goal 1 0 0", "goal (1, 0) lies outside the geofence"),
    (f"run {COURSE} --model none.npz", "none.npz"),
    (f"run {COURSE} --period 0.2", "control.period: 0.2 s is too long"),
    (f"run {COURSE} --timeout 0.2", "link: no such port"),
    (
        "run --driver vesc --link pty:link --scenario course.toml --arm",
        "--arm: only an autopilot is armed",
    ),
    ("run --driver vesc --link pty:link --scenario course.toml", "geometry.wheel_radius: missing"),
    (f"run {COURSE} --set board.system", "--set board.system: expected SECTION.KEY=VALUE"),
    (f"run {COURSE} --set board.system=one", "--set board.system=one: expected"),
    (f"run {COURSE} --set board.system=300", "board.system: expected a MAVLink id"),
    (f"run {COURSE} --v-max -1", "limits.v_max: expected 0.0001 to 100 m/s"),
    ("run --driver mavlink --link smoke:signals --scenario course.toml", "link: expected serial:"),
    (f"run {COURSE} --socket no/such/dir/s", "cannot listen"),
    (f"run {COURSE} --click", "--click: goals come from the live page: give --live, too"),
    (f"run {COURSE} --rehearse", "--rehearse: goes with a learned model"),
    (f"record {ROVER} --excite --output a", "safety.geofence: missing: random driving needs"),
    (f"record {ROVER} --excite --output a --geofence 0 0 .1 1", "too small to drive in at random"),
    (f"record {ROVER} --by-hand --until-covered --output a", "--until-covered: goes with --excite"),
    (f"record {ROVER} --by-hand --arm --output a", "--by-hand: the pilot arms"),
    (f"record {ROVER} --by-hand --output course.toml/a", "cannot write: Not a directory"),
    ("emulate none.toml", "none.toml: cannot read"),
    ("emulate mavlink --link serial:/dev/null", "an emulator serves pty:"),
    ("emulate mavlink --link pty:x --scenario nowhere", "no scenario named"),
    ("emulate mavlink --link pty:x --slip -1", "slip"),
    ("emulate mavlink", "link.url: missing"),
]


@pytest.mark.parametrize(("command", "words"), WRONG)
def test_bad_input_is_one_line_and_exit_status_2(desk, capsys, command, words):
    assert main(command.split()) == 2
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


def test_check_says_what_is_missing_and_moves_nothing(desk, capsys):
    with emulated("rover", arm_after=0.0) as rover:  # it may be asked at once
        assert (
            main([*f"check {ROBOTS}/rover.toml --link pty:link --seconds 0.5".split(), *PATIENT])
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
                    *f"check {ROBOTS}/roboclaw.toml --link pty:link --seconds 2".split(),
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
