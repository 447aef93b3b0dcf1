"""`kmpc run --rehearse`: the first drive with a model, at half speed, beside the nominal robot.

While the robot drives, what the model and what the nominal robot predict is compared with its
motion. A model that does not predict better stops the robot. The result lies beside the model, and
the next run needs no rehearsal.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, replace
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

HALF = 0.5
"""Share of the limits at which a rehearsal is driven."""
EVERY = 1.0
"""How often the predictions are compared [s]."""
LONGEST = 40.0
"""Length of driving after which a model must have shown that it predicts better [s]."""
MAX_MODEL, MAX_RECORD = 2**27, 2**16
"""Largest model, and largest record of a rehearsal, that are read [bytes]."""
PASSED, FAILED = ("BETTER", "ALIKE"), ("WORSE", "UNSURE")


@dataclass(frozen=True)
class Known:
    """What an earlier rehearsal of this model on this vehicle found."""

    verdict: str
    text: str

    @property
    def passed(self) -> bool:
        """Whether the model may be driven at full speed."""
        return self.verdict in PASSED


def record_file(model: str) -> Path:
    """Where the result of a rehearsal lies."""
    return Path(f"{model}.rehearsal.json")


def known_rehearsal(robot: Robot) -> Known | None:
    """What is known of the robot's model on this vehicle; None if it was never rehearsed.

    Raises
    ------
    ConfigError
        For a record that is none.
    """
    from kmpc_lite.learn.provenance import differences

    model = robot.control.model
    if model is None or not record_file(model).exists():
        return None
    said = _read(record_file(model))
    if said["model"] != _digest(model) or differences(said["vehicle"], robot.vehicle):
        return None
    return Known(said["verdict"], said["text"])


def _read(file: Path) -> dict[str, Any]:
    try:
        with closing(open_regular(file, MAX_RECORD)) as opened:
            said = json.loads(opened.read())
        kinds = {"model": str, "vehicle": Mapping, "verdict": str, "text": str}
        if not all(isinstance(said[name], kind) for name, kind in kinds.items()):
            raise TypeError("expected model, vehicle, verdict and text")
    except OSError as error:
        raise ConfigError(f"{file}: {error.strerror or error}") from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise ConfigError(
            f"{file}: no record of a rehearsal ({error}); remove it and rehearse again"
        ) from error
    return dict(said)


def _digest(model: str) -> str:
    try:
        with closing(open_regular(model, MAX_MODEL)) as file:
            return hashlib.sha256(file.read()).hexdigest()
    except OSError as error:
        raise ConfigError(f"{model}: {error.strerror or error}") from error


def at_half_speed(robot: Robot) -> Robot:
    """The robot with half its speeds."""
    limits = robot.gate.limits
    slow = {name: HALF * getattr(limits, name) for name in ("v_max", "v_reverse", "omega_max")}
    return replace(robot, gate=replace(robot.gate, limits=replace(limits, **slow)))


def advice(robot: Robot, rehearse: bool) -> tuple[bool, tuple[str, ...]]:
    """Whether the next drive is a rehearsal, and what a user should know of it.

    Parameters
    ----------
    robot : Robot
        Whose model it is about.
    rehearse : bool
        Whether the user asked for a rehearsal.

    Raises
    ------
    ConfigError
        For a model that has failed its rehearsal, unless it is rehearsed again, or trusted; and
        if there is no model to rehearse.
    """
    model = robot.control.model
    if model is None:
        if rehearse:
            raise ConfigError("--rehearse: goes with a learned model: give --model FILE")
        return False, ()
    known = known_rehearsal(robot)
    if known is None:
        if rehearse:
            return True, (f"{model}: rehearsal at half speed, beside the nominal robot",)
        return False, (
            f"{model}: not rehearsed on this robot yet: --rehearse drives at half speed, and "
            "compares it with the nominal robot",
        )
    if known.passed:
        note = (f"{model}: rehearsed before, drives at full speed: {known.text}",)
        return False, note if rehearse else ()
    if rehearse:
        return True, (f"{model}: rehearsed again, at half speed; before: {known.text}",)
    if robot.control.trust_model:
        return False, (f"{model}: failed its rehearsal, used nevertheless: {known.text}",)
    raise ConfigError(
        f"{model}: failed its rehearsal: {known.text}. Learn anew, or --rehearse again; "
        "--trust-model uses it nevertheless"
    )


class Rehearsal:
    """An observer of the loop that compares predictions with the motion, and remembers the result.

    Rows are taken in the loop's thread and compared in the planner's.

    Parameters
    ----------
    robot : Robot
        What is driven, with what model.
    model : KoopmanModel
        What was learned, as it is in the file.
    """

    def __init__(self, robot: Robot, model: kl.KoopmanModel) -> None:
        self._robot, self._model = robot, model
        self._sampler = RowSampler(model.dt)
        self._rows: list[tuple[float, ...]] = []
        self._compared = 0
        self.result: Comparison | None = None
        """What the comparison says so far."""
        self.trouble = ""
        """Why the robot must be stopped, in words."""

    def on_tick(
        self, now: float, state: State | None, output: GateOutput, sent: bool, fresh: bool
    ) -> None:
        """Take in one tick of the loop."""
        driven = output.state in (GateState.ACTIVE, GateState.STOPPING)
        command = output.speeds if sent else None
        self._rows += self._sampler.take(Tick(now, state, command, driven, fresh))

    def saw(self, *_: object) -> None:
        """Compare once a second; receives each plan."""
        if self.trouble or (len(self._rows) - self._compared) * self._model.dt < EVERY:
            return
        self.compare()

    def compare(self) -> None:
        """Compare what was driven so far."""
        from kmpc_lite.learn.evaluation import ModelVerdict, compare

        rows = self._rows[:]
        self._compared = len(rows)
        before = self.result
        if before is not None and before.verdict is ModelVerdict.BETTER:
            return  # shown once, beyond noise
        self.result = compare(self._model, _episodes(rows, self._model.dt))
        long = len(rows) * self._model.dt >= LONGEST
        verdict = self.result.verdict
        if verdict is ModelVerdict.WORSE or (long and verdict.name not in PASSED):
            self.trouble = f"rehearsal: {self.result}"

    def finish(self) -> dict[str, Any]:
        """Compare a last time and remember the result; give it as plain values."""
        from kmpc_lite.files import write_whole
        from kmpc_lite.learn.evaluation import ModelVerdict

        if not self.trouble:
            self.compare()
        result = self.result
        if result is None or result.verdict is ModelVerdict.SHORT:
            return {
                "verdict": "SHORT",
                "text": f"the model {ModelVerdict.SHORT.value}: rehearse again",
            }
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

    if len(rows) < 2:
        return []
    table = np.array(rows)
    cuts = np.flatnonzero(np.diff(table[:, 0]) > 1.5 * dt) + 1
    parts = np.split(table, cuts)
    return [kl.Episode(p[:, 1:4], p[:-1, 4:6], dt) for p in parts if len(p) > 1]
