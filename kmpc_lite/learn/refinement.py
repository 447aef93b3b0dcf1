"""Responses near the chosen ones by which the chosen rows err least."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kmpc_lite.learn.cross_validation import SelectionOptions, solve_columns
from kmpc_lite.learn.directions import AnyResponse, Search
from kmpc_lite.learn.responses import AT_ONCE, Response, neighbours
from kmpc_lite.learn.windows import squared_errors


def _refine(
    start: AnyResponse,
    error: Callable[[AnyResponse], float],
    search: Search,
    options: SelectionOptions,
) -> AnyResponse:
    """Walk a response other than `AT_ONCE` downhill in ever shorter steps; not one of ages."""
    if start == AT_ONCE or not isinstance(start, Response):
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


def refine_heading(
    search: Search,
    speed: AnyResponse,
    turn: AnyResponse,
    terms: tuple[int, ...],
    options: SelectionOptions,
) -> AnyResponse:
    """Response near one of the turn rate by which the best rows err least."""

    def error(response: AnyResponse) -> float:
        total = search.moments(speed, response).heading.sum(axis=0)
        weights = solve_columns(total, np.array(terms, dtype=int), search.turn_base)
        return float(squared_errors(total[None], weights)[0])

    return _refine(turn, error, search, options)


def refine_along(
    search: Search,
    speed: AnyResponse,
    turn: AnyResponse,
    terms: tuple[int, ...],
    options: SelectionOptions,
) -> AnyResponse:
    """Response near one of the forward speed by which the best rows err least."""
    columns = np.concatenate([terms, search.aside(search.ladders.beside)]).astype(int)

    def error(response: AnyResponse) -> float:
        moment = search.moments(response, turn)
        weights = solve_columns((moment.along + moment.across).sum(axis=0), columns, search.base)
        return float(squared_errors(moment.along.sum(axis=0)[None], weights)[0])

    return _refine(speed, error, search, options)
