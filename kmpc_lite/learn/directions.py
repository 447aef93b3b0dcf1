"""The choice in one direction: how heading, forward and sideways speed answer commands.

Each direction is a row of the model. Of all three the same is asked: which terms, and which
response of their motor, explain blocks of the log beyond chance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from kmpc_lite.learn.cross_validation import (
    Candidate,
    SelectionOptions,
    assign_folds,
    critical_score,
    cross_validate,
    solve_columns,
)
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.ladders import CAR, DIFFERENTIAL, OMNI, Ladder, Ladders
from kmpc_lite.learn.responses import (
    AT_ONCE,
    AgedResponse,
    Response,
    first_candidates,
    neighbours,
)
from kmpc_lite.learn.stopping import unmodelled_delay
from kmpc_lite.learn.windows import Moments, Windows, moments, nominal_rows, squared_errors
from kmpc_lite.types import INPUTS, Array

AnyResponse = Response | AgedResponse
ALONG, ACROSS, HEADING = range(3)
"""Rows of a model, and places of their moments in `Moments`."""
NAMES = ("along", "across", "heading")
NOMINAL = "nominal"
"""Name of the nominal robot, the step before the ladders."""


@dataclass(frozen=True)
class Direction:
    """What was chosen for one row."""

    step: str
    """Of its ladder, or `NOMINAL`."""
    score: float
    """Gain over the nominal robot on blocks held out, in standard errors."""
    critical: float
    """What the score had to exceed."""
    terms: tuple[int, ...] = ()
    """What explains it beside the nominal row."""


BOTH_WAYS = 0.1
"""Share of a log that drives forward, and back, from which on it may show a gain for each."""
STAYS = Direction(NOMINAL, 0.0, float("inf"))
"""What is said of a log that is too short for a choice."""


class Row(NamedTuple):
    """One row of a model: its terms, and the moments that these are fitted to and judged by."""

    which: int
    ladder: Ladder
    base: Array
    """Weights of the nominal robot, (p,)."""
    first: int = 0
    """Weight of its first term."""
    before: tuple[int, ...] = ()
    """Weights of other rows that are free beside its own, and stand before them."""
    after: tuple[int, ...] = ()
    """The same behind them."""

    def columns(self, terms: Sequence[int]) -> Array:
        """Weights that are free where terms are chosen."""
        own = (self.first + term for term in terms)
        return np.array([*self.before, *own, *self.after], dtype=int)

    def judged(self, moment: Moments) -> Array:
        """Moments of its errors."""
        return moment[self.which]

    def fitted(self, moment: Moments) -> Array:
        """Moments whose sum is minimised: both rows of the position are fitted together."""
        return moment.heading if self.which == HEADING else moment.along + moment.across

    def candidate(self, moment: Moments, terms: Sequence[int], price: int = 0) -> Candidate:
        """One way to explain the log, of so many unknowns beside its terms."""
        moments, columns = (self.fitted(moment), self.judged(moment)), self.columns(terms)
        return Candidate(*moments, columns, self.base, len(terms) + price)

    def solve(self, moment: Moments, terms: Sequence[int]) -> Array:
        """Weights (p,) by which terms explain all blocks best."""
        return solve_columns(self.fitted(moment).sum(axis=0), self.columns(terms), self.base)


@dataclass
class Search:
    """Moments of the responses looked at so far."""

    windows: Windows
    smoothing: tuple[float, ...]
    limits: tuple[float, ...]
    log: Dataset
    """What the windows are of."""
    given: tuple[AgedResponse, AgedResponse] | None = None
    """Of speed and turn rate, if there is no choice between responses."""
    known: dict[tuple[AnyResponse, AnyResponse], Moments] = field(default_factory=dict)
    weights: tuple[Array, ...] | None = None
    """Of each block's place and heading, of a car."""

    @property
    def commands(self) -> int:
        """Numbers of a command."""
        return len(self.limits)

    @property
    def ladders(self) -> Ladders:
        """Of the robot's kind."""
        if self.commands > INPUTS:
            return OMNI
        return CAR if self.log.steered else DIFFERENTIAL

    @property
    def both_ways(self) -> bool:
        """Whether the log may show a gain forward and one back."""
        v = self.log.inputs[:, 0]
        ways = ((sign * v > self.smoothing[0]).sum() for sign in (1.0, -1.0))
        return bool(min(ways) >= BOTH_WAYS * len(v))

    def row(self, which: int, along: Sequence[int] = ()) -> Row:
        """Row of a model; the sideways speed's beside chosen terms of the forward speed."""
        nominal, ladders = nominal_rows(self.commands), self.ladders
        if which == HEADING:
            return Row(which, ladders.heading, nominal.heading)
        base, first = np.concatenate([nominal.along, nominal.across]), len(nominal.along)
        if which == ACROSS:
            return Row(which, ladders.across, base, first, before=tuple(along))
        return Row(which, ladders.along, base, after=tuple(first + t for t in ladders.beside))

    def candidates(self, which: int) -> tuple[AnyResponse, ...]:
        """Responses to choose from, of the speed or of the turn rate."""
        if self.given is not None:
            return (self.given[which == HEADING],)
        return first_candidates(self.windows.dt, self.windows.longest)

    def price(self, response: AnyResponse) -> int:
        """Unknowns of a response; none of a car's, whose motor and servo lag before a log tells."""
        return 0 if self.log.steered or response == AT_ONCE else 2

    def late(self, chosen: AnyResponse, which: int) -> AnyResponse:
        """Give a mean delay to a robot that was chosen to obey at once, if its log is sure of one.

        That it answers late is one number, which a log shows long before any term of a model.
        """
        if self.given is not None or chosen != AT_ONCE:
            return chosen
        last = self.commands - 1
        axes = (last,) if which == HEADING else tuple(range(last))
        delay = unmodelled_delay(self.log, axes)
        return Response(min(delay, self.windows.longest * self.log.dt), 0.0)

    def pair(self, which: int, one: AnyResponse, other: AnyResponse) -> Moments:
        """As `moments`, for the response of a row's motor and of the other one."""
        return self.moments(one, other) if which == ALONG else self.moments(other, one)

    def moments(self, speed: AnyResponse, turn: AnyResponse) -> Moments:
        """Second moments of the blocks for a pair of responses."""
        key = (speed, turn)
        if key not in self.known:
            dt, longest = self.windows.dt, self.windows.longest
            kernels = speed.weights(dt, longest), turn.weights(dt, longest)
            found = moments(self.windows, *kernels, self.smoothing, self.limits)
            self.known[key] = self._weighed(found) if self.log.steered else found
        return self.known[key]

    def _weighed(self, found: Moments) -> Moments:
        """Moments of a car, in which slow blocks count as much as fast ones.

        A car is driven at very different speeds, and they are compared block by block.
        """
        if self.weights is None:
            at_once = moments(self.windows, (1.0,), (1.0,), self.smoothing, self.limits)
            place = squared_errors(at_once.along + at_once.across, self.row(ALONG).base)
            turn = squared_errors(at_once.heading, self.row(HEADING).base)
            both = (1.0 / np.maximum(e + np.median(e), 1e-12) for e in (place, turn))
            self.weights = tuple(w[:, None, None] for w in both)
        place, turn = self.weights
        return Moments(found.along * place, found.across * place, found.heading * turn)


def choose_response(
    search: Search, which: int, other: AnyResponse, options: SelectionOptions
) -> tuple[AnyResponse, Direction]:
    """Response of the forward speed's motor, or the turn rate's, given the other's; and terms."""
    row = search.row(which)
    tried = [(r, step) for r in search.candidates(which) for step in range(len(row.ladder))]
    candidates = [
        row.candidate(search.pair(which, r, other), row.ladder[step][1], search.price(r))
        for r, step in tried
    ]
    plain = search.moments(AT_ONCE, other if which == ALONG else AT_ONCE)
    reference = squared_errors(row.judged(plain), row.base)
    best, found = _decide(search, row, candidates, reference, options)
    response = tried[best][0]
    found = _by_gear(search, row, search.pair(which, response, other), found, options)
    return search.late(response, which), found


def choose_across(
    search: Search,
    speed: AnyResponse,
    turn: AnyResponse,
    along: Sequence[int],
    options: SelectionOptions,
) -> Direction:
    """Terms of the sideways speed, beside those of the forward speed."""
    moment, row = search.moments(speed, turn), search.row(ACROSS, along)
    candidates = [row.candidate(moment, terms) for _, terms in row.ladder]
    reference = squared_errors(row.judged(moment), row.solve(moment, ()))
    return _decide(search, row, candidates, reference, options)[1]


def _decide(
    search: Search,
    row: Row,
    candidates: Sequence[Candidate],
    reference: Array,
    options: SelectionOptions,
) -> tuple[int, Direction]:
    """Take the best candidate if it beats the reference beyond chance, else the nominal robot.

    The candidates go through the row's ladder once or more.
    """
    blocks, relative = len(reference), not search.log.steered
    choice = cross_validate(candidates, assign_folds(blocks), reference, relative)
    critical = critical_score(blocks, options.significance)
    if not choice.score > critical:
        return 0, Direction(NOMINAL, choice.score, critical)
    name, terms = row.ladder[choice.best % len(row.ladder)]
    return choice.best, Direction(name, choice.score, critical, terms)


def _by_gear(
    search: Search, row: Row, moment: Moments, found: Direction, options: SelectionOptions
) -> Direction:
    """Add a gain for each way of driving to what was chosen, if that errs less beyond chance.

    It is looked for by itself: a candidate more in every choice would cost the others power.
    """
    gears = search.ladders.gears
    if gears is None or not search.both_ways:
        return found
    motor = int(row.which == HEADING)
    terms = tuple(sorted({*found.terms, motor, gears[motor]}))
    one, both = (row.candidate(moment, chosen) for chosen in (found.terms, terms))
    folds, relative = assign_folds(len(one.judged)), not search.log.steered
    reference = cross_validate([one], folds, squared_errors(one.judged, row.base), relative).errors
    score = cross_validate([both], folds, reference, relative).score
    critical = critical_score(len(folds), options.significance)
    return Direction("gears", score, critical, terms) if score > critical else found


def refine(
    search: Search,
    which: int,
    start: AnyResponse,
    other: AnyResponse,
    terms: Sequence[int],
    options: SelectionOptions,
) -> AnyResponse:
    """Walk in ever shorter steps to a response by which the best row errs least.

    `AT_ONCE` and responses of given ages stay.
    """
    if start == AT_ONCE or not isinstance(start, Response):
        return start
    row, dt, longest = search.row(which), search.windows.dt, search.windows.longest

    def error(response: AnyResponse) -> float:
        moment = search.pair(which, response, other)
        judged = row.judged(moment).sum(axis=0)[None]
        return float(squared_errors(judged, row.solve(moment, terms))[0])

    best, lowest = start, error(start)
    for step in options.refinements:
        for _ in range(4):
            near = [(error(r), r) for r in neighbours(best, step * dt, dt, longest)]
            if not near or min(near)[0] >= lowest:
                break
            lowest, best = min(near)
    return best
