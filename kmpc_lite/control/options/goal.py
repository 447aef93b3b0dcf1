"""When the robot has arrived, and when it has left its goal again."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.control.options.fields import angle, check, radii, share


@dataclass(frozen=True, slots=True)
class GoalOptions:
    """Tolerances of the goal checker for a pose with little noise, and how noise widens them.

    A tolerance that ends in `_noise` counts standard deviations of the measured pose above the
    quiet ones: chance alone hardly carries single poses past 3 to 5 of them, and the averaged pose,
    whose own deviation is a third, past as many of its own.
    """

    turn_distance: float = radii(0.08)
    """Distance from the goal at which the last turn on the spot may begin [radii]."""
    turn_distance_noise: float = share(1.0)
    """What noise adds to it [standard deviations]."""
    turn_limit: float = radii(0.1)
    """Distance at which a last turn is given up: the robot drives to its goal again [radii]."""
    turn_limit_noise: float = share(3.5)
    """What noise adds to it [standard deviations]."""
    enter_distance: float = radii(0.09)
    """Distance at which the robot has arrived [radii]."""
    enter_angle: float = angle(0.025)
    """Error of the heading at which the robot has arrived [rad]."""
    enter_noise: float = share(1.0)
    """What noise adds to both [standard deviations]."""
    leave_distance: float = radii(0.1)
    """Distance of the averaged pose at which a robot that had arrived drives again [radii]."""
    leave_distance_noise: float = share(2.5)
    """What noise adds to it [standard deviations]."""
    leave_angle: float = angle(0.05)
    """Error of the averaged heading at which it drives again [rad]."""
    leave_angle_noise: float = share(1.5)
    """What noise adds to it [standard deviations]."""
    pushed_distance: float = radii(0.05 / 0.15)
    """Distance of one single pose at which it drives again: somebody pushed it [radii]."""
    pushed_distance_noise: float = share(4.0)
    """What noise adds to it [standard deviations]."""
    pushed_angle: float = angle(0.15)
    """Error of one single heading at which it drives again [rad]."""
    pushed_angle_noise: float = share(4.5)
    """What noise adds to it [standard deviations]."""
    off_path: float = radii(0.01 / 0.15)
    """Distance from its path at which a robot near its goal looks for a new one [radii]."""
    off_path_noise: float = share(3.0)
    """What noise adds to it [standard deviations]."""
    quiet_position: float = radii(0.006 / 0.15)
    """Standard deviation of a measured position that widens nothing [radii]."""
    quiet_heading: float = angle(0.024)
    """Standard deviation of a measured heading that widens nothing [rad]."""
    averaging: float = share(0.2)
    """Share of the newest pose in the average: a robot at rest may average its noise away."""

    def __post_init__(self) -> None:
        check(self)
