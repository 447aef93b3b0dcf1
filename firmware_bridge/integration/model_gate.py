"""Before a model drives a robot: whose it is, what its log has shown, and what follows from that.

A model of another vehicle or another period is refused; limits beyond what its log shows are
lowered; where the robot file does not say how hard the robot brakes, the log does.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from firmware_bridge.messages import ConfigError
from firmware_bridge.robot_file import NOMINAL_LATENCY, Robot
from firmware_bridge.safety.gate_settings import Limits

if TYPE_CHECKING:
    import kmpc_lite as kl

BEYOND = 1.05  # limits may exceed what the log shows by this factor
STOP_TIME = 1.0
"""A robot that the log shows to brake harder than the default is to stop from full speed within
this time [s]."""
LONGEST_LATENCY = 0.5  # longest latency that a robot file may hold [s]
TRUST = "--trust-model uses it nevertheless"


def fit_for(robot: Robot, model: kl.KoopmanModel, name: str) -> tuple[Robot, list[str]]:
    """Check a learned model against the robot that it is to drive.

    `robot`: what is to be driven. `model`: what was learned. `name`: of the model's file. Returns
    the robot within what the model's log has shown, and lines that a user should read. Raises
    ConfigError for a model of another vehicle, or of another period.
    """
    info, trust = model.info, robot.control.trust_model
    wrong = [*_other_vehicle(robot, info), *_other_wheels(robot, info)]
    wrong += _other_period(robot, model)
    if wrong and not trust:
        raise ConfigError(f"{name}: {'; '.join(wrong)}. Record this robot and learn anew; {TRUST}")
    notes = [f"{name}: {text}; used nevertheless" for text in wrong]
    if "vehicle" not in info and not trust:
        notes.append(f"{name}: names no vehicle: kmpc fit --vehicle NAME")
    limits, lowered = _within_shown(robot.gate.limits, info.get("driven"))
    if lowered and trust:
        notes.append(f"{name}: its log does not show {', '.join(lowered)}; used nevertheless")
    elif lowered:
        notes.append(f"{name}: its log does not show more: {', '.join(lowered)}; {TRUST}")
        robot = replace(robot, gate=replace(robot.gate, limits=limits))
    robot, told = _with_braking(robot, info.get("stopping"), name)
    return robot, [*notes, *told]


def _other_vehicle(robot: Robot, info: Mapping[str, Any]) -> list[str]:
    """Why the model is another vehicle's, if it is."""
    from kmpc_lite.learn.learning import differences

    different = differences(info.get("vehicle", {}), robot.vehicle)
    if not different:
        return []
    return [f"learned on another vehicle (the model's and this one's: {'; '.join(different)})"]


def _other_wheels(robot: Robot, info: Mapping[str, Any]) -> list[str]:
    """Why the model is of other wheels, if it is."""
    wheels = info.get("wheels", {})
    kind = wheels.get("kind", robot.wheels.kind)
    if kind == robot.wheels.kind:
        return []
    table = ", ".join(f"{key} = {json.dumps(value)}" for key, value in wheels.items())
    return [
        f"learned on wheels of the kind {kind}, and the robot file's are {robot.wheels.kind} "
        f"([robot] wheels = {{{table}}} if that is what it drives on)"
    ]


def _other_period(robot: Robot, model: kl.KoopmanModel) -> list[str]:
    period = robot.control.period
    if period is None or abs(period - model.dt) <= 1e-6 * model.dt:
        return []
    return [f"learned at a period of {model.dt:g} s, and control.period is {period:g} s"]


def _within_shown(limits: Limits, driven: Mapping[str, float] | None) -> tuple[Limits, list[str]]:
    """Limits that the log has shown, and what that lowers, in words."""
    if driven is None:
        return limits, []
    shown = {
        "v_max": driven["forward"],
        "v_reverse": driven["reverse"],
        "omega_max": driven["turn"],
    }
    units = {"v_max": "m/s", "v_reverse": "m/s", "omega_max": "rad/s"}
    low = {
        name: value
        for name, value in shown.items()
        if getattr(limits, name) > BEYOND * value and (value > 0.0 or name == "v_reverse")
    }
    lowered = [f"{n} {low[n]:.3g} {units[n]} instead of {getattr(limits, n):g}" for n in low]
    return replace(limits, **low), lowered


def _with_braking(
    robot: Robot, stopping: Mapping[str, Any] | None, name: str
) -> tuple[Robot, list[str]]:
    """Braking as the log shows it, where the robot file does not say."""
    shown = None if stopping is None else stopping["deceleration"]
    if stopping is None or shown is None:
        return robot, []
    limits = robot.gate.limits
    where = f"the log of {name}, {stopping['stops']:g} stops"
    if "deceleration" in robot.sections.get("limits", {}):
        if limits.deceleration > BEYOND * shown:
            return robot, [
                f"limits.deceleration: {limits.deceleration:g} m/s^2 is given, the robot slows "
                f"down by {shown:.2g} ({where})"
            ]
        return robot, []
    fastest = max(limits.v_max, limits.v_reverse)
    deceleration = min(shown, max(limits.deceleration, fastest / STOP_TIME))
    if abs(deceleration - limits.deceleration) <= 0.02 * limits.deceleration:
        return robot, []
    told = f"limits.deceleration: {deceleration:.2g} m/s^2 ({where})"
    limits = replace(limits, deceleration=deceleration)
    return replace(robot, gate=replace(robot.gate, limits=limits)), [told]


def with_latency(robot: Robot, model: kl.KoopmanModel | None) -> tuple[Robot, str]:
    """Choose a latency if none is given: the model's lag, its log's delay, or the driver's own.

    The text says so, where it matters.
    """
    if robot.control.latency is not None:
        return robot, ""
    stopping = None if model is None else model.info.get("stopping")
    if model is not None and (model.history or model.info.get("unmodelled_delay")):
        latency, note = 0.0, ""
    elif stopping is not None:
        latency = min(LONGEST_LATENCY, max(0.0, round(stopping["delay"], 3)))
        note = f"control.latency: {latency:g} s, as the model's log shows"
    else:
        latency = NOMINAL_LATENCY[robot.link.driver]
        note = (
            f"control.latency: not given, and the model knows no lag: {latency:g} s is taken for "
            f"{robot.link.driver} (or learn it: kmpc fit)"
        )
    robot = replace(robot, control=replace(robot.control, latency=latency))
    return robot, note if latency else ""


def describe_model(robot: Robot) -> list[tuple[bool, str]]:
    """What `kmpc check` says of the model, and of limits and braking with it: fine or not, text."""
    limits = robot.gate.limits
    if robot.control.model is None:
        return [(True, f"no model: the nominal unicycle; {_limits(limits)}, {_braking(robot)}")]
    import kmpc_lite as kl
    from kmpc_lite.learn.verdict import format_changes

    try:
        within, model, notes = load_model(robot)
    except (ConfigError, kl.KmpcError) as error:
        return [(False, f"model: {error}")]
    info, limits = model.info, within.gate.limits
    logs = ", ".join(info.get("log", ())) or "unknown logs"
    found = [f"model: {robot.control.model}, from {logs}, period {model.dt:g} s"]
    found.append(f"with it: {_limits(limits)}, {_braking(within)}")
    stopping = info.get("stopping")
    if stopping is not None:
        way = max(limits.v_max, limits.v_reverse)
        way = way * stopping["delay"] + way**2 / (2.0 * limits.deceleration)
        found.append(
            f"reaction: the motion comes {stopping['delay']:.2g} s after its command (log); "
            f"stopping distance from full speed: {way:.2g} m"
        )
    found += [line.replace("  ", ": ", 1) for line in format_changes(info)]
    return [(True, text) for text in (*found, *(f"note: {note}" for note in notes))]


def _limits(limits: Limits) -> str:
    return (
        f"up to {limits.v_max:.3g} m/s forward, {limits.v_reverse:.3g} m/s back, "
        f"{limits.omega_max:.3g} rad/s"
    )


def _braking(robot: Robot) -> str:
    """Deceleration and its source."""
    deceleration = robot.gate.limits.deceleration
    if "deceleration" in robot.sections.get("limits", {}):
        source = "the robot file"
    elif deceleration != Limits().deceleration:
        source = "the model's log"
    else:
        source = "the default"
    return f"braking at {deceleration:.2g} m/s^2 ({source})"


def load_model(robot: Robot, rehearse: bool = False) -> tuple[Robot, Any, tuple[str, ...]]:
    """Load the robot's model; give the robot within what it has shown, the model, and notes."""
    import kmpc_lite as kl
    from firmware_bridge.integration.rehearsal import at_half_speed

    file, period = robot.control.model, robot.control.period
    if file is None:
        robot, note = with_latency(robot, None)
        nominal = kl.nominal_omni if robot.wheels.kind == "omni" else kl.nominal_unicycle
        return robot, nominal(period or 0.1), (note,) if note else ()
    learned = kl.KoopmanModel.load(file)
    robot, notes = fit_for(robot, learned, file)
    robot = at_half_speed(robot) if rehearse else robot
    if period is not None and abs(period - learned.dt) > 1e-9:
        learned = learned.with_dt(period)
    if robot.control.latency:
        # what the robot file says stands for what the log showed
        info = {k: v for k, v in learned.info.items() if k != "unmodelled_delay"}
        learned = replace(learned, info=info)
    robot, note = with_latency(robot, learned)
    return robot, learned, (*notes, note) if note else tuple(notes)
