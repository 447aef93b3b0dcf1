"""`kmpc run --rehearse`: the first drive with a model, at half speed, beside the nominal robot.

While the robot drives, what the model and what the nominal robot predict is compared with its
motion. A model that does not predict better stops the robot. The result lies beside the model, and
the next run needs no rehearsal.
"""

from __future__ import annotations

import hashlib
import json
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from firmware_bridge.messages import ConfigError, State
from firmware_bridge.recording.recorder import RowSampler, Tick
from firmware_bridge.robot_file import Robot
from firmware_bridge.safety.gate import GateOutput
from firmware_bridge.safety.gate_table import GateState
from kmpc_lite.reading import open_regular

if TYPE_CHECKING:
    import kmpc_lite as kl
    from kmpc_lite.learn.evaluation import Comparison

HALF = 0.5  # share of the limits at which a rehearsal is driven
EVERY, LONGEST = 1.0, 40.0
"""How often predictions are compared, and length of driving after which a model must have shown
that it predicts better [s]."""
MAX_MODEL, MAX_RECORD = 2**27, 2**16
"""Largest model, and largest record of a rehearsal, that are read [bytes]."""
PASSED = ("BETTER", "ALIKE")


def record_file(model: str) -> Path:
    """Where the result of a rehearsal lies."""
    return Path(f"{model}.rehearsal.json")


def _read(file: Path, most: int) -> bytes:
    try:
        with closing(open_regular(file, most)) as opened:
            return bytes(opened.read())
    except (OSError, ValueError) as error:
        raise ConfigError(f"{file}: {getattr(error, 'strerror', None) or error}") from error


def _digest(model: str) -> str:
    return hashlib.sha256(_read(Path(model), MAX_MODEL)).hexdigest()


def known_rehearsal(robot: Robot) -> tuple[bool, str] | None:
    """Whether the robot's model has passed on this vehicle, and what was found; None: unknown.

    Raises ConfigError for a record that is none.
    """
    from kmpc_lite.learn.learning import differences

    model = robot.control.model
    if model is None or not (file := record_file(model)).exists():
        return None
    try:
        said = json.loads(_read(file, MAX_RECORD))
        digest, vehicle, verdict = said["model"], dict(said["vehicle"]), str(said["verdict"])
        text = str(said["text"])
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        if isinstance(error, ConfigError):
            raise
        raise ConfigError(
            f"{file}: no record of a rehearsal ({error}); remove it and rehearse again"
        ) from error
    if digest != _digest(model) or differences(vehicle, robot.vehicle):
        return None
    return verdict in PASSED, text


def at_half_speed(robot: Robot) -> Robot:
    """The robot with half its speeds."""
    limits = robot.gate.limits
    slow = {name: HALF * getattr(limits, name) for name in ("v_max", "v_reverse", "omega_max")}
    return replace(robot, gate=replace(robot.gate, limits=replace(limits, **slow)))


def advice(robot: Robot, rehearse: bool) -> tuple[bool, tuple[str, ...]]:
    """Whether the next drive is a rehearsal, as the user asked or not, and what he should know.

    Raises ConfigError for a model that has failed its rehearsal, unless it is rehearsed again, or
    trusted; and if there is no model to rehearse.
    """
    model = robot.control.model
    if model is None:
        if rehearse:
            raise ConfigError("--rehearse: goes with a learned model: give --model FILE")
        return False, ()
    known = known_rehearsal(robot)
    if known is None:
        beside = "at half speed, beside the nominal robot"
        new = (
            f"rehearsal {beside}" if rehearse else f"not rehearsed yet: --rehearse drives {beside}"
        )
        return rehearse, (f"{model}: {new}",)
    passed, text = known
    if passed:
        note = f"{model}: rehearsed before, drives at full speed: {text}"
        return False, (note,) if rehearse else ()
    if rehearse:
        return True, (f"{model}: rehearsed again, at half speed; before: {text}",)
    if robot.control.trust_model:
        return False, (f"{model}: failed its rehearsal, used nevertheless: {text}",)
    raise ConfigError(
        f"{model}: failed its rehearsal: {text}. Learn anew, or --rehearse again; "
        "--trust-model uses it nevertheless"
    )


class Rehearsal:
    """An observer of the loop that compares predictions with the motion, and remembers the result.

    Rows are taken in the loop's thread and compared in the planner's.

    `robot`: what is driven, with what model. `model`: what was learned, as it is in the file.
    """

    def __init__(self, robot: Robot, model: kl.KoopmanModel) -> None:
        self._robot, self._model, self._sampler = robot, model, RowSampler(model.dt)
        self._rows: list[tuple[float, ...]] = []
        self._compared = 0
        self.result: Comparison | None = None  # what the comparison says so far
        self.trouble = ""  # why the robot must be stopped, in words

    def on_tick(
        self, now: float, state: State | None, output: GateOutput, sent: bool, fresh: bool
    ) -> None:
        """Take in one tick of the loop."""
        driven = output.state in (GateState.ACTIVE, GateState.STOPPING)
        command = output.speeds if sent else None
        self._rows += self._sampler.take(Tick(now, state, command, driven, fresh))

    def saw(self, *_: object) -> None:
        """Compare once a second; receives each plan."""
        if not self.trouble and (len(self._rows) - self._compared) * self._model.dt >= EVERY:
            self._compare()

    def _compare(self) -> None:
        from kmpc_lite.learn.evaluation import ModelVerdict, compare

        self._compared = len(rows := self._rows[:])
        if self.result is not None and self.result.verdict is ModelVerdict.BETTER:
            return  # shown once, beyond noise
        self.result = compare(self._model, _episodes(rows, self._model.dt))
        long, verdict = len(rows) * self._model.dt >= LONGEST, self.result.verdict
        if verdict is ModelVerdict.WORSE or (long and verdict.name not in PASSED):
            self.trouble = f"rehearsal: {self.result}"

    def finish(self) -> dict[str, Any]:
        """Compare a last time and remember the result; give it as plain values."""
        from kmpc_lite.files import write_whole
        from kmpc_lite.learn.evaluation import FEWEST, HORIZON, ModelVerdict

        if not self.trouble:
            self._compare()
        result, short = self.result, ModelVerdict.SHORT
        if result is None or result.verdict is short:
            again = f"rehearse again, moving for {FEWEST * HORIZON:g} s"
            return {"verdict": short.name, "text": f"the model {short.value}: {again}"}
        told = {**result.as_dict(), "text": str(result)}
        if result.verdict is ModelVerdict.UNSURE and not self.trouble:
            told["text"] += ": rehearse again, for longer"
            return told
        file = str(self._robot.control.model)
        record = {"model": _digest(file), "vehicle": self._robot.vehicle, **told}
        with write_whole(record_file(file)) as out:
            out.write(json.dumps(record, indent=1).encode())
        return told


def _episodes(rows: list[tuple[float, ...]], dt: float) -> list[kl.Episode]:
    """Stretches of rows without a gap."""
    import numpy as np

    import kmpc_lite as kl

    table = np.array(rows).reshape(len(rows), -1)
    parts = np.split(table, np.flatnonzero(np.diff(table[:, :1].ravel()) > 1.5 * dt) + 1)
    return [kl.Episode(p[:, 1:4], p[:-1, 4:6], dt) for p in parts if len(p) > 1]
