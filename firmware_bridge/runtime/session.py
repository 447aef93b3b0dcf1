"""One drive from connect to release: link, gate, loop, emergency stop, logs, signals.

It says why a robot does not drive, each reason once; and how a drive ended, in one sentence.
"""

from __future__ import annotations

import gc
import math
import signal
import sys
import time
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, Self, TextIO

from firmware_bridge.drivers import Autopilot, Driver
from firmware_bridge.drivers.boards import BOARDS, load
from firmware_bridge.link import Transport, open_transport
from firmware_bridge.live.terminal import View
from firmware_bridge.messages import BridgeError, ConfigError, Controller
from firmware_bridge.robot_checks import check_period
from firmware_bridge.robot_file import Robot
from firmware_bridge.runtime.controller_thread import Planner
from firmware_bridge.runtime.drive_logs import DriveLogs, Recorder
from firmware_bridge.runtime.loop import ControlLoop
from firmware_bridge.runtime.observer import Observer
from firmware_bridge.safety.estop import EmergencyStop
from firmware_bridge.safety.gate import SafetyGate
from firmware_bridge.safety.places import default_socket
from firmware_bridge.sensors.pose import PosedDriver
from firmware_bridge.sensors.sensor_driver import PlacedDriver, autopilot_of

if TYPE_CHECKING:
    from firmware_bridge.sensors.sight import Sight

STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP, signal.SIGQUIT)
"""Each brakes and releases: Ctrl-C, service manager, lost terminal, Ctrl-Z, Ctrl-backslash."""
FAREWELL = 0.1  # time for the last bytes to leave before the link is closed [s]
LATE_STEPS = 1.3
"""A controller's output that is older than this many periods is late: the robot is slowed."""
SWITCH = 0.0005
"""A busy controller thread gives way to the gate after this long [s]; Python's own figure is
0.005."""


def told_once(reasons: Iterable[str], words: Iterable[str]) -> list[str]:
    """Put an autopilot's own words behind what is known, but for those that it contains already.

    Examples
    --------
    >>> told_once(["link down", "arming is refused for now: Arm: no GPS"], ["PreArm: no GPS"])
    ['link down', 'arming is refused for now: Arm: no GPS']
    """
    known = list(dict.fromkeys(reasons))
    more = (text for text in words if not any(_gist(text) in reason for reason in known))
    return [*known, *dict.fromkeys(more)]


def ended_words(
    what: str, after: float, errors: tuple[float, float], goal: str, why: Iterable[str]
) -> str:
    """Say in one sentence how a drive ended that did not arrive: the same wherever it is shown.

    `what`: happened. `after`: time since the robot was first let drive [s]. `errors`: distance to
    the goal [m] and heading error [rad]; infinite if no pose is known. `goal`: which goal of how
    many; empty for a single one. `why`: what kept it from arriving.

    Examples
    --------
    >>> ended_words("time is up", 20.0, (0.52, 0.1), "", ["no passage is wide enough"])
    'time is up after 20.0 s, 0.52 m and 0.10 rad from the goal: no passage is wide enough'
    """
    distance, turn = errors
    known = f", {distance:.2f} m and {turn:.2f} rad from {goal or 'the goal'}"
    where = known if math.isfinite(distance) else ""
    reasons = "; ".join(why)
    return f"{what} after {after:.1f} s{where}" + (f": {reasons}" if reasons else "")


def _gist(text: str) -> str:
    """The text behind "Arm:" or "PreArm:"; the autopilot says the same behind either."""
    return text.rpartition("Arm:")[2].strip()


class EstopLatched(BridgeError):
    """The robot must not drive before the emergency stop is reset."""


def open_driver(robot: Robot, transport: Transport) -> Driver:
    """Build a robot file's driver on a link not yet open; ConfigError names file and key."""
    kind = load(BOARDS[robot.link.driver].driver)
    try:
        driver: Driver = kind.from_options(transport, robot.driver_table())
    except ConfigError as error:
        raise ConfigError(f"{robot.where}: {error}") from None
    if robot.link.pose is not None:
        feed = driver.feed_pose if isinstance(driver, Autopilot) else None
        driver = PosedDriver(driver, robot.link.pose, feed)
    if robot.lidar is None:
        return driver
    from firmware_bridge.sensors.sighted import with_lidar  # NumPy only for robots that see

    return with_lidar(driver, robot.lidar)


def sight_of(robot: Robot, driver: Driver) -> Sight | None:
    """What a robot's lidar sees; None for a robot without one."""
    if robot.lidar is None:
        return None
    from firmware_bridge.sensors.sighted import SightedDriver

    return driver.sight if isinstance(driver, SightedDriver) else None


class Session:
    """A context in which a robot is driven; leaving it gives the robot back, whatever happened.

    `robot`: checked robot file. `controller`: state to VelocityCommand. `period`: of the
    controller, and of the rows of the CSV [s]. `origin`: pose of the vehicle's frame in ours, where
    the robot file has none. `output`: record to this name with .csv, and of an autopilot .tlog, put
    behind. `by_hand`: nothing is sent, the gate stays idle: a pilot drives. `out`: where to show
    what happens. `observers`: see each tick, beside the recorder. `more`: gives more lines for the
    terminal's picture. `record`: makes another recorder of this session, to a path without an
    ending. `warnings`: returns notes to show once, beside the autopilot's own. `driver`: not yet
    connected, for a robot without a link of bytes; the robot file's if not given. Raises
    ConfigError, LinkError, EstopLatched with one line for the user.
    """

    def __init__(
        self,
        robot: Robot,
        controller: Controller,
        period: float,
        *,
        origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
        output: Path | None = None,
        by_hand: bool = False,
        out: TextIO | None = None,
        observers: tuple[Observer, ...] = (),
        more: Callable[[], list[str]] = list,
        warnings: Callable[[], tuple[str, ...]] = tuple,
        record: Callable[[Session, Path], Recorder] | None = None,
        driver: Driver | None = None,
    ) -> None:
        check_period(period, robot.gate)
        self.robot, self.by_hand, self._out = robot, by_hand, out
        self._origin = origin if robot.origin is None else robot.origin
        self._controller, self._period = controller, period
        self._observers, self._more, self._given = observers, more, driver
        self._warnings = warnings
        self._recorder = None if record is None else partial(record, self)
        self.logs = DriveLogs(output)
        self._handlers: dict[int, Any] = {}
        self._connecting = True
        self.sight: Sight | None = None  # what the lidar sees, for a robot with one
        self.estop = EmergencyStop(default_socket() if robot.socket is None else robot.socket)

    def __enter__(self) -> Self:
        """Check the emergency stop, open logs and link, wait for the board."""
        if self.estop.latched:
            raise EstopLatched(
                f"the emergency stop is pressed ({self.estop.latch_path}): kmpc estop --reset"
            )
        transport: Transport | None = None
        if self._given is None:
            # errors in the robot file are reported before a log is begun
            open_driver(self.robot, open_transport(self.robot.link.url)).close()
            transport = open_transport(self.robot.link.url)
        try:
            transport = self.logs.open(
                transport, self._period, self.by_hand, self.robot, self._recorder
            )
            inner = self._given if transport is None else open_driver(self.robot, transport)
            assert inner is not None
            self._autopilot, self.sight = autopilot_of(inner), sight_of(self.robot, inner)
            self.driver: Driver = PlacedDriver(inner, self._origin)
            self._catch_signals()
            try:
                self.estop.open()
                self.driver.connect(self.robot.link.timeout)
                self._build()
            except BaseException:
                self.driver.close()
                raise
        except BaseException:
            self._end()
            self.logs.discard_if_empty()
            raise
        return self

    def _build(self) -> None:
        control, pilot = self.robot.control, self._autopilot
        arm = bool(self.robot.sections.get("board", {}).get("arm"))
        self.planner = Planner(
            self._controller,
            self.driver.state,
            self._period,
            control.latency or 0.0,
            after=self.logs.planned,
        )
        self.gate = SafetyGate(self.robot.gate, LATE_STEPS * self._period)
        self.loop = ControlLoop(
            self.driver,
            self.gate,
            self.planner,
            command_period=control.command_period,
            observers=(*self.logs.observers, *filter(None, (self.sight,)), *self._observers),
            operator=self.estop,
            take=pilot.take if arm and pilot is not None else None,
            confirm=None if pilot is None else pilot.confirm_frame,
        )

    def drive(self, finished: Callable[[], bool]) -> None:
        """Drive until `finished`, a signal, or for ever; then brake, hold and release."""
        view = None
        if self._out is not None:
            live = self._out.isatty()
            view = View(
                self.loop,
                f"{self.robot.link.driver} {self.robot.link.url}",
                self._out,
                live,
                self._notes,
                self._more,
            )
            view.start()
        interval = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH)
        gc.collect()
        gc.freeze()
        try:
            if not self.by_hand:
                self.gate.enable()
            self._connecting = False
            self.loop.run(finished)
        finally:
            gc.unfreeze()
            sys.setswitchinterval(interval)
            if view is not None:
                view.stop()

    def __exit__(self, *error: object) -> None:
        """Close the link and the logs."""
        try:
            time.sleep(FAREWELL)
            self.driver.close()
        finally:
            self._end()

    def _end(self) -> None:
        self.estop.close()
        self.logs.close()
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        self._handlers = {}

    def problems(self) -> list[str]:
        """Problems that a user must know of, but that stop no robot."""
        return [*filter(None, (self.estop.problem,)), *self.logs.problems]

    def why(self) -> list[str]:
        """Why the robot does not drive, with the autopilot's own words, uncut."""
        return told_once(self.loop.why(), self.words())

    def words(self) -> tuple[str, ...]:
        """Why the autopilot would not arm, in its own words."""
        return () if self._autopilot is None else self._autopilot.refusals()

    def _notes(self) -> list[str]:
        """Lines that a terminal shows once."""
        warnings = () if self._autopilot is None else self._autopilot.warnings()
        words = (f"autopilot: {text}" for text in self.words())
        return [*self.problems(), *warnings, *self._warnings(), *words]

    def report(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {
            "driver": self.robot.link.driver,
            "link": self.robot.link.url,
            "loop": self.loop.report(),
            "counters": dict(self.driver.health().counters),
            "files": self.logs.files,
            "problems": self.problems(),
        }

    def _catch_signals(self) -> None:
        for number in STOPS:
            self._handlers[number] = signal.signal(number, self._on_stop)
        self._handlers[signal.SIGUSR1] = signal.signal(
            signal.SIGUSR1, lambda *_: self.estop.press()
        )

    def _on_stop(self, number: int, frame: FrameType | None) -> None:
        if self._connecting:
            raise KeyboardInterrupt
        self.loop.request_stop(signal.Signals(number).name)
