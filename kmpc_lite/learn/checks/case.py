"""The input of all checks: a log, and the reading of theta (sign, unit) that fits its motion."""

from __future__ import annotations

from math import degrees, log10
from typing import NamedTuple

import numpy as np

from kmpc_lite.learn.checks.evidence import Evidence, Explained, heading_offset, headings
from kmpc_lite.learn.logs import Log

BETTER = 0.6
"""A reading of theta that explains less than this share of what another explains is wrong."""
FITS = 0.3
"""Share that the better reading has to explain."""
OFFSET = 25.0
"""Angle between motion and heading above which it is reported [degrees]."""
NOISE = 3.0
"""An expected motion is seen where a tenth of it is this many times its measurement's noise."""


class Case(NamedTuple):
    """A log, its motion, and the reading of theta that fits best."""

    log: Log
    evidence: Evidence
    moves: Explained
    """Displacements under the best reading of theta."""
    turns: Explained
    """Turns under that reading."""
    sign: int
    """Of theta, that fits."""
    degrees: bool
    """Whether theta fits as degrees."""

    @property
    def reading(self) -> tuple[int, bool]:
        """How theta fits."""
        return self.sign, self.degrees


def make_case(log: Log, evidence: Evidence) -> Case:
    """Choose the reading of theta that fits: the given one, unless another is far better."""
    moves, turns = evidence.moves, evidence.turns
    given, best = moves[1, False], moves[evidence.best]
    sign, as_degrees = 1, False
    if best.sure and best.share > FITS and given.share < BETTER * best.share:
        sign, as_degrees = evidence.best
        other = moves[sign, not as_degrees]
        if as_degrees and other.share >= BETTER * best.share:
            as_degrees = False
    wrong_turn = turns[False].share < BETTER * turns[True].share
    if turns[True].sure and turns[True].share > FITS and wrong_turn:
        as_degrees = True
    elif turns[False].sure and 1.15 < power_of(turns[False]) < 2.4 and not best.sure:
        as_degrees = True
    return Case(log, evidence, moves[sign, as_degrees], turns[as_degrees], sign, as_degrees)


def power_of(explained: Explained) -> float:
    """Power of ten of a factor."""
    return log10(max(abs(explained.factor), 1e-30))


def percent(explained: Explained) -> str:
    """A share in words."""
    return f"{100.0 * max(explained.share, 0.0):.0f} %"


def is_seen(case: Case, channel: int, length: int = 32) -> bool:
    """Whether a tenth of what is asked in a channel would be seen above the poses' noise."""
    motion = case.evidence.motion
    asked = motion.asked[:, channel]
    moved = motion.position if channel == 0 else headings(motion, case.degrees)
    if len(asked) < 4 * length:
        return False
    expected = 0.1 * np.sqrt(np.mean((asked[length:] - asked[:-length]) ** 2))
    bends = moved[2:] - 2.0 * moved[1:-1] + moved[:-2]
    middle = 2.88 if np.iscomplexobj(bends) else 1.65  # of a bend, times sqrt(6) of a pose's noise
    noise = np.median(np.abs(bends)) / middle
    return bool(expected > NOISE * noise)


def varies(case: Case, channel: int) -> bool:
    """Whether a command is given for a good part of the log, and is not always the same."""
    values = np.abs(case.log.commands.values[:, channel])
    largest = values.max()
    return bool((values > 0.1 * largest).mean() > 0.1 and values.std() > 0.05 * largest)


def positions_mirrored(case: Case) -> bool:
    """Whether theta turns as told, so that x and y are what is mirrored."""
    return case.turns.sure and case.turns.factor.real > 0.0


def theta_unit(case: Case) -> str:
    """What --units theta= is to be."""
    offset, _ = heading_offset(case.evidence, case.reading) if case.moves.sure else (0.0, 0.0)
    turned = case.sign < 0 and not positions_mirrored(case)
    unit = ("-" if turned else "") + ("deg" if case.degrees else "rad")
    if abs(degrees(offset)) < OFFSET or not turned and case.sign < 0:
        return unit
    near = 90.0 * round(degrees(offset) / 90.0)
    angle = near if abs(degrees(offset) - near) < 20.0 else degrees(offset)
    return unit + (f"{angle:+.0f}" if case.degrees else f"{np.radians(angle):+.4f}")
