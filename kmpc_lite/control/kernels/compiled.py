"""The kernels in C: the same functions as in the modules of NumPy, which describe them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

import kmpc_lite.control.kernels._kernels as c
from kmpc_lite.control.kernels.compiled_scan import dense as _dense
from kmpc_lite.control.kernels.fill import Around, Iterate, Numbers, PlanMargins
from kmpc_lite.control.kernels.following import Timed
from kmpc_lite.control.kernels.half_planes import KeepOut
from kmpc_lite.control.kernels.tube import Noise
from kmpc_lite.model.linearization import Linearization
from kmpc_lite.model.symmetric import SymmetricForm
from kmpc_lite.types import STATES, Array

LARGEST_HORIZON = 50
"""Stages whose tube has room in C."""
NOTHING = np.empty(0)
NO_NOISE = Noise(NOTHING, NOTHING, NOTHING, NOTHING, 0, 0.0, 0.0, 0.0, 0.0, 0.0, False)


def distances_of_motions(things: Array, points: Array, times: Array) -> Array:
    """As `clearance.distances_of_motions`."""
    motions, sampled, places, _ = points.shape
    out = np.empty((motions, len(times), places, len(things)))
    c.distances(_dense(things), _dense(points), _dense(times), out, motions, sampled, places)
    return out


def box_distances(low: Array, high: Array, points: Array) -> Array:
    """As `boxes.box_distances`."""
    out = np.empty(len(points))
    c.box_distances(*map(_dense, (low, high, points)), out)
    return out


def nearest_boxes(
    low: Array, high: Array, points: Array, behind: float, columns: int
) -> tuple[Array, Array, Array]:
    """As `boxes.nearest_boxes`."""
    shape, room = (len(points), columns), np.empty((len(low), 4))
    found = np.empty(shape, dtype=np.int_), np.empty(shape), np.empty((*shape, 2))
    c.nearest_boxes(*map(_dense, (low, high, points)), room, *found, behind, columns)
    return found


def fill(
    keep: KeepOut,
    margins: PlanMargins | None,
    numbers: Numbers,
    lin: Linearization,
    plan: Iterate,
    around: Around,
) -> None:
    """As `fill.fill`."""
    stages, places = len(plan.inputs), len(around.points) // len(plan.inputs)
    if margins is not None and stages > LARGEST_HORIZON:
        from kmpc_lite.control.kernels import fill as numpy

        numpy.fill(keep, margins, numbers, lin, plan, around)
        return
    kinds = around.gaps.size // stages + places * len(around.things) + len(keep.side_offsets) + 1
    per_stage = kinds * (2 + keep.directions) + keep.slots * (1 + keep.directions)
    *noise, delay, quantile, headway, touch, reach, solver_margin, spreads = (
        NO_NOISE if margins is None else margins.noise
    )
    widest, far, side, path = (0.0, 0.0, 0.0, NOTHING) if margins is None else margins[1:]
    *arrays, scale, open_bound = numbers
    c.fill(
        *map(_dense, (*lin, *plan[:3], *around)),
        keep.side_normals,
        keep.side_offsets,
        *arrays,
        np.empty(stages * per_stage + 3 * (stages + 1)),
        _dense(plan.speeds),
        path,
        *noise,
        stages,
        lin.B_past.shape[1],
        keep.slots,
        keep.directions,
        places,
        scale,
        open_bound,
        keep.distance,
        keep.dt,
        keep.range,
        margins is not None,
        delay,
        spreads,
        quantile,
        headway,
        touch,
        reach,
        solver_margin,
        widest,
        far,
        side,
    )


def stop_errors(
    distances: Array, turns: Array, dt: float, position: Array, heading: Array, *numbers: float
) -> Array:
    """As `stop_errors.stop_errors`."""
    out = np.empty(distances.shape)
    dense = map(_dense, (distances, turns, position, heading))
    c.stop_errors(*dense, out, distances.shape[-1], dt, *numbers)
    return out


def samples(states: Array, count: int) -> Array:
    """As `safe_motion.samples`."""
    motions, poses, _ = states.shape
    out = np.empty((motions, (poses - 1) * count, STATES))
    c.samples(_dense(states), out, motions, count)
    return out


def between_samples(
    clearance: Array, standing: Array, places: Array, begin: Array, radius: float
) -> Array:
    """As `safe_motion.between_samples`."""
    out = np.empty(clearance.shape)
    dense = map(_dense, (clearance, standing, places, begin))
    c.between_samples(*dense, out, len(places), radius)
    return out


def surely_clear(
    clearance: Array, margins: Array, error: Array, travel: Array, ends: Array, lost: float
) -> Array:
    """As `safe_motion.surely_clear`."""
    out = np.empty(len(error), dtype=np.bool_)
    dense = map(_dense, (clearance, margins, error, travel))
    c.surely_clear(*dense, np.ascontiguousarray(ends, dtype=np.intc), out, lost)
    return out


def admissible(
    clearance: Array,
    standing: Array,
    spend: Array,
    margins: Array,
    driven: Array,
    error: Array,
    turns: Array,
    strict: Array,
    ends: Array,
    first: int,
    unsure: float,
) -> Array:
    """As `safe_motion.admissible`."""
    out = np.empty(len(clearance), dtype=np.bool_)
    dense = map(_dense, (clearance, standing, spend, margins, driven, error))
    which = np.ascontiguousarray(turns), np.ascontiguousarray(strict)
    c.admissible(*dense, *which, np.ascontiguousarray(ends, dtype=np.intc), out, first, unsure)
    return out


def locate(path: Timed, pose: Array, place: float, least: float) -> tuple[float, float]:
    """As `following.locate`."""
    found = np.empty(2)
    c.locate(*path[:3], _dense(pose), found, path.step, place, least)
    return found.item(0), found.item(1)


def along_path(
    path: Timed, later: Array, place: float, leg: float, heading: float, turning: bool
) -> Array:
    """As `following.along_path`."""
    states = np.empty((len(later), STATES))
    c.along_path(*path[:3], _dense(later), states, path.braking, place, leg, heading, turning)
    return states


@dataclass(frozen=True, eq=False)
class CompiledForm(SymmetricForm):
    """As `SymmetricForm`, the reference of its kernels."""

    @cached_property
    def _arrays(self) -> tuple[Array, Array]:
        """What the kernels take of it."""
        return _dense(self.motion), _dense(np.array(self.nodes))

    def advance(self, x: Array, w: Array) -> Array:
        """Next states (..., 3) for bilinear inputs (..., nw)."""
        if x.shape[:-1] != w.shape[:-1]:
            return super().advance(x, w)
        out = np.empty(x.shape)
        c.advance(*self._arrays, _dense(x), _dense(w), out)
        return out

    def rollout(self, x0: Array, w: Array) -> Array:
        """States (..., T + 1, 3) from a first one (..., 3), for inputs (..., T, nw)."""
        *motions, periods, _ = w.shape
        out = np.empty((*motions, periods + 1, STATES))
        begins = np.empty((*motions, STATES))
        begins[...] = x0
        c.rollout(*self._arrays, begins, _dense(w), out)
        return out

    def linearize(self, x: Array, w: Array) -> tuple[Array, Array, Array]:
        """Next states (..., 3), their derivatives by x, (..., 3, 3), and by w, (..., 3, nw)."""
        lead = w.shape[:-1]
        value, by_x = np.empty((*lead, STATES)), np.empty((*lead, STATES, STATES))
        by_w = np.empty((*lead, STATES, w.shape[-1]))
        c.linearize(*self._arrays, _dense(x), _dense(w), value, by_x, by_w)
        return value, by_x, by_w


def closed_form(form: SymmetricForm) -> SymmetricForm:
    """The same motion, in C."""
    return CompiledForm(form.motion, form.nodes)
