"""A wire that drops, doubles, spoils, swaps, splits and cuts.

Nothing wrong gets through, and all is well once it is mended.
"""

from __future__ import annotations

import math
import random
from collections import Counter

import pytest
from mavlink_rig import Rig, dialect

from firmware_bridge.drivers.mavlink.options import MavlinkOptions

RATE = 0.06
LIMITS = (0.5, 0.8)


class Spoiler:
    """Faults on one direction of a wire, counted."""

    def __init__(self, seed: int) -> None:
        self.random, self.counts = random.Random(seed), Counter[str]()
        self.held: list[bytes] = []
        self.on = True

    def __call__(self, frame: bytes) -> list[bytes]:
        if not self.on:
            frames, self.held = [*self.held, frame], []
            return frames
        fault = (
            self.random.choice(("drop", "double", "spoil", "swap", "cut", "noise"))
            if self.random.random() < RATE
            else ""
        )
        self.counts[fault] += 1
        frames, self.held = [frame, *self.held], []
        if fault == "drop":
            return frames[1:]
        if fault == "double":
            return [frame, *frames]
        if fault == "spoil":
            spoilt = bytearray(frame)
            for _ in range(self.random.randint(1, 3)):
                spoilt[self.random.randrange(len(spoilt))] ^= self.random.randint(1, 255)
            return [bytes(spoilt), *frames[1:]]
        if fault == "swap":
            self.held = [frame]
            return frames[1:]
        if fault == "cut":
            return [frame[: self.random.randrange(1, len(frame))], *frames[1:]]
        if fault == "noise":
            return [self.random.randbytes(self.random.randint(1, 60)), *frames]
        half = self.random.randrange(len(frame))
        return [frame[:half], frame[half:], *frames[1:]]

    @property
    def faults(self) -> int:
        return self.counts.total() - self.counts[""]


@pytest.mark.parametrize(
    ("seed", "seconds"),
    [(1, 40.0), *[pytest.param(s, 150.0, marks=pytest.mark.long) for s in (1, 2)]],
)
def test_a_bad_wire(seed: int, seconds: float) -> None:
    """About eight faults a second."""
    down, up = Spoiler(seed), Spoiler(seed + 100)
    down.on = up.on = False
    rig = Rig(MavlinkOptions(arm=True))
    rig.to_rover, rig.to_core = down, up
    rig.take()
    down.on = up.on = True
    commands = random.Random(seed)
    worst, fresh, wanted = 0.0, 0, set()

    def drive() -> None:
        nonlocal worst, fresh
        v, omega = commands.uniform(-LIMITS[0], LIMITS[0]), commands.uniform(-LIMITS[1], LIMITS[1])
        wanted.add((v, omega))
        rig.core.set_point(v, omega, rig.now)
        state = rig.core.state
        assert state is not None
        assert state.stamp <= rig.now
        if rig.now - state.stamp < 0.1:
            fresh += 1
            worst = max(worst, math.hypot(state.x - rig.rover.pose[0], state.y - rig.rover.pose[1]))

    rig.run(seconds, drive)
    assert down.faults + up.faults > 6.5 * seconds
    assert worst < 0.06, "a fresh state is never a spoilt one"
    assert fresh > 46.0 * seconds
    assert rig.core.counters["bad_data"] > seconds / 3.0
    assert rig.rover.counters["bad_data"] > seconds / 8.0
    assert rig.rover.counters["aborts"] == 0
    parser = dialect.MAVLink(None)
    messages = [parser.decode(bytearray(frame)) for _, frame in rig.sent]
    set_points = [m for m in messages if m.get_type() == "SET_POSITION_TARGET_LOCAL_NED"]
    known = {(dialect_float(v), dialect_float(-omega)) for v, omega in wanted} | {(0.0, 0.0)}
    assert {(m.vx, m.yaw_rate) for m in set_points} <= known
    down.on = up.on = False
    rig.run(1.0)
    if not rig.ready:
        rig.take()
    rig.drive(0.4, 0.2, 4.0)
    state = rig.core.state
    assert state is not None
    assert (state.v, state.omega) == pytest.approx((0.4, 0.2), abs=0.02)
    assert rig.faults == ()


def dialect_float(value: float) -> float:
    """As a float32 of the wire."""
    return float(
        dialect.MAVLink(None)
        .decode(
            bytearray(
                dialect.MAVLink_attitude_message(0, value, 0, 0, 0, 0, 0).pack(
                    dialect.MAVLink(None)
                )
            )
        )
        .roll
    )


def test_silence_in_each_direction() -> None:
    """The vehicle that is not heard, and the vehicle that does not hear."""
    rig = Rig()
    rig.take()
    rig.drive(0.4, 0.0, 2.0)
    rig.to_core = lambda frame: []
    rig.drive(0.4, 0.0, 1.0)
    status = rig.core.status(rig.now, True)
    assert rig.now - status.heartbeat_stamp == pytest.approx(1.0, abs=0.05)
    assert rig.now - status.pose_stamp == pytest.approx(1.0, abs=0.1)
    rig.to_core = lambda frame: [frame]
    rig.to_rover = lambda frame: []
    rig.drive(0.4, 0.0, 2.0)
    assert rig.ready
    assert rig.core.status(rig.now, True).pose_ok
    rig.drive(0.4, 0.0, 3.0)
    assert rig.rover.stopped, "by its own time-out"


def test_a_flood_from_a_stranger_hides_nothing() -> None:
    rig = Rig()
    rig.take()
    stranger = dialect.MAVLink(None, srcSystem=42, srcComponent=1)
    junk = dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(stranger) * 20
    rig.run(5.0, lambda: (rig.core.receive(junk, rig.now), rig.core.set_point(0.3, 0.0, rig.now)))
    assert rig.core.counters["others"] == 5000
    state = rig.core.state
    assert state is not None
    assert rig.now - state.stamp < 0.1
    assert state.v == pytest.approx(0.3, abs=0.02)
