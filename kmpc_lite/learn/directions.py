"""The choice in one direction: how heading, forward and sideways speed answer commands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

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
from kmpc_lite.learn.responses import AT_ONCE, AgedResponse, Response, first_candidates
from kmpc_lite.learn.stopping import DelayOptions, unmodelled_delay
from kmpc_lite.learn.windows import (
    Moments,
    Windows,
    moments,
    nominal_rows,
    squared_errors,
)
from kmpc_lite.types import INPUTS, Array

AnyResponse = Response | AgedResponse


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


BOTH_WAYS = 0.1
"""Share of a log that drives forward, and back, from which on it may show a gain for each."""
STAYS = Direction(NOMINAL, 0.0, float("inf"))
"""What is said of a log that is too short for a choice."""


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

    @property
    def base(self) -> Array:
        """Nominal rows of the position, side by side, (2 T,)."""
        return position_base(self.commands)

    @property
    def turn_base(self) -> Array:
        """Nominal row of the turn rate, (T,)."""
        return nominal_rows(self.commands).heading

    def aside(self, terms: Sequence[int]) -> Array:
        """Columns of the sideways speed's terms."""
        return len(self.turn_base) + np.array(terms, dtype=int)

    def candidates(self, which: int) -> tuple[AnyResponse, ...]:
        """Responses to choose from, of the speed (0) or the turn rate (1)."""
        if self.given is not None:
            return (self.given[which],)
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
        axes = (last,) if which else tuple(range(last))
        delay = unmodelled_delay(self.log, DelayOptions(axes=axes))
        return Response(min(delay, self.windows.longest * self.log.dt), 0.0)

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
            place = squared_errors(at_once.along + at_once.across, self.base)
            turn = squared_errors(at_once.heading, self.turn_base)
            both = (1.0 / np.maximum(e + np.median(e), 1e-12) for e in (place, turn))
            self.weights = tuple(w[:, None, None] for w in both)
        place, turn = self.weights
        return Moments(found.along * place, found.across * place, found.heading * turn)


def choose_heading(
    search: Search, options: SelectionOptions, speed: AnyResponse = AT_ONCE
) -> tuple[AnyResponse, Direction, tuple[int, ...]]:
    """Response and terms of the turn rate; a car's follows the response of its speed, too."""
    base, ladder = search.turn_base, search.ladders.heading
    candidates, names = [], []
    for response in search.candidates(1):
        moment = search.moments(speed, response).heading
        for step, (_, terms) in enumerate(ladder):
            complexity = len(terms) + search.price(response)
            candidates.append(Candidate(moment, moment, np.array(terms), base, complexity))
            names.append((response, step))
    reference = squared_errors(search.moments(AT_ONCE, AT_ONCE).heading, base)
    response, direction, chosen = _decide(search, candidates, names, ladder, reference, options)
    moment = search.moments(speed, response).heading
    one = Candidate(moment, moment, np.array(chosen, dtype=int), base, 0)
    direction, chosen = _by_gear(search, one, direction, chosen, 1, options)
    return search.late(response, 1), direction, chosen


def choose_along(
    search: Search, turn: AnyResponse, options: SelectionOptions
) -> tuple[AnyResponse, Direction, tuple[int, ...]]:
    """Response and terms of the forward speed, with the sideways speed free."""
    base, ladder, beside = search.base, search.ladders.along, search.aside(search.ladders.beside)
    candidates, names = [], []
    for response in search.candidates(0):
        moment = search.moments(response, turn)
        for step, (_, terms) in enumerate(ladder):
            complexity = len(terms) + search.price(response)
            columns = np.concatenate([terms, beside])
            both = moment.along + moment.across
            candidates.append(Candidate(both, moment.along, columns, base, complexity))
            names.append((response, step))
    reference = squared_errors(search.moments(AT_ONCE, turn).along, base)
    response, direction, chosen = _decide(search, candidates, names, ladder, reference, options)
    moment = search.moments(response, turn)
    columns = np.concatenate([chosen, beside]).astype(int)
    one = Candidate(moment.along + moment.across, moment.along, columns, base, 0)
    direction, chosen = _by_gear(search, one, direction, chosen, 0, options)
    return search.late(response, 0), direction, chosen


def choose_across(
    search: Search,
    speed: AnyResponse,
    turn: AnyResponse,
    along_terms: tuple[int, ...],
    options: SelectionOptions,
) -> tuple[Direction, tuple[int, ...]]:
    """Terms of the sideways speed."""
    moment = search.moments(speed, turn)
    both = moment.along + moment.across
    base, ladder = search.base, search.ladders.across
    candidates = []
    for _, terms in ladder:
        columns = np.concatenate([along_terms, search.aside(terms)]).astype(int)
        candidates.append(Candidate(both, moment.across, columns, base, len(terms)))
    without = solve_columns(both.sum(axis=0), np.array(along_terms, dtype=int), base)
    reference = squared_errors(moment.across, without)
    names = [(speed, step) for step in range(len(ladder))]
    _, direction, terms = _decide(search, candidates, names, ladder, reference, options)
    return direction, terms


def _decide(
    search: Search,
    candidates: list[Candidate],
    names: list[tuple[AnyResponse, int]],
    ladder: Ladder,
    reference: Array,
    options: SelectionOptions,
) -> tuple[AnyResponse, Direction, tuple[int, ...]]:
    """Take the chosen candidate if it beats the reference beyond chance, else the nominal robot."""
    blocks = len(reference)
    relative = not search.log.steered
    choice = cross_validate(candidates, assign_folds(blocks), reference, relative)
    critical = critical_score(blocks, options.significance)
    response, step = names[choice.best]
    if not choice.score > critical:
        return names[0][0], Direction(NOMINAL, choice.score, critical), ()
    name, terms = ladder[step]
    return response, Direction(name, choice.score, critical), terms


def _by_gear(
    search: Search,
    one: Candidate,
    direction: Direction,
    terms: tuple[int, ...],
    which: int,
    options: SelectionOptions,
) -> tuple[Direction, tuple[int, ...]]:
    """Add a gain for each way of driving to what was chosen, if that errs less beyond chance.

    It is looked for by itself: a candidate more in every choice would cost the others power.
    """
    gears = search.ladders.gears
    if gears is None or not search.both_ways:
        return direction, terms
    more = tuple(sorted({*terms, which, gears[which]}))
    both = replace(one, columns=np.union1d(one.columns, more))
    folds, relative = assign_folds(len(one.judged)), not search.log.steered
    reference = cross_validate([one], folds, squared_errors(one.judged, one.base), relative).errors
    score = cross_validate([both], folds, reference, relative).score
    critical = critical_score(len(folds), options.significance)
    return (Direction("gears", score, critical), more) if score > critical else (direction, terms)


def position_base(commands: int) -> Array:
    """Nominal rows of the position, side by side, (2 T,)."""
    rows = nominal_rows(commands)
    return np.concatenate([rows.along, rows.across])
