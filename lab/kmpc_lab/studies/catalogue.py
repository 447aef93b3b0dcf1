"""The studies over random maps by name: conditions, and the controllers that drive under them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from kmpc_lab.studies.conditions import (
    BOTH_CHANGE,
    LAGGING,
    NOISY,
    NOISY_CHANGE,
    NOISY_LAGGING,
    OLD,
    OLD_LAGGING,
    PLAIN,
    SLIPPERY,
    TURNING,
    TURNS_LESS,
    Condition,
)
from kmpc_lab.studies.contenders import EVERYTHING, STUDY_CONTENDERS, UNADAPTED, Contender
from kmpc_lab.studies.training import LAMBDAS
from kmpc_lite.errors import ProblemError

OURS, PAPERS = EVERYTHING.label, "K-NMPC, IPOPT"


@dataclass(frozen=True)
class MapsStudy:
    """What one of the ``kmpc study`` commands drives where nothing else is asked for."""

    text: str
    controllers: tuple[str, ...] = (OURS,)
    """Labels."""
    conditions: tuple[Condition, ...] = (PLAIN,)
    slips: tuple[float, ...] = LAMBDAS
    trained_at: float | None = None


STUDIES: Mapping[str, MapsStudy] = {
    "maps": MapsStudy("random maps by families and slips", (PAPERS, OURS)),
    "lag": MapsStudy(
        "a robot whose motors lag, driven with a model learned from its log, with exact, "
        "noisy and old poses",
        conditions=(LAGGING, NOISY_LAGGING, OLD_LAGGING),
        slips=(0.0, 0.1),
    ),
    "noise": MapsStudy(
        "noisy poses, and old ones", conditions=(NOISY, OLD), slips=(0.0, 0.05, 0.1, 0.2)
    ),
    "turning": MapsStudy(
        "robots that turn about a point centimetres from the one tracked, "
        "driven with a model learned from their logs",
        conditions=TURNING,
        slips=(0.1,),
    ),
    "adaptation": MapsStudy(
        "a floor that changes after a second",
        (UNADAPTED.label, OURS),
        (SLIPPERY, TURNS_LESS, BOTH_CHANGE, NOISY_CHANGE),
        slips=(0.0,),
    ),
    "mismatch": MapsStudy(
        "models learned at another slip than the one driven at",
        (UNADAPTED.label, OURS),
        slips=(0.15, 0.2),
        trained_at=0.1,
    ),
}


def choose(study: MapsStudy, words: Sequence[str] | None) -> list[Contender]:
    """Controllers whose labels contain one of the words; the study's own where none are given.

    Raises
    ------
    ProblemError
        Where nobody is left, or the paper's one-step fit is asked to learn from a log that is no
        simulation of its own.
    """
    if words is None:
        return [c for c in STUDY_CONTENDERS if c.label in study.controllers]
    chosen = [c for c in STUDY_CONTENDERS if any(word.lower() in c.label.lower() for word in words)]
    if not chosen:
        raise ProblemError(
            f"--controllers {' '.join(words)}: nobody is left; "
            f"labels are {'; '.join(c.label for c in STUDY_CONTENDERS)}"
        )
    if study.conditions != (PLAIN,) and any(c.fit != "integral" for c in chosen):
        refused = "; ".join(c.label for c in chosen if c.fit != "integral")
        raise ProblemError(
            f"--controllers {refused}: only controllers with an integral fit are driven in this "
            "study"
        )
    return chosen
