"""How paths around obstacles are found, timed, followed, and given up."""

from __future__ import annotations

import math
from dataclasses import dataclass

from kmpc_lite.control.options.fields import angle, check, count, radii, seconds, share


@dataclass(frozen=True, slots=True)
class GuidanceOptions:
    """Numbers of the guide and of its two path searches."""

    # clearance of paths
    wide_clearance: float = radii(0.4)
    """Clearance beyond the problem's margin that a path keeps where it can [radii]."""
    narrow_clearance: float = radii(0.2)
    """Clearance that is tried where no path keeps the wide one [radii]."""
    least_clearance: float = radii(0.005 / 0.15)
    """Clearance that is tried last: less would not be driven [radii]."""
    spare_clearance: float = radii(0.02 / 0.15)
    """Clearance of a path beyond the margin of a plan at full speed: a plan at its margin has none
    to correct itself [radii]."""
    speed_clearance_limit: float = radii(0.1 / 0.15)
    """Largest clearance that is kept for driving at full speed: a passage that is driven slowly is
    better than a long detour [radii]."""

    back_off: float = radii(0.001 / 0.15)
    """How much nearer than start or goal a path may come to an obstacle, where these are nearer
    than its clearance [radii]."""

    body_samples: int = count(400, least=2)
    """Largest number of poses of a path at which it is looked whether a robot that is not round
    fits."""

    # when a new path is looked for
    off_path_share: float = share(0.08)
    """Distance from the path at which a new one is looked for, as a share of the distance to the
    goal; at least the goal checker's."""
    off_path_limit: float = radii(1.0)
    """Distance from the path at which a new one is looked for in any case [radii]."""
    lost_distance: float = radii(0.5 / 0.15)
    """Distance from the path at which the new one is needed at once: somebody carried the robot
    [radii]."""
    replan_interval: float = seconds(0.3)
    """Least time between two searches for the same map and goal [s]."""
    retry_interval: float = seconds(0.5)
    """Time between two searches where there is no path [s]."""
    moved_distance: float = radii(0.01 / 0.15)
    """How far an obstacle may be from where it was expected before a new path is looked for
    [radii]."""
    near_goal: float = radii(2.0)
    """Distance to the goal below which repeated searches are hurried [radii]: a robot that lags
    more than its model knows is soon where no path began."""
    hurried_parts: int = count(3)
    """Parts of a hurried search that are done in one step, at the most."""
    switch_time: float = seconds(0.5)
    """How much quicker a path on another side of an obstacle must be to be taken [s] ..."""
    switch_share: float = share(0.1)
    """... plus this share of the time that it takes itself."""

    # parking
    shuttle_length: float = radii(2.0)
    """How far from its goal a robot that has stopped beside it drives, to come back along the
    goal's axis [radii]."""
    shuttle_reach: float = radii(0.5)
    """Distance from that place at which it turns back [radii]."""
    shuttle_gain: float = seconds(1.0)
    """How much quicker than turning on the spot that must be [s]."""
    shuttle_speed: float = share(0.5)
    """Share of its speed at which it does so: what a robot slips grows with its speed."""
    shuttles: int = count(3, least=0)
    """How often it is tried for one goal."""

    # progress
    progress_time: float = seconds(0.05)
    """Progress towards the goal that counts [s of path]."""
    patience: float = seconds(0.8)
    """How long the robot may stand before it looks for a path from where it is [s]."""
    detour_time: float = seconds(0.5)
    """How much longer a new path must be than what was left, for the patience to begin anew [s]."""
    stall_time: float = seconds(5.0)
    """Time without progress after which something else is tried: a path on another side, then one
    that keeps less clearance. After as much time again the guidance says that it waits [s]."""
    stall_distance: float = radii(1.0)
    """How far a robot must move within that time [radii] ..."""
    stall_angle: float = angle(0.5)
    """... or turn [rad], not to have stalled."""

    # timing of a path
    turn_share: float = share(0.9)
    """Share of the fastest rate of turn at which paths are timed: the rest corrects."""
    lead_time: float = seconds(0.2)
    """How far the reference runs ahead of the robot [s]."""
    free_turn: float = angle(math.pi / 3)
    """How much of the first turn is made while driving, on a long path far from obstacles [rad]."""
    free_turn_length: float = radii(0.5 / 0.15)
    """Length of a path on which the whole free turn may be made; less on a shorter one [radii]."""
    free_turn_clearance: float = radii(4.0)
    """Clearance that the whole free turn needs: a robot may back up in it [radii]."""
    goal_stretch: float = seconds(0.5)
    """Time before the goal's position is reached in which the reference does not yet begin the last
    turn [s]."""
    grid_step: float = seconds(0.05)
    """Time between the poses of a path among which the robot's place is found [s]."""
    grid_poses: int = count(20_000)
    """Largest number of these poses: a robot that hardly moves would need more than there is memory
    for."""
    turn_length: float = radii(2.0)
    """Length that a turn of one radian counts as when the place is found [radii]."""
    locate_back: float = seconds(0.5)
    """How far the place may move backwards in one step [s]."""
    locate_ahead: float = seconds(1.5)
    """How far the place may move ahead in one step [s]."""

    # the tangent graph
    cut_depth: float = radii(0.002 / 0.15)
    """How deep the chords of a path's arcs may cut an inflated circle [radii]."""
    arc_step: float = angle(0.15)
    """Largest turn between two points of an arc [rad]."""
    turning_radius_share: float = share(0.3)
    """Radius of the circles beside start and goal on which the robot may turn, as a share of the
    distance between them."""
    turning_radius_limit: float = radii(0.5 / 0.15)
    """Largest radius of these circles [radii]."""
    corner_rounds: int = count(12, least=0)
    """How often corners that a path cuts are added before the lattice's own path is taken."""

    graph_circles: int = count(150)
    """Largest number of circles and corners that one graph takes: where more are in the way, no
    path is looked for."""

    # the lattice
    lattice_rectangles: int = count(24)
    """Rectangles of occupancy grids up to which the tangent graph takes all of their corners; the
    lattice picks some of more."""
    lattice_step: float = radii(0.05 / 0.15)
    """Least distance between neighbours of the lattice [radii]."""
    lattice_nodes: int = count(40_000)
    """Largest number of nodes of the lattice: larger maps get wider steps."""
    lattice_field_cells: int = count(1_000_000)
    """Largest number of cells of which distances are worked out: those of a larger or finer grid
    are joined to blocks, which count as occupied where a cell is."""
    lattice_border: float = radii(4.0)
    """How far a path may lead around the outermost obstacle, start or goal [radii]."""
    lattice_near_cost: float = share(0.2)
    """How much longer a step along an obstacle counts than one in the open: between obstacles,
    paths keep away from both."""
    lattice_cut: float = radii(0.02 / 0.15)
    """How deep a path may cut the inflated cells of a grid: it keeps a clearance beyond what the
    robot must [radii]."""
    lattice_sample: float = radii(0.04 / 0.15)
    """Distance between the points of a line that are looked at [radii]."""
    lattice_samples: int = count(400)
    """Largest number of such points of one line."""
    lattice_look: int = count(80)
    """Nodes of a lattice path among which the farthest one in sight is looked for."""
    lattice_searches: int = count(4)
    """Searches from one goal that are kept for the next path to it."""

    # the turning centre
    centre_headings: int = count(8)
    """Headings at which the model is asked for a turn on the spot to either side."""
    centre_distance: float = radii(0.004 / 0.15)
    """Distance from the tracked pose below which the turning centre is taken to be that pose
    [radii]."""
    centre_change: float = radii(0.001 / 0.15)
    """Change of the turning centre that is overlooked [radii]."""
    centre_certainty: float = share(3.5)
    """How many of its standard errors away from the pose the turning centre must be."""
    centre_share: float = share(1.0)
    """How many times what it leaves unexplained a turning centre must explain of the motion."""

    # what is believed of a model
    least_speed_share: float = share(0.05)
    """Share of a command bound that is believed in the least: a model may not know what its log
    never showed, and paths must end."""

    def __post_init__(self) -> None:
        check(self)
