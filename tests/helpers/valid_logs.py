"""Logs of all sorts of robots that are in order, and what can be wrong with a log."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from kmpc_lite.learn.logs import Log, Series

KINDS = (
    "usual",
    "slow",
    "tiny",
    "huge",
    "skid",
    "one way",
    "one turn",
    "noisy",
    "late",
    "measured",
    "far away",
    "gaps",
    "straight",
    "spins",
    "ahead",
    "uneven",
)
"""Sorts of robots and logs."""


class Made(NamedTuple):
    """A log, and what is known of it."""

    kind: str
    table: np.ndarray  # t, x, y, theta, v, omega, (n, 6) in SI units

    @property
    def log(self) -> Log:
        return as_log(self.table)


def as_log(table: np.ndarray) -> Log:
    """A table (n, 6) as it would have been read."""
    poses = Series(table[:, 0], table[:, 1:4], "table")
    commands = Series(table[:, 0], table[:, 4:], "table")
    return Log(f"run.csv {len(table)}", poses, commands, together=True)


def valid(seed: int, kind: str | None = None) -> Made:
    """Make one log of a robot that drives at random commands."""
    random = np.random.default_rng(seed)
    kind = KINDS[seed % len(KINDS)] if kind is None else kind
    fastest = 10.0 ** random.uniform(-0.7, 0.5)
    if kind in ("slow", "tiny"):
        fastest = 10.0 ** random.uniform(-1.8, -1.0)
    elif kind == "huge":
        fastest = random.uniform(4.0, 14.0)
    size = {"tiny": 0.03, "huge": random.uniform(2.0, 8.0)}.get(kind, random.uniform(0.1, 0.8))
    turning = min(fastest / size * random.uniform(0.3, 1.0), 8.0 / fastest, 4.0)
    gains = random.uniform(0.8, 1.1), random.uniform(0.6, 1.1)
    if kind == "skid":
        gains = random.uniform(0.7, 1.0), 0.37
    rate = random.choice([5.0, 10.0, 20.0, 50.0])
    seconds = random.uniform(40.0, 240.0)
    delay = random.uniform(0.5, 1.2) if kind == "late" else random.uniform(0.0, 0.3)
    lag = random.uniform(0.0, 0.4)
    commands = _commands(random, kind, seconds, fastest, turning)
    time, poses, actual = _simulate(commands, seconds, rate, delay, lag, gains, random, kind)
    given = commands[np.minimum((time / STEP).astype(int), len(commands) - 1)]
    if kind == "measured":
        given = actual / gains + random.normal(size=actual.shape) * [0.03 * fastest, 0.03 * turning]
    noise = 10.0 ** random.uniform(-4.0, -2.0)
    if kind == "noisy":
        noise = random.uniform(0.02, 0.05)
    spread = np.array([noise, noise, random.uniform(0.5, 2.0) * min(noise, 0.04)])
    poses = poses + random.normal(size=poses.shape) * spread * min(1.0, 5.0 * fastest)
    poses[:, 2] = np.remainder(poses[:, 2] + np.pi, 2 * np.pi) - np.pi
    table = np.column_stack([time, poses, given])
    if kind == "far away":
        table[:, :3] += [1.7e9, 4.3e5, 5.2e6]
    if kind == "gaps":
        table = table[np.sin(table[:, 0] * 0.3) > -0.7]
    if kind == "uneven":
        table = table[random.uniform(size=len(table)) > 0.1]
    return Made(kind, table)


STEP = 0.01  # of the simulation [s]


def _commands(
    random: np.random.Generator, kind: str, seconds: float, fastest: float, turning: float
) -> np.ndarray:
    """Commands at every step, held for a while."""
    hold = random.uniform(0.4, 2.5)
    count = int(seconds / hold) + 2
    drawn = random.uniform(-1.0, 1.0, (count, 2)) * [fastest, turning]
    if kind in ("one way", "huge") or random.uniform() < 0.3:
        drawn[:, 0] = np.abs(drawn[:, 0])
    if kind == "one turn":
        drawn[:, 1] = np.abs(drawn[:, 1])
    if kind == "straight":
        drawn[:, 1] *= random.uniform(0.02, 0.1)
    if kind == "spins":
        drawn[random.uniform(size=count) < 0.8, 0] = 0.0
    if random.uniform() < 0.3:
        drawn[random.uniform(size=count) < 0.2] = 0.0
    steps = (np.arange(int(seconds / STEP)) * STEP / hold).astype(int)
    return drawn[steps]


def _simulate(
    commands: np.ndarray,
    seconds: float,
    rate: float,
    delay: float,
    lag: float,
    gains: tuple[float, float],
    random: np.random.Generator,
    kind: str,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, poses and true speeds of a robot that answers late, and slips a little."""
    wait = int(delay / STEP)
    heard = np.vstack([np.zeros((wait, 2)), commands])[: len(commands)]
    keep = np.exp(-STEP / lag) if lag > 0.0 else 0.0
    v, omega = lfilter([1.0 - keep], [1.0, -keep], heard * gains, axis=0).T
    top = np.abs(omega).max(initial=1e-9)
    v = v * (1.0 - random.uniform(0.0, 0.25) * np.abs(omega) / top)
    aside = random.uniform(-0.1, 0.1) * v * omega / top
    if kind == "ahead":
        aside = aside + random.uniform(0.05, 0.3) * omega
    theta = random.uniform(-3.0, 3.0) + np.concatenate([[0.0], np.cumsum(omega[:-1]) * STEP])
    moved = (v + 1j * aside) * np.exp(1j * (theta + 0.5 * omega * STEP)) * STEP
    path = np.concatenate([[0.0], np.cumsum(moved)[:-1]])
    every = round(1.0 / rate / STEP)
    rows = np.arange(0, len(commands), every)
    poses = np.column_stack([path.real, path.imag, theta])[rows]
    return rows * STEP, poses, np.column_stack([v, omega])[rows]


def _times(column: str, size: float) -> Callable[[np.ndarray], np.ndarray]:
    place = "t x y theta v omega".split().index(column)

    def change(table: np.ndarray) -> np.ndarray:
        table[:, place] *= size
        return table

    return change


def _all(*changes: Callable[[np.ndarray], np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
    def change(table: np.ndarray) -> np.ndarray:
        for one in changes:
            table = one(table)
        return table

    return change


def _columns(order: list[int]) -> Callable[[np.ndarray], np.ndarray]:
    return lambda table: table[:, order]


def _turned(angle: float) -> Callable[[np.ndarray], np.ndarray]:
    def change(table: np.ndarray) -> np.ndarray:
        table[:, 3] += angle
        return table

    return change


def _unrelated(table: np.ndarray) -> np.ndarray:
    """Commands of another drive of the same robot."""
    random = np.random.default_rng(7)
    runs = np.flatnonzero(np.any(np.diff(table[:, 4:], axis=0), axis=1)) + 1
    parts = np.split(table[:, 4:], runs)
    shuffled = [parts[k] for k in random.permutation(len(parts))]
    return np.column_stack([table[:, :4], np.concatenate(shuffled)])


def _later(seconds: float) -> Callable[[np.ndarray], np.ndarray]:
    def change(table: np.ndarray) -> np.ndarray:
        rows = round(seconds / float(np.median(np.diff(table[:, 0]))))
        return np.column_stack([table[:, :4], np.roll(table[:, 4:], rows, axis=0)])

    return change


def _constant(column: int, value: float) -> Callable[[np.ndarray], np.ndarray]:
    def change(table: np.ndarray) -> np.ndarray:
        table[:, column] = value
        return table

    return change


def _counted(table: np.ndarray) -> np.ndarray:
    """Rows instead of seconds."""
    table[:, 0] = np.arange(len(table))
    return table


MM, DEG = 1e3, 180.0 / np.pi
MM_PATH = _all(_times("x", MM), _times("y", MM))
NED = _all(_columns([0, 2, 1, 3, 4, 5]), _times("theta", -1.0), _turned(0.5 * np.pi))
WRONG: dict[str, tuple[Callable[[np.ndarray], np.ndarray], str]] = {
    "ms": (_times("t", 1e3), "--units t=ms"),
    "ns": (_times("t", 1e9), "--units t=ns"),
    "mm": (MM_PATH, "--units x=mm y=mm"),
    "cm": (_all(_times("x", 100.0), _times("y", 100.0)), "--units x=cm y=cm"),
    "mm/s": (_times("v", MM), "--units v=mm/s"),
    "theta deg": (_times("theta", DEG), "--units theta=deg"),
    "omega deg": (_times("omega", DEG), "--units omega=deg/s"),
    "both deg": (_all(_times("theta", DEG), _times("omega", DEG)), "--units theta=deg"),
    "mirrored": (_times("theta", -1.0), "--units theta=-rad"),
    "compass": (
        _all(_times("theta", -1.0), _turned(0.5 * np.pi), _times("theta", DEG)),
        "--units theta=-deg+90",
    ),
    "ned": (NED, "--frame ned"),
    "y mirrored": (_times("y", -1.0), "--units y=-m"),
    "swapped": (_columns([0, 2, 1, 3, 4, 5]), "--frame swapped"),
    "a quarter": (_turned(0.5 * np.pi), "--units theta=rad-1.5708"),
    "a half": (_turned(np.pi), "--units v=-m/s"),
    "omega mirrored": (_times("omega", -1.0), "--units omega=-rad/s"),
    "unrelated": (_unrelated, "does not follow the commands"),
    "later": (_later(30.0), "does not follow the commands"),
    "before": (_later(2.0), "--shift -"),
    "theta frozen": (_constant(3, 0.5), "theta never changes"),
    "exchanged": (_columns([0, 1, 2, 3, 5, 4]), "does not follow the commands"),
    "s as ns": (_times("t", 1e-9), "--units t=s"),
    "place frozen": (_all(_constant(1, 3.0), _constant(2, 4.0)), "x and y never change"),
    "rows": (_counted, "t, or both of them, are in another unit"),
    "rpm": (_times("omega", 60.0 / (2.0 * np.pi)), "--units omega=rpm"),
    "theta in cdeg": (_times("theta", 100.0 * DEG), "does not follow the commands"),
    "latitude": (_all(_times("x", 1e-5), _times("y", 1e-5)), "longitude and latitude"),
    "pixels": (_all(_times("x", 200.0), _times("y", -200.0)), "198 times as long as v says"),
    "another plane": (_constant(2, 0.0), "y never changes"),
    "no commands": (_all(_constant(4, 0.0), _constant(5, 0.0)), "all commands are 0"),
}
"""What is done to a valid log, and a word of the line that it must get."""
