"""All options of a controller in one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from typing import Any

from kmpc_lite.adaptation.options import AdaptationOptions
from kmpc_lite.control.options.control import (
    MarginOptions,
    PoseOptions,
    SolverOptions,
    StepOptions,
    StopOptions,
)
from kmpc_lite.control.options.guidance import GoalOptions, GuidanceOptions, MovingObstacleOptions
from kmpc_lite.control.options.sight import ObstacleOptions, SightOptions, TrackerOptions
from kmpc_lite.errors import ProblemError, did_you_mean
from kmpc_lite.option_fields import check, group


@dataclass(frozen=True)
class ControllerOptions:
    """Every tunable of the controller, by room.

    Examples
    --------
    >>> options = ControllerOptions.from_dict({"guidance": {"lead_time": 0.3}})
    >>> options.guidance.lead_time, options.changed()
    (0.3, {'guidance': {'lead_time': 0.3}})
    """

    guidance: GuidanceOptions = group(GuidanceOptions())
    """How paths are found, timed and followed."""
    goal: GoalOptions = group(GoalOptions())
    """When the robot has arrived."""
    moving_obstacles: MovingObstacleOptions = group(MovingObstacleOptions())
    """What it does about moving obstacles."""
    tracker: TrackerOptions = group(TrackerOptions())
    """When circles count as moving otherwise than told."""
    margins: MarginOptions = group(MarginOptions())
    """How far it stays away for what its model does not know."""
    solver: SolverOptions = group(SolverOptions())
    """How the nonlinear program is solved."""
    stop: StopOptions = group(StopOptions())
    """Which motions to rest are tried, and what is clear."""
    obstacles: ObstacleOptions = group(ObstacleOptions())
    """How many obstacles it looks at."""
    sight: SightOptions = group(SightOptions())
    """What is remembered of scans, and of circles that are told within a range."""
    pose: PoseOptions = group(PoseOptions())
    """When a pose has jumped."""
    step: StepOptions = group(StepOptions())
    """What a step believes, and how it shares out its time."""
    adaptation: AdaptationOptions = group(AdaptationOptions())
    """How fast, and how far, the model is corrected while driving."""

    def __post_init__(self) -> None:
        check(self)

    @classmethod
    def from_dict(cls, tables: Mapping[str, Any]) -> ControllerOptions:
        """Options from tables of a scenario or problem file: ``{room: {option: value}}``.

        Raises
        ------
        ProblemError
            Names the table or the option that is not there, or whose value is wrong.
        """
        made: ControllerOptions = _changed_by(cls(), tables, "options")
        return made

    def changed(self) -> dict[str, Any]:
        """What differs from the defaults, as `from_dict` takes it: kept with a run."""
        return _difference(asdict(self), asdict(type(self)()))


def _changed_by(options: Any, table: Mapping[str, Any], where: str) -> Any:
    """Options (a dataclass) with the values of a table, in which those of a room are a table."""
    known = [f.name for f in fields(options)]
    values: dict[str, Any] = {}
    for name, value in table.items():
        place = f"{where}.{name}"
        if name not in known:
            hint = did_you_mean(name, known) or f"; expected one of {', '.join(known)}"
            raise ProblemError(f"{place}: unknown{hint}")
        before = getattr(options, name)
        if is_dataclass(before):
            if not isinstance(value, Mapping):
                raise ProblemError(f"{place}: expected a table, got {value!r}")
            values[name] = _changed_by(before, value, place)
        else:
            values[name] = tuple(value) if isinstance(value, list) else value
    try:
        return replace(options, **values)
    except ProblemError as error:
        raise ProblemError(f"{where}: {error}") from error


def _difference(own: dict[str, Any], usual: dict[str, Any]) -> dict[str, Any]:
    """Entries of a table that are others than in another one, table by table."""
    found: dict[str, Any] = {}
    for name, value in own.items():
        if isinstance(value, dict):
            value = _difference(value, usual[name])
            if value:
                found[name] = value
        elif value != usual[name]:
            found[name] = value
    return found
