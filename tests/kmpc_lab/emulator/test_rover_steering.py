"""An emulated rover with steered wheels turns as the real firmware's does (`--model rover`)."""

import math
from collections import deque
from dataclasses import replace

import numpy as np
import pytest
from mavlink_rig import Rig

import kmpc_lite as kl
from firmware_bridge.messages import State
from firmware_bridge.recording.excitation import Excitation
from firmware_bridge.robot_file import load_robot
from firmware_bridge.safety.limits import Limits
from firmware_bridge.wheels import Wheels
from kmpc_lab.emulator.build import build_emulator
from kmpc_lab.emulator.rover.physics import Demand, DriveLimits
from kmpc_lab.emulator.rover.rover import RoverEmulator
from kmpc_lab.emulator.rover.steered import SteeredRover, tuned
from kmpc_lite.cli.main import main
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.scenario.gaps import obstacle_gaps

RADIUS = 0.9
SPEEDS = Limits(v_max=0.5, v_reverse=0.5)
AS_DELIVERED, SCALED = (1.0, 0.75, 0.2), (0.1, 9.0, 1.8)
"""rover.parm's MOT_SPD_SCA_BASE, ATC_STR_RAT_FF and P; and those of docs/howto/boards.md."""
RECORDED = [
    (AS_DELIVERED, 0.5, 0.4, 0.207),
    (AS_DELIVERED, -0.5, 0.4, 0.188),
    (SCALED, 0.5, 0.5, 0.520),
    (SCALED, 0.5, -0.3, -0.319),
    (SCALED, 0.2, 0.2, 0.205),
    (SCALED, -0.5, 0.5, 0.487),
    (SCALED, -0.5, -0.3, -0.304),
    (AS_DELIVERED, 0.0, 0.4, 0.0),
]
"""Parameters, speed and turn rate that were asked for, and the turn rate 1 s to 2 s after that, of
ArduPilot Rover 4.6.3."""


def limits(steering: tuple[float, float, float]) -> DriveLimits:
    return DriveLimits(1.0, 1.0, math.radians(120.0), math.radians(60.0), steering)


@pytest.mark.parametrize(("steering", "speed", "turn", "turned"), RECORDED)
def test_turn_rates_are_those_recorded_from_the_firmware(
    steering: tuple[float, float, float], speed: float, turn: float, turned: float
) -> None:
    rover = SteeredRover(RADIUS)
    for _ in range(200):
        rover.step(Demand(speed or None, turn), limits(steering), 0.02)
    # its integral and its speed loop wander by that much
    assert rover.velocity[2] == pytest.approx(turned, abs=0.03)


def test_a_rover_that_is_asked_for_more_drives_its_tightest_circle() -> None:
    rover = SteeredRover(RADIUS)
    for _ in range(400):
        rover.step(Demand(-0.4, 1.0), limits(SCALED), 0.02)
        east, north, turn = rover.velocity
        assert abs(turn) <= math.hypot(east, north) / RADIUS * 1.001 + 1e-6
    assert rover.velocity[2] == pytest.approx(math.hypot(east, north) / RADIUS, rel=0.01)


def test_a_robot_files_car_is_emulated_as_one_and_turns_as_commanded_by_set_points() -> None:
    link = {"url": "pty:rover", "driver": "mavlink"}
    wheels = {"kind": "car", "turning_radius": RADIUS}
    robot = load_robot(None, {"link": link, "robot": {"wheels": wheels}})
    built = build_emulator(robot, (0.0, 0.0, 0.0), 0.0, 1.0, 0, 0.1)
    assert isinstance(built, RoverEmulator)
    assert built.parameters["MOT_SPD_SCA_BASE"] == SCALED[0]
    rig = Rig(arm_after=0.1, physics=SteeredRover(RADIUS), parameters=tuned(RADIUS))
    rig.take()
    for v, omega in ((0.0, 0.4), (0.5, 0.4), (0.2, 0.2), (-0.5, 0.4)):
        rig.drive(v, omega, 4.0)
        assert rig.rover.velocity[2] == pytest.approx(omega if v else 0.0, abs=0.03)


class Rover:
    """A rover at the end of the bridge's ramps and of a link of 80 ms."""

    def __init__(self) -> None:
        self.body, self.sent = SteeredRover(RADIUS), (0.0, 0.0, 0.0)
        self._late = deque([self.sent] * 4)

    def drive(self, wanted: tuple[float, float, float]) -> list[tuple[float, float, float]]:
        """Drive for 0.1 s; give what was sent."""
        sent = []
        for _ in range(5):
            self.sent = SPEEDS.slew(self.sent, wanted, 0.02)
            self._late.append(self.sent)
            v, omega, _ = self._late.popleft()
            self.body.step(Demand(v or None, omega), limits(SCALED), 0.02)
            sent.append(self.sent)
        return sent


def recorded(seconds: float = 120.0) -> str:
    """A log as `kmpc record --excite` writes it."""
    wheels = Wheels("car", turning_radius=RADIUS)
    excitation = Excitation((-5, -5, 5, 5), SPEEDS, seconds=seconds, wheels=wheels)
    rover, random, curvature = Rover(), np.random.default_rng(0), 0.0
    rows = ["t,x,y,theta,v,curvature"]
    for k in range(round(10 * seconds)):
        pose, (east, north, turn) = rover.body.pose, rover.body.velocity
        v, curvature = wheels.row(rover.sent, curvature)
        seen = np.array(pose) + random.normal(size=3) * 0.002
        rows.append(",".join(f"{value:.6f}" for value in (0.1 * k, *seen, v, curvature)))
        rover.drive(excitation(State(*pose, math.hypot(east, north), turn, 0.1 * k)).speeds)
    return "\n".join(rows)


def test_its_log_is_a_cars_and_what_is_learned_of_it_drives_through_a_door(
    tmp_path, capsys
) -> None:
    # a log of turn rates shows a slow ramp that is its speed's, and such a model turns too late
    log, model = tmp_path / "log.csv", tmp_path / "learned.npz"
    log.write_text(recorded())
    assert main(["fit", str(log), "-o", str(model)]) == 0
    assert "on the spot" not in capsys.readouterr().out
    learned = kl.KoopmanModel.load(model)
    assert "ramps" not in learned.info
    door = replace(Scenario.load("walls_door"), wheels=kl.Car(RADIUS))
    fastest = np.array((0.5, 0.5 / RADIUS))
    most, ramp = tuple(fastest), (SPEEDS.acceleration, SPEEDS.angular_acceleration)
    base = kl.NavigationProblem(
        dt=learned.dt, u_min=-fastest, u_max=most, du_max=ramp, goal_tolerance=(0.035, 0.1)
    )
    controller = kl.Controller(learned, door.problem(base), options=door.options)
    rover, poses, sent = Rover(), [], None
    rover.body.place(*door.start)
    for _ in range(300):
        poses.append(rover.body.pose)
        plan = controller.step(poses[-1], door.goal, door.obstacles_at(0.0), sent=sent)
        if plan.holding and math.hypot(*rover.body.velocity[:2]) < 0.01:
            break
        sent = np.mean(rover.drive((*map(float, plan.command), 0.0)), axis=0)[:2]
    assert math.dist(poses[-1][:2], door.goal[:2]) < 0.06
    assert obstacle_gaps(door, np.array(poses), np.zeros(len(poses))).min() > 0.02
