"""Tables of a study: what is counted, compared, and how sure that is."""

import json
from typing import Any

import numpy as np
import pytest

from kmpc_lab.studies.tables import summarise, time_ratio, wilson


def made_up(
    controller: str,
    slip: float,
    seed: int,
    collision: float | None,
    position: float | None,
    pose: float | None,
) -> dict[str, Any]:
    keys = (
        "controller",
        "family",
        "trained_at",
        "slip",
        "seed",
        "collision_s",
        "position_s",
        "pose_s",
    )
    record = dict(
        zip(keys, (controller, "open", None, slip, seed, collision, position, pose), strict=True)
    )
    return {**record, "condition": "", "clearance_m": -0.01 if collision else 0.02 + 0.001 * seed}


MADE_UP = [
    made_up("a", 0.0, 1, None, 5.0, 6.0),
    made_up("a", 0.0, 2, None, 7.0, None),
    made_up("a", 0.1, 1, 2.0, 1.0, 1.5),
    made_up("a", 0.1, 2, None, 4.0, 8.0),
    made_up("b", 0.0, 1, None, 4.0, 4.0),
    made_up("b", 0.0, 2, None, 4.0, 4.0),
    made_up("b", 0.1, 1, None, 4.0, 4.0),
    made_up("b", 0.1, 2, None, None, None),
]


def test_rows_count_what_arrived_untouched() -> None:
    rows = {(r.controller, r.slip): r for r in summarise(MADE_UP)}
    assert set(rows) == {(c, s) for c in "ab" for s in (0.0, 0.1, None)}
    still, slips, both = rows["a", 0.0], rows["a", 0.1], rows["a", None]
    assert (still.drives, still.collisions, still.at_position, still.at_pose) == (2, 0, 2, 1)
    assert (slips.drives, slips.collisions, slips.at_position, slips.at_pose) == (2, 1, 1, 1)
    assert (both.drives, both.collisions, both.at_position, both.at_pose) == (4, 1, 3, 2)
    assert both.position_s == pytest.approx(16 / 3) and both.pose_s == pytest.approx(7.0)
    assert slips.clearance_m == -0.01
    assert both.as_dict()["wilson_95"]["collisions"] == [round(v, 5) for v in wilson(1, 4)]
    json.dumps(both.as_dict())


def test_times_are_compared_where_both_arrive() -> None:
    # only seed 1 at slip 0: elsewhere one of them collides or never arrives
    assert time_ratio(MADE_UP, "a", "b") == (1, pytest.approx(1.5))
    assert time_ratio(MADE_UP, "a", "nobody") == (0, None)


@pytest.mark.parametrize(
    ("successes", "trials"), [(0, 10), (1, 10), (5, 10), (10, 10), (0, 1), (799, 800), (800, 800)]
)
def test_wilson_holds_the_shares_whose_score_test_is_not_refused(
    successes: int, trials: int
) -> None:
    low, high = wilson(successes, trials)
    assert 0.0 <= low <= successes / trials <= high <= 1.0
    for end in (low, high):
        if 0.0 < end < 1.0:
            # at the ends the observed share is 1.96 standard errors away
            assert abs(successes / trials - end) == pytest.approx(
                1.959964 * np.sqrt(end * (1 - end) / trials), rel=1e-5
            )
