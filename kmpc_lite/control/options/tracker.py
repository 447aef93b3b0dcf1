"""How circles are followed from step to step, and when they count as moving."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.option_fields import check, count, probability, radii, seconds, share


@dataclass(frozen=True, slots=True)
class TrackerOptions:
    """What is believed of sensors that see circles, and of what walks.

    Times are the robot's for circles that a controller is told, and by the clock for what scans
    show and for `ObstacleTracker`, which know of no robot.
    """

    noise: float = radii(2 / 15, zero=False)
    """Standard deviation of a seen position along each axis [radii]: 2 cm for a radius of 15 cm, as
    of a leg that a lidar sees one side of."""
    first_speed: float = share(2.0, zero=False)
    """Standard deviation of the velocity of what was never seen before, along each axis, as a share
    of the robot's fastest: it may be anything."""
    acceleration: float = share(2 / 3, zero=False)
    """Standard deviation of accelerations along each axis, in the robot's fastest speeds a
    second."""
    turn_rate: float = share(0.5, zero=False)
    """Standard deviation of turn rates [rad/s]: a person walks a half circle in six seconds."""
    turn_memory: float = seconds(2.0, zero=False)
    """How long turns last [s]."""
    gate: float = probability(1e-4)
    """Probability that a circle is farther from where its track expects it than is looked."""
    false_alarm: float = probability(1e-3)
    """Probability that a circle which keeps its velocity is taken for one that does not."""
    coast: float = seconds(1.5)
    """How long a track lasts unseen [s], and at most as long as it was seen."""
    spread: float = share(3.0)
    """Standard deviations of its velocity by which a circle that was seen to move grows, up to the
    robot's radius: whether somebody comes or not must not block the way."""
    most: int = count(200)
    """Circles that are followed."""

    gap: float = radii(1.0, zero=False)
    """Distance between neighbouring hits of a scan beyond which another cluster begins
    [radii]."""
    largest_cluster: float = radii(3.0)
    """Radius of the largest cluster of a scan that may be somebody [radii]."""
    fewest_hits: int = count(3)
    """Hits of the smallest one."""
    strayed: float = share(0.5)
    """How far a cluster must have moved to be somebody, in its own radii: what is seen of a post
    changes with the place that it is seen from."""

    begins: float = seconds(0.85)
    """How long a cluster must have left the place where it was to be somebody [s]; a third of it
    where it comes to what was seen to be free."""

    def __post_init__(self) -> None:
        check(self)
