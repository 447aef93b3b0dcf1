"""The report of a run: one HTML file that needs nothing else, and plays the drive."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lab.report.model_section import fit_section, made_rows
from kmpc_lab.report.moments import (
    MOST,
    STATUS_WORDS,
    clearance_words,
    events_of,
    image,
    joined,
    length,
    milliseconds,
    outcome_sentence,
    outcome_title,
    table,
)
from kmpc_lab.report.picture import drive_picture
from kmpc_lab.report.player import FILES, player_data, script
from kmpc_lab.report.runs import trace_of
from kmpc_lab.report.style import render, write_picture
from kmpc_lab.sim.closed_loop import Outcome, Run
from kmpc_lite.errors import KmpcError
from kmpc_lite.model.koopman import KoopmanModel

if TYPE_CHECKING:
    from jinja2 import Template

BADGES = {
    Outcome.REACHED: ("good", "✓ reached"),
    Outcome.COLLISION: ("bad", "✕ collision"),
    Outcome.TIMEOUT: ("late", "◷ out of time"),
}


SCENARIOS_OWN, LEARNED = "slip", "learned"
"""Plants of ``kmpc simulate``; a run that tells none drove the scenario's own."""


def write_report(
    path: str | os.PathLike[str],
    run: Run,
    model: KoopmanModel | None = None,
    title: str | None = None,
    command: str | None = None,
    *,
    u_min: ArrayLike | None = None,
    u_max: ArrayLike | None = None,
    beside: Mapping[str, Run] | None = None,
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
    title : str, optional
        Heading; the outcome in words if not given.
    command : str, optional
        Command line that made the run, to repeat it.
    u_min, u_max : array_like, optional
        Command limits (2,) [m/s, rad/s]; what the run keeps in its `info` if not given.
    beside : mapping, optional
        Other drives on the same map by their names: they are played with it.

    Raises
    ------
    KmpcError
        If matplotlib is missing or the file cannot be written.
    """
    from markupsafe import Markup

    picture = drive_picture({"": trace_of(run, u_min, u_max)}, clearance_words(run))
    tone, badge = BADGES[run.outcome]
    events = [] if run.details is None else events_of(run.details)
    code, script_hash = script()
    page = _template().render(
        title=outcome_title(run) if title is None else title,
        scenario=run.scenario.name,
        tone=tone,
        badge=badge,
        sentence=joined(outcome_sentence(run)),
        events=events[:MOST],
        events_left_out=max(len(events) - MOST, 0),
        tiles=[
            {"name": name, "value": joined(value), "note": joined(note)}
            for name, value, note in _tiles(run)
        ],
        picture=Markup(image(render(picture, "svg"))),
        times_table=Markup(table(_time_rows(run))),
        statuses=Markup(table(_status_rows(run))),
        fit=Markup(fit_section(model)),
        conditions=Markup(table(_conditions(run))),
        toml=run.scenario.to_toml(),
        made=Markup(table(made_rows(run, command))),
        kept=_kept(run.info),
        css=Markup("\n".join(_file(name) for name in ("page.css", "player.css"))),
        data=Markup(player_data(run, u_min, u_max, beside or {})),
        script=Markup(code),
        script_hash=script_hash,
    )
    # a file name may hold what UTF-8 cannot
    write_picture(Path(path), page.encode("utf-8", errors="xmlcharrefreplace"))


def _template() -> Template:
    """The page's frame; whatever is put into it is escaped, but what says that it is HTML."""
    try:
        from jinja2 import Environment, StrictUndefined
    except ImportError as error:
        raise KmpcError("a report needs jinja2: pip install 'kmpc-lab[plot]'") from error
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    return environment.from_string(_file("report.html.j2"))


def _file(name: str) -> str:
    return (FILES / name).read_text(encoding="utf-8")


def _tiles(run: Run) -> Iterable[tuple[str, str, str]]:
    """Key numbers: name, value and note."""
    scenario, times = run.scenario, run.step_times
    clearance = "no obstacles" if not np.isfinite(run.clearance) else length(run.clearance)
    margin = f"{length(scenario.margin)} asked for" if scenario.margin else "edge to edge"
    solved = run.statuses.count("SOLVED")
    without = run.statuses.count("FALLBACK") + run.statuses.count("STOPPED")
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
    yield from numbers


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


def _conditions(run: Run) -> Iterable[tuple[str, str]]:
    """Which robot was driven, and the options that are not the usual ones."""
    plant = str(run.info.get("plant", SCENARIOS_OWN))
    robot = {
        SCENARIOS_OWN: "simulated, with the slip, lag and floors of the scenario",
        LEARNED: "simulated: behaves as the model does; the scenario's [plant] does not act",
    }
    yield "Robot", robot.get(plant, f"{plant}; the scenario's [plant] does not act")
    yield "Obstacles", str(run.scenario.obstacle_count)
    yield "Period and horizon", f"{milliseconds(run.dt)}, {run.plans.shape[1] - 1} stages"
    changed = run.info.get("options", run.scenario.options.changed())
    if isinstance(changed, Mapping) and changed:
        yield "Options that were changed", json.dumps(changed)


def _kept(info: Mapping[str, Any]) -> str:
    """What the caller kept with the run, as JSON."""
    if not info:
        return ""
    return json.dumps(info, indent=2, sort_keys=True, ensure_ascii=False, default=str)
