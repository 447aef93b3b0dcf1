"""`kmpc run`: drive a scenario with a learned model."""

from __future__ import annotations

import argparse
import json
from contextlib import ExitStack
from functools import partial
from typing import Any

from firmware_bridge.cli.options import (
    add_course_options,
    add_drive_options,
    add_live_options,
    add_robot_options,
    live_address,
    people,
    prepare,
    read_robot,
)
from firmware_bridge.integration.course import DRIVE_TIME, Course, course
from firmware_bridge.integration.recording import recorder_of, recording_to
from firmware_bridge.integration.rehearsal import Rehearsal, advice
from firmware_bridge.integration.showing import Showing
from firmware_bridge.messages import BridgeError, ConfigError
from firmware_bridge.robot_file import SECTIONS
from firmware_bridge.safety.places import default_socket
from kmpc_lite.cli.command import Command, command_line, positive
from kmpc_lite.cli.options import add_clearance, add_goal_options, drive_overrides, split_settings


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add_robot_options(parser)
    add_drive_options(parser)
    add = parser.add_argument
    add_course_options(add)
    text = (
        "first drive with a model: at half speed, stopped if the model predicts no "
        "better than the nominal robot; a model that has passed drives at full speed"
    )
    add("--rehearse", action="store_true", help=text)
    text = "scenario file, or the name of one that comes with kmpc_lite"
    add("--scenario", dest="control.scenario", metavar="NAME", help=text)
    add_goal_options(add, "on an empty map about the origin of the robot's frame")
    text = "drive to where the map of the --live page is tapped, until Ctrl-C or --seconds"
    add("--click", action="store_true", help=text)
    add_clearance(add)
    text = (
        "control.map = false: the controller ignores the scenario's obstacles, and drives "
        "by the lidar alone"
    )
    add("--by-sight", dest="control.map", action="store_const", const=False, help=text)
    text = f"give up after this time of driving, or of waiting [s] (default: {DRIVE_TIME:g} a goal)"
    add("--seconds", type=positive, metavar="S", help=text)
    text = "how long to wait for the vehicle before it drives [s] (default: as --seconds)"
    add("--wait", type=positive, metavar="S", help=text)
    add_live_options(parser)


def run(options: argparse.Namespace) -> int:
    """Drive to the goal; status 1 where the robot does not arrive."""
    from firmware_bridge.runtime.drive import run as drive

    options.set, tuning = split_settings(options.set, SECTIONS)
    robot, page = read_robot(options), live_address(options)
    if options.click and page is None:
        raise ConfigError("--click: goals come from the live page: give --live, too")
    showing = None
    if page is not None:
        showing = Showing(page, robot.socket or default_socket())
    saw = None if showing is None else showing.saw
    rehearse, told = advice(robot, options.rehearse)
    job = course(
        robot,
        options.settle,
        options.seconds,
        saw,
        wait=options.wait,
        rehearse=rehearse,
        overrides=drive_overrides(options, tuning),
        click=options.click,
    )
    prepare(options)
    with ExitStack() as stack:
        name = stack.enter_context(recording_to(options.record))
        watching: dict[str, Any] = {}
        if showing is not None:
            showing.job = job
            stack.enter_context(showing)
            watching["watched"] = partial(showing.watch, job=job)
        report, status = drive(
            job.robot,
            job.navigator,
            job.period,
            job.origin,
            name,
            people(options),
            (*told, *job.notes),
            examiner=examiner_of(job) if rehearse else None,
            recorder=recorder_of(job, command_line()),
            **watching,
        )
    if options.json:
        print(json.dumps({"scenario": job.name, **report}))
    return status


def examiner_of(job: Course) -> Rehearsal:
    """Compare the model of a course with its motion, from each plan on."""
    examiner = Rehearsal(job.robot, job.controller.model)
    job.watchers.append(examiner.saw)
    return examiner


COMMAND = Command(
    text="Drive a robot through a scenario with a learned model.",
    examples=(
        "kmpc run robot.toml --model robot.npz --scenario map.toml --arm",
        "kmpc run robot.toml --model robot.npz --scenario map.toml --rehearse  # the first drive",
        "kmpc run robot.toml --scenario map.toml --record monday  # then: kmpc report monday",
        "kmpc run --driver mavlink --link tcp:127.0.0.1:5760 --scenario four_circles_1 --arm",
        "kmpc run robot.toml --goal 2 0 90deg --goal 0 0 0 --loop --arm   # there and back",
    ),
    add_options=add_options,
    run=run,
    errors=(BridgeError,),
)
