"""The digital twin is a robot.

It slides to turn, stops, is the same twice, and feels what it touches.
"""

import numpy as np
import pytest

from kmpc_lab import Outcome, drive
from kmpc_lab.sim.twin import FLOORS, Floor, Ground, Twin
from kmpc_lab.sim.twin.mjcf import TORQUE
from kmpc_lite import Circle, Controller, NavigationProblem, ScenarioError, nominal_unicycle
from kmpc_lite.scenario.files import Scenario


def turn_gain(floor, v=0.2, omega=0.6):
    twin = Twin(ground=Ground(floor))
    twin.command(v, omega)
    twin.advance(1.0)
    before = twin.pose[2]
    twin.advance(2.0)
    return (twin.pose[2] - before) / (2.0 * omega)


def test_it_stands_drives_straight_and_stops():
    twin = Twin(pose=(0.3, -0.2, 0.5))
    twin.advance(0.5)
    assert np.allclose(twin.pose, (0.3, -0.2, 0.5), atol=1e-3)
    twin.command(0.4, 0.0)
    twin.advance(2.0)
    travelled = np.hypot(twin.pose[0] - 0.3, twin.pose[1] + 0.2)
    assert 0.7 < travelled < 0.8 and abs(twin.pose[2] - 0.5) < 0.01
    twin.command(0.0, 0.0)
    twin.advance(1.0)
    assert np.abs(twin.velocity).max() < 1e-3


def test_a_skid_steer_robot_turns_less_than_its_wheels_say_and_least_on_carpet():
    tile, carpet, wet = (turn_gain(FLOORS[name]) for name in ("tile", "carpet", "wet"))
    assert 0.35 < carpet < tile - 0.05 and tile < wet - 0.03 and wet < 0.85


def test_the_floor_changes_by_time_and_by_place():
    wet, tile = FLOORS["wet"], FLOORS["tile"]
    ground = Ground.named("tile", ((1.0, "carpet"),), (("wet", 1.0, 0.0, 0.2),))
    places = np.array([[0.0, 0.0], [1.1, 0.0]])
    assert ground.under(places, 0.0) == [tile, wet] and ground.under(places, 1.0) == [
        FLOORS["carpet"],
        wet,
    ]
    twin = Twin(ground=ground)
    twin.advance(0.5)
    before = twin.model.pair_friction[:, 0].copy()
    twin.advance(0.6)
    assert (before == tile.sliding).all() and (
        twin.model.pair_friction[:, 0] == FLOORS["carpet"].sliding
    ).all()


def test_a_touch_is_felt_and_pushes_back():
    twin = Twin([Circle(0.5, 0.0, 0.1)])
    twin.command(0.4, 0.0)
    twin.advance(0.5)
    assert twin.touched is None
    twin.advance(2.0)
    assert twin.touched is not None and 0.5 < twin.touched < 1.2
    assert twin.pose[0] < 0.45
    assert np.abs(twin.data.actuator_force).max() <= TORQUE


def test_it_is_a_plant_of_the_closed_loop():
    scenario = Scenario(
        "room",
        (-2.0, -2.0, 2.0, 2.0),
        (Circle(0.7, 0.0, 0.12),),
        0.15,
        (0.0, 0.0, 0.0),
        (1.2, 0.0, 0.0),
        margin=0.05,
        timeout=15.0,
    )
    controller = Controller(nominal_unicycle(0.1), scenario.problem(NavigationProblem()))
    twin = Twin.of(scenario)
    run = drive(controller, scenario, twin)
    assert run.outcome is Outcome.REACHED and twin.touched is None
    assert (
        run.path[0].tolist() == list(scenario.start) and np.abs(np.diff(run.path[:, 2])).max() < 0.1
    )


@pytest.mark.parametrize(
    "make",
    (
        lambda: Twin([Circle(1.0, 0.0, 0.1, 0.1, 0.0)]),
        lambda: Ground.named("ice"),
        lambda: Ground(changes=((1.0, FLOORS["wet"]), (0.5, FLOORS["tile"]))),
        lambda: Floor(-1.0, 0.0, 0.0),
    ),
)
def test_what_cannot_be_is_refused(make):
    with pytest.raises(ScenarioError):
        make()
    with pytest.raises(ValueError, match="one state"):
        Twin().trace(np.zeros((2, 3)), np.zeros(2), 0.1, 1)


def test_a_seed_is_one_robot():
    def end(seed):
        twin = Twin(seed=seed)
        twin.command(0.4, 0.3)
        twin.advance(2.0)
        return np.array(twin.pose)

    assert (end(3) == end(3)).all()
    assert np.abs(end(3) - end(4)).max() > 1e-4
