"""Options of the margins: how far plans and commands stay away for what a model does not know."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.control.options.fields import angle, check, count, part, probability, radii, share


@dataclass(frozen=True, slots=True)
class MarginOptions:
    """How wide margins are, and how fast they follow errors that the model did not expect."""

    risk: float = probability(0.05)
    """Probability of leaving the tube around a plan within its memory (0.8 s at dt = 0.1) that
    margins are made for. A collision is far rarer: the robot would have to leave the tube towards
    an obstacle that the plan touches, and no later step could correct it."""
    solver_margin: float = radii(1 / 30)
    """Added to every margin [radii]: what a QP that is stopped at its tolerance, and linearised
    once, may leave of a half-plane."""
    headway: float = radii(0.4)
    """Least margin at the fastest speed [radii], in proportion less below it, and never more than
    the clearance of the path: a floor may begin to slip at any time, and a slip of 0.2 pushes a
    robot aside by half of what it drives in a period."""
    side_margin: float = radii(1 / 15)
    """Margin from the sides of the area [radii]: nothing is hit there, the robot must only not
    creep out."""
    far_clearance: float = radii(2 / 3)
    """Beyond the widest margin by this much [radii] the margins of a plan are not worked out: the
    widest ones do as well."""

    step_risk: float = probability(1e-3)
    """Probability that the error of a single command exceeds what the command check allows for."""
    adapted_step_risk: float = probability(1e-4)
    """The same with a model that was corrected while driving, which knows its floor from a few
    seconds."""
    step_quantile_limit: float = share(2.0, zero=False)
    """Largest quantile of a single command, in quantiles of the plan: exponential slip asks for
    1.9; a log whose pose jumps would ask for nonsense."""
    adapted_step_quantile_limit: float = share(3.0, zero=False)
    """The same with a model that was corrected while driving: exponential slip asks for 2.6."""
    unknown_floor_inflation: float = share(3.0, zero=False)
    """Inflation of the noise beyond which the floor counts as unknown."""
    unknown_floor_slip: float = share(0.35)
    """Standard deviation of a command's error on an unknown floor, as a share of what it drives: a
    slip of 0.2 pushes farther than five times that once in ten thousand periods."""
    check_margin: float = radii(1 / 150)
    """What the command check keeps for reckoning along straight lines [radii]."""
    check_corrections: int = count(3)
    """How often the command check shortens a command and looks again."""
    check_far_periods: float = share(3.0, zero=False)
    """What a command drives in this many periods is far: no robot drives three times as fast as it
    is told."""
    retreat_share: float = part(0.25)
    """Share of a command that is always allowed straight away from an obstacle: a robot that
    touches must get free."""

    innovation_attack: float = part(0.2)
    """Weight of a new error that is larger than before, per period: ten times the slip widens the
    margins 4-fold after one period and 8-fold after five."""
    innovation_release: float = part(0.1)
    """Weight of a new error that is smaller than before, per period: on a calm floor the margins
    are narrow again within two seconds."""
    innovation_calm: float = share(2.5, zero=False)
    """Mean squared error, against the expected one, that widens nothing: heavy-tailed slip exceeds
    it in one period of ten."""
    largest_innovation: float = share(400.0, zero=False)
    """Largest squared error, against the expected one, that counts: beyond it the measurement is
    broken."""
    judged_step: float = radii(1 / 30)
    """Shortest distance of a period whose error is judged [radii]."""
    step_tolerance: float = radii(1 / 150, zero=False)
    """Error of a period that even a model without noise may make [radii]."""
    step_tolerance_share: float = share(0.02)
    """The same as a share of the distance driven."""
    turn_tolerance: float = angle(5e-3, zero=False)
    """Error of the heading that even a model without noise may make in a period [rad]."""
    turn_tolerance_share: float = share(0.05)
    """The same as a share of the turn."""
    usual_speed: float = share(2 / 3, zero=False)
    """Speed, as a share of the fastest, at which errors that were too large are taken to have been
    made, where only their size is known."""
    drift_threshold: float = share(6.0, zero=False)
    """Squared sum of recent errors, against the expected one, beyond which the floor counts as
    unknown: where poses are noisy no single error tells much, but a floor pushes to one side again
    and again."""
    drift_fading: float = part(0.8)
    """What the sum of recent errors keeps of itself per period."""

    def __post_init__(self) -> None:
        check(self)
