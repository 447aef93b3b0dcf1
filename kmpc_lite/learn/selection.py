"""Which terms of a model a log supports: response, slip terms and rows, by one rule.

In each direction (heading, along, across) the choice begins with the nominal unicycle. A richer
candidate replaces it only where it beats it, beyond chance, on blocks that it was neither fitted to
nor chosen by; of those that do, the simplest within a standard error of the best is taken. All
candidates are judged on the same windows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from kmpc_lite.learn.cross_validation import (
    Candidate,
    assign_folds,
    critical_score,
    cross_validate,
    solve_columns,
)
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.responses import AT_ONCE, Response, first_candidates, neighbours
from kmpc_lite.learn.windows import (
    Moments,
    Rows,
    Windows,
    cut,
    largest_speeds,
    moments,
    nominal_rows,
    squared_errors,
)
from kmpc_lite.model.response import TERMS
from kmpc_lite.types import Array

Ladder = tuple[tuple[int, ...], ...]

ALONG_LADDER: Ladder = ((0, 1), (0, 1, 2), (0, 1, 2, 3, 4, 5))
"""Terms of the forward speed, ever more: gains; v*omega; what is even in omega or saturates."""
ODD_LADDER: Ladder = ((0, 1), (0, 1, 2), (0, 1, 2, 6, 7, 8))
"""Terms of the sideways speed and of the turn rate: gains; v*omega; what is odd in omega."""
STEPS = ("nominal", "gains", "product", "slip")
"""What the steps of the ladders are called, the nominal robot before them."""
TERM_COUNT = len(TERMS)


@dataclass(frozen=True)
class SelectionOptions:
    """How a choice is made."""

    window: float = 1.0
    """Length of the windows that are predicted [s]: about what a plan looks ahead."""
    block: float = 5.0
    """Length of a block [s]: longer than what a disturbance lasts."""
    fewest_blocks: int = 16
    """Short logs are cut into shorter blocks until there are as many."""
    longest: float = 1.0
    """Longest history [s]."""
    most_periods: int = 12
    """Longest history [periods]: each period adds columns to the quadratic program."""
    kept: float = 0.5
    """Share of the windows that must remain after the longest history."""
    significance: float = 0.001
    """Probability at which a worthless explanation may pass, in each direction."""
    most_steps: int = 40_000
    """Steps of the longest log that the choice looks at in full; the fit looks at all."""
    refinements: tuple[float, ...] = (0.5, 0.25, 0.125)
    """Steps by which a chosen response is refined [periods]."""


@dataclass(frozen=True)
class Direction:
    """What was chosen for one row."""

    step: str
    """One of `STEPS`."""
    score: float
    """Gain over the nominal robot on blocks held out, in standard errors."""
    critical: float
    """What the score had to exceed."""


@dataclass(frozen=True)
class Selection:
    """What the log supports."""

    rows: Rows
    speed: Response
    turn: Response
    longest: int
    """Longest history that was looked at [periods]."""
    smoothing: tuple[float, float]
    limits: tuple[float, float]
    along: Direction
    across: Direction
    heading: Direction
    blocks: int
    """Blocks that the choice was made on."""
    windows: int
    """Windows that the rows were fitted to."""
    condition: float
    """Condition number of the position's terms, as columns of length one."""

    @property
    def nominal(self) -> bool:
        """Whether nothing beat the nominal robot."""
        return all(d.step == STEPS[0] for d in (self.along, self.across, self.heading))


@dataclass
class _Search:
    """Moments of the responses looked at so far."""

    windows: Windows
    smoothing: tuple[float, float]
    limits: tuple[float, float]
    known: dict[tuple[Response, Response], Moments] = field(default_factory=dict)

    def moments(self, speed: Response, turn: Response) -> Moments:
        """Second moments of the blocks for a pair of responses."""
        key = (speed, turn)
        if key not in self.known:
            dt, longest = self.windows.dt, self.windows.longest
            kernels = speed.weights(dt, longest), turn.weights(dt, longest)
            self.known[key] = moments(self.windows, *kernels, self.smoothing, self.limits)
        return self.known[key]


def select(dataset: Dataset, options: SelectionOptions | None = None) -> Selection:
    """Choose response, slip terms and rows, and fit them.

    Parameters
    ----------
    dataset : Dataset
        What is learned from; nothing else is looked at.
    options : SelectionOptions, optional
        How.
    """
    options = SelectionOptions() if options is None else options
    windows = cut_for(dataset, options)
    limits = largest_speeds(dataset)
    smoothing = 0.05 * limits[0], 0.05 * limits[1]
    blocks = len(windows.blocks)
    if blocks < 3:
        stays = Direction(STEPS[0], 0.0, float("inf"))
        return Selection(
            nominal_rows(),
            AT_ONCE,
            AT_ONCE,
            0,
            smoothing,
            limits,
            stays,
            stays,
            stays,
            blocks,
            0,
            1.0,
        )
    search = _Search(cut_for(_thinned(dataset, options), options), smoothing, limits)
    turn, heading, heading_terms = _choose_heading(search, options)
    speed, along, along_terms = _choose_along(search, turn, options)
    across, across_terms = _choose_across(search, speed, turn, along_terms, options)
    if heading_terms:
        turn = _refine(turn, lambda r: _heading_error(search, r, heading_terms), search, options)
    if along_terms:
        speed = _refine(
            speed, lambda r: _along_error(search, r, turn, along_terms), search, options
        )
    every = _Search(windows, smoothing, limits).moments(speed, turn)
    rows, condition = _fit_rows(every, along_terms, across_terms, heading_terms)
    return Selection(
        rows,
        speed,
        turn,
        windows.longest,
        smoothing,
        limits,
        along,
        across,
        heading,
        blocks,
        windows.count,
        condition,
    )


def cut_for(dataset: Dataset, options: SelectionOptions) -> Windows:
    """Cut a log into enough blocks, after the longest history that leaves enough windows."""
    length = max(1, round(options.window / dataset.dt))
    counts = np.array([len(e) for e in dataset.episodes])
    longest = min(options.most_periods, max(1, round(options.longest / dataset.dt)))
    whole = np.maximum(counts - length + 1, 0).sum()
    while longest and np.maximum(counts - longest - length + 1, 0).sum() < options.kept * whole:
        longest -= 1
    seconds = min(options.block, dataset.steps * dataset.dt / options.fewest_blocks)
    return cut(dataset, longest, length, max(seconds, 1.5 * options.window))


def _thinned(dataset: Dataset, options: SelectionOptions) -> Dataset:
    """Evenly spread pieces of a long log."""
    every = -(-dataset.steps // options.most_steps)
    if every <= 1:
        return dataset
    return Dataset(dataset.windows(4.0 * options.block).episodes[::every])


def _choose_heading(
    search: _Search, options: SelectionOptions
) -> tuple[Response, Direction, tuple[int, ...]]:
    """Response and terms of the turn rate."""
    responses = first_candidates(search.windows.dt, search.windows.longest)
    base = nominal_rows().heading
    candidates, names = [], []
    for response in responses:
        moment = search.moments(AT_ONCE, response).heading
        for step, terms in enumerate(ODD_LADDER):
            complexity = len(terms) + 2 * (response != AT_ONCE)
            candidates.append(Candidate(moment, moment, np.array(terms), base, complexity))
            names.append((response, step))
    reference = squared_errors(search.moments(AT_ONCE, AT_ONCE).heading, base)
    return _decide(candidates, names, ODD_LADDER, reference, options)


def _choose_along(
    search: _Search, turn: Response, options: SelectionOptions
) -> tuple[Response, Direction, tuple[int, ...]]:
    """Response and terms of the forward speed, with the sideways speed free."""
    responses = first_candidates(search.windows.dt, search.windows.longest)
    beside = TERM_COUNT + np.array(ODD_LADDER[1])
    candidates, names = [], []
    for response in responses:
        moment = search.moments(response, turn)
        for step, terms in enumerate(ALONG_LADDER):
            complexity = len(terms) + 2 * (response != AT_ONCE)
            columns = np.concatenate([terms, beside])
            both = moment.along + moment.across
            candidates.append(Candidate(both, moment.along, columns, _position_base(), complexity))
            names.append((response, step))
    reference = squared_errors(search.moments(AT_ONCE, turn).along, _position_base())
    return _decide(candidates, names, ALONG_LADDER, reference, options)


def _choose_across(
    search: _Search,
    speed: Response,
    turn: Response,
    along_terms: tuple[int, ...],
    options: SelectionOptions,
) -> tuple[Direction, tuple[int, ...]]:
    """Terms of the sideways speed."""
    moment = search.moments(speed, turn)
    both = moment.along + moment.across
    candidates = []
    for terms in ODD_LADDER:
        columns = np.concatenate([along_terms, TERM_COUNT + np.array(terms)]).astype(int)
        candidates.append(Candidate(both, moment.across, columns, _position_base(), len(terms)))
    without = solve_columns(both.sum(axis=0), np.array(along_terms, dtype=int), _position_base())
    reference = squared_errors(moment.across, without)
    names = [(speed, step) for step in range(len(ODD_LADDER))]
    _, direction, terms = _decide(candidates, names, ODD_LADDER, reference, options)
    return direction, terms


def _decide(
    candidates: list[Candidate],
    names: list[tuple[Response, int]],
    ladder: Ladder,
    reference: Array,
    options: SelectionOptions,
) -> tuple[Response, Direction, tuple[int, ...]]:
    """Take the chosen candidate if it beats the reference beyond chance, else the nominal robot."""
    blocks = len(reference)
    verdict = cross_validate(candidates, assign_folds(blocks), reference)
    critical = critical_score(blocks, options.significance)
    response, step = names[verdict.best]
    if not verdict.score > critical:
        return AT_ONCE, Direction(STEPS[0], verdict.score, critical), ()
    return response, Direction(STEPS[1 + step], verdict.score, critical), ladder[step]


def _refine(
    start: Response, error: Callable[[Response], float], search: _Search, options: SelectionOptions
) -> Response:
    """Walk a response other than `AT_ONCE` downhill in ever shorter steps."""
    if start == AT_ONCE:
        return start
    dt, longest = search.windows.dt, search.windows.longest
    best, lowest = start, error(start)
    for step in options.refinements:
        for _ in range(4):
            found = [(error(r), r) for r in neighbours(best, step * dt, dt, longest)]
            if not found or min(found)[0] >= lowest:
                break
            lowest, best = min(found)
    return best


def _heading_error(search: _Search, turn: Response, terms: tuple[int, ...]) -> float:
    """Squared heading error of the best rows for a response."""
    total = search.moments(AT_ONCE, turn).heading.sum(axis=0)
    weights = solve_columns(total, np.array(terms), nominal_rows().heading)
    return float(squared_errors(total[None], weights)[0])


def _along_error(search: _Search, speed: Response, turn: Response, terms: tuple[int, ...]) -> float:
    """Squared forward error of the best rows for a response."""
    moment = search.moments(speed, turn)
    columns = np.concatenate([terms, TERM_COUNT + np.array(ODD_LADDER[1])]).astype(int)
    both = (moment.along + moment.across).sum(axis=0)
    weights = solve_columns(both, columns, _position_base())
    return float(squared_errors(moment.along.sum(axis=0)[None], weights)[0])


def _fit_rows(
    every: Moments,
    along_terms: tuple[int, ...],
    across_terms: tuple[int, ...],
    heading_terms: tuple[int, ...],
) -> tuple[Rows, float]:
    """Fit the chosen terms to all windows, and tell how well those tell them apart."""
    both = (every.along + every.across).sum(axis=0)
    columns = np.array([*along_terms, *(TERM_COUNT + t for t in across_terms)], dtype=int)
    position = solve_columns(both, columns, _position_base())
    heading = solve_columns(
        every.heading.sum(axis=0), np.array(heading_terms, dtype=int), nominal_rows().heading
    )
    condition = 1.0
    if len(columns):
        matrix = both[np.ix_(columns, columns)]
        scale = np.sqrt(np.diag(matrix))
        condition = float(np.sqrt(np.linalg.cond(matrix / np.outer(scale, scale))))
    return Rows(position[:TERM_COUNT], position[TERM_COUNT:], heading), condition


def _position_base() -> Array:
    """Nominal rows of the position, side by side, (18,)."""
    rows = nominal_rows()
    return np.concatenate([rows.along, rows.across])
