"""The first line of `kmpc fit`: whether the model is worth driving with, and what is missing."""

import pytest

from kmpc_lite.learn.evaluation import FitReport
from kmpc_lite.learn.fit_summary import verdict

NOMINAL = (0.05, 0.02, 0.01)
DRIVEN = {"forward": 1.1, "reverse": 0.4, "turn": 0.8}


def report(*ratios: float) -> FitReport:
    """Errors that are so many times smaller than the nominal robot's."""
    ours = tuple(n / r for n, r in zip(NOMINAL, ratios, strict=True))
    return FitReport(1.0, 100, ours, ours, NOMINAL, NOMINAL, 0.1)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("ratios", "told"),
    [
        ((1.0, 1.2, 5.0), "Good: predicts 5 times better than nominal in heading;"),
        ((1.0, 1.0, 1.0), "As nominal: the log supports no better prediction;"),
        ((0.5, 1.0, 1.0), "Poor: predicts 2 times worse along than nominal;"),
        ((0.5, 1.0, 3.0), "Mixed: predicts 3 times better than nominal in heading but 2 times"),
        ((1e5, 1.0, 1.0), "Good: predicts over 1000 times better than nominal along;"),
    ],
)
def test_the_verdict_compares_with_the_nominal_robot(ratios: tuple[float, ...], told: str) -> None:
    line = verdict(report(*ratios), {}, DRIVEN)
    assert line.startswith(told) and line.endswith("drive up to 1.1 m/s.")


def test_a_log_at_one_steady_speed_is_not_called_good() -> None:
    line = verdict(report(5.0, 1.0, 1.0), {"missing": ["slow", "left", "right"]}, DRIVEN)
    assert line.startswith(
        "Narrow: predicts 5 times better than nominal along, but only at the one"
    )
    turning = verdict(report(5.0, 1.0, 1.0), {"missing": ["slow"]}, DRIVEN)
    assert turning.startswith("Good: ")
