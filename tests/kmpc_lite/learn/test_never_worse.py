"""No direction of a model is worse than the nominal robot's on what was held out."""

from pathlib import Path

import numpy as np
import pytest
from public_cases import case

import kmpc_lite as kl
from kmpc_lite.learn.learning import learn
from kmpc_lite.learn.loading import load_logs
from kmpc_lite.learn.verdict import verdict


def circles(speed: float, turn: float, seed: int) -> kl.Dataset:
    """A log of circles at one speed, which tells neither speed from turn nor a lag from a gain."""
    random, dt, pose = np.random.default_rng(seed), 0.1, np.zeros(3)
    commands = np.array((speed, turn)) * (1.0 + 0.01 * random.normal(size=(600, 2)))
    seen = []
    for command in commands:
        seen.append(pose + random.normal(size=3) * (0.005, 0.005, 0.017))
        pose = kl.nominal_unicycle(dt).predict(pose, command)
    seen.append(pose)
    return kl.Dataset([kl.Episode(np.array(seen), commands, dt)])


def assert_never_worse(learned) -> None:
    report = learned.report
    for ours, theirs in zip(report.multi_step, report.nominal_multi_step, strict=True):
        assert ours <= 1.25 * theirs


@pytest.mark.parametrize("name", ["circles_1", "car_circles_1"])
def test_a_log_of_circles_is_not_fitted_by_its_noise(name: str) -> None:
    assert_never_worse(learn(load_logs([path := case(f"logs/{name}.csv")]), [path]))


@pytest.mark.parametrize("seed", range(3))
def test_siblings_of_it_are_not_either(seed: int) -> None:
    assert_never_worse(learn(circles(0.5 + 0.3 * seed, 0.6, seed), [Path("log")]))


def test_the_verdict_says_that_it_stays_nominal_and_what_is_missing() -> None:
    learned = learn(load_logs([path := case("logs/circles_1.csv")]), [path])
    words = verdict(learned.report, learned.facts, learned.made["driven"])
    assert words.startswith("As nominal: the log supports no better") and "left turns" in words
    assert learned.model.info["selection"]["directions"]["heading"]["step"] == "nominal"


@pytest.mark.parametrize("on_the_spot", [False, True])
def test_a_differential_robots_log_with_a_steering_column_is_no_cars(
    tmp_path: Path, on_the_spot: bool
) -> None:
    random, dt, pose, rows = np.random.default_rng(3), 0.05, np.zeros(3), []
    for k in range(1200):
        if k % 30 == 0:
            still = on_the_spot and random.random() < 0.5
            command = random.uniform(-1, 1, 2) * (0.0 if still else 0.8, 1.2)
            steering = float(np.arctan2(2.5 * command[1], abs(command[0]) + 1.0))
        rows.append((k * dt, *pose, command[0], steering if on_the_spot else random.uniform(-1, 1)))
        pose = kl.nominal_unicycle(dt).predict(pose, command)
    path = tmp_path / "log.csv"
    head = "t,x,y,theta,v,steering"
    np.savetxt(path, rows, delimiter=",", header=head, comments="")
    with pytest.raises(kl.DataError, match="steering: the robot turns (otherwise|where it stands)"):
        load_logs([path], None, None, None, lambda line: None)
