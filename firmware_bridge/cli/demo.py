"""The main job through the link: record a drive of the emulated rover, learn from it, drive it past obstacles, show that."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

import numpy as np

import kmpc_lite as kl
from firmware_bridge.cli.latency import SCENARIO, emulator, robot_text
from firmware_bridge.messages import BridgeError
from firmware_bridge.robot_file import Robot, load_robot
from firmware_bridge.runtime.drive import DONE, INTERRUPTED, NOT_DONE, SIGNALS, record, run
from firmware_bridge.runtime.loop import TICK
from kmpc_lite.cli.commands import calibrated, describe, load_and_split, make_dictionary, with_info
from kmpc_lite.sim import Outcome, Run, Scenario

PERIOD = 0.1
"""Of controller and rows [s]."""
COMMANDS = {"command_period": TICK}
"""Commands go out faster than plans are made."""
LAGS = [0, 1, 2, 3]
"""Past commands that the model knows: the rover obeys late."""
HOLD = 0.5
"""How long a random command is held [s]."""
SETTLE = 1.0
"""How long the goal must be held [s]."""
PATIENCE = 60.0
"""Give up driving after so long [s]."""
OWN_FILES = (
    "drive.csv",
    "drive.tlog",
    "robot.npz",
    "run.csv",
    "run.tlog",
    "run.npz",
    "report.html",
)
"""What a demo writes into its folder, and replaces the next time."""


class Steps:
    """What the controller saw and planned, step by step, while commands passed."""

    def __init__(self) -> None:
        self.rows: list[tuple[tuple[float, float, float], Any]] = []
        self.is_driving: Callable[[], bool] = lambda: False
        """Whether commands pass."""

    def __call__(self, pose: tuple[float, float, float], plan: Any) -> None:
        """Keep one step."""
        if self.is_driving():
            self.rows.append((pose, plan))

    def as_run(self, scenario: Scenario, report: dict[str, Any], info: dict[str, Any]) -> Run:
        """Make a run of the steps until the goal was reached, or all: poses are those that came through the link.

        Parameters
        ----------
        scenario : Scenario
            What was driven.
        report : dict
            Of `firmware_bridge.runtime.drive.run`.
        info : dict
            What to keep with the run.

        Raises
        ------
        BridgeError
            Where the robot never drove.
        """
        if len(self.rows) < 2:
            raise BridgeError("the rover did not drive: no command passed the gate")
        arrived = report["arrived_after_s"]
        count = len(self.rows) - 1
        if arrived is not None:
            count = max(1, min(count, round(arrived / PERIOD)))
        states, plans = (
            np.array([pose for pose, _ in self.rows[: count + 1]]),
            [plan for _, plan in self.rows[:count]],
        )
        clearance = np.inf if report["clearance_m"] is None else report["clearance_m"]
        outcome = (
            Outcome.COLLISION
            if clearance < 0.0
            else Outcome.TIMEOUT
            if arrived is None
            else Outcome.REACHED
        )
        return Run(
            scenario=scenario,
            dt=PERIOD,
            outcome=outcome,
            duration=count * PERIOD if arrived is None else arrived,
            states=states,
            path=states,
            inputs=np.array([plan.command for plan in plans]),
            plans=np.array([plan.states for plan in plans]),
            statuses=tuple(plan.status.name for plan in plans),
            step_times=np.array([plan.timing["total"] for plan in plans]),
            clearance=clearance,
            info=info,
        )


Prepare = Callable[[Robot, float, float, Steps], Any]
"""Robot, settling time and time limit [s], and who watches the steps -> what `run` needs."""


def demo(
    folder: Path, seconds: float, seed: int, prepare: Prepare, out: TextIO | None, command: str
) -> tuple[dict[str, Any], int]:
    """Record, learn, drive, report; gives the report and the exit status.

    Parameters
    ----------
    folder : Path
        For log, model, run and report; those of an earlier demo are replaced.
    seconds : float
        Of random driving to learn from [s].
    seed : int
        Of the random driving and of the rover's slip.
    prepare : callable
        Puts a controller before the robot; see `Prepare`.
    out : text stream, optional
        For people: a line per phase.
    command : str
        Command line, for the report.

    Raises
    ------
    BridgeError, KmpcError
        With one line for the user.
    """
    from kmpc_lite.report import write_report

    def say(text: str) -> None:
        if out is not None:
            out.write(text + "\n")
            out.flush()

    folder.mkdir(parents=True, exist_ok=True)
    for name in OWN_FILES:
        (folder / name).unlink(missing_ok=True)
    scenario = Scenario.load(SCENARIO)
    with tempfile.TemporaryDirectory(prefix="kmpc-bridge-") as name:
        link, file = Path(name) / "mavlink", Path(name) / "rover.toml"
        file.write_text(robot_text("mavlink", Path(name), PERIOD))
        say(
            f"1  recording {seconds:g} s of random driving of an emulated ArduPilot rover over a pseudo-terminal: {folder / 'drive.csv'}"
        )
        with emulator(file, link, "--seed", str(seed)):
            # the emulated floor is empty: the whole map is free for random driving
            robot = load_robot(file, {"control": COMMANDS, "safety": {"geofence": scenario.bounds}})
            recorded, status = record(
                robot,
                str(folder / "drive"),
                seconds,
                period=PERIOD,
                excitation=(HOLD, seed),
                out=None,
            )
        if recorded["loop"]["stop_reason"] in SIGNALS:
            return {"outcome": "stopped", **recorded}, INTERRUPTED
        if status != DONE:
            raise BridgeError(
                f"{folder / 'drive.csv'}: nothing was recorded: {'; '.join(recorded['problems']) or 'the rover did not drive'}"
            )
        say(f"   {recorded['rows']} rows every {PERIOD:g} s")

        train, held = load_and_split([folder / "drive.csv"], None, None, 0.5, 0)
        model = kl.fit(train, make_dictionary("trig", LAGS, False))
        errors = kl.evaluate(model, held, 1.0)
        model, calibration = calibrated(model, held)
        model = with_info(model, {"held_out": errors.as_dict(), "log": [str(folder / "drive.csv")]})
        model.save(folder / "robot.npz")
        say(f"2  learned {folder / 'robot.npz'} from {train}")
        say("   " + f"{errors}\n{calibration}".replace("\n", "\n   "))

        say(f"3  driving {scenario.name} with it, over a pseudo-terminal again")
        steps = Steps()
        control = {**COMMANDS, "model": str(folder / "robot.npz"), "scenario": SCENARIO}
        drive = prepare(load_robot(file, {"control": control}), SETTLE, PATIENCE, steps)
        steps.is_driving = lambda: drive.navigator.is_driving()
        with emulator(file, link, "--seed", str(seed)):
            report, status = run(
                drive.robot, drive.navigator, drive.period, drive.origin, str(folder / "run"), None
            )
    if status == INTERRUPTED:
        return report, INTERRUPTED
    limits = drive.robot.gate.limits
    info = {
        "plant": "emulated ArduPilot rover over a pty; poses as its EKF tells them",
        "model": model.info["method"],
        "u_min": [-limits.v_reverse, -limits.omega_max],
        "u_max": [limits.v_max, limits.omega_max],
        "commands_sent": report["loop"]["commands_sent"],
    }
    driven = steps.as_run(scenario, report, info)
    driven.save(folder / "run.npz")
    say(f"   {describe(driven)}")
    page = folder / "report.html"
    write_report(page, driven, model=model, fit_report=errors, command=command)
    say(f"4  open {page.resolve()}")
    result = {
        "report": str(page),
        "rows": recorded["rows"],
        "held_out": errors.as_dict(),
        "link": report["loop"],
        **driven.summary(),
    }
    return result, DONE if driven.outcome is Outcome.REACHED else NOT_DONE
