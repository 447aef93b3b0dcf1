"""Options of the step itself: what is believed of its inputs, and what of a solver's answer."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.option_fields import check, radii, share


@dataclass(frozen=True, slots=True)
class StepOptions:
    """What a step believes, and how it shares out its time."""

    accepted_defect: float = radii(1 / 3)
    """How far the model's prediction may be from the plan over one period [radii, and 0.15 rad a
    radius]. Beyond it the solver linearises again around the plan; if that does not help, the
    plan's commands are rolled out with the model."""
    guide_share: float = share(1 / 3)
    """Share of a time budget after which a search for a path is left to the next step."""

    def __post_init__(self) -> None:
        check(self)
