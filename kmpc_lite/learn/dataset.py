"""Episodes of driving, checked once: finite, evenly sampled, never differenced across a gap."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.files import SAME_DT, real_array
from kmpc_lite.geometry import rotate
from kmpc_lite.types import INPUTS, STATES, Array

MAX_ROWS = 10_000_000  # rows of the longest log that is taken in, or made by resampling
CHUNK = 8192  # rows handled at once: what fits a small board's second-level cache


@dataclass(frozen=True, eq=False)
class Episode:
    """One stretch of driving without a gap.

    Parameters
    ----------
    states : ndarray
        Poses (T + 1, 3): x [m], y [m], theta [rad]; the heading is unwrapped here.
    inputs : ndarray
        Commands (T, 2): v [m/s], omega [rad/s], or (T, 3) of an omni: v_x, v_y, omega; row k acts
        from state k to state k + 1.
    dt : float
        Sampling period [s].
    steered : bool
        Whether its turn rates are those of steered wheels, a car's: speed times curvature.

    Raises
    ------
    DataError
        For other shapes, NaN, infinity, or fewer than two states.
    """

    states: Array
    inputs: Array
    dt: float
    steered: bool = False

    def __post_init__(self) -> None:
        """Check the arrays and unwrap the heading."""
        states = real_array(self.states, "episode states", DataError)
        inputs = real_array(self.inputs, "episode inputs", DataError)
        if states.ndim != 2 or states.shape[1] != STATES or len(states) < 2:
            raise DataError(
                f"episode states: expected shape (T + 1, {STATES}) with T >= 1, got {states.shape}"
            )
        steps = len(states) - 1
        if inputs.shape not in ((steps, INPUTS), (steps, INPUTS + 1)):
            raise DataError(
                f"episode inputs: expected shape ({steps}, {INPUTS}), one row per step, "
                f"got {inputs.shape}; an omni has {INPUTS + 1} columns"
            )
        for name, array in (("states", states), ("inputs", inputs)):
            if not np.isfinite(array).all():
                row, column = np.argwhere(~np.isfinite(array))[0]
                raise DataError(
                    f"episode {name}: row {row}, column {column} is {array[row, column]}; "
                    "expected finite numbers"
                )
        if np.any(np.abs(np.diff(states[:, 2])) > np.pi):
            states = np.column_stack([states[:, :2], np.unwrap(states[:, 2])])
        object.__setattr__(self, "states", states)
        object.__setattr__(self, "inputs", inputs)
        object.__setattr__(self, "dt", check_time("episode dt", self.dt))

    def __len__(self) -> int:
        """Count the steps, T."""
        return len(self.inputs)

    @property
    def moved(self) -> Array:
        """How far the robot went along its middle heading, and turned, in each period, (T, m).

        Of an omni also how far it went to the left.
        """
        steps = np.diff(self.states, axis=0)
        middle = self.states[:-1, 2] + 0.5 * steps[:, 2]
        went = [*rotate(steps[:, 0], steps[:, 1], -middle), steps[:, 2]]
        return np.column_stack(went if self.inputs.shape[1] > INPUTS else went[::2])

    def resample(self, dt: float) -> Episode | None:
        """Return the same drive at another period [s], or None if it is shorter than one period.

        Poses are interpolated linearly; a command is the mean of what was held during the new
        period. DataError where the robot turns by more than half a turn within it.
        """
        time = np.arange(len(self) + 1) * self.dt
        return resample(time, self.states, self.inputs, dt, self.steered)


def check_time(name: str, value: float) -> float:
    """Give back a time [s] as a float, or raise DataError naming it."""
    time = real_array(value, name, DataError)
    if time.size != 1 or not (np.isfinite(time).all() and (time > 0.0).all()):
        raise DataError(f"{name}: expected a time > 0 s, got {value}")
    return float(time.item())


def resample(
    time: Array, states: Array, inputs: Array, dt: float, steered: bool = False
) -> Episode | None:
    """Put a drive on an even grid of times.

    The states (T + 1, 3) are at times (T + 1,) [s], and the inputs (T, m) act between them.
    """
    dt = check_time("dt", dt)
    elapsed = time - time[0]
    if elapsed[-1] > MAX_ROWS * dt:
        raise DataError(
            f"dt: {dt:g} s would cut a drive of {elapsed[-1]:g} s into more than {MAX_ROWS:,} steps"
        )
    steps = int(np.floor(elapsed[-1] / dt + 1e-6))
    if steps < 1:
        return None
    grid = np.arange(steps + 1) * dt
    travelled = np.cumsum(inputs * np.diff(time)[:, None], axis=0)
    travelled = np.vstack([np.zeros(inputs.shape[1]), travelled])
    poses = np.column_stack([np.interp(grid, elapsed, column) for column in states.T])
    held = np.column_stack([np.interp(grid, elapsed, column) for column in travelled.T])
    turn = np.abs(np.diff(poses[:, 2])).max()
    if turn > np.pi:  # an episode would take it for the shorter turn the other way
        raise DataError(
            f"dt: within {dt:g} s the robot turns by {turn:.2f} rad, more than half a turn: "
            "choose a shorter period"
        )
    return Episode(poses, np.diff(held, axis=0) / dt, dt, steered)


class Transitions(NamedTuple):
    """Single steps, gathered over episodes."""

    x: Array  # states before, (n, 3)
    u: Array  # commands, (n, m)
    x_next: Array  # states after, (n, 3)
    history: Array | None  # commands before `u`, oldest first, (n, L, m); None for L = 0


class Pieces(NamedTuple):
    """Equally long pieces of driving, gathered over episodes."""

    states: Array  # (n, steps + 1, 3)
    before: Array  # commands before each piece, oldest first, (n, history, m)
    inputs: Array  # commands of each piece, (n, steps, m)


Parts = TypeVar("Parts", Transitions, Pieces)


def _joined(batch: list[Parts]) -> Parts:
    """Steps or pieces one after another."""
    columns: Iterable[Any] = (
        None if column[0] is None else np.concatenate(column) for column in zip(*batch, strict=True)
    )
    return type(batch[0])(*columns)


def _gathered(parts: Iterable[Parts], chunk: int) -> Iterator[Parts]:
    """Join parts to chunks of about `chunk` rows."""
    batch: list[Parts] = []
    rows = 0
    for part in parts:
        batch.append(part)
        rows += len(part[0])
        if rows >= chunk:
            yield _joined(batch)
            batch, rows = [], 0
    if batch:
        yield _joined(batch)


class Dataset:
    """Episodes of one robot, all at one sampling period.

    Parameters
    ----------
    episodes : sequence of Episode
        At least one.
    geometry : mapping, optional
        Wheelbase or track of the robot, where a log told them [m].

    Raises
    ------
    DataError
        For no episodes, or different periods.

    Examples
    --------
    >>> steps = np.arange(5.0)
    >>> drive = Episode(np.c_[0.1 * steps, 0 * steps, 0 * steps], np.tile([1.0, 0.0], (4, 1)), 0.1)
    >>> len(Dataset([drive, drive]))
    2
    """

    def __init__(
        self, episodes: Sequence[Episode], geometry: Mapping[str, float] | None = None
    ) -> None:
        self.geometry = dict(geometry or {})
        self.episodes = () if isinstance(episodes, Episode) else tuple(episodes)
        if isinstance(episodes, Episode) or not all(isinstance(e, Episode) for e in self.episodes):
            raise DataError(
                "a dataset is a list of episodes, each Episode(states, inputs, dt); "
                "Dataset.load(path) reads a log"
            )
        if not self.episodes:
            raise DataError("a dataset needs at least one episode, got none")
        periods = sorted({e.dt for e in self.episodes})
        if periods[-1] - periods[0] > SAME_DT * periods[-1]:
            raise DataError(
                f"episodes have different periods ({periods[0]:g} to {periods[-1]:g} s): "
                "resample them to one dt"
            )
        if len({(e.inputs.shape[1], e.steered) for e in self.episodes}) > 1:
            raise DataError("episodes of different wheels: each kind is learned apart")
        self.dt = periods[0]

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        dt: float | None = None,
        gap: float | None = None,
        columns: Mapping[str, str] | None = None,
        topics: Mapping[str, str] | None = None,
        units: Mapping[str, str] | None = None,
        frame: str = "enu",
        commands: str | os.PathLike[str] | None = None,
        track: float | None = None,
        wheelbase: float | None = None,
        shift: float = 0.0,
        force: bool = False,
    ) -> Dataset:
        """Read a log of any format, or all logs in a folder, and refuse what is suspect.

        Parameters
        ----------
        path : path
            A table (.csv, .tsv, .txt, .npz) with t, x, y, theta, v, omega, or names that mean them,
            or lat, lon and left, right in their place; a rosbag2 folder, .mcap, .db3 or .bag; an
            ArduPilot .bin or .tlog; a PX4 .ulg; a TUM or EuRoC trajectory with `commands` beside
            it.
        dt : float, optional
            Period [s] to resample to; without it a table must be evenly sampled and keeps its own,
            as what was saved comes back; other logs get 0.1 s, or the period of their poses if it
            is longer. `kmpc fit` takes that of tables, too.
        gap : float, optional
            A longer time between poses [s] ends an episode; 2.5 times the median period if not
            given.
        columns : mapping, optional
            Of tables: ``{"theta": "yaw"}``.
        topics : mapping, optional
            Of bags: ``{"odom": "/odom", "cmd": "/cmd_vel"}``.
        units : mapping, optional
            ``{"t": "ns", "theta": "-deg+90"}``.
        frame : {"enu", "ned", "swapped"}
            How the poses lie.
        commands : path, optional
            A table of commands for logs that hold poses only.
        track : float, optional
            Distance between left and right wheels [m], for tables whose commands are their speeds.
        wheelbase : float, optional
            Distance between a car's axles [m], for steering angles; found if not given.
        shift : float
            Added to the times of the commands [s].
        force : bool
            Take a log in which something is suspect as it is, and cut it where its time runs back.

        Raises
        ------
        DataError
            With file, line and column, for whatever is wrong; for a log that no wheeled robot can
            have driven, as `kmpc inspect` tells it: units, frames, clocks, other columns.
        """
        from kmpc_lite.learn.cutting import cut
        from kmpc_lite.learn.loading import read_files
        from kmpc_lite.learn.logs import ReadOptions

        how = ReadOptions(
            columns=columns or {},
            topics=topics or {},
            units=units or {},
            frame=frame,
            commands=None if commands is None else Path(commands),
            track=track,
            wheelbase=wheelbase,
            shift=shift,
            force=force,
        )
        gap = None if gap is None else check_time("gap", gap)
        return cls([e for log, _ in read_files([Path(path)], how, dt) for e in cut(log, dt, gap)])

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the episodes as a .csv or .npz log that `load` reads; whole or not at all."""
        from kmpc_lite.learn.formats.tables import write_log

        write_log(self.episodes, path)

    def __len__(self) -> int:
        """Count the episodes."""
        return len(self.episodes)

    def __repr__(self) -> str:
        """Episodes, steps and minutes."""
        minutes = self.steps * self.dt / 60
        return (
            f"Dataset({len(self)} episodes, {self.steps} steps of {self.dt:g} s, {minutes:.1f} min)"
        )

    @property
    def steps(self) -> int:
        """Number of steps over all episodes."""
        return sum(len(e) for e in self.episodes)

    @property
    def commands(self) -> int:
        """Numbers of a command, m: 3 of an omni."""
        return int(self.episodes[0].inputs.shape[1])

    @property
    def steered(self) -> bool:
        """Whether it is a car's: its turn rates are those of steered wheels."""
        return self.episodes[0].steered

    @property
    def inputs(self) -> Array:
        """Commands of all episodes, one after another, (n, m)."""
        return np.concatenate([e.inputs for e in self.episodes])

    def split(self, fraction: float = 0.5, seed: int = 0) -> tuple[Dataset, Dataset]:
        """Split by whole episodes, at random: `fraction` of them first, the rest second.

        Raises
        ------
        DataError
            If one side would be empty.
        """
        if not 0.0 < fraction < 1.0:
            raise DataError(f"split fraction: expected a share between 0 and 1, got {fraction}")
        count = int(round(fraction * len(self)))
        if not 0 < count < len(self):
            raise DataError(
                f"cannot split {len(self)} episode(s) at {fraction:g}: "
                "each side needs at least one; cut the log with windows(seconds) first"
            )
        order = np.random.default_rng(seed).permutation(len(self))
        pick = [self.episodes[i] for i in order]
        return Dataset(pick[:count]), Dataset(pick[count:])

    def windows(self, seconds: float) -> Dataset:
        """Cut every episode into pieces of at most `seconds`, one step at least.

        One long log can then be split.
        """
        length = max(1, int(min(check_time("windows", seconds) / self.dt + 1e-6, MAX_ROWS)))
        return Dataset(
            [
                replace(e, states=e.states[k : k + length + 1], inputs=e.inputs[k : k + length])
                for e in self.episodes
                for k in range(0, len(e), length)
            ]
        )

    def resample(self, dt: float) -> Dataset:
        """Return the same drives at another period [s]."""
        dt = check_time("dt", dt)
        if abs(dt - self.dt) <= 1e-9 * dt:
            return self
        kept = [r for e in self.episodes if (r := e.resample(dt)) is not None]
        if not kept:
            raise DataError(f"no episode is as long as one period of {dt:g} s")
        return Dataset(kept)

    def pieces(
        self, steps: int, history: int = 0, stride: int = 1, chunk: int = CHUNK
    ) -> Iterator[Pieces]:
        """Yield all pieces of `steps` steps that begin every `stride`, in chunks of about `chunk`.

        Pieces without a full input history are left out.
        """

        def of(e: Episode, starts: Array) -> Pieces:
            rows, ages = starts[:, None], np.arange(-history, steps + 1)
            inputs = e.inputs.take(rows + ages[:-1], axis=0)
            states = e.states.take(rows + ages[history:], axis=0)
            return Pieces(states, inputs[:, :history], inputs[:, history:])

        parts = (
            of(e, np.arange(k, min(k + chunk * stride, last), stride))
            for e in self.episodes
            for last in [len(e) - steps + 1]
            for k in range(history, last, chunk * stride)
        )
        return _gathered(parts, chunk)

    def every_piece(
        self, steps: int, history: int = 0, stride: int = 1, most: int = MAX_ROWS
    ) -> Pieces:
        """Give what `pieces` yields at once, thinned evenly to `most`; empty arrays for none."""
        shapes = (steps + 1, STATES), (history, self.commands), (steps, self.commands)
        parts, seen = [Pieces(*(np.empty((0, *shape)) for shape in shapes))], 0
        room = (len(e) - history - steps + 1 for e in self.episodes)
        every = max(1, -(-sum(max(0, -(-r // stride)) for r in room) // most))
        for part in self.pieces(steps, history, stride):
            # copies, so that what is left out takes no memory
            parts.append(Pieces(*(values[-seen % every :: every].copy() for values in part)))
            seen += len(part.states)
        return _joined(parts)

    def transitions(self, history: int = 0, chunk: int = CHUNK) -> Iterator[Transitions]:
        """Yield all steps in chunks of about `chunk` rows.

        Steps without a full input history are left out.
        """

        def of(e: Episode, first: int, last: int) -> Transitions:
            rows, past = slice(first, last), None  # slices, which cost nothing
            if history:
                before = np.arange(first, last)[:, None] + np.arange(-history, 0)
                past = e.inputs.take(before, axis=0)
            after = e.states[first + 1 : last + 1]
            return Transitions(e.states[rows], e.inputs[rows], after, past)

        parts = (
            of(e, k, min(k + chunk, len(e)))
            for e in self.episodes
            for k in range(history, len(e), chunk)
        )
        return _gathered(parts, chunk)
