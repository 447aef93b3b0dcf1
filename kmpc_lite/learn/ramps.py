"""How fast a robot changes its speeds, where that is slower than it is commanded: its ramps.

Motor boards and heavy robots follow a command that jumps by a ramp. That is no lag: its time grows
with the size of the jump, and a model with a lag promises a stop from full speed far too soon. So
ramps are looked for before all else; where the log shows them, the model is learned from the
commands as the ramps let them through, and the controller asks for no faster changes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kmpc_lite.learn.cross_validation import SelectionOptions
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.ramp_search import RampOptions, follow, is_sure, responses, which_best
from kmpc_lite.learn.selection import learned_axes
from kmpc_lite.learn.steering_rate import find_steering_rate
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
EXPLAINED = 0.5
"""Share of the motion, squared, that the commands must explain, by a ramp or without: of what is
noise of the poses, any ramp explains a part."""
AT_ONCE = 0.3
"""Commands that come to the fastest one within this time come there at once [s]: robots whose ramps
are as short are driven as well by a lag."""
FINE = 3
"""How many times as close as at first responses lie that need no ramp: none is to be taken for one
because a lag lies between two of them."""
MOST = 32
"""Pairs of ramps that are looked at at once: a matter of memory alone."""


def find_ramps(dataset: Dataset, options: RampOptions | None = None) -> Ramps:
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
    options = RampOptions() if options is None else options
    found = np.full((len(Ramps._fields), dataset.commands), FREE)
    # a car's turn rate follows its speed, and its steering has a rate of its own
    for axis in range(1 if dataset.steered else dataset.commands):
        found[:, axis] = _find(dataset, axis, options)
    if dataset.steered:
        found[:, 1] = find_steering_rate(dataset, options)
    return Ramps(*found)


def shown_changes(dataset: Dataset) -> Ramps:
    """Tell how fast a log starts and stops: how the robot follows faster changes is unknown.

    Infinite if the commands come to the fastest one of the log at once, or nearly so; where the
    log starts, or stops, too rarely to tell; and where it does so more slowly than any ramp that is
    looked for, for a robot that is limited to that hardly moves.
    """
    found, longest = np.full((len(Ramps._fields), dataset.commands), FREE), RampOptions.longest
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
            if fastest / longest <= shown < fastest / AT_ONCE:
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
        columns = [follow(told, up, down, episode.dt)[1] for told, up, down in pairs]
        if episode.steered:
            columns[1] = columns[0] * columns[1]
        episodes.append(replace(episode, inputs=np.concatenate(columns, axis=1)))
    return Dataset(episodes)


def _find(dataset: Dataset, axis: int, options: RampOptions) -> tuple[float, float]:
    """Ramps away from zero and towards it of one command; infinite if none is sure."""
    pieces = _pieces(dataset, axis, options)
    told = np.concatenate([u for u, _ in pieces]) if pieces else np.zeros(1)
    fastest = float(np.abs(told).max())
    changes = (float(np.abs(np.diff(u)).max(initial=0.0)) for u, _ in pieces)
    jumps = max(changes, default=0.0) / dataset.dt
    least = fastest / options.longest
    if fastest <= 0.0 or jumps <= least:
        return FREE, FREE
    count = int(np.log(jumps / least) / np.log(options.step)) + 1
    tried = np.append(least * options.step ** np.arange(count), FREE)
    faster, slower = (a.ravel() for a in np.meshgrid(tried, tried))
    limited = np.isfinite(faster) | np.isfinite(slower)
    faster, slower = faster[limited], slower[limited]
    errors, motion = _errors(pieces, faster, slower, dataset.dt, options)
    none, _ = _errors(pieces, np.array([FREE]), np.array([FREE]), dataset.dt, options, FINE)
    # by the best ramp: the commands of a robot that follows slowly explain little by themselves
    left = min(e.sum(axis=2).min(initial=np.inf) for e in (none, errors))
    if errors.shape[2] < options.blocks // 2 or not left < (1.0 - EXPLAINED) * motion:
        return FREE, FREE
    if not is_sure(none, errors, options):
        return FREE, FREE
    pair = faster[best := which_best(errors)], slower[best]
    around = options.refined ** np.arange(-3, 4)
    nearby = [v * around if np.isfinite(v) else np.array([FREE]) for v in pair]
    faster, slower = (a.ravel() for a in np.meshgrid(*nearby))
    best = which_best(_errors(pieces, faster, slower, dataset.dt, options)[0])
    found = float(faster[best]), float(slower[best])
    asked = (_starts([u for u, _ in pieces], dataset.dt, back) for back in (False, True))
    shows = [(rates > ramp).sum() >= STARTS for rates, ramp in zip(asked, found, strict=True)]
    return found if any(shows) else (FREE, FREE)


def _errors(
    pieces: list[tuple[Array, Array]],
    faster: Array,
    slower: Array,
    dt: float,
    options: RampOptions,
    parts: int = 1,
) -> tuple[Array, float]:
    """Squared errors (C, R, B) of ramps, with each of R responses, in each block of the log.

    Beside them what they are a part of: the squares of all ways.

    Responses lie `parts` times as close as those that are tried first when a model is learned.
    """
    longest = SelectionOptions().longest_history(dt)
    kinds = responses(dt, longest, parts)
    length = max(1, round(options.window / dt))
    moved, sums, ends = [], [], []
    for told, went in pieces:
        if len(told) < longest + 2 * length:
            continue
        passed, _ = follow(told, faster, slower, dt)
        sums.append(np.cumsum(np.vstack([np.zeros(len(faster)), passed]), axis=0))
        # ways of whole windows, every half of one
        ends.append(np.arange(longest + length, len(told) + 1, max(1, length // 2)))
        way = np.cumsum(np.append(0.0, went))
        moved.append(way[ends[-1]] - way[ends[-1] - length])
    seen = np.concatenate(moved) if moved else np.empty(0)
    blocks = min(options.blocks, len(seen) // 8)
    found = np.zeros((len(faster), len(kinds), blocks))
    for some in (slice(k, k + MOST) for k in range(0, len(faster) if blocks else 0, MOST)):
        by_age = [
            [at[e - age, some] - at[e - age - length, some] for age in range(longest + 1)]
            for at, e in zip(sums, ends, strict=True)
        ]
        way = dt * np.tensordot(kinds, np.concatenate(by_age, axis=1), axes=1)
        gain = (way * seen[:, None]).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-12)
        left = (seen[:, None] - gain[:, None] * way) ** 2
        for b, block in enumerate(np.array_split(left, blocks, axis=1)):
            found[some, :, b] = block.sum(axis=1).T
    return found, float(seen @ seen)


def _pieces(dataset: Dataset, axis: int, options: RampOptions) -> list[tuple[Array, Array]]:
    """Commands (T,), and how far the robot went along its heading, or turned, in each period."""
    found, count = [], 0
    for episode in dataset.episodes:
        found.append((episode.inputs[:, axis], episode.moved[:, axis]))
        count += len(episode)
        if count >= options.most_steps:
            break
    return found
