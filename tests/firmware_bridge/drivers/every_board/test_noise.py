"""Noise on the line of every serial board: no exception, and no speed beyond the limit."""

import math
import random
import struct

from boards import DRIVERS, EMULATORS, TABLES, Rig
from loopback import Faults, named_wire

from firmware_bridge.drivers.arduino import line
from firmware_bridge.link import open_transport
from firmware_bridge.link.framing import roboclaw_packet, vesc_packet


def test_wire_shows_only_speeds_within_the_limit_under_faults(name):
    """Drop, duplicate, corrupt, reorder, split, cut.

    What the driver writes is decoded here by other means.
    """
    wire = named_wire(f"loopback:storm-{name}", Faults(), seed=7)
    rig = Rig(name, f"loopback:storm-{name}").connect()
    storm = Faults(
        drop=0.05,
        duplicate=0.05,
        corrupt=0.05,
        reorder=0.05,
        split=0.2,
        cut=0.005,
        cut_for=0.05,
        delay=0.002,
    )

    def rims() -> list[float]:
        return [speed for frame in rig.wire.frames for speed in rim_speeds(name, frame)]

    def seen() -> bool:
        faults = wire.bridge.counters["faults"] + wire.board.counters["faults"]
        return len(rims()) > 50 and faults > 20 and rig.counters["timeouts"] > 5

    wire.faults = storm
    rig.drive(0.4, 0.6, 1.2, period=0.01)
    for _ in range(20):  # a busy machine sends less in a second
        if not seen():
            rig.drive(0.4, 0.6, 1.0, period=0.01)
    wire.faults = Faults()
    rig.is_ready()
    counters = rig.counters
    assert counters["driver_errors"] == counters["errors"] == 0
    assert seen() and max(map(abs, rims())) <= 0.9 * 1.001
    rig.starts(0.3, 0.0)
    rig.close()


def rim_speeds(name, frame):
    """Rim speeds [m/s] in a frame of the driver, by decoders that share nothing with the
    bridge's.
    """
    per_metre = 20.0 / (2 * math.pi * 0.0425)
    if name == "roboclaw":
        return (
            []
            if frame[1] != 37
            else [count / 1440 / per_metre for count in struct.unpack(">ii", frame[2:10])]
        )
    if name == "odrive":
        return [
            float(line.split()[2].split(b"*")[0]) / per_metre
            for line in frame.splitlines()
            if line.startswith(b"v ")
        ]
    if name == "roboteq":
        words = [word for word in frame.split(b"\r") if word.startswith(b"!S ")]
        return [int(word.split()[2]) / 60.0 / per_metre for word in words]
    if name == "arduino":
        words = frame.split(b"*")[0].split()[2:4] if frame.startswith(b"V") else []
        return [int(word) / 1440 / per_metre for word in words]
    found, at = [], 0
    while at < len(frame):
        payload = frame[at + 2 : at + 2 + frame[at + 1]]
        at += frame[at + 1] + 5
        payload = payload[2:] if payload[0] == 34 else payload
        found += (
            [struct.unpack(">i", payload[1:5])[0] / 60.0 / 7 / per_metre] if payload[0] == 8 else []
        )
    return found


def test_noise_makes_no_exception_at_either_end(name):
    now = [100.0]
    board = EMULATORS[name].from_options(TABLES[name], clock=lambda: now[0])
    driver = DRIVERS[name].from_options(open_transport("pty:unused"), TABLES[name])
    rng = random.Random(8)
    alphabets = {
        "odrive": b"vfruwsc 01.-einaf*\n\r",
        "roboteq": b"!?^~SGCFMRWDECHO 012-=:+\r",
        "arduino": b"HVPRS 0123456789-*ABCDEF\n",
    }
    alphabet = alphabets.get(name, bytes(range(256)))
    for _ in range(3000):
        noise = bytes(rng.choices(alphabet, k=rng.randint(1, 100)))
        if name == "vesc":
            noise = vesc_packet(
                bytes((rng.choice((0, 4, 6, 7, 8, 30, 34, 50)), *noise))
            )  # whole frames of nonsense
        elif name == "arduino":
            noise += b"\n" + line(noise.decode().replace("*", " ").replace("\n", " "))
        elif name == "roboclaw":
            noise += roboclaw_packet(0x80, rng.choice((14, 34, 35, 36, 37, 40)), noise[:12])
        now[0] += 0.02
        board.handle(noise)
        driver._feed(noise, now[0])
    assert all(map(math.isfinite, board.pose)) and all(map(math.isfinite, board.wheel_command))
    driver.close()
