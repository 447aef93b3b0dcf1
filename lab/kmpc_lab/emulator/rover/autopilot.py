"""What the emulated autopilot decides: modes, arming, set-points, fail-safes. Knows no bytes.

Set-points are read as ArduPilot's rover reads SET_POSITION_TARGET_LOCAL_NED.
"""

from __future__ import annotations

import logging
import math
from collections import deque
from dataclasses import dataclass

from kmpc_lab.emulator.rover.estimator import Estimator, Parameters
from kmpc_lab.emulator.rover.physics import Demand, DriveLimits, RoverPhysics

FRAMES_LOCAL, FRAMES_BODY = (1, 7), (8, 9)
FRAMES = FRAMES_LOCAL + FRAMES_BODY
"""Coordinate frames that are accepted; others, such as 12, are ignored."""
POS_IGNORE, VEL_IGNORE, ACC_IGNORE, YAW_IGNORE, YAW_RATE_IGNORE = 0x003, 0x018, 0x0C0, 0x400, 0x800
"""Bits of a type mask: one of a kind is enough to drop the kind."""
MANUAL, ACRO, STEERING, HOLD, LOITER, GUIDED = 0, 1, 3, 4, 5, 15
MODES = {
    MANUAL: "MANUAL",
    ACRO: "ACRO",
    STEERING: "STEERING",
    HOLD: "HOLD",
    LOITER: "LOITER",
    GUIDED: "GUIDED",
}
"""Modes that can be entered here; missions and returns are not emulated."""
NEED_POSITION = (LOITER, GUIDED)
SET_POINT_TIMEOUT = 3.0
"""After the last set-point the rover drives on for this long, then brakes, as measured [s]."""
EMERGENCY, CRITICAL, WARNING, INFO = 0, 2, 4, 6  # MAV_SEVERITY
PREARM_PERIOD = 30.0
SWITCH_READ = 0.4  # when after boot the mode switch is read, whatever was set until then [s]
FAILSAFE_PERIOD = 0.1  # between looks at the failsafes [s]
EKF_BAD = 1.0  # the EKF fail-safe acts when the position has been bad for this long [s]
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Target:
    """A set-point in GUIDED: a speed, with a turn rate or a heading."""

    speed: float  # [m/s]
    turn: float | None  # counter-clockwise [rad/s]; None to steer to the heading
    heading: float  # [rad], ENU
    uptime: float  # when it came [s]


@dataclass(frozen=True)
class SetPoint:
    """What one message asks for: m/s, rad, and rad/s clockwise (all NED)."""

    frame: int
    mask: int
    velocity: tuple[float, float]
    yaw: float
    yaw_rate: float

    @property
    def _ignores_velocity(self) -> bool:
        return bool(self.mask & VEL_IGNORE)

    @property
    def _ignores_yaw(self) -> bool:
        return bool(self.mask & YAW_IGNORE)

    @property
    def _ignores_rate(self) -> bool:
        return bool(self.mask & YAW_RATE_IGNORE)

    @property
    def finite(self) -> bool:
        """Whether all numbers that the mask asks for are."""
        used = (
            (() if self._ignores_velocity else self.velocity)
            + (() if self._ignores_yaw else (self.yaw,))
            + (() if self._ignores_rate else (self.yaw_rate,))
        )
        return all(map(math.isfinite, used))

    @property
    def understood(self) -> bool:
        """Whether it asks for a speed or a turn, and for nothing that is not emulated."""
        one_turn = self._ignores_yaw or self._ignores_rate
        nothing = self._ignores_velocity and self._ignores_yaw and self._ignores_rate
        return bool(self.mask & ACC_IGNORE and self.mask & POS_IGNORE and one_turn and not nothing)

    def target(self, theta: float, limit: float, uptime: float) -> Target:
        """What the rover does then: at a heading [rad, ENU], with a limit of its speed [m/s]."""
        body = self.frame in FRAMES_BODY
        speed, heading = 0.0, theta
        if not self._ignores_velocity:
            north, east = self.velocity
            backwards = north < 0.0 and not (self._ignores_yaw and self._ignores_rate)
            speed = min(math.hypot(north, east), limit) * (-1.0 if backwards else 1.0)
            angle = -math.atan2(east, north)
            heading = theta + angle if body else math.pi / 2.0 + angle
        if not self._ignores_yaw:
            heading = theta - self.yaw if body else math.pi / 2.0 - self.yaw
        return Target(speed, None if self._ignores_rate else -self.yaw_rate, heading, uptime)


class Autopilot:
    """State of the emulated autopilot.

    `parameters`: ArduPilot's parameters. `physics`: the rover. `estimator`: its pose estimate.
    `arm_after`: arming is refused before this [s after boot].
    """

    def __init__(
        self, parameters: Parameters, physics: RoverPhysics, estimator: Estimator, arm_after: float
    ) -> None:
        self.parameters, self.physics, self.estimator = parameters, physics, estimator
        self._arm_after = arm_after
        self.uptime = 0.0
        self.mode, self.armed = int(parameters["INITIAL_MODE"]), False
        self.mode_changed = False  # set with every change; whoever tells the ground clears it
        self.texts: deque[tuple[int, str]] = deque(maxlen=32)  # what is to be said: severity, text
        names = "set_points ignored_set_points aborts timeouts failsafes arming_refusals"
        self.counters = dict.fromkeys(names.split(), 0)
        self.failsafe = ""
        self._target: Target | None = None
        self._pilot: tuple[float, float, float] | None = None
        self._gcs_heard: float | None = None
        self._gcs_silent_since: float | None = None
        self._position_seen = 0.0
        self._prearm_said = self._failsafes_checked = -math.inf
        self.arming_failure = ""  # set by a test: something that keeps it from arming

    def say(self, severity: int, text: str) -> None:
        """Queue a STATUSTEXT."""
        self.texts.append((severity, text))

    def set_mode(self, mode: int) -> bool:
        """Change the mode; False if it cannot be entered now."""
        if mode == self.mode:
            return True
        if mode not in MODES:
            self.say(WARNING, f"Mode change to {mode} failed: not emulated")
            return False
        if self.armed and mode in NEED_POSITION and not self.estimator.position_ok:
            self.say(WARNING, f"Mode change to {MODES[mode]} failed: requires position")
            return False
        self.mode, self.mode_changed, self._target = mode, True, None
        return True

    @property
    def prearm_failure(self) -> str:
        """Why arming is refused, empty if it is not."""
        if self.parameters["ARMING_CHECK"] == 0.0:
            return ""
        if self.uptime < self._arm_after:
            return (
                "Gyros not calibrated"
                if self.uptime < 0.5 * self._arm_after
                else "AHRS: EKF3 still initialising"
            )
        if self.mode in NEED_POSITION and not self.estimator.position_ok:
            return "Need Position Estimate"
        return self.arming_failure

    def tell_prearm(self) -> bool:
        """Say why arming would be refused; False while armed, when nobody looks."""
        if self.armed:
            return False
        if why := self.prearm_failure:
            self._prearm_said = self.uptime
            self.say(CRITICAL, f"PreArm: {why}")
        return True

    def arm(self, force: bool) -> bool:
        """Arm; False if that is refused."""
        if not self.armed and not force and (why := self.prearm_failure):
            self.counters["arming_refusals"] += 1
            self.say(CRITICAL, f"Arm: {why}")
            return False
        if not self.armed:
            self.armed, self._target = True, None
            self.say(INFO, "Throttle armed")
        return True

    def disarm(self) -> None:
        """Disarm."""
        if self.armed:
            self.armed = False
            self.say(INFO, "Throttle disarmed")

    def heard_gcs(self, system: int) -> None:
        """Take a heartbeat of a ground station; the fail-safe counts one system id only."""
        if system == round(self.parameters["SYSID_MYGCS"]):
            self._gcs_heard = self.uptime

    def pilot(self, throttle: float, steering: float) -> None:
        """Take a pilot's sticks, both from -1 to 1; steering is positive to the right."""
        self._pilot = (min(max(throttle, -1.0), 1.0), min(max(steering, -1.0), 1.0), self.uptime)

    def set_point(
        self, frame: int, mask: int, velocity: tuple[float, float], yaw: float, yaw_rate: float
    ) -> None:
        """Take SET_POSITION_TARGET_LOCAL_NED: m/s, rad, and rad/s clockwise (all NED)."""
        guided = self.mode == GUIDED and self.estimator.origin is not None
        if not guided or frame not in FRAMES:
            self.counters["ignored_set_points"] += 1
            return
        asked = SetPoint(frame, mask, velocity, yaw, yaw_rate)
        if not asked.finite:
            self.counters["aborts"] += 1
            self._target = None
            self.say(EMERGENCY, "set-point not finite: ArduPilot aborts here")
            log.error("%s: the real ArduPilot aborts on it", asked)
            return
        if not asked.understood:
            self.counters["ignored_set_points"] += 1
            self.say(
                INFO,
                "Ignoring SET_POSITION_TARGET_LOCAL_NED; set ACC_IGNORE in mask, "
                "positions are not emulated",
            )
            return
        self.counters["set_points"] += 1
        self._target = asked.target(
            self.estimator.pose[2], self.parameters["WP_SPEED"], self.uptime
        )

    def step(self, uptime: float, dt: float) -> None:
        """One turn of the main loop."""
        if uptime - dt < SWITCH_READ <= uptime:
            self.set_mode(int(self.parameters["INITIAL_MODE"]))
        self.uptime = uptime
        if uptime - self._failsafes_checked >= FAILSAFE_PERIOD - 1e-6:
            self._failsafes_checked = uptime
            self._check_failsafes()
        if (
            not self.armed
            and (why := self.prearm_failure)
            and uptime - self._prearm_said > PREARM_PERIOD
        ):
            self._prearm_said = uptime
            self.say(CRITICAL, f"PreArm: {why}")
        p = self.parameters
        limits = DriveLimits(
            p["ATC_ACCEL_MAX"],
            p["ATC_DECEL_MAX"] or p["ATC_ACCEL_MAX"],
            math.radians(p["ATC_STR_ACC_MAX"]),
            math.radians(p["ATC_STR_RAT_MAX"]),
            (p["MOT_SPD_SCA_BASE"], p["ATC_STR_RAT_FF"], p["ATC_STR_RAT_P"]),
        )
        self.physics.step(self._demand(), limits, dt)
        self.estimator.step(self.physics, uptime, dt)

    def _demand(self) -> Demand:
        """What the mode asks of the speed and yaw-rate loops."""
        if not self.armed:
            return Demand()
        if self.mode in (MANUAL, ACRO, STEERING):
            return self._pilot_demand()
        target = self._target
        if self.mode != GUIDED or target is None:
            return Demand()
        if self.uptime - target.uptime > SET_POINT_TIMEOUT:
            self.counters["timeouts"] += 1
            self.say(WARNING, "target not received last 3.0 secs, stopping")
            self._target = None
            return Demand()
        turn = target.turn
        if turn is None:
            turn = self.parameters["ATC_STR_ANG_P"] * math.remainder(
                target.heading - self.estimator.pose[2], 2.0 * math.pi
            )
        return Demand(target.speed or None, turn)

    def _pilot_demand(self) -> Demand:
        if (
            self._pilot is None
            or self.uptime - self._pilot[2] > self.parameters["RC_OVERRIDE_TIME"]
        ):
            return Demand()
        throttle, steering, _ = self._pilot
        return Demand(
            throttle * self.parameters["CRUISE_SPEED"] or None,
            -steering * math.radians(self.parameters["ATC_STR_RAT_MAX"]),
        )

    def _check_failsafes(self) -> None:
        """GCS fail-safe (off as delivered) and EKF fail-safe: both put the rover into HOLD."""
        silent = (
            self._gcs_heard is not None
            and self.uptime - self._gcs_heard >= self.parameters["FS_GCS_TIMEOUT"]
        )
        if not (self.parameters["FS_GCS_ENABLE"] and silent):
            self._gcs_silent_since = None
        elif self._gcs_silent_since is None:
            self._gcs_silent_since = self.uptime
        gcs = (
            self._gcs_silent_since is not None
            and self.uptime - self._gcs_silent_since > self.parameters["FS_TIMEOUT"]
        )
        if self.estimator.position_ok or not self.armed or self.mode not in NEED_POSITION:
            self._position_seen = self.uptime
        ekf = (
            self.uptime - self._position_seen >= EKF_BAD and self.parameters["FS_EKF_ACTION"] != 0.0
        )
        failsafe = "GCS Failsafe" if gcs else "EKF failsafe" if ekf else ""
        # one that has acted does not act again before it has cleared
        if failsafe and self.mode != HOLD and not self.failsafe:
            self.counters["failsafes"] += 1
            self.failsafe = failsafe
            self.say(WARNING, failsafe)
            if ekf or self.parameters["FS_ACTION"] != 0.0:
                self.set_mode(HOLD)
        elif self.failsafe and not failsafe and self.estimator.position_ok:
            self.say(INFO, f"{self.failsafe} cleared")
            self.failsafe = ""
