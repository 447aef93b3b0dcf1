"""Lidars and their emulators at both ends of a loopback or a pseudo-terminal."""

from contextlib import contextmanager

from firmware_bridge.sensors.lidar.kinds import open_lidar
from firmware_bridge.sensors.lidar.options import LidarOptions
from kmpc_lab.emulator.lidar import emulated_lidar
from kmpc_lite.scenario.world import World

PILLARS = [(2.0, 0.0, 0.5, 0.0, 0.0), (0.0, -1.5, 0.3, 0.0, 0.0), (-1.0, 1.0, 0.2, 0.0, 0.0)]


@contextmanager
def lidar_pair(driver, path, pose=lambda: (0.0, 0.0, 0.0), world=None, **more):
    """A lidar, connected to its emulator; gives both."""
    options = LidarOptions(driver, f"pty:{path}", **{"no_return": "free", **more})
    world = World(PILLARS) if world is None else world
    emulator = emulated_lidar(options, world, pose)
    emulator.start(options.link)
    lidar = open_lidar(options)
    try:
        yield lidar, emulator
    finally:
        lidar.close()
        emulator.close()
