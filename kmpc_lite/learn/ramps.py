"""How fast a robot changes its speeds, where that is slower than it is commanded: its ramps.

Motor boards and heavy robots follow a command that jumps by a ramp. That is no lag: its time grows
with the size of the jump, and a model with a lag promises a stop from full speed far too soon. So
ramps are looked for before all else; where the log shows them, the model is learned from the
commands as the ramps let them through, and the controller asks for no faster changes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.lag import BLOCKS, CHANCE, LONGEST, WINDOW, Motor, Response, is_sure
from kmpc_lite.learn.selection import learned_axes
from kmpc_lite.model.dictionary.response import driven_by_ramps, held_curvatures
from kmpc_lite.model.file import FREE, Ramps
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import Array

RAMP_PARTS = 5  # parts of a period in which a ramp is reckoned
EXPLAINED = 0.5
"""Share of the motion, squared, that the commands must explain, by a ramp or without: of what is
noise of the poses, any ramp explains a part."""
SLOWEST, STEP, REFINED = 6.0, 1.3, 1.08
"""Slowest ramp that is tried: time to the fastest command of the log [s], slower ones where a log
drives in one direction for longer than its robot comes to speed by them; ratio of neighbouring
ramps that are tried first, and around the best one."""
WORTH = 0.05  # share of the squared error that a ramp must explain at the least
BESIDE = [Response(d, t) for d in (0.0, 0.1, 0.2, 0.3, 0.5) for t in (0.0, 0.05, 0.1, 0.2, 0.35)]
"""Responses that are tried beside each ramp [s]."""
STARTS = 3
"""Starts from rest, or stops, from which on a log says how fast its commands were changed; so many
as fast as a ramp, or faster, are needed for the ramp to show."""


def find_ramps(dataset: Dataset) -> Ramps:
    """Find the ramps of speed and turn rate that a log shows beyond chance; infinite for none.

    All pairs of ramps, away from zero and towards it, are compared with none. A car's turns
    follow its speed, and its steering has a rate of its own [1/m per second].

    Examples
    --------
    >>> from kmpc_lab import DifferentialDrive, generate_dataset
    >>> find_ramps(generate_dataset(DifferentialDrive(), 10, 100, dt=0.1, seed=0)).limit
    False
    """
    pairs = [_ramps_of(dataset, axis) for axis in range(dataset.commands)]
    return Ramps(*np.array(pairs).T)


def _ramps_of(dataset: Dataset, axis: int) -> tuple[float, float]:
    """Ramps away from zero and towards it of one number; of a car's steering one for both."""
    motor, servo = Motor(dataset, [axis]), bool(axis and dataset.steered)
    (told,) = motor.told
    commands = np.split(told, motor.parts)
    changes = np.sort(np.concatenate([np.abs(np.diff(u)) for u in commands])) / dataset.dt
    most = float(changes[-STARTS if servo else -1]) if len(changes) >= STARTS else 0.0
    usual = float(np.abs(told).max()) / SLOWEST
    # at what speed an episode begins is not known: its first second says nothing of ramps
    whole = motor.longest * dataset.dt >= LONGEST - 0.5 * dataset.dt
    if not whole or motor.blocks < BLOCKS // 2 or not most > usual > 0.0:
        return FREE, FREE
    slower = 0.0 if servo else np.ceil(np.log(max(usual / _slowest(motor), 1.0)) / np.log(STEP))
    rates = usual * STEP ** np.arange(-slower, int(np.log(most / usual) / np.log(STEP)) + 1)
    free, tried = motor.fit(motor.tried())[0], _pairs([*rates, FREE], [*rates, FREE], servo)
    limited = _limited(motor, tried)
    left = min(float(e.sum(axis=-1).min()) for e in (free, limited))
    every = limited.reshape(-1, motor.blocks)
    if left > 1.0 - EXPLAINED or not is_sure(free, every, CHANCE, WORTH):
        return FREE, FREE
    around = REFINED ** np.arange(-3.0, 4.0)
    best = tried[int(limited.sum(axis=2).min(axis=1).argmin())]
    near = [list(rate * around) if rate < FREE else [FREE] for rate in best]
    tried = _pairs(near[0], near[1], servo)
    found = tried[int(_limited(motor, tried).sum(axis=2).min(axis=1).argmin())]
    if servo:
        return found if found[0] < most else (FREE, FREE)
    asked = (starts(commands, dataset.dt, back) for back in (False, True))
    shows = [(rates > ramp).sum() >= STARTS for rates, ramp in zip(asked, found, strict=True)]
    return found if any(shows) else (FREE, FREE)


def _pairs(faster: list[float], slower: list[float], alike: bool) -> list[tuple[float, float]]:
    """Pairs of ramps that limit anything; both the same where they are alike."""
    if alike:
        return [(rate, rate) for rate in faster if rate < FREE]
    return [(f, s) for f in faster for s in slower if min(f, s) < FREE]


def _limited(motor: Motor, pairs: list[tuple[float, float]]) -> Array:
    """Errors (C, R, B) of pairs of ramps, with the responses that are tried beside each."""
    (faster, slower), parts = np.array(pairs).T, np.split(motor.told[0], motor.parts)
    passed = [follow(told, faster, slower, motor.dt) for told in parts]
    # one pair at a time: as one array all of them are there twice for a moment
    each = (np.concatenate([told[:, k] for told in passed]) for k in range(len(pairs)))
    return np.array([motor.fit(BESIDE, [told])[0] for told in each])


def _slowest(motor: Motor) -> float:
    """Slowest ramp by which a robot may have come to the speed that it shows.

    Within the longest time for which it was commanded in one direction.
    """
    length, fastest, longest = max(1, round(WINDOW / motor.dt)), 0.0, 1
    parts = (np.split(rows[0], motor.parts) for rows in (motor.told, motor.moved))
    for told, moved in zip(*parts, strict=True):
        sums = np.cumsum(np.insert(moved, 0, 0.0))
        shown = np.abs(sums[length:] - sums[:-length]) / (length * motor.dt)
        fastest = max(fastest, float(shown.max(initial=0.0)))
        turns = np.flatnonzero(np.diff(np.sign(told)))
        ends = np.concatenate([[-1], turns, [len(told) - 1]])
        longest = max(longest, int(np.diff(ends).max()))
    return fastest / (longest * motor.dt) if fastest > 0.0 else FREE


def follow(told: Array, faster: Array, slower: Array, dt: float, at_ends: bool = False) -> Array:
    """Speeds that follow commanded ones (T,) by ramps (C,): means of periods (T, C), or at ends."""
    speed = np.full(len(faster), told[0])
    up, down = faster * dt / RAMP_PARTS, slower * dt / RAMP_PARTS
    found = np.empty((len(told), len(faster)))
    for k, aim in enumerate(told.tolist()):
        total = 0.5 * speed
        for _ in range(RAMP_PARTS):
            grows = np.abs(aim) >= np.abs(speed)
            limit = np.where(grows & (aim * speed >= 0.0), up, down)
            speed = speed + np.minimum(np.maximum(aim - speed, -limit), limit)
            total = total + speed
        found[k] = speed if at_ends else (total - 0.5 * speed) / RAMP_PARTS
    return found


REST, SPEED = 0.1, 0.5  # shares of the fastest command between which a start, or a stop, is timed


def starts(commands: Sequence[Array], dt: float, backwards: bool = False) -> Array:
    """Fastest changes (n,) of starts from rest to speed; backwards: of stops.

    A command that changes its sign was at rest in between.
    """
    fastest, rates = max(float(np.abs(u).max()) for u in commands), []
    for told in commands:
        u = told[::-1] if backwards else told
        size, rest = np.abs(u), -1
        rises = np.where(u[1:] * u[:-1] < 0.0, size[1:], np.diff(size))
        for k, now in enumerate(size.tolist()):
            if now <= REST * fastest:
                rest = k
            elif k and u[k] * u[k - 1] < 0.0:
                rest = k - 1
            if 0 <= rest < k and now >= SPEED * fastest:
                rates.append(float(rises[rest:k].max()) / dt)
                rest = -1
    return np.array(rates)


AT_ONCE = 0.3
"""Commands that come to the fastest one within this time come there at once [s]: robots whose ramps
are as short are driven as well by a lag."""


def shown_changes(dataset: Dataset) -> Ramps:
    """Tell how fast a log starts and stops: how the robot follows faster changes is unknown.

    Infinite if the commands come to the fastest one of the log at once, or nearly so; where the
    log starts, or stops, too rarely to tell; and where it does so more slowly than any ramp that is
    looked for, for a robot that is limited to that hardly moves.
    """
    found = np.full((len(Ramps._fields), dataset.commands), FREE)
    for axis in range(dataset.commands):
        commands = [
            held_curvatures(e.inputs) if axis and e.steered else e.inputs[:, axis]
            for e in dataset.episodes
        ]
        fastest = max(float(np.abs(u).max()) for u in commands)
        for side, backwards in enumerate((False, True)):
            rates = starts(commands, dataset.dt, backwards)
            shown = float(np.sort(rates)[-STARTS]) if len(rates) >= STARTS else FREE
            if fastest / SLOWEST <= shown < fastest / AT_ONCE:
                found[side, axis] = shown
    return Ramps(*found)


def with_ramps(model: KoopmanModel, dataset: Dataset, ramps: Ramps) -> KoopmanModel:
    """Return a model with the ramps of its log, and the log's fastest changes, in its `info`.

    The controller asks for no faster ones, for the log does not show how the robot follows them. If
    the model knows no more of a speed than the nominal robot does, nothing limits its changes.
    """
    limited = np.asarray(np.isfinite(ramps).any(axis=0))
    shown = np.where(learned_axes(model) | limited, shown_changes(dataset), FREE)
    told = {"ramps": ramps, "changes": Ramps(*shown)}
    limits = {name: limits.as_dict() for name, limits in told.items() if limits.limit}
    dictionary = driven_by_ramps(model.dictionary, limited)
    return replace(model, dictionary=dictionary, info={**model.info, **limits})


def let_through(dataset: Dataset, ramps: Ramps) -> Dataset:
    """Give the same driving with what ramps let through of its commands by the ends of periods."""
    if not ramps.limit:
        return dataset
    episodes = []
    for episode in dataset.episodes:
        asked = episode.inputs.T
        if episode.steered:  # its wheels stay steered while it rolls
            asked = np.stack([asked[0], held_curvatures(episode.inputs)])
        pairs = zip(asked, ramps.faster[:, None], ramps.slower[:, None], strict=True)
        columns = [follow(told, up, down, episode.dt, True) for told, up, down in pairs]
        if episode.steered:
            columns[1] = columns[0] * columns[1]
        episodes.append(replace(episode, inputs=np.concatenate(columns, axis=1)))
    return Dataset(episodes)
