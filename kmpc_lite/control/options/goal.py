"""When the robot has arrived, and when it has left its goal again."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.option_fields import angle, check, count, radii, seconds, share


@dataclass(frozen=True, slots=True)
class GoalOptions:
    """Tolerances of the goal checker for a pose with little noise, and how noise widens them.

    Each option that ends in `_noise` widens the tolerance before it where poses are noisy: by this
    many times the amount by which the measured pose's standard deviation exceeds the quiet one.
    Chance hardly ever carries a single pose farther than 3 to 5 standard deviations; those of the
    averaged pose are a third as large, or less.
    """

    turn_distance: float = radii(0.08)
    """Distance from the goal at which the last turn on the spot may begin [radii]."""
    turn_distance_noise: float = share(1.0)
    """How much noise widens `turn_distance` [standard deviations]."""
    turn_limit: float = radii(0.1)
    """A robot that is farther from its goal than this during the last turn gives that turn up, and
    drives to its goal again [radii]."""
    turn_limit_noise: float = share(3.5)
    """How much noise widens `turn_limit` [standard deviations]."""
    enter_distance: float = radii(0.09)
    """A robot that is nearer to its goal than this [radii] ..."""
    enter_angle: float = angle(0.025)
    """... with a smaller error of its heading than this [rad] has arrived."""
    enter_noise: float = share(1.0)
    """How much noise widens `enter_distance` and `enter_angle` [standard deviations]."""
    leave_distance: float = radii(0.1)
    """A robot that had arrived drives again when its averaged pose is farther from the goal than
    this [radii] ..."""
    leave_distance_noise: float = share(2.5)
    """How much noise widens `leave_distance` [standard deviations]."""
    leave_angle: float = angle(0.05)
    """... or when the averaged heading is wrong by more than this [rad] ..."""
    leave_angle_noise: float = share(1.5)
    """How much noise widens `leave_angle` [standard deviations]."""
    pushed_distance: float = radii(0.05 / 0.15)
    """... or when one single pose is farther away than this: somebody pushed it [radii] ..."""
    pushed_distance_noise: float = share(4.0)
    """How much noise widens `pushed_distance` [standard deviations]."""
    pushed_angle: float = angle(0.15)
    """... or when one single heading is wrong by more than this [rad]."""
    pushed_angle_noise: float = share(4.5)
    """How much noise widens `pushed_angle` [standard deviations]."""
    content_stalls: int = count(4)
    """A robot that has stalled so often, one stall after the other, is content with twice these
    tolerances, and with once more of them after each further stall: what cannot be reached more
    closely is held where it is."""
    content_most: int = count(5)
    """How many times the tolerances it is content with at the most."""
    off_path: float = radii(0.01 / 0.15)
    """A robot near its goal looks for a new path when it is farther from its path than this
    [radii]."""
    off_path_noise: float = share(3.0)
    """How much noise widens `off_path` [standard deviations]."""
    quiet_position: float = radii(0.006 / 0.15)
    """A standard deviation of measured positions up to this widens nothing [radii]."""
    quiet_heading: float = angle(0.024)
    """A standard deviation of measured headings up to this widens nothing [rad]."""
    averaging_time: float = seconds(0.5, zero=False)
    """Memory of the averaged pose [s]: a robot at rest averages its noise away."""
    averaging_period: float = seconds(0.1, zero=False)
    """Period up to which poses are averaged by that time [s]. A longer one counts as this, so that
    five poses count at the least, whatever time they took: how much noise is left hangs on how many
    they are."""

    def __post_init__(self) -> None:
        check(self)
