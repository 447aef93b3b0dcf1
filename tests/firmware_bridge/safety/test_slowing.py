"""Late poses and late commands slow the robot; a lost pose may be waited for."""

from dataclasses import replace

import pytest

from firmware_bridge.messages import LinkStatus, State, VelocityCommand
from firmware_bridge.safety.gate import SafetyGate
from firmware_bridge.safety.gate_settings import GateSettings, Limits
from firmware_bridge.safety.gate_table import GateState

TICK = 0.02
SETTINGS = GateSettings(Limits(v_max=0.5, v_reverse=0.5), settle=0.1)
GPS_LOST = ("EKF: no horizontal position",)


class Drive:
    """A gate whose poses and commands come when the test says so."""

    def __init__(self, settings=SETTINGS, late_after=None):
        self.gate, self.now = SafetyGate(settings, late_after), 100.0
        self.pose = self.command = self.now
        self.x, self.faults, self.pose_ok, self.ready = 0.0, (), True, True
        self.speeds, self.states = [], []
        self.gate.enable()

    def step(self):
        self.now += TICK
        status = LinkStatus(True, self.now, self.pose, self.ready, self.pose_ok, faults=self.faults)
        output = self.gate.step(
            self.now,
            VelocityCommand(0.5, 0.0, self.command),
            State(self.x, 0.0, 0.0, 0.5, 0.0, self.pose),
            status,
        )
        self.speeds.append(output.v)
        self.states.append(output.state)
        return output

    def run(self, seconds, pose_every=TICK, plan_every=0.1, plan_takes=0.0):
        """Drive with a pose and a plan every so often; a plan is out when it is done."""
        end = self.now + seconds
        next_pose = next_plan = self.now
        while self.now < end - 1e-9:
            if self.now >= next_pose - 1e-9:
                self.pose, next_pose = self.now, next_pose + pose_every
            if self.now >= next_plan + plan_takes - 1e-9:
                self.command, next_plan = next_plan, next_plan + max(plan_every, plan_takes)
            self.step()
        return self

    def lose(self, seconds):
        """Drive without a pose, which the board tells after a while."""
        for _ in range(round(seconds / TICK)):
            self.command = min(self.command, self.pose + 0.5)
            self.step()
        return self


def test_gaps_of_a_quarter_second_slow_the_robot_and_do_not_stop_it():
    """They made it stop and go: each gap was a fault, a ramp to zero and half a second of wait."""
    drive = Drive().run(3.0)
    assert drive.speeds[-1] == 0.5
    drive.speeds.clear()
    drive.states.clear()
    drive.run(10.0, pose_every=0.28)
    assert set(drive.states) == {GateState.ACTIVE}
    assert min(drive.speeds) > 0.25
    assert max(drive.speeds[100:]) <= 0.5
    assert sum(drive.speeds[100:]) / len(drive.speeds[100:]) < 0.49


@pytest.mark.parametrize(("takes", "slowed"), [(0.02, False), (0.06, False), (0.11, True)])
def test_late_steps_slow_the_robot(takes, slowed):
    drive = Drive().run(3.0)
    drive.speeds.clear()
    drive.states.clear()
    drive.run(5.0, plan_takes=takes)
    assert (min(drive.speeds) < 0.47) is slowed
    assert set(drive.states) == {GateState.ACTIVE}


def test_a_slow_controller_is_not_late_as_long_as_it_keeps_its_period():
    slow = replace(SETTINGS, watchdog=0.5)
    drive = Drive(slow, late_after=1.3 * 0.33).run(3.0, plan_every=0.33)
    drive.speeds.clear()
    drive.run(5.0, plan_every=0.33, plan_takes=0.05)
    assert set(drive.speeds) == {0.5}


def test_a_pose_that_is_gone_brakes_no_later_than_before_and_is_then_a_stop():
    drive = Drive().run(3.0)
    lost, x = drive.now, 0.0
    while drive.step().v > 0.0 or drive.gate.state is GateState.ACTIVE:
        x += drive.speeds[-1] * TICK
        assert drive.now - lost < 1.0
    assert x < 0.25 * 0.5 + 0.5**2 / 2.0 + 0.02
    assert drive.states[-1] in (GateState.STOPPING, GateState.HOLDING)


def test_a_lost_pose_ends_in_a_release_unless_it_may_be_waited_for():
    for resume, end in ((0.0, GateState.RELEASED), (10.0, GateState.ACTIVE)):
        drive = Drive(replace(SETTINGS, resume=resume)).run(3.0)
        drive.lose(5.0)
        assert drive.gate.state is (GateState.HOLDING if resume else GateState.RELEASED)
        assert drive.speeds[-1] == 0.0
        drive.run(2.0)
        assert drive.gate.state is end


def test_an_estimate_that_the_board_distrusts_is_waited_for_too():
    drive = Drive(replace(SETTINGS, resume=10.0)).run(3.0)
    drive.faults, drive.pose_ok = GPS_LOST, False
    drive.run(5.0)
    assert drive.gate.state is GateState.HOLDING
    drive.faults, drive.pose_ok = (), True
    assert drive.run(2.0).gate.state is GateState.ACTIVE


def test_a_pose_that_comes_back_elsewhere_is_not_driven_on():
    drive = Drive(replace(SETTINGS, resume=10.0)).run(3.0)
    drive.lose(3.0)
    drive.x = 0.6
    drive.run(4.0)
    assert GateState.ACTIVE not in drive.states[-150:]
    assert drive.gate.state is GateState.RELEASED


@pytest.mark.parametrize("wrong", ["fault", "taken"])
def test_whatever_else_goes_wrong_meanwhile_ends_the_waiting(wrong):
    drive = Drive(replace(SETTINGS, resume=10.0)).run(3.0)
    drive.lose(2.0)
    if wrong == "fault":
        drive.faults = ("over-temperature",)
    else:
        drive.ready = False
    drive.lose(1.0)
    drive.faults, drive.ready = (), True
    assert drive.run(3.0).gate.state in (GateState.RELEASED, GateState.YIELDED)
    assert drive.speeds[-1] == 0.0


def test_what_comes_back_late_in_the_hold_is_given_the_time_to_settle():
    """Through a ground station that stalled it came back 0.4 s before the release, and was lost."""
    drive = Drive(replace(SETTINGS, settle=0.5)).run(3.0)
    while drive.gate.state is not GateState.HOLDING:
        drive.lose(TICK)
    drive.lose(0.8)
    assert drive.gate.state is GateState.HOLDING
    assert drive.run(2.0).gate.state is GateState.ACTIVE
    assert GateState.RELEASED not in drive.states
