"""How an emulated rover with steered wheels moves: Rover 4.6.3 steers after its turn rate."""

from __future__ import annotations

import math

from kmpc_lab.emulator.rover.physics import DriveLimits, RoverPhysics, within

LOCK = math.radians(35.0)
"""Steering angle at which it drives its tightest circle: SITL's own rover."""
SLOWEST = 0.1
"""From this speed on it steers in inverse proportion to its speed, if it is tuned [m/s]."""


def tuned(turning_radius: float) -> dict[str, float]:
    """Parameters with which turn rates are what was asked, as docs/howto/boards.md says."""
    ahead = turning_radius / SLOWEST
    return {"MOT_SPD_SCA_BASE": SLOWEST, "ATC_STR_RAT_FF": ahead, "ATC_STR_RAT_P": 0.2 * ahead}


class SteeredRover(RoverPhysics):
    """A rover that turns only while it drives.

    The firmware steers in proportion to the turn rate that is asked for, whatever the speed; above
    MOT_SPD_SCA_BASE in inverse proportion to the speed, so that the turn rate is what was asked.

    `turning_radius`: of its tightest circle [m]; SITL's rover has 0.9. `slip`, `turn_gain`, `seed`:
    of `kmpc_lab.sim.plants.robots.DifferentialDrive`.
    """

    def __init__(
        self, turning_radius: float, slip: float = 0.0, turn_gain: float = 1.0, seed: int = 0
    ) -> None:
        super().__init__(slip, turn_gain, seed)
        self._radius = turning_radius

    def _turn_loop(self, wanted: float, limits: DriveLimits, h: float) -> None:
        """Steer as AR_AttitudeControl::get_steering_out_rate and AP_MotorsUGV do."""
        target = within(wanted, limits.turn)
        self._turn_ramp += within(target - self._turn_ramp, limits.turn_acceleration * h)
        slowest, ahead, behind = limits.steering
        steering = ahead * self._turn_ramp + behind * (self._turn_ramp - self._turn)
        if abs(self._speed) > slowest > 0.0:
            steering *= slowest / abs(self._speed)
        if self._speed < 0.0:
            steering = -steering
        bend = math.sin(LOCK * within(steering, 1.0)) / math.sin(LOCK) / self._radius
        self._turn = self._speed * bend
