"""What a report says of what made its run, and of its model: its log, and its errors."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Iterable, Mapping
from dataclasses import fields
from html import escape
from importlib import metadata
from pathlib import Path

import numpy as np

from kmpc_lab.report.moments import milliseconds, table
from kmpc_lab.sim.closed_loop import Run
from kmpc_lite.learn.evaluation import FitReport
from kmpc_lite.model.koopman import KoopmanModel

NOISE_COMMANDS = {"at rest": (0.0, 0.0), "at 0.5 m/s": (0.5, 0.0), "at 0.5 rad/s": (0.0, 0.5)}
"""Commands (v [m/s], omega [rad/s]) for which the model's noise is given."""


def fit_section(model: KoopmanModel | None) -> str:
    """How the model was made, and how well it predicts where `kmpc fit` has kept all of that."""
    if model is None:
        return ""
    parts, kept = [table(_model_rows(model))], model.info.get("held_out")
    if isinstance(kept, Mapping) and set(kept) == {field.name for field in fields(FitReport)}:
        parts.append(_errors_table(FitReport(**kept)))
    return "\n".join(["<section>", "<h2>The model</h2>", *parts, "</section>"])


def _model_rows(model: KoopmanModel) -> Iterable[tuple[str, str]]:
    info = model.info
    form = (
        "derivative of the pose, integrated over the period"
        if model.continuous
        else "next pose, one period on"
    )
    yield "Method", f"{info.get('method', 'not known')} ({form})"
    yield (
        "Dictionary",
        f"{type(model.dictionary).__name__}, {model.dictionary.size} lifted coordinates, "
        f"{model.history} past commands",
    )
    yield "Period", milliseconds(model.dt)
    if "samples" in info:
        yield "Samples", str(info["samples"])
    if "rank" in info:
        yield "Rank", f"{info['rank']} of {info.get('features', '?')} features"
    if isinstance(info.get("condition"), int | float):
        yield "Condition", f"{info['condition']:.4g}"
    if "log" in info:
        yield (
            "Log",
            ", ".join(map(str, info["log"])) if isinstance(info["log"], list) else str(info["log"]),
        )
    if model.noise_model is not None:
        for name, command in NOISE_COMMANDS.items():
            speeds = np.zeros(model.inputs)
            speeds[[0, -1]] = command
            forward, left, heading = 1e3 * np.sqrt(np.diag(model.noise(speeds)))
            yield (
                f"Noise {name}",
                f"{forward:.3g} mm forward, {left:.3g} mm sideways, "
                f"{heading:.3g} mrad per step (standard deviation)",
            )


def _errors_table(report: FitReport) -> str:
    """Held-out errors as a table of four rows."""
    ahead = f"{report.horizon:g} s"
    rows = (
        ("one step", "model", report.one_step),
        ("one step", "nominal unicycle", report.nominal_one_step),
        (ahead, "model", report.multi_step),
        (ahead, "nominal unicycle", report.nominal_multi_step),
    )
    cells = "\n".join(
        f'<tr><th scope="row">{escape(when)}</th><td>{who}</td>'
        + "".join(f"<td>{1e3 * value:.3g}</td>" for value in errors)
        + "</tr>"
        for when, who, errors in rows
    )
    head = (
        "<tr><th>ahead</th><th></th><th>along [mm]</th><th>across [mm]</th><th>heading "
        "[mrad]</th></tr>"
    )
    note = (
        f"Root mean square over {report.starts} starts in driving that the fit has not seen. "
        f"The paper's RMSE of one step: {report.rmse_percent:.2f} %."
    )
    return (
        f'<div class="scroll"><table class="numbers">\n{head}\n{cells}\n</table></div>\n<p '
        f'class="small">{escape(note)}</p>'
    )


def made_rows(run: Run, command: str | None) -> Iterable[tuple[str, str]]:
    """Rows of a name and a value."""
    driven = run.info.get("command")
    if driven not in (None, command):
        yield "Driven by", str(driven)
    if command is not None:
        yield "Command", command
    yield "Python", platform.python_version()
    for name in ("kmpc-lite", "numpy", "scipy", "osqp", "matplotlib"):
        yield name, _version(name)
    yield (
        "Machine",
        ", ".join(
            part
            for part in (
                _processor(),
                platform.machine(),
                f"{os.cpu_count() or '?'} cores",
                sys.platform,
            )
            if part
        ),
    )


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"


def _processor() -> str:
    """Name of the board or the processor, where the system tells it."""
    for source, key in (("/proc/device-tree/model", ""), ("/proc/cpuinfo", "model name")):
        file = Path(source)
        if file.is_file():
            text = file.read_text(encoding="utf-8", errors="replace").strip("\0\n ")
            lines = [
                line.partition(":")[2].strip() if key else line
                for line in text.splitlines()
                if line.startswith(key)
            ]
            if lines:
                return lines[0]
    return platform.processor()
