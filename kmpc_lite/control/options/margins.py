"""Options of the margins: how far plans and commands stay away for what a model does not know."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.option_fields import angle, check, part, probability, radii, seconds, share


@dataclass(frozen=True, slots=True)
class MarginOptions:
    """How wide margins are, and how fast they follow errors that the model did not expect."""

    risk: float = probability(0.05)
    """Probability of leaving the tube around a plan within its memory (8 periods) that margins are
    made for. A collision is far rarer: the robot would have to leave the tube towards an obstacle
    that the plan touches, and no later step could correct it."""
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
    """Margins are worked out for obstacles within the widest margin and this much more [radii]; for
    those farther away the widest margin is used."""

    step_risk: float = probability(1e-3)
    """Probability that the error of a single command exceeds what its margin allows for."""
    adapted_step_risk: float = probability(1e-4)
    """The same with a model that was corrected while driving: it knows its floor from a few seconds
    only."""
    step_quantile_limit: float = share(2.0, zero=False)
    """The margin of a single command, in standard deviations, is at most this many times that of a
    plan: slip with exponential tails needs 1.9 times as many; a log whose pose jumps would ask for
    nonsense."""
    adapted_step_quantile_limit: float = share(3.0, zero=False)
    """The same with a model that was corrected while driving: slip with exponential tails needs 2.6
    times as many."""
    unknown_floor_inflation: float = share(3.0, zero=False)
    """The floor counts as unknown where errors are more than this many times as large as the model
    expects."""
    unknown_floor_slip: float = share(0.35)
    """Standard deviation of a command's error on an unknown floor, as a share of what it drives: a
    slip of 0.2 pushes farther than five times that once in ten thousand periods."""

    innovation_attack_time: float = seconds(0.5, zero=False)
    """Memory of the running mean of errors where the newest is larger [s]: ten times the slip
    widens the margins 4-fold after 0.1 s and 8-fold after 0.5 s."""
    innovation_release_time: float = seconds(1.0, zero=False)
    """Memory of that mean where the newest error is smaller [s]: on a calm floor the margins are
    narrow again within 2 s."""
    fading_period: float = seconds(0.1, zero=False)
    """Period up to which errors fade by these times [s]. A longer one counts as this, so that five
    errors count at the least, and ten where they become smaller, whatever time they took: how
    surely chance is told from a floor hangs on how many they are."""
    innovation_calm: float = share(2.5, zero=False)
    """Running mean of squared errors, as a multiple of the expected one, up to which margins stay
    as they are: slip with heavy tails exceeds it in one period of ten."""
    largest_innovation: float = share(400.0, zero=False)
    """Largest squared error that counts, as a multiple of the expected one: a larger one is a
    broken measurement."""
    judged_step: float = radii(1 / 30)
    """Errors are judged only of periods that drive at least this far [radii]."""
    step_tolerance: float = radii(1 / 150, zero=False)
    """Error of the position in one period that is always expected, even of a model without noise
    [radii]."""
    step_tolerance_share: float = share(0.02)
    """The same as a share of the distance driven."""
    turn_tolerance: float = angle(5e-3, zero=False)
    """Error of the heading in one period that is always expected, even of a model without noise
    [rad]."""
    turn_tolerance_share: float = share(0.05)
    """The same as a share of the turn."""
    usual_speed: float = share(2 / 3, zero=False)
    """Where only the size of errors is known, they are taken to have been made at this speed, as a
    share of the fastest."""
    drift_threshold: float = share(6.0, zero=False)
    """Squared sum of recent errors, as a multiple of the expected one, beyond which the floor
    counts as unknown: where poses are noisy, a single error tells little, but a floor that pushes
    to one side does so again and again."""
    drift_fading: float = part(0.8)
    """Factor by which the sum of recent errors fades per period, however long that is: five count.
    What a model does not know of its robot's lag is as lasting as what a floor does, and the more
    errors add up, the smaller is what counts as one: over half a second of short periods, robots
    that lag took their own floor for an unknown one."""

    def __post_init__(self) -> None:
        check(self)
