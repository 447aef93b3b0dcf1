"""Which terms of a model a log supports: response, slip terms and rows, by one rule.

In each direction (heading, along, across) the choice begins with the nominal unicycle. A richer
candidate replaces it only if it beats it, beyond chance, on blocks that it was neither fitted to
nor chosen by; of those that do, the simplest is taken that the best does not beat beyond chance.
All candidates are judged on the same windows. The chosen rows become a model with a record of it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.cross_validation import SelectionOptions
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.directions import (
    ACROSS,
    ALONG,
    HEADING,
    NAMES,
    NOMINAL,
    STAYS,
    AnyResponse,
    Direction,
    Search,
    choose_across,
    choose_response,
    refine,
)
from kmpc_lite.learn.least_squares import symmetric_generator
from kmpc_lite.learn.responses import AT_ONCE, shares_of_ages
from kmpc_lite.learn.windows import Rows, Windows, cut, largest_speeds, nominal_rows
from kmpc_lite.model.dictionary import Dictionary
from kmpc_lite.model.dictionary.response import ResponseDictionary
from kmpc_lite.model.dictionary.terms import terms_of
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import INPUTS, STATES, Array

CAR_OPTIONS = SelectionOptions(significance=0.01)
"""Motor and servo of a car lag, and few blocks of its log show how much: as with ramps, what is
missed is a stop that comes too late."""


@dataclass(frozen=True)
class Selection:
    """What the log supports; by default nothing beyond the nominal robot."""

    smoothing: tuple[float, ...]
    limits: tuple[float, ...]
    blocks: int
    """Blocks that the choice was made on."""
    rows: Rows
    speed: AnyResponse = AT_ONCE
    turn: AnyResponse = AT_ONCE
    longest: int = 0
    """Longest history that was looked at [periods]."""
    directions: tuple[Direction, ...] = (STAYS, STAYS, STAYS)
    """Along, across, heading."""
    windows: int = 0
    """Windows that the rows were fitted to."""
    condition: float = 1.0
    """Condition number of the position's terms, as columns of length one."""
    steered: bool = False
    """Whether the turn's response is that of a car's curvature."""

    @property
    def nominal(self) -> bool:
        """Whether nothing beat the nominal robot."""
        return all(direction.step == NOMINAL for direction in self.directions)


def select(
    dataset: Dataset,
    options: SelectionOptions | None = None,
    ages: Sequence[int] = (),
    whole: Dataset | None = None,
    stay: Collection[int] = (),
) -> Selection:
    """Choose response, slip terms and rows, and fit them.

    Parameters
    ----------
    dataset : Dataset
        What is fitted.
    options : SelectionOptions, optional
        How.
    ages : sequence of int
        Of the commands that act [periods]; if there are none, a dead time and a time constant
        are looked for.
    whole : Dataset, optional
        What terms are chosen on: the log of which `dataset` is a part; `dataset` if not given.
    stay : collection of int
        Directions (`ALONG`, `ACROSS`, `HEADING`) that stay those of the nominal robot.

    Raises
    ------
    DataError
        For ages that a log is too short for, or an omni's.
    """
    if ages and dataset.commands > INPUTS:
        raise DataError(
            "lags: how much of past commands acts is found of a speed and a turn rate; an omni's "
            "lag is found by itself (lags='auto')"
        )
    if options is None:
        options = CAR_OPTIONS if dataset.steered else SelectionOptions()
    windows, limits = cut_for(dataset, options, ages), largest_speeds(dataset)
    terms = tuple(0.05 * most for most in limits), limits
    blocks = len(windows.blocks)
    if blocks < 3 and ages:
        longest = (windows.longest + windows.length) * dataset.dt
        raise DataError(
            f"lags: expected at least three pieces of driving longer than {longest:g} s without a "
            f"gap, as lags up to {max(ages)} periods need; got {blocks}"
        )
    if blocks < 3:
        return Selection(*terms, blocks, nominal_rows(len(limits)), steered=dataset.steered)
    given = shares_of_ages(windows, ages) if ages else None
    fitted, search = (
        Search(cut_for(_thinned(log, options), options, ages), *terms, log, given)
        for log in (dataset, dataset if whole is None else whole)
    )
    turn: AnyResponse = AT_ONCE
    speed: AnyResponse = AT_ONCE
    heading = along = across = STAYS
    if HEADING not in stay:
        turn, heading = choose_response(search, HEADING, AT_ONCE, options)
    if ALONG not in stay:
        speed, along = choose_response(search, ALONG, turn, options)
    if HEADING not in stay and dataset.steered and speed != AT_ONCE:
        turn, heading = choose_response(search, HEADING, speed, options)
    if ACROSS not in stay:
        across = choose_across(search, speed, turn, along.terms, options)
    # only a car's turn rate follows its speed
    rolls = speed if dataset.steered else AT_ONCE
    turn = refine(fitted, HEADING, turn, rolls, heading.terms, options)
    speed = refine(fitted, ALONG, speed, turn, along.terms, options)
    every = Search(windows, *terms, dataset)
    chosen = (along, across, heading)
    rows, condition = _fit_rows(every, speed, turn, chosen)
    return Selection(
        *terms,
        len(search.windows.blocks),
        rows,
        speed,
        turn,
        windows.longest,
        chosen,
        windows.count,
        condition,
        dataset.steered,
    )


def cut_for(dataset: Dataset, options: SelectionOptions, ages: Sequence[int] = ()) -> Windows:
    """Cut a log into enough blocks, after the longest history that leaves enough windows.

    Where ages of commands [periods] are given, after one that holds them.
    """
    length = max(1, round(options.window / dataset.dt))
    counts = np.array([len(e) for e in dataset.episodes])
    longest = max(ages, default=options.longest_history(dataset.dt))
    whole = np.maximum(counts - length + 1, 0).sum()
    while (
        not ages
        and longest
        and np.maximum(counts - longest - length + 1, 0).sum() < options.kept * whole
    ):
        longest -= 1
    seconds = min(options.block, dataset.steps * dataset.dt / options.fewest_blocks)
    return cut(dataset, longest, length, max(seconds, 1.5 * options.window))


def _thinned(dataset: Dataset, options: SelectionOptions) -> Dataset:
    """Evenly spread pieces of a long log."""
    every = -(-dataset.steps // options.most_steps)
    if every <= 1:
        return dataset
    return Dataset(dataset.windows(4.0 * options.block).episodes[::every])


def _fit_rows(
    search: Search, speed: AnyResponse, turn: AnyResponse, chosen: tuple[Direction, ...]
) -> tuple[Rows, float]:
    """Fit the chosen terms to all windows.

    Beside them how well the windows tell those of the position apart.
    """
    along, across, heading = (direction.terms for direction in chosen)
    every, position = search.moments(speed, turn), search.row(ACROSS, along)
    columns, condition = position.columns(across), 1.0
    if len(columns):
        matrix = position.fitted(every).sum(axis=0)[np.ix_(columns, columns)]
        scale = np.sqrt(np.diag(matrix))
        condition = float(np.sqrt(np.linalg.cond(matrix / np.outer(scale, scale))))
    ahead, aside = np.split(position.solve(every, across), 2)
    return Rows(ahead, aside, search.row(HEADING).solve(every, heading)), condition


def build_model(selection: Selection, base: Dictionary, dt: float) -> KoopmanModel:
    """Write the selected rows in the paper's bilinear form, with as few inputs as they need."""
    rows, m = np.array(selection.rows), base.commands
    terms = terms_of(m)
    used = [t for i, t in enumerate(terms) if i < m or rows[:, i].any()]
    speed = selection.speed.weights(dt, selection.longest)
    turn = selection.turn.weights(dt, selection.longest)
    dictionary = base
    if len(used) > m or len(speed) > 1 or len(turn) > 1:
        dictionary = ResponseDictionary(
            base, speed, turn, used, selection.smoothing, selection.limits, selection.steered
        )
    kept = rows[:, [terms.index(t) for t in used]]
    nz, nw = dictionary.size, dictionary.input_size
    return KoopmanModel(
        dictionary,
        dt,
        np.zeros((STATES, nz)),
        np.zeros((STATES, nw)),
        symmetric_generator(dictionary, *kept),
        np.eye(STATES),
        continuous=True,
        info=describe_selection(selection, used),
    )


def describe_selection(selection: Selection, used: list[str]) -> dict[str, Any]:
    """What was chosen, as values that JSON can hold."""
    directions = {
        name: {
            "step": found.step,
            "score": _finite(found.score),
            "critical": _finite(found.critical),
        }
        for name, found in zip(NAMES, selection.directions, strict=True)
    }
    return {
        "method": "integral",
        "symmetric": True,
        "samples": selection.windows,
        "rank": len(used),
        "features": len(used),
        "condition": selection.condition,
        "response": {
            "speed": selection.speed.described(),
            "turn": selection.turn.described(),
            "longest": selection.longest,
        },
        "selection": {
            "directions": directions,
            "terms": used,
            "rows": np.array(selection.rows).tolist(),
            "blocks": selection.blocks,
        },
    }


def learned_axes(model: KoopmanModel) -> Array:
    """Whether a model differs from the nominal robot in each number of a command, (m,) bool."""
    chosen, m = model.info.get("selection"), model.inputs
    if chosen is None:
        return np.ones(m, dtype=bool)
    rows = np.array(chosen["rows"])  # files of earlier versions have fewer terms
    along, across, heading = rows != np.array(nominal_rows(m))[:, : rows.shape[1]]
    speed, turn = (any(model.info["response"][name]) for name in ("speed", "turn"))
    place = along.any() or across.any() or speed
    return np.array([*[place] * (m - 1), heading.any() or turn])


def _finite(value: float) -> float | None:
    """A number that JSON can hold, or None."""
    return float(value) if np.isfinite(value) else None
