"""What contradicts the symmetry of space in a log, and what a user can mend.

Displacements are regressed on the motion, the same seen in a mirror, a drift of the world, the
motion without its sign and a creep of the robot; turns alike. What the log does not tell apart from
what comes before it is not reported at all: a robot that always drives at one speed shows no creep.
The blocks' jackknife tells how sure each is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kmpc_lite.learn.cross_validation import SelectionOptions
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.responses import Response
from kmpc_lite.learn.selection import cut_for
from kmpc_lite.learn.windows import Block, answered_commands, largest_speeds, window_sums
from kmpc_lite.types import INPUTS, Array

# thresholds above which a line is written: what is less does no harm
SURE = 4.0
"""Standard errors that make something sure."""
DRIFT = 0.02
"""Drift and creep, as a share of the largest speed."""
TURNING = 0.02
"""Creep of the heading, as a share of the largest turn rate."""
COMPASS = 0.1
"""Share by which the turn gain depends on the heading."""
OFFSET = 0.035
"""Angle between the heading and the direction of driving [rad]."""
SIDES = 0.1
"""Share by which the gains forward and back, or left and right, differ."""
APART = 0.05
"""Share of an explanation that those before it must leave: else the log cannot show it."""


@dataclass(frozen=True)
class Coefficient:
    """A complex number and its standard error."""

    value: complex
    error: float

    def sure(self, least: float) -> bool:
        """Whether it is both beyond chance and large enough to matter."""
        return abs(self.value) > max(least, SURE * self.error)


def diagnose(
    dataset: Dataset,
    speed: Response,
    turn: Response,
    gears: bool = False,
) -> list[str]:
    """What a user should know of a log's frames, one line each.

    Parameters
    ----------
    dataset : Dataset
        What was learned from.
    speed, turn : Response
        How late the robot answers.
    gears : bool
        Whether gains forward and back were learned.
    """
    windows = cut_for(dataset, SelectionOptions())
    if len(windows.blocks) < 4:
        return []
    kernels = [r.weights(dataset.dt, windows.longest) for r in (speed, turn)]
    position, heading = [], []
    for block in windows.blocks:
        answered = answered_commands(block, *kernels)
        if dataset.commands > INPUTS:  # ahead + i left
            answered = np.column_stack([answered[:, 0] + 1j * answered[:, 1], answered[:, 2]])
        position.append(_position_moments(block, answered, windows.length, dataset.dt))
        heading.append(_heading_moments(block, answered, windows.length, dataset.dt))
    v_max, *_, omega_max = largest_speeds(dataset)
    moved, turned = (_jackknife(np.array(m)) for m in (position, heading))
    return [*_tell_position(moved, v_max, gears), *_tell_heading(turned, omega_max)]


def _position_moments(block: Block, answered: Array, length: int, dt: float) -> Array:
    """Second moments of [Zv, Zw, conj Zv, t, Z|v|, Z0, d], complex (7, 7), in the world's frame."""
    columns = np.column_stack([answered, np.abs(answered[:, 0]), np.ones(len(answered))])
    z = window_sums(block.turned[:, None] * columns, block, length)
    moved = block.moved * np.conj(block.frame)
    time = np.full(len(z), length * dt)
    rows = np.column_stack([z[:, 0], z[:, 1], np.conj(z[:, 0]), time, z[:, 2:], moved])
    gram: Array = rows.conj().T @ rows
    return gram


def _heading_moments(block: Block, answered: Array, length: int, dt: float) -> Array:
    """Second moments of [w, v, |w|, t, w cos, w sin, turn], (7, 7)."""
    omega = answered[:, 1] * dt
    columns = np.column_stack(
        [
            omega,
            answered[:, 0] * dt,
            np.abs(omega),
            np.full(len(omega), dt),
            answered[:, 1] * block.turned.real,
            answered[:, 1] * block.turned.imag,
        ]
    ).real
    rows = np.column_stack([window_sums(columns, block, length), block.heading]).astype(complex)
    gram: Array = rows.conj().T @ rows
    return gram


def _jackknife(moments: Array) -> list[Coefficient]:
    """Least squares from blocks' moments (B, p + 1, p + 1), with standard errors.

    What cannot be told apart from what comes before it is zero, and not sure.
    """
    total = moments.sum(axis=0)
    shown = _told_apart(total[:-1, :-1])
    found = [Coefficient(0.0, float("inf"))] * (len(total) - 1)
    if not shown:
        return found
    count = len(moments)
    without = np.concatenate([total[None], total - moments])
    matrix, target = without[:, shown][:, :, shown], without[:, shown, -1]
    scale = np.sqrt(np.maximum(np.diagonal(matrix, axis1=1, axis2=2).real, 1e-300))
    scaled = matrix / (scale[:, :, None] * scale[:, None, :])
    scaled = scaled + 1e-9 * np.eye(scaled.shape[-1])
    weights = np.linalg.solve(scaled, (target / scale)[..., None])[..., 0] / scale
    spread = weights[1:] - weights[1:].mean(axis=0)
    errors = np.sqrt((count - 1) / count * np.sum(np.abs(spread) ** 2, axis=0))
    for k, weight, error in zip(shown, weights[0], errors, strict=True):
        found[k] = Coefficient(complex(weight), float(error))
    return found


def _told_apart(gram: Array) -> list[int]:
    """Columns of which those before them leave at least a share, by their moments (p, p)."""
    shown: list[int] = []
    for k, energy in enumerate(np.diagonal(gram).real):
        left = energy
        if shown:
            cross = gram[shown, k]
            left -= np.vdot(cross, np.linalg.solve(gram[np.ix_(shown, shown)], cross)).real
        if left > APART * energy:
            shown.append(k)
    return shown


def _tell_position(found: list[Coefficient], v_max: float, gears: bool) -> list[str]:
    """Lines about the frame of the positions."""
    motion, _, mirror, drift, unsigned, creep = found
    if mirror.sure(abs(motion.value)):
        return ["the robot moves as if seen in a mirror: check the signs of x, y and theta"]
    told = []
    angle = float(np.angle(motion.value))
    if abs(angle) > 0.5 * np.pi:
        told.append("v > 0 drives backwards: theta is off by half a turn, or v has the other sign")
    elif abs(angle) > max(OFFSET, SURE * motion.error / max(abs(motion.value), 1e-12)):
        told.append(
            f"the robot drives {np.degrees(angle):+.1f} degrees off its heading theta "
            "(learned, and no harm; the sensor's mount can be mended)"
        )
    if unsigned.sure(0.5 * SIDES * abs(motion.value)) and not gears:
        told.append(
            f"the robot drives forward at {abs(motion.value + unsigned.value):.2f} of its command, "
            f"and reverses at {abs(motion.value - unsigned.value):.2f}: the model has one gain"
        )
    if drift.sure(DRIFT * v_max):
        told.append(
            f"the robot drifts by {abs(drift.value):.2g} m/s towards "
            f"{np.angle(drift.value):+.1f} rad whichever way it faces: a slope, or a frame that "
            "moves; this is not learned"
        )
    if creep.sure(DRIFT * v_max):
        told.append(
            f"the log shows {abs(creep.value):.2g} m/s at zero command, "
            f"{np.angle(creep.value):+.1f} rad off the heading; the model stands still there"
        )
    return told


def _tell_heading(found: list[Coefficient], omega_max: float) -> list[str]:
    """Lines about the heading."""
    gain, _, unsigned, creep, cos, sin = found
    told = []
    if gain.value.real < -SURE * gain.error:
        told.append("omega > 0 turns right: omega or theta has the other sign")
    if unsigned.sure(0.5 * SIDES * abs(gain.value)):
        left, right = (gain.value + sign * unsigned.value for sign in (1, -1))
        told.append(
            f"the robot turns left at {left.real:.2f} of its command, and right at "
            f"{right.real:.2f}: the model has one gain"
        )
    if creep.sure(TURNING * omega_max):
        told.append(
            f"the log turns by {creep.value.real:.2g} rad/s at zero command; the model stands still"
        )
    size = float(np.hypot(cos.value.real, sin.value.real))
    error = float(np.hypot(cos.error, sin.error))
    if size > max(COMPASS * abs(gain.value), SURE * error):
        where = np.arctan2(sin.value.real, cos.value.real)
        told.append(
            f"turns come out {100 * size / abs(gain.value):.0f} % larger where theta is "
            f"{where:+.1f} rad: a compass that errs with the heading; this is not learned"
        )
    return told
