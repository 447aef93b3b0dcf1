"""When the robot has arrived, and when it has left its goal again."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.option_fields import angle, check, radii, seconds


@dataclass(frozen=True, slots=True)
class GoalOptions:
    """Tolerances of the goal checker for a pose with little noise; noise widens them."""

    enter_distance: float = radii(0.09)
    """A robot that is nearer to its goal than this [radii] ..."""
    enter_angle: float = angle(0.025)
    """... with a smaller error of its heading than this [rad] has arrived."""
    leave_distance: float = radii(0.1)
    """A robot that had arrived drives again when its averaged pose is farther from the goal than
    this [radii] ..."""
    leave_angle: float = angle(0.05)
    """... or when the averaged heading is wrong by more than this [rad] ..."""
    pushed_distance: float = radii(0.05 / 0.15)
    """... or when one single pose is farther away than this: somebody pushed it [radii] ..."""
    pushed_angle: float = angle(0.15)
    """... or when one single heading is wrong by more than this [rad]."""
    averaging_time: float = seconds(0.5, zero=False)
    """Memory of the averaged pose [s]: a robot at rest averages its noise away."""

    def __post_init__(self) -> None:
        check(self)
