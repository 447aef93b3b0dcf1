"""The emulated rover with a fault that the real firmware showed, for the bridge of any commit.

    python tests/helpers/faulty_rover.py lowered --link tcp:127.0.0.1:5790 &
    kmpc run --driver mavlink --link tcp:127.0.0.1:5790 --scenario four_circles_1 --arm --v-max 0.5

Ends some seconds after the bridge has left, and tells what the rover really did.
"""

from __future__ import annotations

import argparse
import math
import sys
import time

from pymavlink.dialects.v20 import ardupilotmega as dialect

from firmware_bridge.drivers.mavlink.codec import MavlinkCodec
from kmpc_lab.emulator.rover.rover import RoverEmulator

FAULTS = {
    "none": "nothing is wrong",
    "lowered": "another station asks for 4 Hz every 15 s, as MAVProxy does",
    "restart": "the autopilot restarts 3 s after it began to drive, where it stands then",
    "refused": "its estimator never gets ready, and it refuses to arm",
}
STANDS = 0.02
"""Slower than this it stands [m/s]."""


class Watch:
    """What the rover really does."""

    def __init__(self) -> None:
        self.began, self.moved = math.inf, 0.0
        self.stops = 0
        self.moving = False
        self.after = 0.0
        """Way since the fault [m]."""

    def see(self, now: float, speed: float, period: float, faulty: bool) -> None:
        """Take in a speed [m/s]."""
        if speed > STANDS and not self.moving:
            self.began = min(self.began, now)
        if speed <= STANDS and self.moving:
            self.stops += 1
        self.moving = speed > STANDS
        self.moved += speed * period
        self.after += speed * period * faulty


def main() -> None:
    """Serve the rover."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("fault", choices=FAULTS, help=str(FAULTS))
    parser.add_argument("--link", default="tcp:127.0.0.1:5790")
    parser.add_argument("--seconds", type=float, default=60.0)
    given = parser.parse_args()
    refused = given.fault == "refused"
    rover = RoverEmulator(arm_after=math.inf if refused else 2.0)
    station = MavlinkCodec(255, 230)
    rover.start(given.link)
    start = now = time.monotonic()
    watch, faults = Watch(), 0
    try:
        while now - start < given.seconds:
            time.sleep(0.02)
            before, now = now, time.monotonic()
            v, u, omega = rover.velocity
            watch.see(now, math.hypot(v, u) + 0.1 * abs(omega), now - before, faults > 0)
            due = now - watch.began
            if given.fault == "lowered" and due > 2.0 + 15.0 * faults:
                asks = dialect.MAVLink_request_data_stream_message(1, 1, 0, 4, 1)
                rover.receive(station.encode(asks), now)
                faults += 1
            elif given.fault == "restart" and due > 3.0 and not faults:
                with rover._lock:
                    rover._boot(0.0)
                faults += 1
    finally:
        rover.close()
    place = tuple(round(p, 2) for p in rover.pose)
    sys.stdout.write(
        f"{given.fault}: {watch.stops} stops, {watch.moved:.2f} m driven, "
        f"{watch.after:.2f} m of them after the fault; at {place}\n"
    )


if __name__ == "__main__":
    main()
