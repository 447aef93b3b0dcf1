"""What a fit says first: whether the model is worth driving with, and what its log lacks."""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees
from typing import Any

from kmpc_lite.learn.evaluation import FitReport

DIRECTIONS = ("along", "across", "in heading")
BETTER = 1.25
"""Ratio of the nominal robot's error to the model's from which on the model is better."""
WORSE = 1.02
"""Ratio of the model's error to the nominal robot's from which on the model is worse."""
MISSING = {
    "length": "minutes of driving",
    "forward": "driving forward",
    "reverse": "reversing",
    "slow": "slow driving",
    "fast": "fast driving",
    "left": "left turns",
    "right": "right turns",
    "forward, left": "left turns while driving forward",
    "forward, right": "right turns while driving forward",
    "reverse, left": "left turns while reversing",
    "reverse, right": "right turns while reversing",
    "on the spot": "turns on the spot",
    "stops": "stops",
}
"""What a log may lack, by the name of its part (`Coverage`)."""


def verdict(report: FitReport, facts: Mapping[str, Any], driven: Mapping[str, float]) -> str:
    """Tell in one line how good a model is, how fast it may be driven, and what its log lacks.

    Parameters
    ----------
    report : FitReport
        Its errors on what was held out.
    facts : mapping
        Of the fit, as `summarize_fit` gives them; may be empty.
    driven : mapping
        Largest speeds of the log, as `driven_speeds` gives them.
    """
    fastest = max(driven["forward"], driven["reverse"])
    told = f"{_compared(report)}; drive up to {fastest:.2g} m/s."
    lacking = facts.get("missing", ())
    if not lacking:
        return told
    names = ", ".join(MISSING[name] for name in lacking)
    return f"{told} Missing: {names}: `kmpc record --excite` shows them."


def _compared(report: FitReport) -> str:
    """How the errors compare with the nominal robot's."""
    pairs = list(zip(DIRECTIONS, report.multi_step, report.nominal_multi_step, strict=True))
    better = [(theirs / max(ours, 1e-12), name) for name, ours, theirs in pairs]
    best, where = max(better)
    least, lost = min(better)
    gains = f"predicts {_times(best)} times better than nominal {where}"
    if least * WORSE < 1.0:
        losses = f"{_times(1.0 / max(least, 1e-12))} times worse {lost}"
        if best > BETTER:
            return f"Mixed: {gains} but {losses}"
        return f"Poor: predicts {losses} than nominal"
    if best > BETTER:
        return f"Good: {gains}"
    return "As nominal: the log supports no better prediction than the nominal robot's"


def _times(ratio: float) -> str:
    """A ratio in words."""
    return "over 1000" if ratio > 1e3 else f"{ratio:.2g}" if ratio < 100.0 else f"{ratio:.0f}"


def tell_errors(report: FitReport) -> str:
    """Errors after the report's horizon, in one line."""
    ours, nominal = (
        f"{100 * e[0]:.2g} cm along, {100 * e[1]:.2g} cm across, {degrees(e[2]):.2g} degrees"
        for e in (report.multi_step, report.nominal_multi_step)
    )
    return f"errors {ours} after {report.horizon:g} s; nominal robot: {nominal}"


def tell_response(facts: Mapping[str, Any]) -> str:
    """How late the robot answers and how far it drives until it stands, in one line."""
    lag = facts["lag"]
    late = ", ".join(
        f"{name} {lag[key]['dead_time']:.2f} s dead time + {lag[key]['time_constant']:.2f} s"
        for key, name in (("speed", "speed"), ("turn", "turn rate"))
        if any(lag[key].values())
    )
    return (
        f"lag    {late or 'none: it obeys at once'}; stopping distance from "
        f"{facts['largest']['v']:.2g} m/s: {facts['braking_distance']:.2g} m"
    )
