"""The study of learning: what it says of one robot of each kind, and how it says it."""

import numpy as np

import kmpc_lite as kl
from kmpc_lab.studies.learning import (
    Ratio,
    compare,
    format_harm,
    format_ratios,
    study_lagging,
    study_nominal,
)


def test_a_lagging_robot_errs_by_a_quarter_of_nominal_at_most() -> None:
    (row,) = study_lagging(robots=1)
    assert max(row.along, row.across, row.heading) <= 0.25 and row.history > 0


def test_a_nominal_robot_is_not_harmed() -> None:
    rows = study_nominal(robots=1)
    assert "harmed 0 (0.0 %)" in format_harm(rows)


def test_a_bound_is_above_its_ratio_and_what_is_worse_is_counted() -> None:
    random = np.random.default_rng(1)
    nominal = [random.normal(size=(30, 3)) for _ in range(40)]
    model = kl.nominal_unicycle(0.1)
    better = compare(
        "better", model, [0.5 * e * random.uniform(0.8, 1.2) for e in nominal], nominal
    )
    assert 0.4 < better.along < better.bounds[0] < 0.6
    worse = Ratio("worse", 1.02, 1.0, 1.0, (1.1, 1.0, 1.0), 0)
    assert "harmed 1 (50.0 %), at most by 2.00 %" in format_harm([better, worse])
    assert "worst                     1.020" in format_ratios("both", [better, worse])
