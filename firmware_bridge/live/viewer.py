"""Starts the process that shows a drive to Foxglove, and sends it what is new.

What it shows is what a recorded drive holds, made by the same encoder.
"""

from __future__ import annotations

import pickle
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Self

from firmware_bridge.live.address import LOOPBACK, LiveError
from firmware_bridge.live.channel import LONGEST
from firmware_bridge.live.moment import LastStep, nearest_circles
from firmware_bridge.recording.drive.records import Gate, Health, PoseSeen, Record, Sent, Stepped
from kmpc_lite.control.plan import PlannedAround

if TYPE_CHECKING:
    from kmpc_lite.scenario.files import Scenario

PORT = 8765
"""Foxglove's default port."""
PERIOD, HEALTH_PERIOD = 0.1, 1.0
"""Between two packets, and between two looks at link and vehicle [s]."""
PATIENCE = 10.0
"""How long the process may take to start, and to end [s]."""
MODULE = "firmware_bridge.live.foxglove_server"


class Shown:
    """What a drive left last, by which a viewer sees whether it is new."""

    def __init__(self) -> None:
        self._step: LastStep | None = None
        self._gate: tuple[Any, ...] = ()
        self._looked = -HEALTH_PERIOD

    def records(
        self,
        now: float,
        step: LastStep | None,
        pose: tuple[float, float, float] | None,
        command: tuple[float, float],
        gate: tuple[str, tuple[str, ...]],
        health: Callable[[], dict[str, Any]],
    ) -> list[Record]:
        """Give records of what is true at `now` [s]: plans and changes of the gate once."""
        found: list[Record] = []
        if pose is not None:
            found.append(PoseSeen(now, pose))
        found.append(Sent(now, command))
        if step is not None and step is not self._step:
            self._step = step
            found.append(_stepped(now, step))
        if gate != self._gate:
            self._gate = gate
            found.append(Gate(now, *gate))
        if now - self._looked >= HEALTH_PERIOD:
            self._looked = now
            found.append(Health(now, health()))
        return found


def _stepped(now: float, step: LastStep) -> Stepped:
    """Make the record of a step, without the map around it, which the viewer has."""
    plan, around, circles = step.plan, step.plan.around, nearest_circles(step)
    known = PlannedAround(circles, None, around.radius, around.dt, footprint=around.footprint)
    light = replace(plan, around=known)
    light.__dict__["clearance"] = plan.clearance
    insight = step.insight
    return Stepped(now, step.pose, light, insight.path, insight.margins, circles, None, step.scan)


class Viewer:
    """A Foxglove WebSocket server on this computer, as a context.

    Parameters
    ----------
    port : int
        Of ws://127.0.0.1:PORT.

    Raises
    ------
    LiveError
        If the port is taken.
    """

    def __init__(self, port: int = PORT) -> None:
        try:
            with socket.create_server((LOOPBACK, port)):
                pass
        except OSError as error:
            raise LiveError(
                f"--foxglove {port}: cannot listen at {LOOPBACK}: {error.strerror or error}: "
                "another viewer? give another port"
            ) from error
        self._port = port
        self.link = f"ws://{LOOPBACK}:{port}"
        self.problem = ""
        """Why nothing is shown any more, in words; empty while it is."""
        self._quit = threading.Event()
        self._thread: threading.Thread | None = None

    def __enter__(self) -> Self:
        """Start the process; it serves once it knows what is driven."""
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        # a session of its own: Ctrl-C is the robot's business
        self._process = subprocess.Popen(
            [sys.executable, "-m", MODULE, str(theirs.fileno())],
            pass_fds=[theirs.fileno()],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            start_new_session=True,
        )
        theirs.close()
        ours.setblocking(False)
        self._socket = ours
        return self

    def start(self, scenario: Scenario, dt: float, records: Callable[[], list[Record]]) -> None:
        """Send what `records` gives, ten times a second, from a thread of its own.

        Parameters
        ----------
        scenario : Scenario
            What is driven.
        dt : float
            Period of the controller [s].
        records : callable
            Gives what is new, at times of `time.monotonic`; it must not wait.
        """
        told = (self._port, scenario, dt, time.time() - time.monotonic())
        assert self._process.stdin is not None
        try:
            pickle.dump(told, self._process.stdin)
            self._process.stdin.close()
        except OSError:
            self.problem = "Foxglove is served no more: its process has ended"
            return
        self._thread = threading.Thread(
            target=self._run, args=(records,), name="live-viewer", daemon=True
        )
        self._thread.start()

    def __exit__(self, *error: object) -> None:
        """End the process."""
        self._quit.set()
        if self._thread is not None:
            self._thread.join()
        self._socket.close()
        if self._process.stdin is not None:
            self._process.stdin.close()
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _run(self, records: Callable[[], Sequence[Record]]) -> None:
        while not self._quit.wait(PERIOD) and not self.problem:
            try:
                self._send(records())
            except Exception as failure:  # a viewer must not stop a robot
                self.problem = f"Foxglove shows no more: {type(failure).__name__}: {failure}"

    def _send(self, records: Sequence[Record]) -> None:
        for record in records:
            data = pickle.dumps(record, protocol=pickle.HIGHEST_PROTOCOL)
            if len(data) > LONGEST:
                continue
            try:
                self._socket.send(data)
            except BlockingIOError:  # it is behind: left out
                continue
            except OSError:
                self.problem = "Foxglove is served no more: its process has ended"
                return
