"""Which terms of a model a log supports: slip and gains, by one rule in each direction.

In each direction the choice begins with the nominal unicycle, which answers as late as the robot
does (`learn.lag`). Ladders of ever more terms replace it only if they beat it, beyond chance, on
blocks that they were neither fitted to nor chosen by; of those that do, the simplest is taken that
the best does not beat beyond chance. Errors are quadratic forms in the blocks' second moments:
fitting without a part of the log costs two small products, not another pass.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from kmpc_lite.learn.coverage import find_coverage
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.lag import (
    AT_ONCE,
    CHANCE,
    MOST_STEPS,
    Found,
    Response,
    assign_folds,
    critical_score,
    find_response,
    gain_score,
)
from kmpc_lite.learn.regression import symmetric_generator
from kmpc_lite.learn.windows import (
    Moments,
    Rows,
    Windows,
    cut,
    largest_inputs,
    moments,
    nominal_rows,
    squared_errors,
)
from kmpc_lite.model.dictionary import Dictionary
from kmpc_lite.model.dictionary.response import OMNI_TERMS, TERMS, ResponseDictionary, terms_of
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import INPUTS, STATES, Array

ALONG, ACROSS, HEADING = range(3)  # rows of a model, and places of their moments in `Moments`
NAMES = ("along", "across", "heading")
NOMINAL = "nominal"  # name of the nominal robot, the step before the ladders
WINDOW, BLOCK, FEWEST_BLOCKS = 1.0, 5.0, 16
"""Length of the windows that are predicted, about what a plan looks ahead, and of a block, longer
than a disturbance lasts [s]; short logs are cut into shorter blocks until there are so many."""
MOST_HISTORY, KEPT = 24, 0.5
"""Longest history of a model [periods]: each adds columns to the quadratic program; share of the
windows that must remain after it."""
SIGNIFICANCE, OF_CARS = 0.001, 0.01
"""Probability at which a worthless explanation may pass, in each direction; few blocks of a car's
log show how tyres and servo turn it. Where more terms explain nothing they pass by `CHANCE`."""
SMOOTHED = 0.05  # share of the largest speed below which ``|omega|`` is rounded
TURNING_AHEAD = {"forward, left", "forward, right"}
"""Parts of a log without which products of speed and turn rate stay out."""
BOTH_WAYS = 0.1
"""Share of a log that drives forward, and back, from which on it may show a gain for each."""
RIDGE = 1e-9  # share of the scaled moments' diagonals that is added to them
Ladder = dict[str, tuple[int, ...]]  # steps of ever more terms, by name


def _ladder(terms: tuple[str, ...], **steps: str) -> Ladder:
    """Steps, each with its terms, parted by blanks."""
    return {n: tuple(sorted(terms.index(t) for t in told.split())) for n, told in steps.items()}


_BOTH, _TURNS = "v omega v*omega", "v omega v*omega omega*|omega| omega^3 v^2*omega"
_BY_SPEED = "v omega v*omega v*|omega| v*omega^2 v*|v|"
DIFFERENTIAL = (
    # its own gain; a turning centre beside the pose; what is even in omega or saturates
    _ladder(TERMS, gain="v", gains="v omega", product=_BOTH, slip=_BY_SPEED),
    # a heading that is off; a turning centre ahead of the pose; what is odd in omega
    _ladder(TERMS, offset="v", centre="omega", gains="v omega", product=_BOTH, slip=_TURNS),
    # its own gain; a robot that draws to one side; what is odd in omega
    _ladder(TERMS, gain="omega", gains="v omega", product=_BOTH, slip=_TURNS),
)
CAR = (
    _ladder(TERMS, gain="v"),
    # tyres that drift outwards, and a pose that is not over the rear axle
    _ladder(TERMS, drift="v^2*omega", centre="omega", gains="omega v^2*omega"),
    # what tyres lose at speed, and in tight turns; wheels that are not straight
    _ladder(
        TERMS,
        understeer="omega v^2*omega",
        saturates="omega v^2*omega omega*|omega|",
        draws="v omega v^2*omega",
        slip=_TURNS,
    ),
)
_EVERY = "v lateral omega"
_AHEAD, _ASIDE = f"{_EVERY} lateral*omega v*|v|", f"{_EVERY} v*omega lateral*|lateral|"
OMNI = (
    _ladder(OMNI_TERMS, gain="v", centre="v omega", gains=_EVERY, slip=_AHEAD),
    _ladder(OMNI_TERMS, gain="lateral", centre="lateral omega", gains=_EVERY, slip=_ASIDE),
    _ladder(OMNI_TERMS, gain="omega", gains=_EVERY, slip=f"{_EVERY} omega*|omega|"),
)
"""Of forward speed, sideways speed and turn rate, in the order of the rows."""
BESIDE = (0, 1, 2)  # terms of the sideways speed that are free where the forward speed's are chosen
GEARS = TERMS.index("|v|"), TERMS.index("omega*sgn(v)")
"""Terms by which forward speed and turn rate differ in reverse, tried beside the others."""


class Direction(NamedTuple):
    """What was chosen for one row."""

    step: str  # of its ladder, or `NOMINAL`
    score: float  # gain over the nominal robot on blocks held out, in standard errors
    critical: float  # what the score had to exceed
    terms: tuple[int, ...] = ()  # what explains it beside the nominal row


STAYS = Direction(NOMINAL, 0.0, float("inf"))  # what is said where there is no choice


@dataclass(frozen=True)
class Selection:
    """What the log supports; by default nothing beyond the nominal robot."""

    smoothing: tuple[float, ...]
    limits: tuple[float, ...]
    blocks: int  # blocks that the choice was made on
    rows: Rows
    speed: Response = AT_ONCE
    turn: Response = AT_ONCE
    doubts: tuple[str, ...] = ()  # what the log leaves open of the responses, in words
    longest: int = 0  # longest history of a response [periods]
    directions: tuple[Direction, ...] = (STAYS, STAYS, STAYS)  # along, across, heading
    windows: int = 0  # windows that the rows were fitted to
    condition: float = 1.0  # condition number of the position's terms, as columns of length one
    steered: bool = False  # whether the turn's response is that of a car's curvature


def select(dataset: Dataset, whole: Dataset | None = None, stay: Collection[int] = ()) -> Selection:
    """Find how late the robot answers, choose slip terms and gains, and fit them.

    `dataset`: what is fitted. `whole`: what lags and terms are chosen on: the log of which
    `dataset` is a part; `dataset` if not given. `stay`: directions (`ALONG`, `ACROSS`, `HEADING`)
    that stay those of the nominal robot.
    """
    log = dataset if whole is None else whole
    limits, m = largest_inputs(dataset.inputs), dataset.commands
    smoothing = tuple(SMOOTHED * most for most in limits)
    ahead, turning = find_response(log, range(m - 1)), find_response(log, (m - 1,))
    if log.steered and (as_told := _turns_as_told(log, ahead, turning)):
        dataset, log, turning = _unsteered(dataset), _unsteered(log), as_told
    found, doubts = {ALONG: AT_ONCE, HEADING: AT_ONCE}, []
    for which, lag, name in ((ALONG, ahead, "speed"), (HEADING, turning, "turn rate")):
        if lag.sure and which not in stay:
            found[which] = lag.response
            doubts += [f"lag of the {name}: ambiguous, {lag.doubt}"] if lag.doubt else []
    speed, turn = found[ALONG], found[HEADING]
    longest = min(MOST_HISTORY, max(speed.periods(dataset.dt), turn.periods(dataset.dt)))
    judged, fitted = (_windows(data, longest) for data in (_thinned(log), dataset))
    blocks = min(len(judged.blocks), len(fitted.blocks))
    if blocks < 3:
        return Selection(smoothing, limits, blocks, nominal_rows(m), steered=dataset.steered)
    answers = _moments(judged, speed, turn, smoothing, limits)
    at_once = _moments(judged, AT_ONCE, AT_ONCE, smoothing, limits)
    chooser = _Chooser(answers, at_once, log, smoothing[0])
    along = STAYS if ALONG in stay else chooser.choose(ALONG)
    heading = STAYS if HEADING in stay else chooser.choose(HEADING)
    across = STAYS if ACROSS in stay else chooser.choose(ACROSS, along.terms)
    chosen = (along, across, heading)
    every = _moments(fitted, speed, turn, smoothing, limits)
    if dataset.steered:
        every = weighed(every, every)
    rows, condition = _fit_rows(every, chooser, chosen)
    told = Selection(smoothing, limits, len(judged.blocks), rows, speed, turn, tuple(doubts))
    told = replace(told, longest=fitted.longest, directions=chosen, windows=fitted.count)
    return replace(told, condition=condition, steered=dataset.steered)


def _turns_as_told(log: Dataset, ahead: Found, steering: Found) -> Found | None:
    """How a car behind an autopilot answers turn rates, however fast it is; None of other cars."""
    free, limits = _unsteered(log), largest_inputs(log.inputs)
    found = ahead, steering, find_response(free, (1,))
    speed, steered, turn = (f.response if f.sure else AT_ONCE for f in found)
    longest = min(MOST_HISTORY, max(r.periods(log.dt) for r in (speed, steered, turn)))

    def errors(data: Dataset, turn: Response) -> Array:
        smoothing = tuple(SMOOTHED * most for most in limits)
        judged = _moments(_windows(_thinned(data), longest), speed, turn, smoothing, limits)
        return squared_errors(judged.heading, nominal_rows().heading)

    by_wheels, as_told = errors(log, steered), errors(free, turn)
    score, blocks = gain_score(by_wheels, as_told, False), len(as_told)
    return found[-1] if blocks > 2 and score > critical_score(blocks, OF_CARS) else None


def _unsteered(dataset: Dataset) -> Dataset:
    return Dataset([replace(episode, steered=False) for episode in dataset.episodes])


def _windows(dataset: Dataset, longest: int) -> Windows:
    """Cut a log into enough blocks, after a history that leaves enough windows."""
    length = max(1, round(WINDOW / dataset.dt))
    counts = np.array([len(e) for e in dataset.episodes])
    whole = np.maximum(counts - length + 1, 0).sum()
    while longest and np.maximum(counts - longest - length + 1, 0).sum() < KEPT * whole:
        longest -= 1
    seconds = min(BLOCK, dataset.steps * dataset.dt / FEWEST_BLOCKS)
    return cut(dataset, longest, length, max(seconds, 1.5 * WINDOW))


def _moments(
    windows: Windows,
    speed: Response,
    turn: Response,
    smoothing: tuple[float, ...],
    limits: tuple[float, ...],
) -> Moments:
    """Second moments of windows for a response of each motor."""
    by_speed, by_turn = (r.weights(windows.dt, windows.longest) for r in (speed, turn))
    return moments(windows, by_speed, by_turn, smoothing, limits)


def _thinned(dataset: Dataset) -> Dataset:
    """Evenly spread pieces of a long log."""
    every = -(-dataset.steps // MOST_STEPS)
    if every <= 1:
        return dataset
    return Dataset(dataset.windows(4.0 * BLOCK).episodes[::every])


class Row(NamedTuple):
    """One row of a model: its terms, and the moments that these are fitted to and judged by."""

    which: int
    ladder: Ladder
    base: Array  # weights of the nominal robot, (p,)
    first: int = 0  # weight of its first term
    before: tuple[int, ...] = ()
    """Weights of other rows that are free beside its own, and stand before them."""
    after: tuple[int, ...] = ()  # the same behind them

    def columns(self, terms: Sequence[int]) -> Array:
        """Weights that are free where terms are chosen."""
        own = (self.first + term for term in terms)
        return np.array([*self.before, *own, *self.after], dtype=int)

    def fitted(self, moment: Moments) -> Array:
        """Moments whose sum is minimised: both rows of the position are fitted together."""
        return moment.heading if self.which == HEADING else moment.along + moment.across

    def solve(self, moment: Moments, terms: Sequence[int]) -> Array:
        """Weights (p,) by which terms explain all blocks best."""
        return solve_columns(self.fitted(moment).sum(axis=0), self.columns(terms), self.base)


class _Chooser:
    """Chooses the terms of each row by the moments of one log."""

    def __init__(self, moment: Moments, at_once: Moments, log: Dataset, slow: float) -> None:
        self._commands, self._steered = log.commands, log.steered
        kinds = OMNI if log.commands > INPUTS else CAR if log.steered else DIFFERENTIAL
        self._ladders: tuple[Ladder, ...] = kinds
        parts = () if log.steered else find_coverage([e.inputs for e in log.episodes], log.dt).parts
        if not (log.steered or {p.name for p in parts if p.is_shown} >= TURNING_AHEAD):
            # how it turns while it drives would be a guess
            named = enumerate(terms_of(log.commands))
            mixed = {k for k, term in named if "omega" in term and term[0] in "vl"}
            self._ladders = tuple(
                {name: terms for name, terms in ladder.items() if mixed.isdisjoint(terms)}
                for ladder in self._ladders
            )
        v = log.inputs[:, 0]
        ways = min(float((sign * v > slow).mean()) for sign in (1.0, -1.0))
        self._gears = GEARS if ways >= BOTH_WAYS and log.commands == INPUTS else None
        self._critical = critical_score(
            len(moment.heading), OF_CARS if log.steered else SIGNIFICANCE
        )
        self._moment, self._at_once = moment, at_once
        if log.steered:
            self._moment, self._at_once = weighed(moment, moment), weighed(at_once, moment)

    def row(self, which: int, along: Sequence[int] = ()) -> Row:
        """Row of a model; the sideways speed's beside chosen terms of the forward speed."""
        nominal, ladder = nominal_rows(self._commands), self._ladders[which]
        if which == HEADING:
            return Row(which, ladder, nominal.heading)
        base, first = np.concatenate([nominal.along, nominal.across]), len(nominal.along)
        if which == ACROSS:
            return Row(which, ladder, base, first, before=tuple(along))
        return Row(which, ladder, base, after=tuple(first + t for t in BESIDE))

    def choose(self, which: int, along: Sequence[int] = ()) -> Direction:
        """Take the best step of a ladder if it beats the nominal robot beyond chance.

        A gain for each way of driving is looked for by itself: a candidate more in every choice
        would cost the others power.
        """
        row = self.row(which, along)
        plain = (self._moment, row.solve(self._moment, ()))
        if which != ACROSS:
            plain = (self._at_once, row.base)
        reference = squared_errors(plain[0][which], plain[1])
        steps = list(row.ladder.items())
        best, score, errors = self._validate(row, [terms for _, terms in steps], reference)
        found = Direction(NOMINAL, score, self._critical)
        if score > self._critical:
            found = Direction(steps[best][0], score, self._critical, steps[best][1])
        if self._gears is None or which == ACROSS:
            return found
        motor = int(which == HEADING)
        terms = tuple(sorted({*found.terms, motor, self._gears[motor]}))
        errors = self._validate(row, [found.terms], reference)[2]
        score = self._validate(row, [terms], errors)[1]
        return Direction("gears", score, self._critical, terms) if score > self._critical else found

    def _validate(
        self, row: Row, steps: Sequence[Sequence[int]], reference: Array
    ) -> tuple[int, float, Array]:
        """Nested cross-validation: the step that is taken, its score, and honest errors (B,).

        For each fold, the choice is made by cross-validation among the other folds, the weights are
        fitted to them, and the errors are taken on the fold.
        """
        fitted, judged = row.fitted(self._moment), self._moment[row.which]
        folds = assign_folds(len(judged))
        count = int(folds.max()) + 1
        one, other = np.triu_indices(count)
        outer = np.zeros((len(steps), len(folds)))
        inner = np.zeros((len(steps), count, len(folds)))
        parts = np.array([fitted[folds == k].sum(axis=0) for k in range(count)])
        # leave out one fold where both are the same, else both
        left_out = parts[one] + np.where((one == other)[:, None, None], 0.0, parts[other])
        for c, terms in enumerate(steps):
            weights = solve_columns(parts.sum(axis=0) - left_out, row.columns(terms), row.base)
            errors = squared_errors(judged, weights)
            for i, j, told in zip(one, other, errors, strict=True):
                if i == j:
                    outer[c, folds == i] = told[folds == i]
                else:
                    inner[c, i, folds == j] = told[folds == j]
                    inner[c, j, folds == i] = told[folds == i]
        sizes, honest = [len(terms) for terms in steps], np.empty(len(folds))
        for o in range(count):
            chosen = simplest(inner[:, o, folds != o], sizes)
            honest[folds == o] = outer[chosen, folds == o]
        score = gain_score(reference, honest, not self._steered)
        return simplest(outer, sizes), score, honest


def weighed(moment: Moments, by: Moments) -> Moments:
    """Moments of a car, in which slow blocks count as much as fast ones: it is driven at both.

    Each block counts by the inverse of what the nominal robot errs in it. They are compared block
    by block then, as they are.
    """
    base = nominal_rows()
    place = squared_errors(by.along + by.across, np.concatenate([base.along, base.across]))
    turn = squared_errors(by.heading, base.heading)
    place, turn = (
        (1.0 / np.maximum(e + np.median(e), 1e-12))[:, None, None] for e in (place, turn)
    )
    return Moments(moment.along * place, moment.across * place, moment.heading * turn)


def simplest(errors: Array, sizes: Sequence[int]) -> int:
    """Index of the simplest candidate that the best one does not beat beyond chance: errors (C, B).

    Of 20 terms that explain nothing, one is taken.
    """
    total, blocks = errors.sum(axis=1), errors.shape[1]
    best = int(np.argmin(total))
    behind = errors - errors[best]
    spread = behind.std(axis=1, ddof=1) * np.sqrt(blocks)
    near: Array = np.flatnonzero(total - total[best] <= critical_score(blocks, CHANCE) * spread)
    return int(min(near.tolist(), key=lambda c: (sizes[c], total[c])))


def solve_columns(moment: Array, columns: Array, base: Array) -> Array:
    """Least squares in some weights, the others held.

    `moment`: second moments, the target's last, (..., p + 1, p + 1). `columns`: which weights are
    free. `base`: all weights before; those not in `columns` keep these values, (p,). Returns
    weights (..., p).
    """
    weights = np.broadcast_to(base, (*moment.shape[:-2], len(base))).copy()
    if not len(columns):
        return weights
    held = base.copy()
    held[columns] = 0.0
    matrix = moment[..., columns[:, None], columns]
    target = moment[..., columns, -1] - moment[..., columns, :-1] @ held
    scale = np.sqrt(np.diagonal(matrix, axis1=-2, axis2=-1))
    scale = np.where(scale > 0.0, scale, 1.0)
    # what the log does not tell apart is shared out evenly, and what it does not show stays zero
    scaled = matrix / (scale[..., :, None] * scale[..., None, :]) + RIDGE * np.eye(len(columns))
    weights[..., columns] = np.linalg.solve(scaled, (target / scale)[..., None])[..., 0] / scale
    return weights


def _fit_rows(
    every: Moments, chooser: _Chooser, chosen: tuple[Direction, ...]
) -> tuple[Rows, float]:
    """Fit the chosen terms to all windows.

    Beside them how well the windows tell those of the position apart.
    """
    along, across, heading = (direction.terms for direction in chosen)
    position = chooser.row(ACROSS, along)
    columns, condition = position.columns(across), 1.0
    if len(columns):
        matrix = position.fitted(every).sum(axis=0)[np.ix_(columns, columns)]
        scale = np.sqrt(np.diag(matrix))
        condition = float(np.sqrt(np.linalg.cond(matrix / np.outer(scale, scale))))
    ahead, aside = np.split(position.solve(every, across), 2)
    return Rows(ahead, aside, chooser.row(HEADING).solve(every, heading)), condition


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
        name: {"step": step, **{k: v if np.isfinite(v) else None for k, v in scores.items()}}
        for name, (step, score, critical, _) in zip(NAMES, selection.directions, strict=True)
        for scores in [{"score": score, "critical": critical}]
    }
    return {
        "method": "integral",
        "symmetric": True,
        "samples": selection.windows,
        "rank": len(used),
        "features": len(used),
        "condition": selection.condition,
        "response": {
            "speed": list(selection.speed),
            "turn": list(selection.turn),
            "longest": selection.longest,
            "doubts": list(selection.doubts),
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
