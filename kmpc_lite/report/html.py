"""The report of a run: one HTML file that needs nothing else, neither network nor scripts."""

from __future__ import annotations

import json
import os
import platform
import re
import sys
from base64 import b64encode
from collections.abc import Iterable, Mapping
from dataclasses import fields
from html import escape
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.learn.evaluation import FitReport
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.report.page import CAPTIONS, MOVING_CAPTION, PAGE
from kmpc_lite.report.pictures import run_pictures
from kmpc_lite.report.scenario_rows import robot_rows, scenario_rows
from kmpc_lite.report.style import render, write_picture
from kmpc_lite.report.words import (
    STATUS_WORDS,
    length,
    milliseconds,
    outcome_sentence,
    outcome_title,
)
from kmpc_lite.sim.closed_loop import Outcome, Run

BADGES = {
    Outcome.REACHED: ("good", "✓ reached"),
    Outcome.COLLISION: ("bad", "✕ collision"),
    Outcome.TIMEOUT: ("late", "◷ out of time"),
}
NOISE_COMMANDS = {"at rest": (0.0, 0.0), "at 0.5 m/s": (0.5, 0.0), "at 0.5 rad/s": (0.0, 0.5)}
"""Commands (v [m/s], omega [rad/s]) for which the model's noise is told."""
UNIT = re.compile(r"(?<=\d) (?=(?:mm|ms|mrad|m|s|rad|m/s|rad/s|%)(?![\w]))")


def write_report(
    path: str | os.PathLike[str],
    run: Run,
    model: KoopmanModel | None = None,
    fit_report: FitReport | None = None,
    title: str | None = None,
    command: str | None = None,
    *,
    u_min: ArrayLike | None = None,
    u_max: ArrayLike | None = None,
) -> None:
    """Write the report of a run: one HTML file, whole or not at all.

    The same input gives the same bytes on the same machine.

    Parameters
    ----------
    path : path
        The file to write.
    run : Run
        What was driven.
    model : KoopmanModel, optional
        What the controller drove with.
    fit_report : FitReport, optional
        Held-out errors of the model; what it keeps as ``info["held_out"]`` where not given.
    title : str, optional
        Heading; the outcome in words where not given.
    command : str, optional
        Command line that made the run, to repeat it.
    u_min, u_max : array_like, optional
        Command limits (2,) [m/s, rad/s]; what the run keeps in its `info` where not given.

    Raises
    ------
    KmpcError
        Where matplotlib is missing or the file cannot be written.
    """
    held_out = _held_out(model) if fit_report is None else fit_report
    moving = any(circle.vx or circle.vy for circle in run.scenario.circles)
    pictures = {
        name: _image(
            name, render(figure, "svg"), MOVING_CAPTION if name == "map" and moving else ""
        )
        for name, figure in run_pictures(run, held_out, u_min, u_max).items()
    }
    heading = outcome_title(run) if title is None else title
    tone, badge = BADGES[run.outcome]
    page = PAGE.format(
        title=escape(heading),
        scenario=escape(run.scenario.name),
        tone=tone,
        badge=badge,
        sentence=_text(outcome_sentence(run)),
        tiles="\n".join(_tiles(run)),
        map=pictures["map"],
        commands=pictures["commands"],
        errors=pictures["errors"],
        timing=pictures["timing"],
        times_table=_table(_time_rows(run)),
        statuses=_table(_status_rows(run)),
        fit=_fit_section(model, held_out, pictures.get("fit", "")),
        robot_table=_table(robot_rows(run)),
        scenario_table=_table(scenario_rows(run)),
        toml=escape(run.scenario.to_toml()),
        made=_table(_made_rows(run, command)),
        kept=_kept(run.info),
    )
    # a file name may hold what UTF-8 cannot
    write_picture(Path(path), page.encode("utf-8", errors="xmlcharrefreplace"))


def _image(name: str, svg: bytes, more: str) -> str:
    """Picture as an element; inside an image its ids cannot meet those of the others."""
    alt, caption = CAPTIONS[name]
    image = (
        f'<img alt="{escape(alt)}" '
        f'src="data:image/svg+xml;base64,{b64encode(svg).decode("ascii")}">'
    )
    return (
        f'<figure class="{name}">{image}<figcaption>{escape(caption + more)}</figcaption></figure>'
    )


def _text(text: str) -> str:
    """Escape, and keep a number and its unit on one line."""
    return escape(UNIT.sub("\u00a0", text))


def _tiles(run: Run) -> Iterable[str]:
    """Key numbers."""
    scenario, times = run.scenario, run.step_times
    clearance = "no obstacles" if not np.isfinite(run.clearance) else length(run.clearance)
    margin = f"{length(scenario.margin)} asked for" if scenario.margin else "edge to edge"
    solved, without = (
        run.statuses.count("SOLVED"),
        run.statuses.count("FALLBACK") + run.statuses.count("STOPPED"),
    )
    numbers = (
        ("Duration", f"{run.duration:.4g} s", f"{scenario.timeout:g} s allowed"),
        (
            "Position error",
            length(run.position_error),
            f"{length(scenario.tolerance)} counts as arrived",
        ),
        (
            "Heading error",
            f"{run.heading_error:.3f} rad",
            f"{scenario.heading_tolerance:g} rad counts as arrived",
        ),
        ("Smallest clearance", clearance, margin),
        ("Step time, p50", milliseconds(float(np.median(times))), f"period {milliseconds(run.dt)}"),
        ("Step time, p99", milliseconds(float(np.quantile(times, 0.99))), "99 % of steps within"),
        (
            "Step time, max",
            milliseconds(float(times.max())),
            f"{100 * float(times.max()) / run.dt:.2g} % of the period",
        ),
        (
            "Steps solved",
            f"{solved} of {len(run.statuses)}",
            f"{without or 'none'} without a new plan",
        ),
    )
    for name, value, note in numbers:
        content = (
            f'<span class="name">{name}</span><strong>{_text(value)}</strong><span '
            f'class="note">{_text(note)}</span>'
        )
        yield f'<div class="tile">{content}</div>'


def _table(rows: Iterable[tuple[str, str]]) -> str:
    """Rows of a name and a value; both are text, not HTML."""
    body = "\n".join(
        f'<tr><th scope="row">{_text(name)}</th><td>{_text(value)}</td></tr>'
        for name, value in rows
    )
    return f'<div class="scroll"><table>\n{body}\n</table></div>'


def _status_rows(run: Run) -> Iterable[tuple[str, str]]:
    for status, words in STATUS_WORDS.items():
        count = run.statuses.count(status)
        if count:
            yield (
                status,
                f"{count} of {len(run.statuses)} steps ({100 * count / len(run.statuses):.3g} %): "
                f"{words}",
            )


def _time_rows(run: Run) -> Iterable[tuple[str, str]]:
    times = run.step_times
    slowest, late = int(np.argmax(times)), int(np.sum(times > run.dt))
    yield "Steps", str(len(times))
    yield "Half of them within (p50)", milliseconds(float(np.median(times)))
    yield "99 % within (p99)", milliseconds(float(np.quantile(times, 0.99)))
    yield "All within (max)", milliseconds(float(times.max()))
    yield (
        "Slowest step",
        f"at {slowest * run.dt:.4g} s; "
        f"{STATUS_WORDS.get(run.statuses[slowest], run.statuses[slowest])}",
    )
    yield "Period, the budget", milliseconds(run.dt)
    yield "Steps over budget", str(late) if late else "none"


def _held_out(model: KoopmanModel | None) -> FitReport | None:
    """Held-out errors that `kmpc fit` keeps with the model, where it has all of them."""
    kept = None if model is None else model.info.get("held_out")
    names = {field.name for field in fields(FitReport)}
    if not isinstance(kept, Mapping) or set(kept) != names:
        return None
    return FitReport(**kept)


def _fit_section(model: KoopmanModel | None, report: FitReport | None, picture: str) -> str:
    """How the model was made and how well it predicts, or nothing."""
    if model is None and report is None:
        return ""
    parts = ["<section>", "<h2>The model</h2>"]
    if model is not None:
        parts.append(_table(_model_rows(model)))
    if report is not None:
        parts += [_errors_table(report)]
    if picture:
        parts = [*parts[:2], '<div class="beside"><div>', *parts[2:], "</div>", picture, "</div>"]
    return "\n".join([*parts, "</section>"])


def _model_rows(model: KoopmanModel) -> Iterable[tuple[str, str]]:
    info = model.info
    form = (
        "derivative of the pose, integrated over the period"
        if model.continuous
        else "next pose, one period on"
    )
    yield "Method", f"{info.get('method', 'not told')} ({form})"
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
            forward, left, heading = 1e3 * np.sqrt(np.diag(model.noise(command)))
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


def _made_rows(run: Run, command: str | None) -> Iterable[tuple[str, str]]:
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


def _kept(info: Mapping[str, Any]) -> str:
    """What the caller kept with the run, as JSON in a fold."""
    if not info:
        return ""
    text = escape(json.dumps(info, indent=2, sort_keys=True, ensure_ascii=False, default=str))
    return f"<details><summary>What was kept with the run</summary><pre>{text}</pre></details>"
