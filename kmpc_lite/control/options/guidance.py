"""How paths around obstacles are found, timed, followed, and given up."""

from __future__ import annotations

import math
from dataclasses import dataclass

from kmpc_lite.option_fields import angle, check, count, radii, seconds, share


@dataclass(frozen=True, slots=True)
class GuidanceOptions:
    """Numbers of the guide and of its two path searches."""

    # clearance of paths
    wide_clearance: float = radii(0.4)
    """Clearance beyond the problem's margin that a path keeps where it can [radii]."""
    narrow_clearance: float = radii(0.2)
    """Clearance that is tried where no path keeps the wide one [radii]."""
    least_clearance: float = radii(0.005 / 0.15)
    """Clearance that is tried last: a path that keeps less would not be driven [radii]."""
    spare_clearance: float = radii(0.02 / 0.15)
    """How much more clearance a path keeps than a plan's margin at full speed [radii]: a plan that
    touches its margin cannot correct itself."""
    speed_clearance_limit: float = radii(0.1 / 0.15)
    """Largest clearance that a path keeps so that it can be driven at full speed [radii]: driving
    slowly through a passage is better than a long detour."""

    back_off: float = radii(0.001 / 0.15)
    """Start or goal may lie nearer to an obstacle than the path's clearance. The path may then come
    nearer than they do by this much [radii]."""

    body_samples: int = count(400, least=2)
    """Largest number of poses of a path at which it is looked whether a robot that is not round
    fits."""

    # when a new path is looked for
    off_path_share: float = share(0.08)
    """A robot that is farther from its path than this share of its distance to the goal looks for a
    new path; the goal checker's tolerance is the least such distance."""
    off_path_limit: float = radii(1.0)
    """A robot that is farther from its path than this looks for a new one, however far the goal is
    [radii]."""
    lost_distance: float = radii(0.5 / 0.15)
    """A robot that is farther from its path than this needs the new one in the same step: somebody
    has carried it [radii]."""
    replan_interval: float = seconds(0.3)
    """Least time between two searches for the same map and goal [s]."""
    retry_interval: float = seconds(0.5)
    """Time between two searches where there is no path [s]."""
    moved_distance: float = radii(0.01 / 0.15)
    """How far an obstacle may be from where it was expected before a new path is looked for
    [radii]."""
    near_goal: float = radii(2.0)
    """Distance to the goal below which repeated searches for a path are hurried [radii]: a robot
    that lags more than its model knows has soon left the place where the search began."""
    settled_share: float = share(0.4)
    """A robot that is nearer to its goal than `near_goal`, and is commanded faster than this share
    of its speed, is still on its way there: it looks for no new path for having left its own."""
    goal_slack: float = share(0.5)
    """A path that begins near the goal may end beside it, by this share of the distance at which
    the last turn may begin: what is left to the side takes two turns."""
    hurried_parts: int = count(3)
    """Most parts of a search that are done in one step while the robot has a path."""
    urgent_parts: int = count(60)
    """Most parts of a search that the robot needs at once that are done in one step. Most searches
    end sooner; among very many obstacles the robot drives on as before, or stands, for a step more,
    which else would come late."""
    switch_time: float = seconds(0.5)
    """A path that passes an obstacle on another side than before is taken only where it is quicker
    by this time [s] ..."""
    switch_share: float = share(0.1)
    """... plus this share of its own time."""
    narrow_cost: float = share(1.0)
    """A path that keeps less than the wide clearance counts as longer by this share: the robot
    drives it more slowly."""
    unknown_cost: float = share(0.2)
    """What scans have not shown of a path counts as longer by this share: the robot may have to
    return."""
    unfit_cost: float = seconds(1000.0)
    """What a path costs on which a robot that is not round does not fit: it is driven if there is
    no other [s]."""

    # parking
    shuttle_length: float = radii(2.0)
    """A robot that has stopped beside its goal may drive a shuttle: away from the goal along the
    axis of its heading, and back. This is how far away [radii]."""
    shuttle_reach: float = radii(0.5)
    """Distance from the far end of the shuttle at which the robot turns back [radii]."""
    shuttle_gain: float = seconds(1.0)
    """How much quicker than turning on the spot a shuttle must be [s]."""
    shuttle_speed: float = share(0.5)
    """Share of its speed at which the robot drives a shuttle: it slips more at speed."""
    shuttles: int = count(3, least=0)
    """Most shuttles for one goal."""

    # progress
    progress_time: float = seconds(0.05)
    """How much time of its path the robot must have left behind for that to count as progress [s].
    """
    patience: float = seconds(0.8)
    """How long the robot may stand before it looks for a path from where it is [s]."""
    detour_time: float = seconds(0.5)
    """A new path that is longer than what was left of the old one by this time is a detour: the
    patience begins anew [s]."""
    stall_time: float = seconds(5.0)
    """A robot without progress for so long has stalled: it tries a path on another side of some
    obstacle, and the next time one that keeps less clearance. Without progress for as long again,
    the guidance says that it waits [s]."""
    stall_distance: float = radii(1.0)
    """A robot that moves farther than this within that time has not stalled yet on a detour
    [radii]."""
    stall_angle: float = angle(0.5)
    """A robot that turns by more than this is not told to stand still [rad]; turning brings it no
    nearer to its goal by itself."""
    tried_paths: int = count(4)
    """Most paths on which time was lost that are remembered for one goal."""

    # timing of a path
    turn_share: float = share(0.9, zero=False)
    """Share of the fastest turn rate at which paths are timed: the rest is left for corrections."""
    lead_time: float = seconds(0.2)
    """How far the reference runs ahead of the robot [s]."""
    free_turn: float = angle(math.pi / 3)
    """How much of the first turn the robot makes while it drives, on a long path far from obstacles
    [rad]."""
    free_turn_length: float = radii(0.5 / 0.15, zero=False)
    """Length of a path on which the robot may make the whole free turn; on a shorter path it makes
    a part of it in proportion [radii]."""
    free_turn_clearance: float = radii(4.0, zero=False)
    """Clearance that the whole free turn needs: the robot may back up in it [radii]."""
    goal_stretch: float = seconds(0.5)
    """For so long before the path reaches the goal's position, the reference ends there: it does
    not begin the last turn yet [s]."""
    brake_share: float = share(0.6)
    """Share of `du_max` with which the reference brakes before the goal: turning takes the rest,
    and what brakes with all of it has nothing left for an error."""
    grid_step: float = seconds(0.05, zero=False)
    """Time between neighbouring poses of a path, among which the robot's place is looked for [s].
    """
    grid_poses: int = count(20_000)
    """Most poses of one path: the path of a robot that hardly moves would need more than there is
    memory for."""
    turn_length: float = radii(2.0, zero=False)
    """One radian of heading counts as much as this distance when the robot's place on its path is
    looked for [radii]."""
    locate_back: float = seconds(0.5)
    """How far back along its path the robot's place may move in one step [s]."""
    locate_ahead: float = seconds(1.5)
    """How far ahead along its path the robot's place may move in one step [s]."""

    # the tangent graph
    cut_depth: float = radii(0.002 / 0.15, zero=False)
    """How deep the chords of a path's arcs may cut an inflated circle [radii]."""
    arc_step: float = angle(0.15, zero=False)
    """Largest turn between two points of an arc [rad]."""
    turning_radius_share: float = share(0.3)
    """Radius of the circles beside start and goal on which the robot may turn, as a share of the
    distance between them."""
    turning_radius_limit: float = radii(0.5 / 0.15)
    """Largest radius of these circles [radii]."""
    corner_rounds: int = count(12, least=0)
    """A path may still cut corners that the graph does not hold. They are added, and the graph is
    searched again, so often; after that the lattice's own path is taken."""

    graph_circles: int = count(150)
    """Most circles and corners of one graph: where more are in the way, the search gives up."""

    # the lattice
    lattice_rectangles: int = count(24)
    """Occupancy grids with up to so many rectangles give the tangent graph all of their corners; of
    larger ones the lattice picks some."""
    lattice_step: float = radii(0.05 / 0.15)
    """Least distance between neighbours of the lattice [radii]."""
    lattice_nodes: int = count(40_000)
    """Largest number of nodes of the lattice: larger maps get wider steps."""
    lattice_field_cells: int = count(1_000_000)
    """Most cells for which the distance to the nearest obstacle is worked out. Cells of a larger or
    finer grid are joined to blocks, which count as occupied where one of their cells is."""
    lattice_border: float = radii(4.0)
    """How far a path may lead around the outermost obstacle, start or goal [radii]."""
    lattice_near_cost: float = share(0.2)
    """A step along an obstacle counts as longer than one in the open, by this share: paths keep in
    the middle between two obstacles."""
    lattice_cut: float = radii(0.02 / 0.15)
    """How deep a path may cut the inflated cells of a grid [radii]: its clearance is larger than
    what the robot needs."""
    lattice_sample: float = radii(0.04 / 0.15, zero=False)
    """A line is looked at in points that lie so far apart [radii]."""
    lattice_samples: int = count(400)
    """Most of these points on one line."""
    lattice_look: int = count(80, least=2)
    """A lattice path is pulled straight: from each corner, the farthest node in sight is looked for
    among so many."""
    lattice_searches: int = count(4)
    """Most goals for which the lattice keeps its search, to find the next path to them at once."""

    # the turning centre
    centre_headings: int = count(8)
    """At so many headings the model is asked for a turn on the spot, to either side."""
    centre_distance: float = radii(0.004 / 0.15)
    """A turning centre nearer to the tracked pose than this is taken to be the tracked pose
    [radii]."""
    centre_change: float = radii(0.001 / 0.15)
    """Changes of the turning centre below this are ignored [radii]."""
    centre_certainty: float = share(3.5)
    """A turning centre counts only where it lies this many of its standard errors away from the
    tracked pose."""
    centre_share: float = share(1.0)
    """A turning centre counts only where it explains this many times as much of the predicted
    motion as it leaves unexplained."""

    # what is believed of a model
    least_speed_share: float = share(0.05)
    """The robot is believed to reach at least this share of each command bound: a model may not
    know what its log never showed, and paths must end."""

    def __post_init__(self) -> None:
        check(self)
