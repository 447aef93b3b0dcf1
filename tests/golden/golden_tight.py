"""Recorded drives with no room to spare: beside obstacles, at the edge of what is believed."""

from __future__ import annotations

import numpy as np
from golden_scripts import ROBOT_NOISE, Random, Script, draft, in_sim, pick

LAG = {"lag": 0.3, "dead_time": 0.15}


def braked_often(random: Random, i: int) -> Script:
    """The solver fails every few steps, so that the way to a stop of the plan before is driven."""
    families = ("narrow", "dense", "moving", "walls", "corridor", "polygons", "rooms")
    model = ("lag", "slip", "lag_noisy", "skid")[i % 4]
    problem = {"du_max": [0.8, 3.0]} if i % 5 == 4 else {}
    script = draft(random, "braked often", pick(random, i, families), model, 0.02, problem=problem)
    script.plant |= LAG if model.startswith("lag") else {}
    script.noise = ROBOT_NOISE if model == "lag_noisy" else (0.0,) * 3
    k = 4
    while k < 50:
        length = int(random.integers(1, 6))
        for late in range(length):
            script.at(k + late, qp=["failed", 0])
        k += length + int(random.integers(2, 6))
    script.steps = 54
    return script


def squeezed(random: Random, i: int) -> Script:
    """Begin beside an obstacle, or a little inside it."""
    model = ("slip", "lag", "nominal", "noisy", "turning")[i % 5]
    script = draft(random, "squeezed", pick(random, i, ("open", "moving", "polygons")), model, 0.03)
    script.plant |= LAG if model == "lag" else {}
    script.plant |= {"turning_point": (0.05, 0.02)} if model == "turning" else {}
    circles = script.events[0]["obstacles"]["circles"]
    for gap in (-0.015, 0.0, 0.004, 0.012, 0.03)[i % 5 :][:2]:
        bearing = script.start[2] + random.uniform(-2.0, 2.0)
        away = 0.15 + 0.18 + gap
        middle = script.start[:2] + away * np.array([np.cos(bearing), np.sin(bearing)])
        drift = random.uniform(-0.05, 0.05, 2) if i % 3 == 2 else np.zeros(2)
        circles.append([*middle.tolist(), 0.18, *drift.tolist()])
    for k in (9, 10, 17, 26, 27, 28):
        script.at(k, qp=["failed", 0])
    script.steps = 40
    return script


def surrounded(random: Random, i: int) -> Script:
    """Circles come from several sides at once."""
    family = pick(random, i, ("open", "walls", "moving"))
    script = draft(random, "surrounded", family, ("slip", "lag")[i % 2], 0.02, steps=50)
    script.plant |= LAG if i % 2 else {}
    bearing = random.uniform(-np.pi, np.pi)
    for side in range(3 + i % 2):
        bearing += 2 * np.pi / (3 + i % 2) + random.uniform(-0.3, 0.3)
        along = np.array([np.cos(bearing), np.sin(bearing)])
        speed = random.uniform(0.1, 0.3)
        place = script.start[:2] - (speed * random.uniform(1.5, 4.0) + 0.4) * along
        row = [*place.tolist(), 0.15 + 0.02 * side, *(speed * along).tolist()]
        script.events[0]["obstacles"]["circles"].append(row)
    return script


def fast(random: Random, i: int) -> Script:
    """Above the speeds that the margins were made for."""
    problem = {"u_min": [-1.0, -1.5], "u_max": [1.0, 1.5]}
    family = pick(random, i, ("dense", "narrow", "corridor", "rooms"))
    return draft(random, "fast", family, ("calm", "slip")[i % 2], 0.01, problem=problem, steps=40)


def displaced(random: Random, i: int) -> Script:
    """Carried by just about as much as a plan, a way and a stand at the goal bear."""
    script = draft(random, "displaced", pick(random, i), ("slip", "noisy")[i % 2], 0.02, steps=56)
    for k, sizes in ((10, (0.45, 0.62)), (22, (0.04, 0.2)), (34, (0.08, 0.2))):
        size, bearing = random.uniform(*sizes), random.uniform(-np.pi, np.pi)
        script.kicks[k] = (size * np.cos(bearing), size * np.sin(bearing), 0.0)
    script.kicks |= {16: (0.0, 0.0, 1.1), 28: (0.0, 0.0, -0.9), 44: (0.52, 0.0, 0.0)}
    # single poses that are wrong by as much as is still believed
    for k in (13, 19, 25, 31, 40, 48):
        script.poses[k] = [float("nan"), float("nan"), float(random.uniform(-3.0, 3.0))]
    return script


def strange_floors(random: Random, i: int) -> Script:
    """Floors at the limits of what is adapted to, and wear that is seen in minutes only."""
    floor = in_sim("Floor")
    changes = (
        (floor(1.0, 0.0, 0.1),),
        (floor(1.0, 0.0, 3.4),),
        (floor(1.0, 1.5, 1.0),),
        tuple(floor(1.0 + 2.0 * k, 0.01, 1.0 - 0.012 * k) for k in range(15)),
        (floor(1.0, 0.02, 0.85),),
        (floor(1.0, 0.08, 1.0),),
    )[i % 6]
    noise = ROBOT_NOISE if i % 2 else (0.0,) * 3
    script = draft(random, "strange floors", "open", "noisy" if i % 2 else "calm", 0.01)
    script.plant["floors"], script.noise = changes, noise
    script.steps = 340 if i % 6 == 3 else 110
    for k in range(25, script.steps, 25):
        script.at(k, goal=random.uniform(-1.6, 1.6, 3).tolist())
    return script
