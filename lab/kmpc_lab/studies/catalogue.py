"""All studies: what they drive, and what varies. It is read by help, and imports nothing heavy."""

from __future__ import annotations

from kmpc_lab.studies.study import Axis, Study
from kmpc_lite.cli.command import positive

OURS, PAPERS = "ours, everything on", "K-NMPC, IPOPT"
SLIPS = (0.0, 0.01, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2)  # of the paper's table 1
TABLE_1 = (
    *("NMPC, IPOPT", PAPERS, "ours, paper's formulation", "ours, paper's, integral fit", OURS),
)
SIGHTED = ("ours", "pursuit")
STUDIES = {
    study.name: study
    for study in (
        Study(
            "table1",
            "The paper's table 1 beside ours. The rows of IPOPT need the extra peers.",
            "table1:drive",
            {
                "controllers": Axis(TABLE_1, "rows"),
                "slips": Axis(
                    (*map("{:g}".format, SLIPS), *(f"{at} trained at 0.1" for at in (0.15, 0.2))),
                    "columns",
                ),
                "scenario": Axis(
                    ("four_circles_1",), "map; its slip and seed are replaced", others=True
                ),
            },
            5,
            ("kmpc study table1", "kmpc study table1 --drives 100 --json > table1.json"),
            course="trial",
        ),
        Study(
            "maps",
            "Random maps by families and slips, driven by IPOPT and by ours.",
            "maps:drive",
            {
                "controllers": Axis(
                    (*TABLE_1, "ours, no adaptation"), "by labels", usual=(PAPERS, OURS)
                ),
                "conditions": Axis(
                    ("plain", "lag", "lag, noisy", "lag, noisy, old"),
                    "motors that lag by 0.3 s behind a dead time of 0.15 s, learned from a log; "
                    "noisy poses; poses 0.1 s old",
                    usual=("plain",),
                ),
                "families": Axis(
                    ("open", "dense", "narrow", "trap", "corridor", "moving", "polygons", "walls")
                    + ("rooms",),
                    "4 to 9 circles, 10 to 14, a passage of 6 cm, a U that opens towards the "
                    "start, walls of circles with gaps, circles that cross, polygons, 4 to 7 "
                    "walls, a house as a grid",
                    usual=("open",),
                ),
                "slips": Axis(SLIPS, "mean slip ratios", others=True),
            },
            100,
            (
                "kmpc study maps --drives 10 --families dense trap --slips 0.1",
                "kmpc study maps --records maps.jsonl",
                "kmpc study maps --conditions lag --slips 0 0.1 --controllers everything",
            ),
            versus=("controllers", PAPERS),
        ),
        Study(
            "anyrobot",
            "Robots drawn at random from a seed: size, speed, period, lag, slip, turning centre, "
            "noise and, of one in three, a footprint. Each is learned from its own log and drives "
            "a map of its size.",
            "robot_drives:drive_random",
            {
                "wheels": Axis(
                    ("differential", "round", "car", "omni"),
                    "what is drawn: round without footprints",
                    usual=("differential",),
                )
            },
            40,
            ("kmpc study anyrobot --drives 10", "kmpc study anyrobot --wheels car omni"),
            seed=2000,
        ),
        Study(
            "scales",
            "The standard robot at six scales, and robots of other numbers; learned from one "
            "minute of poses that err by 2 cm and 3 degrees; with ramps; at a period of 1 s.",
            "robot_drives:drive_named",
            {
                "robots": Axis(
                    (
                        *("x0.1", "x0.25", "x1", "x4", "x10", "x30"),
                        *("Husky-like", "Warthog-like", "micro", "forward only", "slow turner"),
                        *("fast", "one-minute log", "ramps 1, 1 s", "ramps 2, 1 s"),
                        *("ramps 1, 2 s", "1 s, N 10", "1 s, N 20", "1 s, N 40"),
                    ),
                    "by names",
                )
            },
            40,
            ("kmpc study scales --drives 10", "kmpc study scales --robots x0.1 Husky"),
            seed=2000,
        ),
        Study(
            "real",
            "Drives of a plant made from one half of a real log, with models learned from the "
            "other half: with and without lags, with and without adaptation.",
            "real:drive",
            {
                "models": Axis(
                    tuple(
                        name + adapts
                        for name in ("auto", "no lags", "lags 0 1 2 3")
                        for adapts in ("", ", adapted")
                    ),
                    "how models are learned",
                )
            },
            100,
            ("kmpc study real --log husky.csv --radius 0.5 --speed 1 --turn-rate 1",),
            seed=300,
            needs={
                "log": (str, "log of a real robot"),
                "radius": (positive, "radius of the robot [m]"),
                "speed": (positive, "its largest speed [m/s]"),
                "turn-rate": (positive, "its largest turn rate [rad/s]"),
            },
        ),
        Study(
            "parking",
            "Cars of any size, speed and turning radius park in bays and along kerbs, leave dead "
            "ends, turn round in lanes and drive in the open: time against the quickest curve of "
            "Reeds and Shepp, changes of gear, and touches by the exact outline.",
            "parking:drive",
            {
                "scenes": Axis(
                    ("open", "bay", "dead end", "lane", "gap 1.2", "gap 1.25", "gap 1.3")
                    + ("gap 1.35", "gap 1.4", "gap 1.5", "gap 1.7")
                    + ("open, forward only", "open, slow steering"),
                    "where; gaps in lengths of the car",
                )
            },
            20,
            ("kmpc study parking --drives 10", "kmpc study parking --scenes open gap"),
            seed=2000,
            course="car",
        ),
        Study(
            "limits",
            "Robots of 0.3 to 4 m/s that change their speed by 0.3 to 5 m/s^2, in fields of "
            "circles: time against the ideal with these accelerations, shares of statuses, and "
            "the change of commands.",
            "limits:drive",
            {
                "robots": Axis(
                    (
                        "0.3 m/s, 0.3 m/s^2, 1 rad/s^2",
                        "0.6 m/s, 0.4 m/s^2, 2 rad/s^2",
                        "1 m/s, 0.5 m/s^2, 1.5 rad/s^2",
                        "1.5 m/s, 1.5 m/s^2, 5 rad/s^2",
                        "1.5 m/s, 5 m/s^2, 10 rad/s^2",
                        "3 m/s, 1 m/s^2, 3 rad/s^2",
                        "4 m/s, 0.3 m/s^2, 1 rad/s^2",
                        "4 m/s, 5 m/s^2, 10 rad/s^2",
                    ),
                    "by speed and accelerations",
                ),
                "limits": Axis(
                    ("given", "learned", "untold"), "how they are known", ("given", "learned")
                ),
                "reach": Axis((0.0, 2.0), "circles are reported within it [m]; 0: all", (), True),
            },
            40,
            ("kmpc study limits --drives 5", "kmpc study limits --robots '3 m/s'"),
            course="field",
            versus=("limits", "given"),
        ),
        Study(
            "sight",
            "Rooms, mazes and forests driven by lidar alone, beside a lattice search with pure "
            "pursuit that sees the same.",
            "sight:drive",
            {
                "drivers": Axis(SIGHTED, "who drives"),
                "robots": Axis(("standard", "Husky-like"), "by names"),
                "kinds": Axis(("rooms", "maze", "forest"), "of worlds"),
                "reach": Axis((2.0, 4.0, 8.0), "how far the lidar sees [m]", others=True),
            },
            10,
            ("kmpc study sight --kinds maze --reach 4 --robots standard",),
            course="world",
            versus=("drivers", "pursuit"),
        ),
        Study(
            "clutter",
            "Fields of cylinders in the manner of the BARN challenge, driven by a Jackal-like "
            "robot by lidar alone, beside a dynamic window: a kinematic replica, no Gazebo score.",
            "clutter:drive",
            {
                "worlds": Axis(
                    ("field", "moving"),
                    "drawn fields, cylinders that move, or barn:FOLDER of the public set's "
                    "world_N.world, whose numbers are the seeds",
                    usual=("field",),
                    others=True,
                ),
                "conditions": Axis(
                    ("exact", "noisy", "late"),
                    "exact: 2 mm, 0.1 degrees, ranges 1 mm; noisy: 1 cm, 0.5 degrees, 1 cm; late: "
                    "exact, 50 ms old without a driver knowing it, odometry drifts by 15 mm a "
                    "metre",
                    usual=("exact", "noisy"),
                ),
                "drivers": Axis(("ours", "dwa"), "who drives"),
            },
            50,
            (
                "kmpc study clutter --drives 10 --drivers ours dwa",
                "kmpc study clutter --worlds barn:the-barn-challenge/jackal_helper/worlds/BARN "
                "--seed 0 --drives 300",
            ),
            course="world",
            versus=("drivers", "dwa"),
        ),
        Study(
            "pedestrians",
            "Drives among pedestrians that ignore the robot, straight or in arcs; the controller "
            "is told their velocity, or zero, or zero with noise, or has scans. Contacts are "
            "counted.",
            "pedestrians:drive",
            {
                "people": Axis((4, 8), "how many"),
                "walks": Axis(("straight", "turning"), "how they walk"),
                "seen": Axis(("told", "zero", "noisy", "lidar"), "how they are known"),
            },
            100,
            ("kmpc study pedestrians --drives 10", "kmpc study pedestrians --people 8 --seen told"),
            course="crowd",
        ),
        Study(
            "hard",
            "Rows in which a person at the remote would drive better, and what is asked of each.",
            "hard:drive",
            {
                "rows": Axis(
                    (
                        *("3 m/s, given", "3 m/s, learned", "3 m/s, by sight of 2 m"),
                        *("0.5 m/s^2, untold", "clutter, exact", "clutter, noisy"),
                        *("clutter, late", "clutter, by DWA", "gap of 1.5 lengths"),
                        *("gap of 1.35 lengths", "cars into bays", "cars that turn in a lane"),
                        *("cars in the open", "cars that only drive ahead"),
                        *("cars that steer slowly", "omnis sideways into a slot"),
                        "omnis through a door",
                        *("8 pedestrians, told", "8 pedestrians, lidar"),
                    ),
                    "by names",
                )
            },
            10,
            ("kmpc study hard --drives 5 --rows cars", "kmpc study hard --seed 930000"),
            course="course",
        ),
        Study(
            "jumps",
            "Drives whose pose jumps again and again: for one sample, for a second, in heading, or "
            "with its frame for good.",
            "jumps:drive",
            {
                "kinds": Axis(("one sample", "a second", "heading", "for good"), "of jumps"),
                "sizes": Axis((0.05, 0.1, 0.3, 1.0), "of jumps [m or rad]", others=True),
            },
            100,
            ("kmpc study jumps --drives 10", "kmpc study jumps --kinds heading"),
        ),
    )
}
