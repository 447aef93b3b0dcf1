"""All options of a controller in one."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields
from typing import Any

from kmpc_lite.control.options.goal import GoalOptions
from kmpc_lite.control.options.guidance import GuidanceOptions
from kmpc_lite.control.options.margins import MarginOptions
from kmpc_lite.control.options.obstacles import ObstacleOptions
from kmpc_lite.control.options.solver import SolverOptions
from kmpc_lite.control.options.step import StepOptions
from kmpc_lite.control.options.stop import StopOptions
from kmpc_lite.control.options.traffic import TrafficOptions
from kmpc_lite.errors import ProblemError


@dataclass(frozen=True)
class ControllerOptions:
    """Every tunable of the controller, by room.

    Examples
    --------
    >>> options = ControllerOptions.from_dict({"guidance": {"lead_time": 0.3}})
    >>> options.guidance.lead_time, options.changed()
    (0.3, {'guidance': {'lead_time': 0.3}})
    """

    guidance: GuidanceOptions = field(default_factory=GuidanceOptions)
    """How paths are found, timed and followed."""
    goal: GoalOptions = field(default_factory=GoalOptions)
    """When the robot has arrived."""
    traffic: TrafficOptions = field(default_factory=TrafficOptions)
    """What it does about moving obstacles."""
    margins: MarginOptions = field(default_factory=MarginOptions)
    """How far it stays away for what its model does not know."""
    solver: SolverOptions = field(default_factory=SolverOptions)
    """How the nonlinear program is solved."""
    stop: StopOptions = field(default_factory=StopOptions)
    """How a stop trajectory is found."""
    obstacles: ObstacleOptions = field(default_factory=ObstacleOptions)
    """How many obstacles it looks at."""
    step: StepOptions = field(default_factory=StepOptions)
    """What a step believes, and how it shares out its time."""

    def __post_init__(self) -> None:
        for f in fields(self):
            value, kind = getattr(self, f.name), f.default_factory
            if not isinstance(value, kind):  # type: ignore[arg-type]
                raise ProblemError(
                    f"ControllerOptions.{f.name}: expected {kind.__name__}, "  # type: ignore[union-attr]
                    f"got {type(value).__name__}"
                )

    @classmethod
    def from_dict(cls, tables: dict[str, Any]) -> ControllerOptions:
        """Options from tables of a scenario or problem file: ``{room: {option: value}}``.

        Raises
        ------
        ProblemError
            Names the table or the option that is not there, or whose value is wrong.
        """
        rooms = {f.name: f.default_factory for f in fields(cls)}
        made: dict[str, Any] = {}
        for room, given in tables.items():
            if room not in rooms:
                raise ProblemError(f"options.{room}: expected one of {', '.join(rooms)}")
            kind: Any = rooms[room]
            if not isinstance(given, dict):
                raise ProblemError(f"options.{room}: expected a table, got {given!r}")
            known = {f.name for f in fields(kind)}
            for name in given:
                if name not in known:
                    raise ProblemError(
                        f"options.{room}.{name}: expected one of {', '.join(sorted(known))}"
                    )
            values = {k: tuple(v) if isinstance(v, list) else v for k, v in given.items()}
            made[room] = kind(**values)
        return cls(**made)

    def changed(self) -> dict[str, dict[str, Any]]:
        """What differs from the defaults, as `from_dict` takes it: kept with a run."""
        own, usual = asdict(self), asdict(type(self)())
        rooms = {
            room: {k: v for k, v in values.items() if v != usual[room][k]}
            for room, values in own.items()
        }
        return {room: values for room, values in rooms.items() if values}
