"""Episodes of driving, checked once: finite, evenly sampled, never differenced across a gap."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.files import SAME_DT
from kmpc_lite.learn.episode import MAX_ROWS, Episode, check_time
from kmpc_lite.learn.pieces import Pieces, Transitions, gathered, joined, pieces_of, steps_of
from kmpc_lite.types import Array

CHUNK = 8192
"""Rows handled at once: what fits a small board's second-level cache."""


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
        kinds = {(e.inputs.shape[1], e.steered) for e in self.episodes}
        if len(kinds) > 1:
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
        from kmpc_lite.learn.formats.readers import find_logs, refuse_unused
        from kmpc_lite.learn.loading import read_checked
        from kmpc_lite.learn.logs import ReadOptions

        dt = None if dt is None else check_time("dt", dt)
        gap = None if gap is None else check_time("gap", gap)
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
        files = find_logs([path])
        refuse_unused(files, how)
        return cls([e for file in files for e in cut(read_checked(file, how, dt)[0], dt, gap)])

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the episodes as a .csv or .npz log that `load` reads; whole or not at all."""
        from kmpc_lite.learn.formats.tables import write_log

        write_log(self.episodes, path)

    def __len__(self) -> int:
        """Count the episodes."""
        return len(self.episodes)

    def __repr__(self) -> str:
        """Episodes, steps and minutes."""
        return (
            f"Dataset({len(self)} episodes, {self.steps} steps of {self.dt:g} s, "
            f"{self.steps * self.dt / 60:.1f} min)"
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
        pieces = [
            Episode(e.states[k : k + length + 1], e.inputs[k : k + length], e.dt, e.steered)
            for e in self.episodes
            for k in range(0, len(e), length)
        ]
        return Dataset(pieces)

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
        parts = (
            pieces_of(e, np.arange(k, min(k + chunk * stride, last), stride), steps, history)
            for e in self.episodes
            for last in [len(e) - steps + 1]
            for k in range(history, last, chunk * stride)
        )
        return gathered(parts, chunk)

    def every_piece(
        self, steps: int, history: int = 0, stride: int = 1, most: int = MAX_ROWS
    ) -> Pieces:
        """Give what `pieces` yields at once, thinned evenly to `most`; empty arrays for none."""
        parts, seen = [pieces_of(self.episodes[0], np.arange(0), steps, history)], 0
        room = (len(e) - history - steps + 1 for e in self.episodes)
        every = max(1, -(-sum(max(0, -(-r // stride)) for r in room) // most))
        for part in self.pieces(steps, history, stride):
            # copies, so that what is left out takes no memory
            parts.append(Pieces(*(values[-seen % every :: every].copy() for values in part)))
            seen += len(part.states)
        return joined(parts)

    def transitions(self, history: int = 0, chunk: int = CHUNK) -> Iterator[Transitions]:
        """Yield all steps in chunks of about `chunk` rows.

        Steps without a full input history are left out.
        """
        parts = (
            steps_of(e, k, min(k + chunk, len(e)), history)
            for e in self.episodes
            for k in range(history, len(e), chunk)
        )
        return gathered(parts, chunk)
