"""Record golden drives: what this commit's controller answers, for later ones to compare with."""

from __future__ import annotations

import argparse
import platform
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from golden_file import CODES, COLUMNS, FILE, Drive, first_difference, load, rounded, save
from golden_kinds import scripts
from golden_scripts import Script, in_sim, learn_models
from golden_session import Session, measure, replay

import kmpc_lite as kl

SUBSAMPLES = 4
PARKED = 6
"""Steps at rest at the goal after which a drive ends."""
GIVEN = 2.0**20
"""Poses are given as multiples of its inverse, 1 um: they compress better."""

ROUNDING = ((1e-15, 1), (1e-15, 2), (1e-14, 3))
"""Sizes [m, rad] and seeds of what poses are changed by to see what hangs on rounding."""
SHORTEST = 8
"""A drive that bears it for fewer steps is left out."""


def environment() -> dict[str, str]:
    """What rounding depends on."""
    import osqp
    import scipy

    found = {
        "python": platform.python_version(),
        "machine": platform.machine(),
        "kmpc_lite": kl.__version__,
    }
    return {**found, "numpy": np.__version__, "scipy": scipy.__version__, "osqp": osqp.__version__}


class Robot:
    """The plant of a script: where it is, and what is measured of it."""

    def __init__(self, script: Script, number: int, dt: float) -> None:
        plant = {"lag": 0.0, "dead_time": 0.0, **script.plant}
        self._plant, self._dt = in_sim("LaggingDrive")(**plant), dt
        self._script, self._random = script, np.random.default_rng([number, 7])
        self.pose, self.command = script.start.copy(), np.zeros(2)
        self._path = [self.pose]

    def measure(self, k: int) -> np.ndarray:
        """The pose (3,) that arrives at step k."""
        script = self._script
        if k in script.kicks:
            self.pose = self.pose + script.kicks[k]
            self._path[-1] = self.pose
        place = max(SUBSAMPLES * (k - script.pose_age / self._dt), 0.0)
        before, after = self._path[int(place)], self._path[min(int(place) + 1, len(self._path) - 1)]
        pose = (
            before + (place % 1.0) * (after - before) + self._random.normal(size=3) * script.noise
        )
        if k in script.poses:
            given = np.array(script.poses[k])
            # a single number given stands for a pose that has jumped
            pose = np.where(np.isnan(given) & ~np.isnan(given).all(), pose, given)
        pose = np.round(pose * GIVEN) / GIVEN
        pose[2] += 2 * np.pi * script.turns
        return pose

    def drive(self, k: int, wanted: np.ndarray) -> None:
        """Let a period pass."""
        script, command = self._script, wanted
        if script.gate is not None:
            reach = np.array(script.gate) * self._dt
            command = self.command + np.clip(wanted - self.command, -reach, reach)
        if k in script.pilot:
            known = np.array(script.pilot[k])
            command = np.array([0.1, 0.4]) if np.isnan(known).any() else known
        command = np.round(command * GIVEN) / GIVEN
        trace = self._plant.trace(self.pose, command, self._dt, SUBSAMPLES)
        if k in script.blocked:
            trace = np.tile(self.pose, (SUBSAMPLES, 1))
        self._path.extend(trace)
        self.pose, self.command = trace[-1], command

    def sent(self, k: int) -> np.ndarray | None:
        """What is told of the period before step k; none where nothing is."""
        if self._script.gate is None or k == 0:
            return None
        unknown = k - 1 in self._script.pilot and np.isnan(self._script.pilot[k - 1]).any()
        return np.full(2, np.nan) if unknown else self.command


def record(number: int, script: Script, names: list[str], models: list[kl.KoopmanModel]) -> Drive:
    """Drive a script in closed loop."""
    events: dict[int, dict[str, Any]] = {}
    for event in script.events:
        if "update_model" in event:
            event["update_model"] = names.index(event["update_model"])
        events.setdefault(event["step"], {}).update(event)
    setup = {
        "kind": script.kind,
        "model": names.index(script.model),
        "problem": script.problem,
        "options": script.options,
    }
    setup["events"] = list(events.values())
    session = Session(setup, models)
    robot = Robot(script, number, script.problem.get("dt", 0.1))
    rows: list[tuple[Any, ...]] = []
    parked = 0
    with session.faults.installed(session.faulty):
        for k in range(script.steps):
            if k in script.hooks:
                event = {"step": k, **script.hooks[k](robot.pose)}
                setup["events"].append(event)
                session.add(event)
            pose, sent = robot.measure(k), robot.sent(k)
            now = float(k) if script.ticking else 0.0
            plan = session.step(k, pose.copy(), sent, now)
            values, codes = measure(plan)
            rows.append(
                (pose, np.full(2, np.inf) if sent is None else sent, now, rounded(values), codes)
            )
            robot.drive(k, plan.command.copy())
            session.spoil(k, plan)
            parked = parked + 1 if plan.holding else 0
            # a mishap that is still to come is waited for
            if parked >= PARKED and k >= max(
                [e["step"] for e in setup["events"]] + list(script.kicks) + list(script.poses)
            ):
                break
    poses, sents, clock, values, codes = (np.array(column) for column in zip(*rows, strict=True))
    return Drive(
        number,
        setup,
        poses,
        sents,
        clock,
        values.reshape(-1, len(COLUMNS)),
        codes.astype(np.uint8).reshape(-1, len(CODES)),
    )


def answered(drive: Drive, models: list[kl.KoopmanModel]) -> Drive:
    """The same drive with what is answered now."""
    values, codes = replay(drive, models)
    return replace(drive, values=rounded(values), codes=codes)


def steady(drive: Drive, models: list[kl.KoopmanModel]) -> Drive | None:
    """Cut a drive before the first step that hangs on rounding; none where little is left."""
    length = len(drive.poses)
    for size, seed in ROUNDING:
        moved = replace(
            drive,
            poses=drive.poses + size * np.random.default_rng(seed).normal(size=drive.poses.shape),
        )
        difference = first_difference(drive, *replay(moved, models))
        if difference is not None:
            length = min(length, difference[0])
    if length < SHORTEST:
        return None
    parts = {
        name: getattr(drive, name)[:length]
        for name in ("poses", "sent", "clock", "values", "codes")
    }
    return replace(drive, **parts)


def main() -> int:
    """Record."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "-o", "--output", type=Path, default=FILE, help="file to write (default: %(default)s)"
    )
    parser.add_argument(
        "--drives", type=int, default=290, help="about how many (default: %(default)s)"
    )
    parser.add_argument(
        "--seed", type=int, default=10, help="of maps, mishaps and noise (default: %(default)s)"
    )
    parser.add_argument(
        "--answers",
        action="store_true",
        help="keep models, poses and mishaps as they were recorded, and take this commit's answers",
    )
    given = parser.parse_args()
    drives: list[Drive] = []
    if given.answers:
        learned, asked, about = load(given.output)
        found = ((d.setup["kind"], answered(d, learned)) for d in asked)
        given.seed = about["seed"]
    else:
        models = learn_models()
        names, learned = list(models), list(models.values())
        every = scripts(given.drives, given.seed)
        # a drive's number is that of those kept before it
        found = ((s.kind, record(len(drives), s, names, learned)) for s in every)
    for kind, drive in found:
        kept = steady(drive, learned)
        if kept is None:
            sys.stdout.write(f"left out, for it hangs on rounding: {kind}\n")
        else:
            drives.append(kept)
    where = Path(kl.__file__).parent
    commit = subprocess.run(
        ["git", "-C", str(where), "rev-parse", "HEAD"], capture_output=True, text=True, check=False
    )
    save(
        given.output,
        learned,
        drives,
        {"commit": commit.stdout.strip(), "seed": given.seed, **environment()},
    )
    steps = sum(len(d.poses) for d in drives)
    size = given.output.stat().st_size / 1e6
    sys.stdout.write(f"{given.output}: {len(drives)} drives, {steps} steps, {size:.2f} MB\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
