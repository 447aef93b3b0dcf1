"""Every flood in turn, and what it costs: the table of docs/results/attacks.md."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from kmpc_lab.attacks.floods import FLOODS, Flood, Surface
from kmpc_lab.attacks.trial import Trial, run

HEAD = (
    "surface",
    "attack",
    "MB read",
    "gate late, p99 [ms]",
    "standstill [s]",
    "ratio",
    "emergency stop [ms]",
)


@dataclass(frozen=True)
class Row:
    """One flood beside the same drive without it."""

    flood: Flood
    quiet: Trial
    attacked: Trial

    @property
    def ratio(self) -> float:
        """Time to standstill under attack, by that without."""
        return self.attacked.standstill / self.quiet.standstill

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON: seconds."""
        both = {"without": self.quiet, "with": self.attacked}
        return {
            "surface": self.flood.surface.name,
            "attack": self.flood.name,
            "bytes_read": self.attacked.bytes_in,
            "ratio": round(self.ratio, 3),
            **{
                name: {
                    "late_p99_s": round(trial.late_p99(), 5),
                    "late_max_s": round(max(trial.late), 5),
                    "standstill_s": round(trial.standstill, 4),
                    "emergency_stop_s": round(trial.press, 5),
                }
                for name, trial in both.items()
            },
        }

    def cells(self) -> tuple[str, ...]:
        """For people: without / with the attack."""
        quiet, attacked = self.quiet, self.attacked
        return (
            self.flood.surface.name,
            self.flood.name,
            f"{attacked.bytes_in / 1e6:.1f}",
            f"{1e3 * quiet.late_p99():.1f} / {1e3 * attacked.late_p99():.1f}",
            f"{quiet.standstill:.2f} / {attacked.standstill:.2f}",
            f"{self.ratio:.2f}",
            f"{1e3 * quiet.press:.0f} / {1e3 * attacked.press:.0f}",
        )


def chosen(words: Sequence[str]) -> list[Flood]:
    """Floods whose surface or name contains one of the words; all of them without words."""
    names = ((flood, f"{flood.surface.name}: {flood.name}".lower()) for flood in FLOODS)
    return [
        flood for flood, name in names if not words or any(word.lower() in name for word in words)
    ]


def measure(floods: Sequence[Flood], say: Callable[[str], None] = lambda text: None) -> list[Row]:
    """Drive each surface without an attack, then under each; `say` takes what is under way."""
    quiet: dict[Surface, Trial] = {}
    rows = []
    for number, flood in enumerate(floods, 1):
        say(f"{number} of {len(floods)}: {flood.surface.name}: {flood.name} ...")
        if flood.surface not in quiet:
            quiet[flood.surface] = run(flood.surface, ())
        rows.append(Row(flood, quiet[flood.surface], run(flood.surface, (flood, *flood.also))))
    say("")
    return rows


def table(rows: Sequence[Row]) -> str:
    """Render the rows in Markdown."""
    lines = [HEAD, tuple("-" * 3 for _ in HEAD), *(row.cells() for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
