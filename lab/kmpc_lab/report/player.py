"""What a page plays: the instants of a drive as JSON and packed numbers, in bounded size."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Iterable, Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from firmware_bridge.recording.drive.seen import CORNERS, STEP, hits, outline
from kmpc_lab.report.moments import STATUS_WORDS, Moments, moments, outcome_title, path_times
from kmpc_lab.report.picture import rectangles, view_of
from kmpc_lab.report.runs import limits, trace_of
from kmpc_lab.sim.closed_loop import Run
from kmpc_lite.control.world.occupancy import OccupancyGrid
from kmpc_lite.control.world.outlines import corners_of
from kmpc_lite.control.world.shapes import Wall
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.types import Array

FILES = Path(__file__).parent / "page_files"
SCRIPTS = ("data.js", "sight.js", "map.js", "charts.js", "player.js")
MOST_MOMENTS = 3000  # instants that a page plays: of a longer drive every so manieth
STAGES, PATH_POINTS = 11, 60  # places of a plan and points of a path that are shown at the most
BUDGET = 900_000  # characters that all of it may take; with less of the instants it takes less
MOST_BOXES = 3000  # rectangles of a grid that are shown
FEWEST = 50
MOST_PLACES = 1500  # places of a drive that is shown beside another


def player_data(run: Run, u_min: Any, u_max: Any, beside: Mapping[str, Run]) -> str:
    """Give what a page plays as JSON that can stand in a script element.

    `beside` are other drives on the same map, by name: they are shown at the same time.
    """
    others = [_other(name, drive) for name, drive in beside.items()]
    now = moments(run)
    count = len(now.details.times)
    stride = max(1, -(-count // MOST_MOMENTS))
    while True:
        shown = np.arange(0, count, stride)
        table = {**_table(run, now, shown, u_min, u_max), "beside": others}
        text = _safe(json.dumps(table, separators=(",", ":")))
        if len(text) <= BUDGET or len(shown) <= FEWEST:
            return text
        stride *= 2


def script() -> tuple[str, str]:
    """Give the page's script, and the hash by which a browser knows that it is ours."""
    parts = [(FILES / name).read_text(encoding="utf-8") for name in SCRIPTS]
    text = "\n(function () {\n'use strict';\n" + "\n".join(parts) + "})();\n"
    return text, "sha256-" + b64encode(sha256(text.encode()).digest()).decode()


def _safe(text: str) -> str:
    """JSON in which nothing can end a script element."""
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return text


def _table(run: Run, now: Moments, shown: Array, u_min: Any, u_max: Any) -> dict[str, Any]:
    details, gates = now.details, [state for _, state, _ in now.details.gates]
    near = np.unique(np.linspace(0, details.plans.shape[1] - 1, STAGES).astype(int))
    plans = details.plans[np.ix_(shown, near)]
    reasons = _numbered(details.reasons[k] for k in shown)
    why = [", ".join(reasons) for _, _, reasons in details.gates]
    low, high = limits(run, u_min, u_max)
    return {
        "map": _map(run),
        "every": int(shown[1] - shown[0]) if len(shown) > 1 else 1,
        "dt": run.dt,
        "time": _packed(details.times[shown], "f4"),
        "pose": _packed(now.poses[shown], "f4"),
        "plan": _places(plans[..., :2]),
        "stages": plans.shape[1],
        "margin": _packed(np.clip(details.margins[np.ix_(shown, near)], 0.0, 60.0), "f4"),
        "paths": [_thin(path, PATH_POINTS) for path in details.paths],
        "pathOf": _packed(details.path_of[shown], "i4"),
        "circles": _ragged([details.circles[k] for k in _used(details.circles_of[shown])]),
        "circlesOf": _packed(_renumbered(details.circles_of[shown]), "i4"),
        "scans": _scans(now, shown, run.scenario.options.sight.memory),
        "status": [details.statuses[k] for k in shown],
        "statusWords": STATUS_WORDS,
        "progress": [details.progress[k] for k in shown],
        "reason": reasons[0],
        "reasonOf": _packed(reasons[1], "i4"),
        "gates": [
            f"{state.lower()}: {w}" if w else state.lower()
            for state, w in zip(gates, why, strict=True)
        ],
        "gateOf": _packed(now.gate[shown], "i4"),
        "series": _series(now, shown, low, high, run.dt),
        "end": float(details.times[-1]),
    }


def _other(name: str, drive: Run) -> dict[str, Any]:
    """Where another drive was, and when; its time begins with the page's."""
    times = path_times(drive)
    shown = np.unique(np.linspace(0, len(times) - 1, MOST_PLACES).astype(int))
    return {
        "name": name,
        "ended": outcome_title(drive),
        "time": _packed(times[shown], "f4"),
        "pose": _packed(drive.path[shown], "f4"),
    }


def _map(run: Run) -> dict[str, Any]:
    """What stays: in metres."""
    scenario = run.scenario
    outlines: list[Any] = []
    walls: list[Any] = []
    boxes: list[Any] = []
    for solid in () if scenario.solids is None else scenario.solids.solids:
        if isinstance(solid, Wall):
            walls.append([*np.round(corners_of(solid).ravel(), 4).tolist(), solid.thickness])
        elif isinstance(solid, OccupancyGrid):
            boxes += np.round(rectangles(solid)[:MOST_BOXES], 3).reshape(-1, 8).tolist()
        else:
            outlines.append(np.round(corners_of(solid), 4).tolist())
    return {
        "view": np.round(view_of([trace_of(run)]), 3).ravel().tolist(),
        "bounds": list(scenario.bounds),
        "radius": scenario.radius,
        **_body(scenario),
        "start": list(scenario.start),
        "goal": list(scenario.goal),
        "tolerance": scenario.tolerance,
        "known": [[c.x, c.y, c.radius] for c in scenario.circles if not (c.vx or c.vy)],
        "outlines": outlines,
        "walls": walls,
        "boxes": boxes,
    }


def _body(scenario: Scenario) -> dict[str, Any]:
    """The robot: its outline where it is not round, how far it reaches ahead and aside [m]."""
    footprint = scenario.footprint
    if footprint is None:
        return {"outline": None, "front": scenario.radius, "aside": scenario.radius}
    outline = np.round(footprint.outline, 4)
    return {
        "outline": outline.tolist(),
        "front": float(outline[:, 0].max()),
        "aside": footprint.half_width,
    }


def _series(now: Moments, shown: Array, low: Any, high: Any, dt: float) -> list[dict[str, Any]]:
    """Charts: title, unit, lines by their names, and limits."""
    details = now.details
    bounds = (
        [[], []]
        if low is None or high is None
        else [[float(low[k]), float(high[k])] for k in (0, 1)]
    )
    charts = [
        (
            "Forward speed",
            "m/s",
            {"planned": details.commands[:, 0], "sent": now.sent[:, 0]},
            bounds[0],
        ),
        (
            "Turn rate",
            "rad/s",
            {"planned": details.commands[:, 1], "sent": now.sent[:, 1]},
            bounds[1],
        ),
        ("Clearance", "m", {"robot": now.gaps, "plan's smallest": details.clearances}, [0.0]),
        ("Distance to the goal", "m", {"distance": now.distance}, []),
        ("Heading error", "rad", {"error": now.turn}, []),
        ("Step time", "ms", {"step": 1e3 * details.step_times}, [1e3 * dt]),
        ("Age of the pose", "ms", {"age": 1e3 * details.pose_ages}, []),
    ]
    return [
        {
            "title": title,
            "unit": unit,
            "limits": lines,
            "lines": {
                name: _packed(values[shown], "f4")
                for name, values in parts.items()
                if np.isfinite(values).any()
            },
        }
        for title, unit, parts, lines in charts
        if any(np.isfinite(values).any() for values in parts.values())
    ]


def _packed(values: Array, kind: str) -> dict[str, str]:
    """Numbers as bytes, which a script reads at once."""
    return {
        "kind": kind,
        "data": b64encode(np.ascontiguousarray(values, dtype=f"<{kind}").tobytes()).decode(),
    }


def _places(points: Array) -> dict[str, Any]:
    """Places to the millimetre where the map is no larger than 60 m, else less exact."""
    flat = np.nan_to_num(points.reshape(-1, 2))
    low, high = flat.min(axis=0, initial=0.0), flat.max(axis=0, initial=0.0)
    middle = (low + high) / 2
    step = max(float((high - low).max()) / 60_000, 0.001)
    told = np.round((flat - middle) / step).astype(np.int16)
    return {**_packed(told, "i2"), "step": step, "middle": middle.tolist()}


def _ragged(parts: list[Array]) -> dict[str, Any]:
    """Rows x, y, radius of sets of circles, or x, y of hits, one set after the other."""
    width = min(parts[0].shape[1], 3) if parts else 3
    rows = [part[:, :width] for part in parts]
    ends = np.cumsum([0, *(len(part) for part in rows)])
    flat = np.concatenate([np.empty((0, width)), *rows])
    return {"width": width, "ends": _packed(ends, "i4"), "rows": _packed(flat, "f4")}


def _scans(now: Moments, shown: Array, memory: float) -> dict[str, Any]:
    """Newest scan at each instant: its hits, what it saw to be free, and how long that counts."""
    scans = now.details.scans
    if not scans:
        return {}
    times = np.array([time for time, _ in scans])
    newest = np.searchsorted(times, now.details.times[shown] + 1e-6, side="right") - 1
    chosen = [scans[k][1] for k in _used(newest)]
    corners = np.array([outline(scan) for scan in chosen]).reshape(-1, CORNERS + 1, 2)
    told = np.clip(np.round(corners / STEP), -32_767, 32_767)
    return {
        **_ragged([hits(scan) for scan in chosen]),
        "of": _packed(_renumbered(newest), "i4"),
        "outline": {**_packed(told, "i2"), "step": STEP},
        "corners": CORNERS + 1,
        "memory": memory,
    }


def _used(numbers: Array) -> list[int]:
    return [int(k) for k in np.unique(numbers) if k >= 0]


def _renumbered(numbers: Array) -> Array:
    """Numbers among those that are used; -1 stays."""
    used = np.array(_used(numbers), dtype=int)
    found: Array = np.where(numbers >= 0, np.searchsorted(used, numbers), -1)
    return found


def _numbered(texts: Iterable[str]) -> tuple[list[str], Array]:
    """Texts, each once, and which is where."""
    known: dict[str, int] = {}
    places = np.array([known.setdefault(text, len(known)) for text in texts])
    return list(known), places


def _thin(points: Array, most: int) -> list[list[float]]:
    """Points of a line, its ends among them."""
    if len(points) > most:
        points = points[np.unique(np.linspace(0, len(points) - 1, most).astype(int))]
    out: list[list[float]] = np.round(points.astype(float), 3).tolist()
    return out
