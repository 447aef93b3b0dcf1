"""Serial boards with encoders: driver, emulator, robot file, for tests that all must pass."""

import math
import time

from loopback import named_wire, serve_on
from waiting import until

from firmware_bridge.drivers.boards import BOARDS, load
from firmware_bridge.link import open_transport
from kmpc_lab.emulator.build import EMULATORS as FAR_ENDS

GEOMETRY = {
    "wheel_radius": 0.0425,
    "track": 0.27,
    "max_wheel_speed": 0.9,
    "gear_ratio": 20.0,
    "invert_right": True,
}
TABLES = {
    "roboclaw": {"geometry": GEOMETRY, "board": {"counts_per_turn": 1440, "watchdog": 0.3}},
    "odrive": {"geometry": GEOMETRY, "board": {"watchdog": 0.3, "command_timeout": 0.25}},
    "roboteq": {"geometry": GEOMETRY, "board": {"counts_per_turn": 1440, "watchdog": 0.3}},
    "arduino": {"geometry": GEOMETRY, "board": {"counts_per_turn": 1440, "watchdog": 0.3}},
    "vesc": {"geometry": GEOMETRY, "board": {"can_id": 5, "pole_pairs": 7, "brake_current": 8.0}},
}
DRIVERS = {name: load(BOARDS[name].driver) for name in TABLES}
EMULATORS = {name: load(FAR_ENDS[name]) for name in TABLES}


def patient(name):
    """Its table, with times that a busy machine keeps, where they are not what is tested."""
    board = TABLES[name]["board"]
    longer = {key: 3.0 for key in board if key == "watchdog"}
    return {**TABLES[name], "board": {**board, **longer, "reply_timeout": 0.4}}


def with_board(name, **options):
    """Give the robot file of a board with other options."""
    return {**TABLES[name], "board": {**TABLES[name]["board"], **options}}


def distance(driver, emulator):
    """Metres and radians between odometry and truth."""
    state, (x, y, theta) = driver.state(), emulator.pose
    return math.hypot(state.x - x, state.y - y), abs(math.remainder(state.theta - theta, math.tau))


class Spy:
    """A transport that keeps what the driver writes."""

    def __init__(self, transport):
        self._transport, self.frames = transport, []

    def write(self, data):
        self.frames.append(data)
        return self._transport.write(data)

    def __getattr__(self, name):
        return getattr(self._transport, name)


class Rig:
    """A driver and an emulator on one link."""

    def __init__(self, name, url, table=None, **floor):
        self.name, self.url = name, url
        table = table or TABLES[name]
        self.emulator = EMULATORS[name].from_options(table, **floor)
        if url.startswith("loopback:"):
            serve_on(self.emulator, wire := named_wire(url))
            self.wire = Spy(wire.take(board=False))
        else:
            self.emulator.start(url)
            self.wire = Spy(open_transport(url))
        self.driver = DRIVERS[name].from_options(self.wire, table)

    def connect(self):
        self.driver.connect(20.0)
        return self

    def drive(self, v, omega, seconds, period=0.02):
        """Command for a while, as the loop does."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.driver.send(v, omega)
            time.sleep(period)

    def command(self, v, omega):
        """Command once: zero to a board that waits for it since a busy machine was too late."""
        ready = self.driver.health().ready
        self.driver.send(v * ready, omega * ready)

    def starts(self, v, omega):
        """Command until the robot moves."""
        assert until(lambda: self.command(v, omega) or not self.emulator.stopped)

    def is_ready(self):
        """Command zero until the robot can be driven."""
        assert until(lambda: self.driver.send(0.0, 0.0) or self.driver.health().ready)

    def come_to_rest(self):
        """Command zero until the robot stands and its odometry knows where."""
        here = None

        def stands():
            nonlocal here
            before, here = here, self.emulator.pose
            self.driver.send(0.0, 0.0)
            time.sleep(0.05)
            return before is not None and math.dist(before, here) < 1e-6

        assert until(stands)
        seen = time.monotonic()
        assert until(lambda: self.driver.state().stamp > seen)

    @property
    def counters(self):
        return self.driver.health().counters

    def close(self):
        self.driver.close()
        self.emulator.close()
