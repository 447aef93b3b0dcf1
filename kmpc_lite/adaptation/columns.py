"""Columns of what online adaptation keeps: 20 numbers of a step, and 12 sums over steps.

The sums are, with the weight a: p.p, p.d, p x d, d.d; with the weight b: h h, h g, g g, h turned,
g turned, turned turned; and how many steps had a weight a, and b. `Regressor.row` and
`reweighed_sums` make them in this order, `estimate` reads them.
"""

from __future__ import annotations

MOTION_SIZE = 7
"""Numbers of a motion: the displacement p = (px, py) that the model gives [m], in the map's frame,
and the measured one d = (dx, dy); the turn h that the model gives [rad], the way ahead g [m], and
the measured turn."""
MOTION = slice(0, MOTION_SIZE)
"""The motion, whitened: what the noise of a pose shares with the steps before is taken back."""
WEIGHTS = slice(7, 9)
"""The weights a of the position and b of the turn."""
HEADING = slice(9, 11)
"""cos and sin of the heading before the step."""
SPEEDS = slice(11, 13)
"""v^2 and omega^2 of the command."""
AS_MEASURED = slice(13, 13 + MOTION_SIZE)
"""The motion once more, as it was measured."""
STEP_SIZE = AS_MEASURED.stop
"""Numbers that are kept of a step."""
SUMS = 12
"""Sums over steps."""
