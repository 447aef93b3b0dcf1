"""A robot file, a model and a map become a drive: a pose and a scan in, a command out."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from firmware_bridge.integration.model_gate import load_model
from firmware_bridge.messages import ConfigError, command_of, speeds_of
from firmware_bridge.robot_file import Robot
from firmware_bridge.runtime.navigator import Navigator, Planned, Pose, Route, Task
from kmpc_lite.scenario.overrides import NO_AREA, DriveOverrides, drawn_table

if TYPE_CHECKING:
    from firmware_bridge.runtime.navigator import Moment, Step

Look = Callable[["Moment"], tuple[list[Any], Any] | None]
"""What a robot sees: obstacles, and the scan among them, if any; None while it is blind."""
Watcher = Callable[[Pose, Any, Any], None]
"""Receives each pose, its plan and its scan, in the thread that plans."""
NO_OVERRIDES = DriveOverrides()
HERE = (0.0, 0.0, 0.0)  # about this an empty map is drawn if goals are clicked
FENCE_ROOM = 0.25
"""Without a geofence of its own a robot may leave the scenario's area by so much [m]."""
WITHIN = 0.7  # share of what counts as arrived within which the robot stays: a single pose is noisy
DRIVE_TIME = 120.0
"""How long each goal may take by default [s]: low speeds take longer than a scenario's own limit.
"""
LOOK_AHEAD = 2.0  # time that the controller plans ahead, however short its period [s]
BUDGET = 0.5  # share of its period that a step may take: none of its commands is to come late
DEEP = 0.5
"""A pose further inside an obstacle than this share of the robot's radius, or of its half width,
cannot be true; one that only seems to touch, for a pose's noise or a map's, may drive."""


class Course(NamedTuple):
    """All that a run needs."""

    name: str
    robot: Robot
    navigator: Any
    period: float
    origin: tuple[float, float, float]
    notes: tuple[str, ...]  # what a user should know before it drives
    scenario: Any
    controller: Any  # kmpc_lite's
    watchers: list[Watcher]


def course(
    robot: Robot,
    settle: float,
    seconds: float | None,
    watch: Watcher | None = None,
    wait: float | None = None,
    rehearse: bool = False,
    overrides: DriveOverrides = NO_OVERRIDES,
    click: bool = False,
    look: Look | None = None,
    planner: Any = None,
) -> Course:
    """Put a controller and a map before a robot.

    `robot`: whose `control` names the scenario and the model. `settle`: how long the goal must be
    held [s]. `seconds`: give up after so long [s]; `DRIVE_TIME` for each goal if not given.
    `watch`: receives each pose and plan. `wait`: how long the vehicle may take until it drives [s];
    `seconds` if not given. `rehearse`: whether it drives at half the speed that limits and model
    allow. `overrides`: what counts instead of the scenario's own. `click`: whether goals are
    clicked while it drives, instead of the scenario's. `look`: what it sees, instead of its lidar.
    Without a geofence of its own it may drive everywhere. `planner`: finds paths; kmpc_lite's own
    if not given. Raises ConfigError for a scenario or a model that cannot be used.
    """
    import kmpc_lite as kl

    if click and not overrides.goals and robot.control.scenario is None:
        overrides = overrides._replace(goals=(HERE,))
    scenario = scenario_of(robot, overrides)
    if look is not None and robot.control.scenario is None:
        fence = robot.gate.geofence
        has_area, area = fence is not None, fence or scenario.bounds
        scenario = replace(scenario, bounds=area, has_area=has_area)
    try:
        robot, learned, notes = load_model(robot, rehearse)
        if robot.footprint is None and overrides.radius is None:
            shape = {k: learned.info[k] for k in ("radius", "footprint") if k in learned.info}
            scenario = scenario.of_robot(shape)
        controller = build_controller(robot, scenario, learned, planner)
    except kl.KmpcError as error:
        raise ConfigError(str(error)) from error
    robot = _fenced(robot, scenario, drawn=look is None)
    if robot.lidar is None and look is None and not robot.control.map:
        raise ConfigError(f"{robot.where}: control.map: false needs a [lidar] (--lidar NAME)")
    watchers: list[Watcher] = [] if watch is None else [watch]
    route = Route(scenario.goals, scenario.loop, click)
    gap_at: Any = partial(_gap, scenario)
    if look is not None:
        gap_at = SeenGap()
        watchers.append(gap_at.saw)
    step = planning(robot, scenario, controller, route, watchers, look)
    task = Task(
        scenario.goal,
        scenario.tolerance,
        scenario.heading_tolerance,
        scenario.radius,
        scenario.circles_at,
        gap_at,
        partial(misplaced, scenario) if robot.control.map else None,
        route,
    )
    period = robot.control.period or controller.problem.dt
    seconds = seconds or (math.inf if click else DRIVE_TIME * len(route.goals))
    navigator = Navigator(step, task, settle, seconds, wait=wait)
    name, made = scenario.name, (scenario, controller, watchers)
    return Course(name, robot, navigator, period, own_frame(robot, scenario), notes, *made)


def _gap(scenario: Any, pose: Pose, time: float) -> float:
    """Distance of a robot at a pose and a time [s] to the nearest obstacle, between edges [m]."""
    import numpy as np

    from kmpc_lite.scenario.world import obstacle_gaps

    return float(obstacle_gaps(scenario, np.array([pose]), np.array([time]))[0])


def _fenced(robot: Robot, scenario: Any, drawn: bool) -> Robot:
    """Check goals against the robot's geofence; without one give it that of a map that is drawn."""
    if robot.gate.geofence is not None:
        for goal in scenario.goals:
            if wrong := beyond(robot, goal):
                raise ConfigError(f"{scenario.name}: {wrong}")
    elif drawn:
        x_min, y_min, x_max, y_max = scenario.bounds
        fence = (x_min - FENCE_ROOM, y_min - FENCE_ROOM, x_max + FENCE_ROOM, y_max + FENCE_ROOM)
        return replace(robot, gate=replace(robot.gate, geofence=fence))
    return robot


def beyond(robot: Robot, goal: Pose) -> str:
    """Say that a goal lies where the gate would stop the robot; empty if it does not."""
    x_min, y_min, x_max, y_max = robot.gate.geofence or NO_AREA
    x, y, _ = goal
    if x_min <= x <= x_max and y_min <= y <= y_max:
        return ""
    fence = ", ".join(f"{side:g}" for side in (x_min, y_min, x_max, y_max))
    return f"goal ({x:g}, {y:g}) lies outside the geofence [{fence}]"


def scenario_of(robot: Robot, overrides: DriveOverrides = NO_OVERRIDES) -> Any:
    """Scenario of a robot's file, with its footprint and wheels, and a command line's overrides.

    Raises ConfigError for a scenario that is missing, or cannot be read.
    """
    from kmpc_lite.control import Footprint
    from kmpc_lite.control.wheels import Car, Omni, read_wheels
    from kmpc_lite.errors import KmpcError
    from kmpc_lite.reading import parse_toml
    from kmpc_lite.scenario.files import Scenario

    named = robot.control.scenario
    if named is None and not overrides.goals:
        raise ConfigError(
            f"{robot.where}: control.scenario: missing: give --scenario NAME or --goal X Y THETA"
        )
    try:
        if named is None:
            name, table = "command line", drawn_table(overrides.goals)
        else:
            scenario = Scenario.load(named)
            name, table = scenario.name, parse_toml(scenario.to_toml())
        overrides.put(table)
        # what is drawn of a map without bounds has room around it, and is where the robot may go
        scenario = replace(Scenario.from_table(table, name, named or name), has_area=True)
        if robot.footprint is not None:
            scenario = replace(scenario, footprint=Footprint.of(robot.footprint))
        if robot.wheels.kind == "differential" and not isinstance(scenario.wheels, Car | Omni):
            return scenario
        return replace(scenario, wheels=read_wheels(robot.wheels.table))
    except KmpcError as error:
        raise ConfigError(str(error)) from error


def _together(robot: Robot) -> dict[str, Any]:
    """What wheels on either side can do together; an autopilot mixes them itself."""
    geometry = robot.sections.get("geometry", {})
    if robot.wheels.kind != "differential":
        return {}
    return {key: geometry[key] for key in ("track", "max_wheel_speed") if key in geometry}


def build_controller(robot: Robot, scenario: Any, learned: Any, planner: Any = None) -> Any:
    """kmpc_lite's controller for this map, within the robot's limits."""
    import kmpc_lite as kl

    base = replace(base_problem(robot, learned.dt), goal_tolerance=goal_tolerance(scenario))
    how = {"planner": planner, "adaptation": adaptation(robot), "options": scenario.options}
    return kl.Controller(learned, scenario.problem(base), time_budget=BUDGET * learned.dt, **how)


def goal_tolerance(scenario: Any) -> tuple[float, float]:
    """How near to its goal the robot stays [m, rad]: within what counts as arrived, noise and all.

    No nearer than the controller's own default asks for, where that is within, too: a robot that
    lags, or whose poses are noisy, swings about its goal for a precision that was not requested.
    """
    own = scenario.options.goal
    usual = own.leave_distance * scenario.radius, own.leave_angle
    arrived = scenario.tolerance, scenario.heading_tolerance
    distance, angle = (
        min(max(WITHIN * limit, near), limit) for limit, near in zip(arrived, usual, strict=True)
    )
    return distance, angle


def base_problem(robot: Robot, dt: float) -> Any:
    """Build a problem with the robot's limits, of a period [s]."""
    import kmpc_lite as kl
    from kmpc_lite.control.wheels import read_wheels

    limits = robot.gate.limits
    problem = kl.NavigationProblem(
        dt=dt,
        horizon=min(100, max(20, round(LOOK_AHEAD / dt))),
        u_min=(-limits.v_reverse, -limits.omega_max),
        u_max=(limits.v_max, limits.omega_max),
        # a plan that knows nothing of the gate's ramps brakes too late, and swings about its goal
        du_max=(limits.acceleration, limits.angular_acceleration),
        deceleration=(limits.deceleration, limits.angular_deceleration),
        **_together(robot),
    ).with_wheels(read_wheels(robot.wheels.table))
    if problem.wheels.inputs == 2:
        return problem
    v_min, _, omega_min = problem.u_min
    v_max, _, omega_max = problem.u_max
    aside = limits.sideways
    return replace(problem, u_min=(v_min, -aside, omega_min), u_max=(v_max, aside, omega_max))


def adaptation(robot: Robot) -> bool | None:
    """The controller's `adaptation`: as asked for a learned model, none of the nominal one."""
    return False if robot.control.model is None else robot.control.adaptation


def misplaced(scenario: Any, pose: Pose) -> str:
    """Say that a robot at a pose [m, m, rad] stands inside an obstacle; empty if it does not."""
    if not all(map(math.isfinite, pose)):
        return ""
    gap = _gap(scenario, pose, 0.0)
    body = scenario.footprint
    if gap >= -DEEP * (scenario.radius if body is None else body.half_width):
        return ""
    x, y, theta = pose
    off = math.dist((x, y), scenario.start[:2])
    return (
        f"stands inside an obstacle by {-gap:.2f} m, at x {x:.2f} m, y {y:.2f} m, "
        f"theta {theta:.2f} rad, {off:.2f} m from the scenario's start: is frame.origin right?"
    )


def own_frame(robot: Robot, scenario: Any) -> Pose:
    """Pose of the vehicle's own frame: wheels begin at the start, others know where they are."""
    if robot.origin is not None:
        return robot.origin
    if robot.is_autopilot or robot.link.pose is not None:
        return 0.0, 0.0, 0.0
    start: Pose = scenario.start
    return start


def planning(
    robot: Robot,
    scenario: Any,
    controller: Any,
    route: Route,
    watchers: Sequence[Watcher],
    look: Look | None = None,
) -> Step:
    """Give what plans from a pose to the present goal, past what the robot knows and sees.

    With `look`, its obstacles count instead of the lidar's, and who drives to goals that come while
    it drives plans nothing at a goal that is held: others may drive then.
    """
    solids = () if scenario.solids is None else scenario.solids.solids
    inputs = controller.problem.wheels.inputs
    told, yields = robot.control.map, look is not None and route.clicked
    waits = "no goal yet" if yields else "no goal yet: tap the map of the live page"
    if look is None:
        look = _by_lidar if robot.lidar is not None else _nothing

    def step(pose: Pose, circles: Any, moment: Moment) -> Planned:
        if route.idle or (yields and route.done):
            return Planned(0.0, 0.0, "NO_GOAL", "the goal is held" if route.done else waits)
        if (seen := look(moment)) is None:
            return Planned(0.0, 0.0, "NO_SCAN")
        obstacles = [*(circles if told else ()), *(solids if told else ()), *seen[0]]
        plan = controller.step(pose, route.goal, obstacles, sent=command_of(moment.held, inputs))
        if len(route.goals) > 1:
            plan = replace(plan, leg=route.leg)
        for saw in watchers:
            saw(pose, plan, seen[1])
        v, omega, vy = speeds_of(plan.command)
        return Planned(v, omega, plan.status.name, plan.reason, vy)

    return step


class SeenGap:
    """Distance of a pose to what was seen at the last plan: a `Watcher`."""

    def __init__(self) -> None:
        self._around: Any = None

    def saw(self, pose: Pose, plan: Any, scan: Any) -> None:
        """Take a plan."""
        self._around = plan.around

    def __call__(self, pose: Pose, time: float) -> float:
        """Distance between the edges [m]; infinite before the first plan."""
        import numpy as np

        return math.inf if self._around is None else float(self._around.clearance(np.array([pose])))


def _nothing(moment: Moment) -> tuple[list[Any], Any]:
    return [], None


def _by_lidar(moment: Moment) -> tuple[list[Any], Any] | None:
    if moment.scan is None:
        return None
    scan = laser_scan(moment.scan)
    return [scan], scan


def laser_scan(scan: Any) -> Any:
    """Make the controller's scan of the bridge's (`firmware_bridge.sensors.sight.Scan`).

    Its age is zero: the mount already says where the sensor was, as seen from the step's pose.
    """
    import kmpc_lite as kl

    return kl.LaserScan(
        scan.ranges,
        scan.angle_min,
        scan.angle_increment,
        range_min=scan.range_min,
        range_max=scan.range_max,
        mount=scan.mount,
        noise=scan.noise,
    )
