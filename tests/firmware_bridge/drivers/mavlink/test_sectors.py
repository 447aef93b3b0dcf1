"""OBSTACLE_DISTANCE and DISTANCE_SENSOR, made turns of a lidar."""

import math

import numpy as np
import pytest
from mavlink_rig import dialect

from firmware_bridge.drivers.mavlink.codec import MavlinkCodec
from firmware_bridge.drivers.mavlink.core import MavlinkCore
from firmware_bridge.drivers.mavlink.options import MavlinkOptions
from firmware_bridge.drivers.mavlink.sectors import KEPT, Sectors
from firmware_bridge.messages import State
from kmpc_lab.emulator.lidar.sectors import SectorSensor
from kmpc_lite.scenario.world import World

FACING_NORTH = State(0.0, 0.0, math.pi / 2, 0.0, 0.0, 0.0)


def rig(state=None, component=1):
    """Sectors behind the driver's core, and what a component of the vehicle says to it."""
    sectors = Sectors(1, lambda: state)
    core = MavlinkCore(MavlinkOptions(sectors=True), lambda frame: None, 1.7e9, sectors.take)
    codec = MavlinkCodec(1, component)
    return sectors, lambda message, now: core.receive(codec.encode(message), now)


def ring(distances, step=5.0, offset=0.0, frame=12, low=20, high=800):
    told = [*distances, *[65535] * (72 - len(distances))]
    return dialect.MAVLink_obstacle_distance_message(
        0, 0, told, int(abs(step)), low, high, step, offset, frame
    )


def eighth(orientation, distance, **more):
    fields = {"min_distance": 20, "max_distance": 800, "type": 0, "id": 10 + orientation, **more}
    return dialect.MAVLink_distance_sensor_message(
        0, current_distance=distance, orientation=orientation, covariance=0, **fields
    )


def at(sweep, direction):
    """What is reported of a direction on the vehicle, counter-clockwise [rad]."""
    off = np.abs(np.angle(np.exp(1j * (sweep.angles - direction))))
    return sweep.ranges[np.argmin(off)] if off.min() < 0.02 else None


@pytest.mark.parametrize("component", [1, 158])
def test_sectors_go_clockwise_from_the_front(component):
    sectors, say = rig(component=component)
    told = [801] * 72
    told[0], told[18], told[36], told[54] = 100, 200, 65535, 0
    say(ring(told), 5.0)
    sweep = sectors.sweep()
    assert at(sweep, 0.0) == 1.0 and at(sweep, -math.pi / 2) == 2.0
    assert math.isnan(at(sweep, math.pi)) and at(sweep, math.pi / 2) == 0.0
    assert at(sweep, 1.0) == math.inf and sweep.stamp == 5.0
    assert (sweep.range_min, sweep.range_max) == (0.2, 8.0)
    # a sector is as wide as it is: its neighbour begins after two and a half degrees
    assert at(sweep, math.radians(2.0)) == 1.0 and at(sweep, math.radians(3.0)) == math.inf


def test_sectors_aligned_with_north_turn_with_the_vehicle():
    message = ring([100, *[801] * 71], frame=0)
    sectors, say = rig(FACING_NORTH)
    say(message, 5.0)
    assert at(sectors.sweep(), 0.0) == 1.0
    sectors, say = rig(State(0.0, 0.0, 0.0, 0.0, 0.0, 0.0))  # facing east: north is to the left
    say(message, 5.0)
    assert at(sectors.sweep(), math.pi / 2) == 1.0 and at(sectors.sweep(), 0.0) == math.inf
    sectors, say = rig(None)
    say(message, 5.0)
    assert sectors.sweep() is None and sectors.counters["refused"] == 1


def test_eight_orientations_make_a_turn_and_an_old_one_is_unknown():
    sectors, say = rig()
    for orientation in range(8):
        say(eighth(orientation, 100 * (orientation + 1)), 5.0 + 0.01 * orientation)
    sweep = sectors.sweep()
    assert at(sweep, 0.0) == 1.0 and at(sweep, -math.pi / 2) == 3.0 and at(sweep, 3.0) == 5.0
    assert at(sweep, math.pi / 2) == 7.0 and at(sweep, math.pi / 4) == math.inf  # 8 m: nothing
    assert sweep.stamps.min() == 5.0 and sweep.stamp == pytest.approx(5.07)
    say(eighth(0, 150), 5.0 + KEPT + 0.05)
    sweep = sectors.sweep()
    assert at(sweep, 0.0) == 1.5 and at(sweep, -math.pi / 4) is None
    assert at(sweep, math.pi / 2) == 7.0


def test_a_single_sensor_is_as_wide_as_it_says():
    sectors, say = rig()
    say(eighth(0, 300, id=0, horizontal_fov=0.4), 5.0)
    assert at(sectors.sweep(), 0.19) == 3.0 and at(sectors.sweep(), 0.25) is None
    say(eighth(2, 300, id=1), 5.1)
    assert at(sectors.sweep(), -math.pi / 2 + 0.08) == 3.0
    assert at(sectors.sweep(), -math.pi / 2 + 0.15) is None
    say(eighth(2, 300, id=1, signal_quality=1), 5.1)
    assert math.isnan(at(sectors.sweep(), -math.pi / 2))
    say(eighth(25, 30, id=2), 5.2)  # down: the ground
    assert sectors.counters["refused"] == 1


def test_the_finer_of_both_is_taken():
    sectors, say = rig()
    say(ring([100] * 72), 5.0)
    say(eighth(0, 700), 5.5)
    assert at(sectors.sweep(), 0.0) == 1.0
    say(eighth(0, 700), 5.0 + KEPT + 0.1)
    assert at(sectors.sweep(), 0.0) == 7.0


def test_strangers_and_nonsense_are_passed_over():
    sectors, say = rig()
    core = MavlinkCore(MavlinkOptions(sectors=True), lambda frame: None, 1.7e9, sectors.take)
    core.receive(MavlinkCodec(2, 1).encode(ring([100] * 72)), 5.0)
    assert sectors.sweep() is None and sectors.counters["messages"] == 0
    for message in (
        ring([100] * 72, low=800, high=20),
        ring([100] * 72, frame=20),
        ring([100] * 72, offset=math.nan),
        ring([100] * 72, step=0.0),
        eighth(0, 100, min_distance=0, max_distance=0),
    ):
        say(message, 5.0)
    assert sectors.sweep() is None and sectors.counters["refused"] == 5
    assert "PRX1_TYPE" in sectors.health().faults[0]


def test_the_emulated_sensor_sees_a_pillar_where_it_is():
    sensor = SectorSensor(World([(2.0, 0.0, 0.5, 0.0, 0.0)]))
    sectors, say = rig()
    say(sensor.message((0.0, 0.0, 0.0), 1.0), 5.0)
    assert at(sectors.sweep(), 0.0) == pytest.approx(1.5, abs=0.05)
    assert at(sectors.sweep(), 1.0) == math.inf
    say(sensor.message((0.0, 0.0, math.pi / 2), 1.0), 5.1)
    assert at(sectors.sweep(), -math.pi / 2) == pytest.approx(1.5, abs=0.05)
