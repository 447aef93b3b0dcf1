"""The files that a drive is recorded to, opened before it and closed after it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from firmware_bridge.link import Transport
from firmware_bridge.recording.durable import DurableFile
from firmware_bridge.recording.link_log import Chunk, RecordedTransport, tlog
from firmware_bridge.recording.recorder import CsvRecorder
from firmware_bridge.robot_file import Robot
from firmware_bridge.runtime.observer import Observer


class Recorder(Observer, Protocol):
    """Records what the loop does, in a file of its own."""

    @property
    def file(self) -> DurableFile[Any]:
        """Where to."""

    def planned(self) -> None:
        """Take time for what was planned last: its command is on its way."""

    def finish(self, report: dict[str, Any]) -> None:
        """Note how the drive ended."""

    def close(self) -> None:
        """Write what waits, and close; idempotent."""


class DriveLogs:
    """A CSV, what goes over an autopilot's link, and what another recorder writes.

    `output`: path of the files without their endings; nothing is recorded if not given.
    """

    def __init__(self, output: Path | None) -> None:
        self._output = output
        self._csv: CsvRecorder | None = None
        self._recorder: Recorder | None = None
        self._link: DurableFile[Chunk] | None = None

    def open(
        self,
        transport: Transport | None,
        period: float,
        by_hand: bool,
        robot: Robot,
        record: Callable[[Path], Recorder] | None,
    ) -> Transport | None:
        """Make the files; give the transport whose bytes are recorded, if there is one.

        Raises ConfigError if one of them exists or cannot be made.
        """
        if self._output is None:
            return transport

        def named(ending: str) -> Path:
            assert self._output is not None
            return self._output.with_name(self._output.name + ending)

        self._csv = CsvRecorder(named(".csv"), period, by_hand, robot.vehicle, robot.wheels)
        if record is not None:
            self._recorder = record(self._output)
        if transport is None or not robot.is_autopilot:
            return transport
        self._link = tlog(named(".tlog"))
        return RecordedTransport(transport, self._link.put)

    @property
    def observers(self) -> tuple[Observer, ...]:
        """What sees each tick of the loop."""
        found: tuple[Observer | None, ...] = (self._csv, self._recorder)
        return tuple(observer for observer in found if observer is not None)

    @property
    def rows(self) -> int:
        """Rows in the CSV so far."""
        return 0 if self._csv is None else self._csv.rows

    @property
    def files(self) -> list[str]:
        """Their paths."""
        return [str(file.path) for file in self._files()]

    @property
    def problems(self) -> list[str]:
        """What is wrong with them."""
        return [file.problem for file in self._files() if file.problem]

    def planned(self) -> None:
        """Tell the recorder that it may take time for what was planned last."""
        if self._recorder is not None:
            self._recorder.planned()

    def finish(self, report: dict[str, Any]) -> None:
        """Note how the drive ended."""
        if self._recorder is not None:
            self._recorder.finish(report)

    def close(self) -> None:
        """Write what waits, and close; idempotent."""
        if self._csv is not None:
            self._csv.close()
        for file in self._files():
            file.close()

    def discard_if_empty(self) -> None:
        """Remove closed files into which nothing came."""
        for file in self._files():
            file.discard_if_empty()

    def _files(self) -> list[DurableFile[Any]]:
        files: list[DurableFile[Any] | None] = [
            None if self._csv is None else self._csv.file,
            self._link,
            None if self._recorder is None else self._recorder.file,
        ]
        return [file for file in files if file is not None]
