"""How circles are followed from step to step, and when they count as moving."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.option_fields import check, probability, radii, seconds, share


@dataclass(frozen=True, slots=True)
class TrackerOptions:
    """What is believed of sensors that see circles, and of what walks.

    Times are the robot's in a controller, and by the clock in an `ObstacleTracker`, which knows of
    no robot.
    """

    noise: float = radii(2 / 15, zero=False)
    """Standard deviation of a seen position along each axis [radii]: 2 cm for a radius of 15 cm, as
    of a leg that a lidar sees one side of."""
    acceleration: float = share(2 / 3, zero=False)
    """Standard deviation of accelerations along each axis, in the robot's fastest speeds a
    second."""
    false_alarm: float = probability(1e-3)
    """Probability that a circle which keeps its velocity is taken for one that does not."""
    coast: float = seconds(1.5)
    """How long a track lasts unseen [s], and at most as long as it was seen."""
    spread: float = share(3.0)
    """Standard deviations of its velocity by which a circle that was seen to move grows, up to the
    robot's radius: whether somebody comes or not must not block the way."""

    begins: float = seconds(0.85)
    """How long a cluster must have left the place where it was to be somebody [s]; a third of it
    where it comes to what was seen to be free."""

    def __post_init__(self) -> None:
        check(self)
