"""Short versions of ``kmpc study pedestrians`` and ``kmpc study jumps``, and how they count."""

import numpy as np
import pytest
from executors import Inline

from kmpc_lab.sim.pedestrians import Pedestrians, Walks
from kmpc_lab.studies import jumps, pedestrians
from kmpc_lab.studies.records import Work


@pytest.mark.parametrize("turning", [False, True])
def test_pedestrians_walk_at_their_pace_and_stay_about(turning: bool) -> None:
    crowd = Pedestrians(Walks(8, turning), 1, np.zeros(2))
    assert (np.hypot(*crowd.circles[:, :2].T) >= 1.5).all()
    for _ in range(300):
        before = crowd.circles
        places = crowd.walk(0.1, 10)
        there = crowd.circles[:, :2]
        np.testing.assert_array_equal(places[-1], there)
        walked = np.hypot(*(there - before[:, :2]).T)
        assert (walked <= 0.1 * crowd.speeds + 1e-9).all()
        assert (walked >= 0.099 * crowd.speeds).all()
        assert np.abs(there).max() < 4.5


def test_a_contact_is_attributed_to_what_moves() -> None:
    stood = np.zeros((200, 2))
    assert pedestrians._kind(stood, np.array([0.4, 0.0])) == "walked_into"
    drives = np.column_stack([0.006 * np.arange(200), np.zeros(200)])
    ahead, behind = drives[-1] + (0.4, 0.0), drives[-1] - (0.4, 0.0)
    assert pedestrians._kind(drives, ahead) == "driven_into"
    assert pedestrians._kind(drives, behind) == "met"
    # what is left of a command to stand approaches no pedestrian
    stops = drives.copy()
    stops[-50:] = stops[-50] + np.column_stack([1e-7 * np.arange(50), np.zeros(50)])
    assert pedestrians._kind(stops, stops[-1] + (0.4, 0.0)) == "met"


def test_records_of_pedestrians_are_resumed_and_reported(tmp_path, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.setattr(pedestrians, "TIMEOUT", 3.0)
    path = tmp_path / "people.jsonl"
    work = Work(Inline(), records=path)
    for _ in range(2):
        records = pedestrians.study(work, 1, (4,), ("told",), first_seed=2)
    assert len(records) == 2 == len(path.read_text().splitlines())
    assert "straight" in pedestrians.format_rows(records)
    assert sum(row["driven_into"] for row in pedestrians.rows(records)) == 0


@pytest.mark.parametrize("kind", jumps.KINDS)
def test_a_pose_jumps_as_often_and_as_long_as_given(kind: str) -> None:
    made, wrong = jumps.Jumps(kind, 0.3, 1), []
    for k in range(300):
        wrong.append(made.at(0.1 * k) + made.frame)
    off = np.array(wrong)
    changed = np.flatnonzero(np.abs(np.diff(off, axis=0)).max(axis=1) > 0)
    assert 5 <= made.count <= 15
    sizes = np.abs(np.diff(off, axis=0))[changed]
    size = sizes[:, 2] if kind == "heading" else np.hypot(*sizes[:, :2].T)
    np.testing.assert_allclose(size, 0.3)
    if kind == "one sample":
        assert (np.diff(changed)[::2] == 1).all()


def test_a_robot_whose_pose_jumps_arrives(tmp_path) -> None:  # type: ignore[no-untyped-def]
    records = jumps.study(Work(Inline()), 1, ("a second",), (0.3,), first_seed=1)
    (row,) = jumps.rows(records)
    assert row["collisions"] == 0 and row["arrived"] == 1 and row["waited_s"] > 0.5
    assert "a second" in jumps.format_rows(records)
