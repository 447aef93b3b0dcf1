"""Recorded drives of every kind of robot, floor and option."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from golden_scripts import ROBOT_NOISE, Random, Script, draft, in_sim, pick


def plain(random: Random, i: int) -> Script:
    slip = (0.0, 0.05, 0.2, 0.02)[i % 4]
    return draft(
        random, "plain", pick(random, i), ("slip", "nominal", "slip", "calm")[i % 4], slip, steps=64
    )


def lagging(random: Random, i: int) -> Script:
    noisy, old = i % 3 > 0, 0.1 * (i % 3 == 2)
    more = {
        "plant": {"lag": 0.3, "dead_time": 0.15},
        "noise": ROBOT_NOISE if noisy else (0.0,) * 3,
        "pose_age": old,
    }
    script = draft(
        random, "lag", pick(random, i), "lag_noisy" if noisy else "lag", 0.02, steps=64, **more
    )
    script.options = {"pose_age": old} if old else {}
    return script


def noisy(random: Random, i: int) -> Script:
    age = (0.0, 0.1, 0.25)[i % 3]
    noise = tuple((1.0, 2.5)[i % 2] * n for n in ROBOT_NOISE)
    script = draft(
        random,
        "noise",
        pick(random, i),
        ("noisy", "very_noisy")[i % 2],
        0.03,
        noise=noise,
        pose_age=age,
    )
    return replace(script, options={"pose_age": age} if age else {})


def turning(random: Random, i: int) -> Script:
    model, point = (("turning", (0.05, 0.02)), ("turning_back", (-0.04, 0.0)))[i % 2]
    return draft(
        random, "turning point", pick(random, i), model, 0.03, plant={"turning_point": point}
    )


def rates(random: Random, i: int) -> Script:
    problem = {
        "du_max": ([0.5, 1.5], [0.3, 4.0], [1.0, np.inf])[i % 3],
        "deceleration": ([1.0, 4.0], [0.6, 2.0])[i % 2],
    }
    lag = {"lag": 0.3, "dead_time": 0.15} if i % 4 == 3 else {}
    return draft(
        random,
        "du_max",
        pick(random, i),
        "lag" if lag else "slip",
        0.02,
        problem=problem,
        plant=lag,
    )


def paper(random: Random, i: int) -> Script:
    options = {"guidance": False, "tightening": None}
    if i % 5 == 3:
        options = {"guidance": False}
    elif i % 5 == 4:
        options = {"tightening": None}
    family = pick(random, i, ("open", "moving", "dense", "polygons", "walls", "rooms"))
    return draft(
        random,
        f"paper {options}",
        family,
        ("paper", "nominal", "slip")[i % 3],
        0.03,
        options=options,
        steps=50,
    )


def floors(random: Random, i: int) -> Script:
    floor = in_sim("Floor")
    changes = (
        (floor(1.0, 0.2),),
        (floor(1.0, 0.0, 0.6),),
        (floor(1.0, 0.2, 0.6),),
        (floor(0.8, 0.3), floor(4.0, 0.01)),
    )[i % 4]
    options = {"adaptation": False} if i % 4 == 1 and i > 4 else {}
    lag = {"lag": 0.3, "dead_time": 0.15} if i % 5 == 4 else {}
    noise = ROBOT_NOISE if i % 3 == 1 else (0.0,) * 3
    model = "lag_noisy" if lag else ("slip", "calm", "noisy")[i % 3]
    more = {"plant": {"floors": changes, **lag}, "options": options, "noise": noise, "steps": 80}
    return draft(random, "floor changes", pick(random, i), model, 0.02, **more)


def converged(random: Random, i: int) -> Script:
    options = {"sqp_iterations": (3, 20, 50, 2)[i % 4], "guidance": i % 2 == 0}
    family = pick(random, i, ("open", "polygons", "dense", "moving"))
    model = ("slip", "paper", "lag")[i % 3]
    return draft(random, "passes", family, model, 0.02, options=options, steps=14)


def asymmetric(random: Random, i: int) -> Script:
    bounds = (
        {"u_min": [0.0, -0.8], "u_max": [0.6, 0.8]},
        {"u_min": [-0.1, -0.5], "u_max": [0.5, 1.0]},
        {"u_min": [-0.6, -0.3], "u_max": [0.2, 1.2]},
        {"u_min": [-0.3, 0.0], "u_max": [0.6, 1.0]},
    )[i % 4]
    return draft(
        random, "bounds", pick(random, i), ("slip", "skid")[i % 2], 0.02, problem=bounds, steps=56
    )


def other_numbers(random: Random, i: int) -> Script:
    problem, options, model = (
        ({"horizon": 10}, {}, "slip"),
        ({"horizon": 30, "margin": 0.05}, {}, "slip"),
        ({"dt": 0.05, "horizon": 25}, {}, "fast"),
        (
            {"Q": [2.0, 2.0, 0.5], "Q_terminal": [10.0, 10.0, 1.0], "R": [[0.5, 0.1], [0.1, 0.2]]},
            {"guidance": False},
            "slip",
        ),
        ({"slack_weights": [20.0, 200.0], "robot_radius": 0.1}, {"obstacle_slots": 2}, "calm"),
        ({}, {"risk": 0.2}, "slip"),
        ({}, {"risk": 0.001}, "lag"),
        ({"robot_radius": 0.2, "deceleration": [0.5, 1.5]}, {"obstacle_slots": 9}, "skid"),
        ({"x_min": [-1.2, -2.0, -np.inf], "x_max": [2.0, 1.2, np.inf]}, {}, "slip"),
    )[i % 9]
    script = draft(
        random,
        "other numbers",
        pick(random, i + i // 9),
        model,
        0.03,
        problem=problem,
        options=options,
        steps=50,
    )
    script.plant |= {"lag": 0.3, "dead_time": 0.15} if model == "lag" else {}
    return script
