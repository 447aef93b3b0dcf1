"""Nobody is driven into who turns on the spot beside the robot."""

from __future__ import annotations

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.control.options import StopOptions
from kmpc_lite.control.stop.braking import Braking
from kmpc_lite.control.stop.passers_by import PassersBy, share_beside
from kmpc_lite.types import Array

RADIUS, TIME, AWAY = 0.15, 0.1, 0.5


def share(person: list[float], there: Array) -> float:
    circles = np.array([person])
    speeds = np.hypot(circles[:, 3], circles[:, 4])
    return share_beside(circles, speeds, np.zeros(2), there, RADIUS, TIME, AWAY)


@pytest.mark.parametrize("speed", [0.3, 1.0])
def test_a_motion_ends_clear_of_wherever_he_turns_or_leads_away(speed: float) -> None:
    random, slowed = np.random.default_rng(1), 0
    for _ in range(300):
        bearing, way, turn = random.uniform(-np.pi, np.pi, 3)
        gap, length = random.uniform(-0.05, 0.3), random.uniform(0.01, 0.1)
        towards = np.array([np.cos(bearing), np.sin(bearing)])
        place = (gap + 0.25 + RADIUS) * towards
        there = length * np.array([np.cos(way), np.sin(way)])
        found = share([*place, 0.25, speed * np.cos(turn), speed * np.sin(turn)], there)
        slowed += found < 1.0
        end = found * there
        leads_away = there @ towards <= -AWAY * length
        reaches = np.hypot(*(end - place)) - 0.25 - RADIUS - TIME * speed < -1e-12
        assert 0.0 <= found <= 1.0
        assert leads_away or not reaches or found == 0.0
        assert found == 1.0 or not leads_away
    assert slowed > 30


def test_who_stands_and_who_is_far_does_not_count() -> None:
    ahead = np.array([0.06, 0.0])
    assert share([0.42, 0.0, 0.25, 0.0, 0.0], ahead) == 1.0
    assert share([1.0, 0.0, 0.25, -1.0, 0.0], ahead) == 1.0
    assert share([0.42, 0.0, 0.25, -1.0, 0.0], np.zeros(2)) == 1.0


@pytest.mark.parametrize("du_max", [None, (1.5, 5.0)])
def test_a_controller_does_not_drive_towards_who_walks_beside_it(
    du_max: tuple[float, float] | None,
) -> None:
    problem = kl.NavigationProblem() if du_max is None else kl.NavigationProblem(du_max=du_max)
    controller = kl.Controller(kl.nominal_unicycle(0.1), problem)
    # walks past at 6 cm, and would be clear if he kept his way
    command = controller.step(
        (0.0, 0.0, 0.0), (2.0, 0.0, 0.0), [kl.Circle(0.2, 0.42, 0.25, vx=-0.8)]
    ).command
    assert command[0] <= 0.02


def slowed_by(problem: kl.NavigationProblem, gap: float, bearing: float = 0.0) -> float:
    """Share of 0.1 m/s at which the robot passes who walks at 1 m/s, at a gap and a bearing."""
    passers_by = PassersBy(problem, Braking(problem, StopOptions()), StopOptions())
    away = gap + 0.25 + RADIUS
    person = [away * np.cos(bearing), away * np.sin(bearing), 0.25, 0.0, 1.0]
    states = np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0]])
    return passers_by.share(np.array([person]), np.ones(1), states, np.array([0.1, 0.7]), 8)


def test_he_may_turn_for_three_tenths_of_a_second_at_the_most() -> None:
    assert slowed_by(kl.NavigationProblem(du_max=(0.1, 0.1)), 0.32) == 1.0
    assert slowed_by(kl.NavigationProblem(du_max=(0.1, 0.1)), 0.30) < 0.1


def test_a_motion_makes_room_that_leads_away_by_sixty_degrees() -> None:
    bearing = np.arccos(-0.55), np.arccos(-0.45)
    assert slowed_by(kl.NavigationProblem(), 0.1, bearing[0]) == 1.0
    assert slowed_by(kl.NavigationProblem(), 0.1, bearing[1]) == 0.0
