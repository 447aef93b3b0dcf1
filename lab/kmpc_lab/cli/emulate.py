"""`kmpc emulate`: serve an emulated robot on a link until it is ended."""

from __future__ import annotations

import argparse
import json
import signal
import threading
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TextIO

from firmware_bridge.cli.options import need_driver, people
from firmware_bridge.link.url import LinkUrl
from firmware_bridge.messages import BridgeError, ConfigError
from firmware_bridge.robot_file import Robot, load_robot
from firmware_bridge.sensors.lidar.options import LIDARS
from kmpc_lab.emulator.build import Emulator, build_emulator
from kmpc_lab.emulator.mocap import MocapSender
from kmpc_lite.cli.command import Command, need, positive

if TYPE_CHECKING:
    from kmpc_lab.emulator.lidar import LidarEmulator
    from kmpc_lite.scenario.files import Scenario

TOPICS = "topics"  # instead of a link: those of ROS 2
SCENARIO = "four_circles_1"  # of a robot behind ROS 2 topics, if none is named
SHOWN = 0.5  # between pictures of the pose [s]


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add("robot", help="mavlink, ros2, or a robot file")
    text = "pty:PATH, tcp:HOST:PORT or udp:HOST:PORT (default: the robot file's)"
    add("--link", metavar="URL", help=text)
    add("--scenario", metavar="NAME", help="scenario whose start and floor are used")
    text = "pose at which the robot starts [m, m, rad]"
    add("--start", nargs=3, type=float, metavar=("X", "Y", "THETA"), help=text)
    text = (
        "slip: a robot that slips at random (default)\n"
        "mujoco: the digital twin of a ROSbot 2, among the scenario's obstacles"
    )
    add("--physics", choices=("slip", "mujoco"), default="slip", help=text)
    add("--slip", type=float, help="mean slip ratio of the floor")
    text = "share of a commanded turn that the robot makes"
    add("--turn-gain", type=float, metavar="SHARE", help=text)
    add("--seed", type=int, default=0, help="seed of the slip (default: 0)")
    text = (
        "emulate a lidar, too, which sees the scenario's obstacles: the robot file's, or\n"
        f"{', '.join(LIDARS)} (the rover's own sensors)"
    )
    add("--lidar", choices=LIDARS, nargs="?", const=True, help=text)
    add("--lidar-link", metavar="URL", help="where it is served (default: the robot file's)")
    add("--pose", metavar="URL", help="emulate motion capture, too: send poses to udp:HOST:PORT")
    text = "time after boot without arming [s] (default: 2)"
    add("--arm-after", type=float, metavar="S", default=2.0, help=text)
    add("--seconds", type=positive, metavar="S", help="end after this time [s]")
    _add_topic_options(parser)


def _add_topic_options(parser: argparse.ArgumentParser) -> None:
    """Add what only a robot behind ROS 2 topics has."""
    add = parser.add_argument_group("ros2").add_argument
    text = "topics that show obstacles (default: map and scan); repeatable"
    add("--sees", action="append", choices=("map", "scan", "nothing"), help=text)
    add("--stamped", action="store_true", help="commands are TwistStamped")
    add("--drifts", action="store_true", help="odometry begins at zero; amcl_pose tells where")
    add("--use-sim-time", action="store_true", help="publish /clock, and stamp with it")
    text = "ROS arguments, last: -r __ns:=/robot"
    add("--ros-args", nargs=argparse.REMAINDER, default=[], metavar="...", help=text)


def run(options: argparse.Namespace) -> int:
    """Emulate a robot until Ctrl-C, or for so long."""
    if options.robot == "ros2":
        report = emulate(_topics(options), TOPICS, options.seconds, people(options))
        if options.json:
            print(json.dumps(report))
        return 0
    autopilot = options.robot == "mavlink"
    driver = "mavlink" if autopilot else None
    name = options.lidar if isinstance(options.lidar, str) else None
    robot = load_robot(
        None if autopilot else options.robot,
        {
            "link": {"url": options.link, "driver": driver, "pose": options.pose},
            "lidar": {"driver": name, "link": options.lidar_link},
        },
    )
    need_driver(robot)
    if options.physics == "mujoco":
        need("--physics mujoco", "mujoco")
    emulator, lidar = _emulator(options, robot)
    report = emulate(
        emulator,
        robot.link.url,
        options.seconds,
        people(options),
        options.pose,
        options.seed,
        lidar,
    )
    if options.json:
        print(json.dumps(report))
    return 0


def _topics(options: argparse.Namespace) -> Emulator:
    """Build a robot behind ROS 2 topics."""
    need("without /opt/ros/$ROS_DISTRO/setup.bash sourced, kmpc emulate ros2", "rclpy")
    from kmpc_lab.emulator.ros2 import EmulatedRobot, Ros2Emulator
    from kmpc_lite.scenario.files import Scenario

    given: dict[str, Any] = {
        "start": None if options.start is None else tuple(options.start),
        "slip": options.slip,
        "turn_gain": options.turn_gain,
    }
    changed = {name: value for name, value in given.items() if value is not None}
    scenario = replace(Scenario.load(options.scenario or SCENARIO), **changed)
    sees = tuple(name for name in options.sees or ("map", "scan") if name != "nothing")
    robot = EmulatedRobot(sees, options.stamped, options.drifts, options.use_sim_time)
    return Ros2Emulator(scenario, robot, options.seed, tuple(options.ros_args))


def _emulator(
    options: argparse.Namespace, robot: Robot
) -> tuple[Emulator, tuple[LidarEmulator, str] | None]:
    """Build what the options of a command line ask for: the robot, and its lidar with its URL."""
    scenario: Scenario | None = None
    start, slip, turn_gain = (0.0, 0.0, 0.0), 0.0, 1.0
    if options.scenario is not None:
        from kmpc_lite.scenario.files import Scenario

        scenario = Scenario.load(options.scenario)
        start, slip, turn_gain = scenario.start, scenario.slip, scenario.turn_gain
    if options.start is not None:
        start = tuple(options.start)
    slip = slip if options.slip is None else options.slip
    turn_gain = turn_gain if options.turn_gain is None else options.turn_gain
    twin = None
    if options.physics == "mujoco":
        from kmpc_lab.sim.twin import Twin

        twin = Twin.of(scenario, options.seed) if scenario else Twin(seed=options.seed)
    emulator = build_emulator(robot, start, slip, turn_gain, options.seed, options.arm_after, twin)
    if options.lidar is None:
        return emulator, None
    from kmpc_lab.emulator.lidar import Eyes

    return emulator, Eyes(robot.lidar, scenario, options.seed).served(lambda: emulator.pose)


def emulate(
    emulator: Emulator,
    url: str,
    seconds: float | None,
    out: TextIO | None,
    pose: str | None = None,
    seed: int = 0,
    lidar: tuple[LidarEmulator, str] | None = None,
) -> dict[str, Any]:
    """Serve until SIGINT, SIGTERM, or for so long [s]; tells the last pose.

    With `pose`, motion capture sends there, with the noise of `seed`; a `lidar` is served at its
    URL.

    Raises ConfigError, LinkError where the link cannot be served.
    """
    if url != TOPICS and LinkUrl.parse(url).kind == "serial":
        raise ConfigError(f"link {url}: an emulator serves pty:, tcp: or udp:; give --link")
    done = threading.Event()
    handlers = {
        number: signal.signal(number, lambda *_: done.set())
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    until = None if seconds is None else time.monotonic() + seconds
    camera = None if pose is None else MocapSender(lambda: emulator.pose, pose, seed)
    try:
        if lidar is not None:
            lidar[0].start(lidar[1])
        emulator.start(url)
        if camera is not None:
            camera.start()
        if out is not None:
            out.write(f"serving {url}; Ctrl-C ends\n")
            out.flush()
        while not done.is_set() and (until is None or time.monotonic() < until):
            done.wait(SHOWN if until is None else min(SHOWN, max(0.0, until - time.monotonic())))
            if out is not None and out.isatty():
                x, y, theta = emulator.pose
                moves = "stands" if emulator.stopped else "moves"
                place = f"x {x:8.3f} m   y {y:8.3f} m   theta {theta:7.3f} rad"
                out.write(f"\r\x1b[2K{place}   {moves}")
                out.flush()
        return {
            "link": url,
            "pose": [round(c, 6) for c in emulator.pose],
            "stopped": emulator.stopped,
        }
    finally:
        if camera is not None:
            camera.close()
        if lidar is not None:
            lidar[0].close()
        emulator.close()
        for number, handler in handlers.items():
            signal.signal(number, handler)


COMMAND = Command(
    text="Pretend to be a robot: a rover of ArduPilot, a board, or a robot of ROS 2 topics.",
    examples=(
        "kmpc emulate mavlink --link tcp:127.0.0.1:5760",
        "kmpc emulate robot.toml --link pty:/tmp/robot --scenario four_circles_1",
        "kmpc emulate ros2 --sees map",
    ),
    add_options=add_options,
    run=run,
    errors=(BridgeError,),
)
