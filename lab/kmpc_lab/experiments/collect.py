"""Data as the paper collects them, through the link.

Four sign scenarios at 10 Hz, and normally distributed commands at 1 Hz.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from firmware_bridge.messages import State, VelocityCommand
from firmware_bridge.recording.excitation import Excitation
from firmware_bridge.safety.limits import Limits
from kmpc_lab.emulator.mocap import MocapOptions
from kmpc_lab.experiments.batch import BatchDrive, Setup
from kmpc_lab.experiments.wire import ManualClock, Network
from kmpc_lab.sim.twin import Ground, Twin

FAST = Setup(
    Limits(
        v_max=0.8,
        v_reverse=0.8,
        omega_max=1.0,
        acceleration=2.0,
        deceleration=2.0,
        angular_acceleration=8.0,
        angular_deceleration=8.0,
    )
)
"""10 Hz. The paper's unit square, less what the wheels (0.9 m/s) cannot do."""
SLOW = Setup(
    Limits(
        v_max=0.4,
        v_reverse=0.4,
        omega_max=0.6,
        acceleration=2.0,
        deceleration=2.0,
        angular_acceleration=8.0,
        angular_deceleration=8.0,
    ),
    period=1.0,
    mocap=MocapOptions(noise=0.005, heading_noise=0.01, delay=0.05),
    network=Network(0.15, 0.45),
    watchdog=2.0,
)
"""1 Hz, as on the paper's hardware: from the picture of the pose to the wheels it takes 0.2 to 0.5
s."""
FENCE = (-4.0, -4.0, 4.0, 4.0)
SAMPLES = {"fast": 24_000, "slow": 6_200}
"""Rows of the paper's sets."""
EPISODES = 40
"""Every set is recorded in so many drives."""
NORMAL = 0.1
"""Standard deviation of the commands at 1 Hz [m/s, rad/s]."""


class NormalCommands:
    """A controller that draws v and omega from N(0, 0.1^2) every period (paper, sec. V.C)."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)

    def __call__(self, state: State) -> VelocityCommand:
        """Give the command for now."""
        return VelocityCommand(
            self._random.gauss(0.0, NORMAL), self._random.gauss(0.0, NORMAL), state.stamp
        )


@dataclass(frozen=True)
class Collected:
    """A recorded set."""

    files: tuple[Path, ...]
    rows: int
    simulated: float
    """Time that passed for the robot [s]."""


def collect(
    folder: Path,
    kind: str,
    samples: int,
    ground: Ground | None = None,
    seed: int = 1,
    robot: int = 0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Collected:
    """Drive at random and record, in `EPISODES` files at most.

    Parameters
    ----------
    folder : Path
        For the CSV files.
    kind : str
        ``fast``: uniform commands in the four sign scenarios, 10 Hz. ``slow``: normal commands, 1
        Hz, with latency.
    samples : int
        Rows in all, at least.
    ground : Ground
        Floor of the twin.
    seed : int
        Of the commands; a tuning seed.
    robot : int
        Which robot.
    progress : callable
        Called with drives done and drives in all.
    """
    setup = FAST if kind == "fast" else SLOW
    folder.mkdir(parents=True, exist_ok=True)
    drives = max(4, min(EPISODES, samples // 100))
    each = -(-samples // drives)
    files, rows, simulated = [], 0, 0.0
    for i in range(drives):
        clock = ManualClock()
        fast = kind == "fast"
        controller = (
            Excitation(FENCE, setup.limits, setup.period, seed=seed * 1000 + i, manoeuvres=False)
            if fast
            else NormalCommands(seed * 1000 + i)
        )
        file = folder / f"{kind}_{i:02d}.csv"
        file.unlink(missing_ok=True)
        drive = BatchDrive(
            Twin(ground=ground, seed=robot), controller, setup, clock, seed * 1000 + i, file
        )
        seconds = each * setup.period + 1.0
        began: list[float] = []

        def finished(
            drive: BatchDrive = drive, began: list[float] = began, seconds: float = seconds
        ) -> bool:
            began.append(drive.clock.now)
            return drive.clock.now - began[0] > seconds

        drive.run(finished)
        files.append(file)
        rows += drive.rows
        simulated += seconds
        progress(i + 1, drives)
    return Collected(tuple(files), rows, simulated)
