"""What a fit has found of its robot and model, and what it says: robot, verdict, how learned."""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees
from typing import Any

import numpy as np

from kmpc_lite.learn.coverage import WORDS, find_coverage
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.evaluation import FitReport
from kmpc_lite.learn.lag import Response
from kmpc_lite.learn.windows import largest_inputs
from kmpc_lite.model.dictionary.response import evaluate_terms
from kmpc_lite.model.file import Ramps
from kmpc_lite.model.koopman import KoopmanModel

DIRECTIONS = ("along", "across", "in heading")
BETTER, WORSE = 1.25, 1.02
"""Ratio of the nominal robot's error to the model's from which on the model is better, and the
inverse ratio from which on it is worse."""
CHOSEN = {
    "nominal": "as commanded: the log supports no more",
    "gain": "its own gain",
    "gears": "a gain forward and one backward",
    "understeer": "its own gain, and understeer",
    "saturates": "understeer, and less in tight turns",
    "draws": "understeer, and wheels that are not straight",
    "drift": "tyres that drift outwards",
    "offset": "a heading that is off",
    "centre": "a turning centre ahead of the pose",
    "gains": "gains",
    "product": "gains and v*omega",
    "slip": "gains and slip terms",
}


def times(ratio: float) -> str:
    """A ratio in words."""
    return "over 1000" if ratio > 1e3 else f"{ratio:.2g}" if ratio < 100.0 else f"{ratio:.0f}"


def find_gains(model: KoopmanModel, driven: Dataset) -> dict[str, Any]:
    """Gains and slip of a model that ``lags="auto"`` has learned, at the speeds of some driving."""
    rows, limits = np.array(model.info["selection"]["rows"]), largest_inputs(driven.inputs)
    speeds = np.array(limits)
    ahead, round_ = np.eye(len(limits))[[0, -1]] * speeds
    straight, back, tight = (
        evaluate_terms(np.array([ahead, -ahead, ahead + round_]), 0.05 * speeds, limits) @ rows.T
    )
    own, turned = float(rows[2, len(limits) - 1]), rows[:, len(limits) - 1]
    gain = own if abs(own) > 1e-6 else 1.0
    return {
        "largest": {"v": limits[0], "omega": limits[-1]},
        "speed_gain": float(straight[0] / limits[0]),
        "reverse_gain": float(-back[0] / limits[0]),
        "turn_gain": own,
        "speed_kept_in_a_tight_turn": float(tight[0] / straight[0]) if straight[0] else 1.0,
        "side_slip": float(tight[1] / limits[0]),
        "turning_centre": [float(-turned[1] / gain), float(turned[0] / gain)],
        "heading_offset": float(np.arctan2(rows[1, 0], rows[0, 0])),
    }


def describe_fit(
    model: KoopmanModel, train: Dataset, whole: Dataset, report: FitReport
) -> dict[str, Any]:
    """Facts about a robot that ``lags="auto"`` has learned, as values that JSON can hold.

    `model`: what was learned. `train`, `whole`: what it was learned from, and the log of which that
    is a part: what that shows is not missing. `report`: its held-out errors.
    """
    speed, turn = (Response(*model.info["response"][name]) for name in ("speed", "turn"))
    shown = find_coverage([e.inputs for e in whole.episodes], whole.dt, steered=whole.steered)
    gains = find_gains(model, train)
    worse = [
        f"{name} it predicts worse than the nominal robot: {ours:.3g} against {nominal:.3g}"
        for name, ours, nominal in zip(
            DIRECTIONS, report.multi_step, report.nominal_multi_step, strict=True
        )
        if ours > WORSE * nominal
    ]
    return {
        "lag": {"speed": speed._asdict(), "turn": turn._asdict()},
        **gains,
        "braking_distance": abs(gains["speed_gain"]) * gains["largest"]["v"] * speed.delay,
        "directions": {k: d["step"] for k, d in model.info["selection"]["directions"].items()},
        "missing": [part.name for part in shown.missing],
        "warnings": [*worse, *model.info["response"].get("doubts", ()), *shown.warnings()],
    }


def describe_robot(made: Mapping[str, Any], facts: Mapping[str, Any]) -> dict[str, Any]:
    """What was found out of the robot itself, as values that JSON can hold.

    `made`: as `describe_making` gives it. `facts`: as `describe_fit` gives them; may be empty.
    """
    told = {**made["wheels"], **made.get("geometry", {})}
    if facts:
        told |= {"lag": facts["lag"], "stopping_distance": facts["braking_distance"]}
    return told


def tell_robot(made: Mapping[str, Any], facts: Mapping[str, Any]) -> str:
    """The same in one line."""
    told = [str(made["wheels"]["kind"])]
    lengths = {**made.get("geometry", {}), **made["wheels"]}
    for name in ("wheelbase", "track", "turning_radius"):
        if name in lengths:
            told.append(f"{name.replace('_', ' ')} {abs(lengths[name]):.2g} m")
    line = f"robot  {', '.join(told)}"
    if not facts:
        return line
    lag = facts["lag"]
    late = ", ".join(
        f"{name} {lag[key]['dead_time']:.2f} s dead time + {lag[key]['time_constant']:.2f} s"
        for key, name in (("speed", "speed"), ("turn", "turn rate"))
        if any(lag[key].values())
    )
    return (
        f"{line}; lag {late or 'none: it obeys at once'}; stopping distance from "
        f"{facts['largest']['v']:.2g} m/s: {facts['braking_distance']:.2g} m"
    )


def verdict(report: FitReport, facts: Mapping[str, Any], driven: Mapping[str, float]) -> str:
    """Tell in one line how good a model is, how fast it may be driven, and what its log lacks.

    `report`: its errors on what was held out. `facts`: of the fit, as `describe_fit` gives them;
    may be empty. `driven`: largest speeds of the log, as `driven_speeds` gives them.
    """
    lacking = facts.get("missing", ())
    # of such a log, how it compares is known at one speed alone
    steady = "slow" in lacking and not {"left", "right"}.isdisjoint(lacking)
    pairs = zip(DIRECTIONS, report.multi_step, report.nominal_multi_step, strict=True)
    better = [(theirs / max(ours, 1e-12), name) for name, ours, theirs in pairs]
    (best, where), (least, lost) = max(better), min(better)
    gains = f"predicts {times(best)} times better than nominal {where}"
    losses = f"{times(1.0 / max(least, 1e-12))} times worse {lost}"
    if least * WORSE < 1.0:
        told = f"Mixed: {gains} but {losses}" if best > BETTER else ""
        told = told or f"Poor: predicts {losses} than nominal"
    elif best > BETTER:
        told = f"Narrow: {gains}, but only at the one speed of its log" if steady else ""
        told = told or f"Good: {gains}"
    else:
        told = "As nominal: the log supports no better prediction; the nominal robot's model is "
        told += "written"
    told += f"; drive up to {max(driven['forward'], driven['reverse']):.2g} m/s."
    if stays := facts.get("stays_nominal"):
        told += f" It stays nominal {' and '.join(stays)}."
    if lacking:
        names = ", ".join(WORDS[name].noun for name in lacking)
        told += f" Missing: {names}: `kmpc record --excite` shows them."
    return told


def tell_errors(report: FitReport) -> str:
    """Errors after the report's horizon, in one line."""
    ours, nominal = (
        f"{100 * e[0]:.2g} cm along, {100 * e[1]:.2g} cm across, {degrees(e[2]):.2g} degrees"
        for e in (report.multi_step, report.nominal_multi_step)
    )
    return f"errors {ours} after {report.horizon:g} s; nominal robot: {nominal}"


def format_summary(facts: Mapping[str, Any]) -> str:
    """How it was learned, as one block for a terminal."""
    chosen = facts["directions"]
    centre, offset = facts["turning_centre"], np.degrees(facts["heading_offset"])
    kept = 100.0 * (1.0 - facts["speed_kept_in_a_tight_turn"])
    v, omega = facts["largest"]["v"], facts["largest"]["omega"]
    back = facts["reverse_gain"]
    reverse = f" ({back:.3g} in reverse)" if abs(back - facts["speed_gain"]) > 1e-9 else ""
    lines = [
        f"chosen along: {CHOSEN[chosen['along']]}; across: {CHOSEN[chosen['across']]}; "
        f"heading: {CHOSEN[chosen['heading']]}",
        f"gains  speed {facts['speed_gain']:.3g}{reverse}, turns {facts['turn_gain']:.3g} of the "
        "command",
        f"slip   at {v:.2g} m/s and {omega:.2g} rad/s: {kept:+.0f} % of the speed lost, "
        f"{facts['side_slip']:+.2g} m sideways per metre",
        f"point  the pose is tracked {1e3 * -centre[0]:+.0f} mm ahead and "
        f"{1e3 * -centre[1]:+.0f} mm left of the turning centre; "
        f"heading offset {offset:+.1f} degrees",
    ]
    return "\n".join(lines + [f"warn   {line}" for line in facts["warnings"]])


def format_making(info: Mapping[str, Any]) -> str:
    """Vehicle, speeds, stops and limits of a model's `info`, in lines for a terminal."""
    driven, stopping = info["driven"], info["stopping"]
    name = info.get("vehicle")
    who = ", ".join(f"{k} {v}" for k, v in name.items()) if name else "not given (--vehicle NAME)"
    late = f"stops  {stopping['stops']} in the log; the motion comes {stopping['delay']:.2g} s late"
    if stopping["deceleration"] is not None:
        late += f", and slows down by {stopping['deceleration']:.2g} m/s^2"
    lines = [
        f"whose  {who}",
        f"speeds {driven['forward']:.2g} m/s forward, {driven['reverse']:.2g} m/s back, "
        f"{driven['turn']:.2g} rad/s: kmpc run goes no faster with this model",
        late,
    ]
    return "\n".join([*lines, *format_changes(info)])


def format_changes(info: Mapping[str, Any]) -> list[str]:
    """Lines that tell which changes of commands the controller asks for, where they are limited."""
    told = {
        "ramps": "ramps  {}: the controller commands no faster changes",
        "changes": "asked  {}: fastest starts and stops in the log, not exceeded",
    }
    return [line.format(_limits(info, name)) for name, line in told.items() if name in info]


def _limits(info: Mapping[str, Any], name: str) -> str:
    """Limits of changes in words."""
    told, ramps = [], Ramps.of(info, name)
    speeds = ("speed", "speed sideways")[: len(ramps.slower) - 1]
    last = ("curvature", "1/m/s") if info.get("steered") else ("turn rate", "rad/s^2")
    for (what, unit), *limits in zip(
        [*((speed, "m/s^2") for speed in speeds), last], *ramps, strict=True
    ):
        finite = [
            f"{limit:.2g} {unit} {side}"
            for limit, side in zip(limits, Ramps._fields, strict=True)
            if np.isfinite(limit)
        ]
        told += [f"{what} {', '.join(finite)}"] if finite else []
    return "; ".join(told)
