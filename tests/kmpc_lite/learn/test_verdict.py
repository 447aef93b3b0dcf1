"""The first line of `kmpc fit`: whether the model is worth driving with."""

import pytest

from kmpc_lite.learn.evaluation import FitReport
from kmpc_lite.learn.verdict import verdict

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
    ],
)
def test_the_verdict_compares_with_the_nominal_robot(ratios: tuple[float, ...], told: str) -> None:
    line = verdict(report(*ratios), {}, DRIVEN)
    assert line.startswith(told) and line.endswith("drive up to 1.1 m/s.")
