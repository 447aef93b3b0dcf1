"""Margins of a plan: how far a robot spreads around it, from its speed, and between its samples.

Each stage feels the noise of the periods before, carried on by the model's Jacobians: without
feedback for as long as commands take to act, then under the feedback that later steps give, which
has forgotten what is older than `MEMORY` more periods (`kmpc_lite.model.tube`, shared with
calibration). White noise of each period is a column of its own; what is alike in all periods is one
column, to which each of them adds. Sizes: N stages, at most 50; m commands; K columns.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kmpc_lite.model.tube import MEMORY, closed_loop, rotations
from kmpc_lite.types import STATES, Array

DOUBLINGS = MEMORY.bit_length() - 1


class Noise(NamedTuple):
    """What the margins of a plan follow from."""

    white: Array
    """(3, 3 m) factors of the covariances of a period's noise, by each command, side by side."""
    lasting: Array
    """The same of errors that are alike in all periods; (3, 0) without any."""
    pose: Array
    """(3, 3) factor of a measured pose's noise."""
    pose_by_speed: Array
    """(3, 3), the same by speed; (3, 0) without any."""
    delay: int
    """Periods until the feedback acts."""
    quantile: float
    """How many standard deviations are kept."""
    headway_time: float
    """Time of driving on at a speed that is the least margin [s]."""
    touch: float
    """Radius at which chords cut [m]."""
    reach: float
    """How far the outline lies from the pose [m]."""
    solver_margin: float
    """Added to all [m]."""
    spreads: bool
    """Whether there is any noise in a plan."""


def tube_margins(
    noise: Noise, by_x: Array, states: Array, inputs: Array, normals: Array, path_clearance: Array
) -> Array:
    """Margins (N, K) of stages 1 to N [m].

    `noise`: what is not known. `by_x`, `states`, `inputs`: the model's derivatives by the state (N,
    3, 3) at the plan: (N + 1, 3) and (N, m). `normals`: (N, K, 2) unit vectors away from obstacles;
    (N, K, 3) with the slope by the heading. `path_clearance`: (N,) what the path keeps [m]: headway
    is no more.
    """
    chords = chord_margins(states, noise.touch, noise.reach) + noise.solver_margin
    headway = np.minimum(noise.headway_time * np.abs(inputs[:, 0]), path_clearance)[:, None]
    if noise.spreads:
        across = normals @ factors(noise, by_x, states, inputs)[:, : normals.shape[2]]
        kept = noise.quantile * np.sqrt(np.einsum("nsc,nsc->ns", across, across))
        headway = np.maximum(kept, headway)
    out: Array = np.broadcast_to(headway + chords[:, None], normals.shape[:2]).copy()
    return out


def factors(noise: Noise, by_x: Array, states: Array, inputs: Array) -> Array:
    """Factors F (N, 3, C) of the covariances ``F F'`` of the pose: never indefinite."""
    headings = states[:-1, 2]
    cos, sin = np.cos(headings), np.sin(headings)
    turned, jacobians = rotations(cos, sin), closed_loop(by_x, cos, sin)
    by_command = inputs.repeat(STATES, axis=1)[:, None]
    parts = [turned @ noise.pose]
    if noise.pose_by_speed.size:
        parts.append(turned @ (noise.pose_by_speed * inputs[:, :1, None]))
    fresh, white = _carried_on(by_x, turned @ (noise.white * by_command), noise.delay)
    parts += fresh
    lasting: Array | None = None
    if noise.lasting.size:
        young, lasting = _carried_on(by_x, turned @ (noise.lasting * by_command), noise.delay)
    # doubling: beside what m periods have spread, what the m periods before them did, moved on
    for level in range(DOUBLINGS):
        span = 1 << level
        if span >= len(by_x):
            break
        older = np.zeros_like(white)
        np.matmul(jacobians[span:], white[:-span], out=older[span:])
        white = np.concatenate([white, older], axis=2)
        if lasting is not None:
            lasting[span:] += jacobians[span:] @ lasting[:-span]
        if level + 1 < DOUBLINGS:
            longer = jacobians.copy()
            np.matmul(jacobians[span:], jacobians[:-span], out=longer[span:])
            jacobians = longer
    parts.append(white)
    if lasting is not None:
        parts.append(sum(young, lasting))
    out: Array = np.concatenate(parts, axis=2)
    return out


def _carried_on(by_x: Array, columns: Array, periods: int) -> tuple[list[Array], Array]:
    """Columns (N, 3, c) of each period after 0, 1, ... periods without feedback, and thereafter."""
    young = []
    for _ in range(periods):
        young.append(columns)
        moved = np.zeros_like(columns)
        np.matmul(by_x[1:], columns[:-1], out=moved[1:])
        columns = moved
    return young, columns


def chord_margins(states: Array, touch: float, reach: float = 0.0) -> Array:
    """How much nearer than its samples (N + 1, 3) a path comes between them, (N,) [m].

    A chord of length L whose ends keep a distance D from a centre comes as near as ``sqrt(D^2 -
    L^2 / 4)``, and an arc that turns by phi bulges beyond its chord by ``L phi / 8``: with ``D =
    sqrt((R + bulge)^2 + L^2 / 4)`` the path stays outside the radius R of `touch`, the smallest
    that an obstacle has.
    """
    steps = np.abs(states[1:] - states[:-1])
    lengths = np.hypot(steps[:, 0], steps[:, 1]) + reach * steps[:, 2]
    bulges, squares = lengths * steps[:, 2] / 8, lengths * lengths / 4
    # a sample ends one chord and begins the next
    bulges[:-1] = np.maximum(bulges[:-1], bulges[1:])
    squares[:-1] = np.maximum(squares[:-1], squares[1:])
    out: Array = np.sqrt((touch + bulges) ** 2 + squares) - touch
    return out
