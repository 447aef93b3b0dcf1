"""The emulated lidar of a robot file, in the world of a scenario."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from firmware_bridge.messages import ConfigError
from firmware_bridge.sensors.lidar.options import LidarOptions

if TYPE_CHECKING:
    from kmpc_lab.emulator.lidar.lidar import LidarEmulator, Pose
    from kmpc_lite.scenario.files import Scenario
    from kmpc_lite.scenario.world import World


class Eyes:
    """What the emulated robot of a robot file sees through its lidar.

    `options`: the robot file's. `scenario`: whose obstacles are seen. `seed`: of noise and
    drop-outs. Raises ConfigError if one of them is missing.
    """

    def __init__(self, options: LidarOptions | None, scenario: Scenario | None, seed: int) -> None:
        if options is None:
            raise ConfigError("--lidar: the robot has no [lidar]: give --lidar NAME")
        if scenario is None:
            raise ConfigError("--lidar: nothing to see: give --scenario NAME")
        from kmpc_lite.scenario.world import world_of

        self._options, self._world, self._seed = options, world_of(scenario), seed

    def served(self, pose: Callable[[], Pose]) -> tuple[LidarEmulator, str]:
        """Lidar of a robot at `pose`, and the URL to serve it at."""
        assert self._options.link is not None
        lidar = emulated_lidar(self._options, self._world, pose, self._seed)
        return lidar, self._options.link


def emulated_lidar(
    options: LidarOptions, world: World, pose: Callable[[], Pose], seed: int = 0
) -> LidarEmulator:
    """Build a lidar that has a link of its own, mounted as the robot file says."""
    from kmpc_lab.emulator.lidar import ld06, rplidar

    model = {"rplidar": rplidar.MODEL, "ld06": ld06.MODEL}[options.driver]
    there = replace(model, mount=options.mount, mirrored=options.mirrored)
    if options.driver == "rplidar":
        return rplidar.RplidarEmulator(world, pose, there, seed)
    return ld06.Ld06Emulator(world, pose, there, seed)
