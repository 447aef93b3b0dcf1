"""Drives by laser scanners of every kind, in worlds that nobody has told of."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import kmpc_lite as kl
from outcomes.lab import SightOptions, box_edges, has_passage, sight_course
from outcomes.plant import Body
from outcomes.rows.build import Table, drive, scene
from outcomes.sensing import Both, Scanner
from outcomes.setup import Scene, Setup

QUARTER = math.pi / 2


def by_lidar(
    seed: int, kind: str, number: int, radius: float = 0.15, reach: float = 4.0, **more: Any
) -> Setup:
    """A world that nobody has told of, by lidar alone."""
    course = sight_course(kind, 7_000 + number + 500 * seed, radius)
    half, by = 0.5 * course.side, radius / 0.15
    place = Scene((-half, -half, half, half), course.world.circles, edges=course.world.edges)
    speeds = more.pop("speeds", (0.6 * by, math.pi / 4))
    problem = {
        "robot_radius": radius,
        "u_min": (-speeds[0], -speeds[1]),
        "u_max": speeds,
        **more.pop("problem", {}),
    }
    scanner = Scanner(reach, **more.pop("scanner", {}))
    ideal = math.hypot(*(course.goal - course.start)[:2]) / speeds[0]
    limit = 4.0 * ideal + 40.0
    tolerance = (0.15 * radius, 0.1)
    return drive(
        *(place, course.start, course.goal, seed),
        problem=problem,
        sense=scanner,
        limit=limit,
        tolerance=tolerance,
        **more,
    )


LIDAR = Table("lidar")
for kind, count in (("rooms", 5), ("maze", 5), ("forest", 5)):
    for number in range(count):
        reach = (4.0, 2.0, 2.0, 4.0, 1.2)[number]
        LIDAR.add(
            f"{kind} {number} by a lidar of {reach:g} m",
            by_lidar,
            kind,
            number,
            reach=reach,
            quick=(kind, number) == ("forest", 0),
        )
for number in range(2):
    LIDAR.add(
        f"rooms by lidar, Husky-like {number}",
        by_lidar,
        "rooms",
        10 + number,
        0.5,
        8.0,
        speeds=(1.0, 1.0),
    )
    LIDAR.add(
        f"a maze by a lidar of 720 beams {number}",
        by_lidar,
        "maze",
        12 + number,
        scanner={"beams": 720},
    )
    LIDAR.add(
        f"a forest by a lidar of 90 beams and 3 cm of noise {number}",
        by_lidar,
        "forest",
        14 + number,
        scanner={"beams": 90, "noise": 0.03},
    )
for number in range(2):
    LIDAR.add(
        f"a forest at 1.5 m/s that changes by 1.5 m/s^2, by lidar {number}",
        by_lidar,
        "forest",
        16 + number,
        speeds=(1.5, 2.0),
        problem={"du_max": (1.5, 5.0), "deceleration": (1.5, 5.0)},
        body=Body(0.05, ramp=(1.5, 5.0)),
    )
    LIDAR.add(
        f"rooms with poses of 5 mm and 0.02 rad noise, by lidar {number}",
        by_lidar,
        "rooms",
        18 + number,
        model="noise",
        noise=(0.005, 0.02),
    )


def barn(seed: int, number: int, fill: float, beams: int, speed: float, ramp: float) -> Setup:
    """A field of cylinders from a cellular automaton, as the BARN challenge has, and a Jackal."""
    random = np.random.default_rng([seed, number, 61])
    start, goal = np.array((0.0, -1.0, QUARTER)), np.array((0.0, 10.0, QUARTER))
    bounds = (-2.25, -2.0, 2.25, 11.0)
    for _ in range(300):
        cells = random.random((60, 30)) < fill
        for _ in range(4):
            near = sum(
                np.roll(np.roll(np.pad(cells, 1), dy, 0), dx, 1)[1:-1, 1:-1]
                for dy in (-1, 0, 1)
                for dx in (-1, 0, 1)
                if dy or dx
            )
            cells = np.where(near >= 5, True, np.where(near <= 1, False, cells))
        y, x = np.nonzero(cells)
        rows = np.stack([0.15 * x - 2.175, 0.15 * y + 0.075, np.full(len(x), 0.075)], axis=1)
        if has_passage(rows, start, goal, 0.31, np.array(bounds), cell=0.05):
            break
    circles = np.hstack([rows, np.zeros((len(rows), 2))])
    place = Scene(bounds, circles, edges=box_edges(-2.6, -2.4, 2.6, 11.4))
    problem = {
        "footprint": kl.Footprint.rectangle(0.508, 0.43),
        "u_min": (-speed, -1.5),
        "u_max": (speed, 1.5),
        "du_max": (ramp, 6.0),
        "deceleration": (ramp, 6.0),
    }
    scanner = Scanner(10.0, beams, view=1.5 * math.pi, mount=(0.12, 0.0, 0.0))
    return drive(
        *(place, start, goal, seed),
        problem=problem,
        body=Body(0.03, ramp=(ramp, 6.0)),
        sense=scanner,
        limit=70.0,
        tolerance=(0.15, 0.3),
    )


BARN = Table("BARN")
for number, (fill, beams, speed, ramp) in enumerate(
    (
        (0.10, 360, 1.0, 1.5),
        (0.15, 360, 1.0, 1.5),
        (0.20, 360, 1.0, 1.0),
        (0.25, 360, 1.5, 1.5),
        (0.15, 720, 1.0, 1.5),
        (0.20, 720, 1.5, 1.5),
        (0.25, 720, 1.0, 1.0),
        (0.20, 720, 2.0, 2.0),
    )
):
    BARN.add(
        f"cylinders {number}: {fill:.0%} filled, {beams} beams, {speed:g} m/s, {ramp:g} m/s^2",
        barn,
        number,
        fill,
        beams,
        speed,
        ramp,
    )


ROOM = {"bounds": (-0.3, -0.3, 7.3, 4.3), "edges": box_edges(0.0, 0.0, 7.0, 4.0)}


def in_room(seed: int, start: Any, goal: Any, scanner: dict[str, Any], **more: Any) -> Setup:
    """An empty room of 7 x 4 m."""
    return drive(scene(**ROOM), start, goal, seed, sense=Scanner(8.0, **scanner), **more)  # type: ignore[arg-type]


def walls_of(seed: int, boxes: Any, start: Any, goal: Any, half: float = 3.0, **more: Any) -> Setup:
    """Boxes that only the scanner shows, in a closed room."""
    edges = [box_edges(-half, -half, half, half), *(box_edges(*box) for box in boxes)]
    place = scene(*more.pop("circles", ()), half=half, edges=np.concatenate(edges))
    sense = more.pop("scanner", None) or Scanner(**more.pop("scan", {}))
    return drive(place, start, goal, seed, sense=sense, **more)


VIEW = Table("scanners")
FRONT = {"mount": (0.1, 0.0, 0.0)}
for degrees, x, heading in ((90, 5.0, 2.6), (180, 5.0, math.pi), (270, 2.5, 2.6)):
    VIEW.add(
        f"a scanner of {degrees} degrees swung to and fro where it does not look",
        in_room,
        (1.0, 2.0, heading),
        (x, 2.0, math.pi),
        {"view": math.radians(degrees), "beams": degrees + 1, **FRONT},
        quick=degrees == 180,
    )
VIEW.add(
    "one that cannot back up looks to either side before it sets off",
    in_room,
    (1.0, 2.0, QUARTER),
    (5.0, 2.0, math.pi),
    {"view": QUARTER, "beams": 91, **FRONT},
    problem={"u_min": (0.0, -math.pi / 4)},
)
for free, right in ((1.0, "arrived"), (0.0, "waiting")):
    VIEW.add(
        f"a camera at the front edge of a robot with corners, free at start {free:g}",
        in_room,
        (2.0, 2.0, 0.0),
        (2.0, 3.5, QUARTER),
        {"view": QUARTER, "beams": 91, "mount": (0.2, 0.0, 0.0)},
        problem={"footprint": kl.Footprint.rectangle(0.4, 0.25)},
        options={"options": kl.ControllerOptions(sight=SightOptions(free_at_start=free))},
        right=right,
        limit=30.0,
    )
for mounted, word in ((0.0, "ahead"), (math.pi, "backwards")):
    VIEW.add(
        f"a camera that looks {word}: that gear is driven",
        in_room,
        (1.0, 2.0, QUARTER),
        (6.0, 2.0, QUARTER),
        {"view": QUARTER, "beams": 91, "mount": (0.0, 0.0, mounted)},
    )
VIEW.add(
    "a scanner upside down and askew",
    walls_of,
    [(0.0, -0.4, 0.3, 0.5)],
    (-2, 0, 0),
    (2, 0, 0),
    scan={"mount": (0.05, 0.02, 1.5), "mirrored": True},
)
VIEW.add(
    "masts on the robot were followed as walkers",
    walls_of,
    [],
    (0.0, 0.0, 0.0),
    (1.8, 0.0, 0.0),
    scan={"masts": (QUARTER, -QUARTER)},
    quick=True,
)
VIEW.add(
    "scans 0.2 s old: posts walked when the robot turned",
    walls_of,
    [],
    (-2, 0, 2.0),
    (2, 0.3, 0),
    scan={"age": 0.2},
    circles=[(0.0, 0.05, 0.15), (0.8, -0.6, 0.1), (-0.6, 0.7, 0.1)],
    quick=True,
)
VIEW.add(
    "a scanner whose turn takes 0.15 s",
    walls_of,
    [],
    (-2, 0, 2.0),
    (2, 0.3, 0),
    scan={"turn_time": 0.15},
    circles=[(0.0, 0.05, 0.15), (0.8, -0.6, 0.1), (-0.6, 0.7, 0.1)],
)
VIEW.add(
    "a scanner that hangs for three seconds stops the robot",
    walls_of,
    [],
    (-2, 0, 0),
    (2, 0.3, 0),
    scan={"hangs": (1.5, 4.5)},
    circles=[(0.4, 0.05, 0.15)],
)
VIEW.add(
    "a scanner that hangs for good stops the robot",
    walls_of,
    [],
    (-2, 0, 0),
    (2, 0.3, 0),
    scan={"hangs": (1.5, 1e9)},
    circles=[(0.4, 0.05, 0.15)],
    limit=15.0,
    right="waiting",
)
VIEW.add(
    "a scanner that dies stops the robot",
    walls_of,
    [],
    (-2, 0, 0),
    (2, 0.3, 0),
    scan={"dies": (1.5, 1e9)},
    circles=[(0.4, 0.05, 0.15)],
    limit=15.0,
    right="waiting",
    quick=True,
)
VIEW.add(
    "a scanner that sees nothing for two seconds",
    walls_of,
    [],
    (-2, 0, 0),
    (2, 0.3, 0),
    scan={"dies": (1.5, 3.5)},
    circles=[(0.4, 0.05, 0.15)],
)
for spare in (0.03, 0.06):
    half = 0.15 + spare
    VIEW.add(
        f"a door with {100 * spare:g} cm to either side by lidar was waited before for ever",
        walls_of,
        [(-0.05, -3.0, 0.05, -half), (-0.05, half, 0.05, 3.0)],
        (-1.5, -0.8, 0),
        (1.5, -1.0, 0),
        scan={"noise": 0.01 if spare > 0.03 else 0.0},
        quick=spare > 0.03,
    )
VIEW.add(
    "both walls of a corridor walked along with the robot",
    walls_of,
    [(-2.5, 0.35, 2.5, 0.45), (-2.5, -0.45, 2.5, -0.35)],
    (-2.7, 0, 0),
    (2.7, 0, 0),
    3.5,
)
VIEW.add(
    "a corner is kept at its tip: a large robot backed onto it",
    walls_of,
    [(-0.5, -4.0, 0.5, 0.6), (-0.5, 2.2, 0.5, 4.0)],
    (2.5, 0.0, 0.4),
    (-2.5, 0.0, math.pi),
    4.0,
    problem={"robot_radius": 0.5, "u_min": (-1.0, -1.0), "u_max": (1.0, 1.0)},
    scan={"reach": 8.0},
)
VIEW.add(
    "a robot outside its area drove blind",
    lambda seed: drive(
        scene(edges=np.array([[5.0, -4.0, 5.0, 4.0]])),
        (6.0, 0.0, math.pi),
        (0.0, 0.0, math.pi),
        seed,
        sense=Scanner(),
        limit=12.0,
    ),
    right="unreachable/waiting",
)
VIEW.add(
    "panes of glass that come back as NaN",
    walls_of,
    [(0.0, -0.6, 0.05, 0.6)],
    (-2, 0, 0),
    (2, 0, 0),
    scan={"glass": (-0.02, 0.07)},
)
VIEW.add(
    "somebody may step out of what is not seen: slower",
    walls_of,
    [(0.0, -2.0, 0.6, -0.3)],
    (-2, 0, 0),
    (2, 0, 0),
    options={"options": kl.ControllerOptions(sight=SightOptions(emerging_speed=1.0))},
)
VIEW.add(
    "a lidar of 0.8 m",
    walls_of,
    [(0.0, -0.6, 0.3, 0.6)],
    (-2, 0, 0),
    (2, 0, 0),
    scan={"reach": 0.8},
    limit=90.0,
)
VIEW.add(
    "scan and circles at once",
    lambda seed: drive(
        scene((0.0, 0.1, 0.2), (0.7, -0.4, 0.15), edges=box_edges(-2.2, -2.2, 2.2, 2.2)),
        (-1.6, 0, 0),
        (1.6, 0, 0),
        seed,
        sense=Both(Scanner()),
    ),
)
VIEW.add(
    "a dead end that a lidar of 1 m shows late",
    walls_of,
    [(0.6, -1.0, 0.7, 1.0), (-0.8, 0.9, 0.7, 1.0), (-0.8, -1.0, 0.7, -0.9)],
    (-2, 0, 0),
    (2, 0, 0),
    scan={"reach": 1.0},
    limit=90.0,
)
