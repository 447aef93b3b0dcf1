"""Recorded drives in which something happens: new goals, new obstacles, broken numbers, a push."""

from __future__ import annotations

from typing import Any

import numpy as np
from golden_scripts import FAR_POLYGON, ROBOT_NOISE, Hook, Random, Script, draft, pick


def told(random: Random, i: int) -> Script:
    script = draft(
        random,
        "sent",
        pick(random, i),
        ("slip", "lag", "noisy")[i % 3],
        0.02,
        gate=(0.6, 2.0),
        steps=56,
    )
    if i % 3 == 1:
        script.plant |= {"lag": 0.3, "dead_time": 0.15}
    begin = int(random.integers(8, 25))
    for k in range(begin, begin + 6):
        script.pilot[k] = [np.nan, np.nan] if i % 2 else [0.2, -0.3]
    return script


def new_goals(random: Random, i: int) -> Script:
    script = draft(
        random, "goals change", pick(random, i), ("slip", "lag_noisy")[i % 2], 0.03, steps=70
    )
    script.plant |= {"lag": 0.3, "dead_time": 0.15} if i % 2 else {}
    for k in (12, 30, 45):
        script.at(
            k, goal=[*random.uniform(-1.7, 1.7, 2).tolist(), float(random.uniform(-9.0, 9.0))]
        )
    return script


def appearing(random: Random, i: int) -> Script:
    script = draft(
        random, "obstacles appear", pick(random, i), ("slip", "lag")[i % 2], 0.03, steps=60
    )
    script.plant |= {"lag": 0.3, "dead_time": 0.15} if i % 2 else {}
    before = script.events[0]["obstacles"]

    def ahead(distance: float, radius: float, speed: float) -> Hook:
        def hook(pose: np.ndarray) -> dict[str, Any]:
            along = np.array([np.cos(pose[2]), np.sin(pose[2])])
            row = [*(pose[:2] + distance * along).tolist(), radius, *(speed * along).tolist()]
            # rows are where circles were when the drive began
            return {"obstacles": {**before, "circles": [*before["circles"], row]}}

        return hook

    script.hooks = {
        12: ahead(0.55, 0.15, 0.0),
        24: ahead(0.3, 0.2, 0.0),
        34: ahead(0.9, 0.1, -0.0),
        44: ahead(0.1, 0.1, 0.0),
    }
    return script.at(50, obstacles=before)


def broken_numbers(random: Random, i: int) -> Script:
    script = draft(
        random,
        "broken numbers",
        pick(random, i),
        ("slip", "lag", "nominal", "noisy")[i % 4],
        0.03,
        steps=50,
    )
    script.plant |= {"lag": 0.3, "dead_time": 0.15} if i % 4 == 1 else {}
    script.problem |= {"du_max": [0.8, 3.0]} if i % 3 == 2 else {}
    goal, obstacles = script.events[0]["goal"], script.events[0]["obstacles"]
    nan = float("nan")
    begin, length = int(random.integers(8, 16)), (1, 3, 14)[i % 3]
    if i % 4 == 0:
        script.poses = {k: [nan] * 3 for k in range(begin, begin + length)} | {40: [1e6, 0.0, 0.0]}
    elif i % 4 == 1:
        script.at(begin, goal=[nan, 0.0, 0.0]).at(begin + length, goal=goal)
        script.poses = {40: [np.inf, 0.0, 0.0]}
    elif i % 4 == 2:
        bad = {"circles": [[nan, 0.0, 0.2, 0.0, 0.0]], "objects": False}
        script.at(begin, obstacles=bad).at(begin + length, obstacles=obstacles)
    else:
        far = {**obstacles, "polygons": [FAR_POLYGON]}
        script.at(begin, obstacles=far).at(begin + length, obstacles=obstacles)
        script.at(40, obstacles={"circles": [[0.0, 0.0, -0.2, 0.0, 0.0]]}).at(
            42, obstacles=obstacles
        )
    return script


def broken_solver(random: Random, i: int) -> Script:
    fault = ("failed", "x", "y", "stopped")[i % 4]
    script = draft(
        random, f"solver {fault}", pick(random, i), ("slip", "lag", "paper")[i % 3], 0.03, steps=46
    )
    script.plant |= {"lag": 0.3, "dead_time": 0.15} if i % 3 == 1 else {}
    script.problem |= {"du_max": [0.8, 3.0]} if i % 5 == 2 else {}
    begin, length = int(random.integers(8, 14)), (1, 2, 4, 16)[(i // 4) % 4]
    script.at(3, qp=[fault, 0])
    for k in range(begin, begin + length):
        script.at(k, qp=[fault, int(i % 2)])
    for k in range(36, 36 + (2, 12)[i % 2]):
        script.at(k, qp=["failed", 0])
    return script


def spoilt(random: Random, i: int) -> Script:
    script = draft(random, "caller spoils the plan", pick(random, i), "slip", 0.03, steps=30)
    return script.at(10, spoil=True).at(18, spoil=True)


def budget(random: Random, i: int) -> Script:
    options: dict[str, Any] = {"time_budget": 10.0}
    if i % 3 == 2:
        options["sqp_iterations"] = 8
    script = draft(
        random,
        "budget",
        pick(random, i),
        "slip",
        0.03,
        options=options,
        steps=40 if i % 3 < 2 else 14,
    )
    script.ticking = True
    goal = random.uniform(-1.5, 1.5, 3).tolist()
    script.at(0, qp_seconds=1.5)
    for k in range(5, 12):
        script.at(k, qp_seconds=2.0, jump=4.0 if i % 2 else 0.0)
    script.at(20, goal=goal, jump=4.0).at(21, jump=3.0, qp_seconds=3.0).at(22, jump=4.0).at(
        23, qp_seconds=11.0
    )
    return script


def parking(random: Random, i: int) -> Script:
    model = ("slip", "noisy", "lag_noisy", "very_noisy", "nominal", "turning", "calm")[i % 7]
    noise = {"noisy": 1.0, "lag_noisy": 1.0, "very_noisy": 2.5}.get(model, 0.0)
    script = draft(
        random, "parking", pick(random, i, ("open", "dense", "polygons")), model, 0.02, steps=76
    )
    script.plant |= {"lag": 0.3, "dead_time": 0.15} if model == "lag_noisy" else {}
    script.plant |= {"turning_point": (0.05, 0.02)} if model == "turning" else {}
    script.problem |= {"du_max": [0.6, 2.0]} if i % 4 == 3 else {}
    script.noise = tuple(noise * n for n in ROBOT_NOISE)
    away, bearing, turn = (
        random.uniform(0.0, 0.25),
        random.uniform(-np.pi, np.pi),
        random.uniform(-1.0, 1.0),
    )
    goal = script.events[0]["goal"]
    script.start = np.array(goal) + (away * np.cos(bearing), away * np.sin(bearing), turn)
    # carried a little, by a hair more than it is left for, and away
    script.kicks = {40: (0.012, 0.009, 0.02), 50: (0.0, 0.017, -0.03), 58: (0.06, 0.0, 0.0)}
    return script


def carried(random: Random, i: int) -> Script:
    script = draft(
        random,
        "carried",
        pick(random, i),
        ("slip", "noisy", "lag")[i % 3],
        0.03,
        steps=56,
        turns=(0, 1, -3)[i % 3],
    )
    script.kicks = {
        10: (0.0, 0.09, 0.0),
        20: (0.12, -0.1, 0.4),
        30: (-0.3, 0.45, -1.3),
        42: (0.0, 0.0, 2.5),
    }
    script.poses = {15: [0.9, float("nan"), float("nan")]}
    return script


def unreachable(random: Random, i: int) -> Script:
    script = draft(
        random,
        "unreachable",
        pick(random, i, ("open", "polygons", "moving", "rooms")),
        "slip",
        0.03,
        steps=50,
    )
    goal, table = script.events[0]["goal"], script.events[0]["obstacles"]
    middle = goal if i % 2 else script.start.tolist()
    angles = np.arange(8) * np.pi / 4
    ring = [
        [middle[0] + 0.5 * np.cos(a), middle[1] + 0.5 * np.sin(a), 0.12, 0.0, 0.0] for a in angles
    ]
    if i % 3 == 2:
        ring = [[goal[0] + 0.1, goal[1], 0.2, 0.0, 0.0]]
    before = dict(table)
    table["circles"] = [*before["circles"], *ring]
    return script.at(30, obstacles=before)


def chased(random: Random, i: int) -> Script:
    family = pick(random, i, ("open", "polygons", "moving", "walls"))
    script = draft(random, "chased", family, ("slip", "lag", "calm")[i % 3], 0.02, steps=64)
    script.plant |= {"lag": 0.3, "dead_time": 0.15} if i % 3 == 1 else {}
    if i % 2:
        script.start = np.array(script.events[0]["goal"]) + (0.02, -0.01, 0.1)
    for _ in range(1 + i % 3):
        bearing, speed, aside = (
            random.uniform(-np.pi, np.pi),
            random.uniform(0.15, 0.4),
            random.uniform(-0.15, 0.15),
        )
        along = np.array([np.cos(bearing), np.sin(bearing)])
        place = script.start[:2] - random.uniform(1.0, 1.6) * along + aside * along[::-1]
        script.events[0]["obstacles"]["circles"].append(
            [*place.tolist(), 0.15, *(speed * along).tolist()]
        )
    return script


def swapped(random: Random, i: int) -> Script:
    script = draft(random, "model swapped, reset", pick(random, i), "slip", 0.1, steps=44)
    return script.at(12, update_model="calm").at(20, reset=True).at(30, update_model="turning")


def held(random: Random, i: int) -> Script:
    script = draft(
        random, "held", pick(random, i), ("slip", "lag", "noisy", "skid")[i % 4], 0.03, steps=64
    )
    script.plant |= {"lag": 0.3, "dead_time": 0.15} if i % 4 == 1 else {}
    script.plant |= {"turn_gain": 0.5} if i % 4 == 3 else {}
    script.blocked = range(14, 14 + (12, 30, 20, 40)[i % 4])
    return script
