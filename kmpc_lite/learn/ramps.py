"""How fast a robot changes its speeds, where that is slower than it is commanded: its ramps.

Motor boards and heavy robots follow a command that jumps by a ramp. That is no lag: its time grows
with the size of the jump, and a model with a lag promises a stop from full speed far too soon. So
ramps are looked for before all else; where the log shows them, the model is learned from the
commands as the ramps let them through, and the controller asks for no faster changes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.episode import Episode
from kmpc_lite.learn.ramp_search import (
    LONGEST,
    MOST_STEPS,
    STEP,
    WINDOW,
    Stretch,
    find_ramp,
    follow,
)
from kmpc_lite.learn.selection import learned_axes
from kmpc_lite.model.dictionary.curvature import held_curvatures
from kmpc_lite.model.dictionary.response import driven_by_ramps
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.ramps import FREE, Ramps
from kmpc_lite.types import Array

STARTS = 3
"""Starts from rest, or stops, from which on a log says how fast its commands were changed; so many
as fast as a ramp, or faster, are needed for the ramp to show."""
REST, SPEED = 0.1, 0.5
"""Shares of the fastest command between which a start, or a stop, is timed."""
AT_ONCE = 0.3
"""Commands that come to the fastest one within this time come there at once [s]: robots whose ramps
are as short are driven as well by a lag."""


def find_ramps(dataset: Dataset) -> Ramps:
    """Find the ramps of speed and turn rate that a log shows beyond chance.

    All pairs of ramps, away from zero and towards it, are compared with none, each with the dead
    time, the time constant and the gain that suit it best, on parts of the log that they were not
    chosen by.

    Examples
    --------
    >>> from kmpc_lab import DifferentialDrive, generate_dataset
    >>> find_ramps(generate_dataset(DifferentialDrive(), 10, 100, dt=0.1, seed=0)).limit
    False
    """
    found = np.full((len(Ramps._fields), dataset.commands), FREE)
    # a car's turn rate follows its speed, and its steering has a rate of its own
    for axis in range(1 if dataset.steered else dataset.commands):
        found[:, axis] = _find(dataset, axis)
    if dataset.steered:
        found[:, 1] = find_steering_rate(dataset)
    return Ramps(*found)


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
            rates = _starts(commands, dataset.dt, backwards)
            if len(rates) < STARTS:
                continue
            shown = float(np.sort(rates)[-STARTS])
            if fastest / LONGEST <= shown < fastest / AT_ONCE:
                found[side, axis] = shown
    return Ramps(*found)


def _starts(commands: list[Array], dt: float, backwards: bool = False) -> Array:
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


def _find(dataset: Dataset, axis: int) -> tuple[float, float]:
    """Ramps away from zero and towards it of one command; infinite if none is sure."""
    stretches = [
        Stretch(e.inputs[:, axis], e.moved[:, axis], np.full(len(e), e.dt))
        for e in _shortened(dataset)
    ]
    commands = [s.told for s in stretches]
    changes = _changes(commands, dataset.dt)
    least = _slowest(stretches, dataset.dt)
    tried = np.append(_rates(commands, changes.max(initial=0.0), least), FREE)
    if len(tried) == 1:
        return FREE, FREE
    faster, slower = (a.ravel() for a in np.meshgrid(tried, tried))
    limited = np.isfinite(faster) | np.isfinite(slower)
    found = find_ramp(stretches, faster[limited], slower[limited], dataset.dt)
    asked = (_starts(commands, dataset.dt, back) for back in (False, True))
    shows = [(rates > ramp).sum() >= STARTS for rates, ramp in zip(asked, found, strict=True)]
    return found if any(shows) else (FREE, FREE)


def find_steering_rate(dataset: Dataset) -> float:
    """Find how fast the curvature of a car changes [1/m per second]; infinite if none is sure.

    A servo turns at a rate of its own: the larger a change, the longer it takes. Taken for a lag it
    would be too late for small changes, which it follows at once, and too early for large ones.
    Turns are predicted from the ways that were driven: how the speed follows does not matter.
    """
    stretches = [
        Stretch(held_curvatures(e.inputs), e.moved[:, -1], e.moved[:, 0])
        for e in _shortened(dataset)
    ]
    commands = [s.told for s in stretches]
    changes = np.sort(_changes(commands, dataset.dt))
    most = float(changes[-STARTS]) if len(changes) >= STARTS else 0.0
    rates = _rates(commands, most)
    if not len(rates):
        return FREE
    found, _ = find_ramp(stretches, rates, rates, dataset.dt, alike=True)
    return found if found < most else FREE


def _shortened(dataset: Dataset) -> list[Episode]:
    """Episodes until there are as many steps as are looked at."""
    before = np.cumsum([0, *(len(e) for e in dataset.episodes[:-1])])
    return [e for e, n in zip(dataset.episodes, before, strict=True) if n < MOST_STEPS]


def _changes(commands: list[Array], dt: float) -> Array:
    """How fast commands change from row to row, (n,)."""
    return np.concatenate([np.abs(np.diff(told)) for told in commands]) / dt


def _slowest(stretches: list[Stretch], dt: float) -> float:
    """Slowest ramp by which a robot may have come to the speed that it shows.

    Within the longest time for which it was commanded in one direction.
    """
    length, fastest, longest = max(1, round(WINDOW / dt)), 0.0, 1
    for stretch in stretches:
        sums = np.cumsum(np.insert(stretch.moved, 0, 0.0))
        shown = np.abs(sums[length:] - sums[:-length]) / (length * dt)
        fastest = max(fastest, float(shown.max(initial=0.0)))
        turns = np.flatnonzero(np.diff(np.sign(stretch.told)))
        ends = np.concatenate([[-1], turns, [len(stretch.told) - 1]])
        longest = max(longest, int(np.diff(ends).max()))
    return fastest / (longest * dt) if fastest > 0.0 else FREE


def _rates(commands: list[Array], most: float, slowest: float = FREE) -> Array:
    """Ramps that are tried first, (n,): those that take the longest, to the fastest change.

    Slower ones are tried down to the slowest that a log can show.
    """
    usual = max(float(np.abs(told).max()) for told in commands) / LONGEST
    if not most > usual > 0.0:
        return np.empty(0)
    slower = np.ceil(np.log(max(usual / slowest, 1.0)) / np.log(STEP))
    faster = int(np.log(most / usual) / np.log(STEP))
    return usual * STEP ** np.arange(-slower, faster + 1)
