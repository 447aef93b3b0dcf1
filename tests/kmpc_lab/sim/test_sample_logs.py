"""Logs to try things with are read, and tell of the robot that was simulated."""

from pathlib import Path

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.sim import sample_logs


@pytest.mark.parametrize("kind", ["ardupilot_log", "ros_bag"])
def test_a_sample_log_is_read_and_learned_from(kind: str, tmp_path: Path) -> None:
    if kind == "ros_bag":
        pytest.importorskip("rosbags", reason="the extra logs (rosbags) is not installed")
    path = getattr(sample_logs, kind)(tmp_path / "log.bin", seconds=40.0, seed=3)
    data = kl.Dataset.load(path)
    (episode,) = data.episodes
    assert len(episode.inputs) == pytest.approx(400, abs=3)
    assert abs(episode.inputs).max(axis=0) == pytest.approx((0.6, 0.8), abs=0.1)
    model = kl.fit(data, lags="auto")
    # from rest, half a metre less the 0.15 s by which the motors lag, on a floor that slips
    reached = model.rollout(np.zeros(3), np.tile((0.5, 0.0), (10, 1)))[-1]
    assert reached[0] == pytest.approx(0.5 * 1.03 * 0.85, abs=0.02)
