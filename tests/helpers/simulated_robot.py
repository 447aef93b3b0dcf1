"""A robot with dead time and lag that is driven without a link, tick by tick, faster than time."""

from __future__ import annotations

import math
import random
from collections import deque
from dataclasses import replace

from firmware_bridge.messages import STILL, Controller, State
from firmware_bridge.recording.watch import DriveWatch
from firmware_bridge.runtime.controller_thread import unicycle_arc
from firmware_bridge.safety.gate import GateOutput
from firmware_bridge.safety.gate_settings import Limits
from firmware_bridge.safety.gate_table import Action, GateState
from firmware_bridge.safety.unmoved import Unmoved, UnmovedOptions

TICK = 0.02


class Simulated:
    """Obeys commands late, with gains on both speeds; the watches of recording and gate look on."""

    def __init__(
        self,
        limits: Limits,
        lag: float = 0.2,
        dead_time: float = 0.1,
        gains: tuple[float, ...] = (1.0, 1.0, 1.0),
        period: float = 0.1,
        noise: tuple[float, float] = (0.002, 0.005),
        frozen_after: float = math.inf,
    ) -> None:
        self.limits, self.period, self.noise = limits, period, noise
        self.gains = (*gains, 1.0)[:3]
        self.watch, self.unmoved = DriveWatch(period, limits), Unmoved(UnmovedOptions())
        self.trouble = ""
        self.frozen_after = frozen_after
        self._keep = math.exp(-TICK / lag) if lag else 0.0
        self._waiting = deque([STILL] * (round(dead_time / TICK) + 1))
        self._random = random.Random(0)
        self.state = State(0.0, 0.0, 0.3, 0.0, 0.0, 0.0)

    def seen(self) -> State:
        """The pose as it is measured."""
        at, turn = self.noise
        draw, s = self._random.gauss, self.state
        return replace(
            s, x=s.x + draw(0.0, at), y=s.y + draw(0.0, at), theta=s.theta + draw(0.0, turn)
        )

    def drive(self, controller: Controller, seconds: float) -> list[State]:
        """Drive until time is up, or the watch finds trouble; true poses."""
        poses, command, wanted, pose = [], STILL, STILL, self.seen()
        every = round(self.period / TICK) or 1
        for k in range(round(seconds / TICK)):
            if self.state.stamp < self.frozen_after:
                pose = self.seen()
            pose = replace(pose, stamp=self.state.stamp)
            if k % every == 0:
                answer = controller(pose)
                wanted = self.limits.clip(answer.speeds)
            command = self.limits.slew(command, wanted, TICK)
            output = GateOutput(*command[:2], Action.SEND, GateState.ACTIVE, (), command[2])
            self.watch.on_tick(self.state.stamp, pose, output, True, k % every == 0)
            stays = self.unmoved.look(GateState.ACTIVE, self.state.stamp, command, pose)
            self.trouble = self.watch.trouble or stays
            if self.trouble:
                break
            self._waiting.append(command)
            told = self._waiting.popleft()
            s = self.state
            v, omega, vy = (
                gain * c + (now - gain * c) * self._keep
                for gain, c, now in zip(self.gains, told, (s.v, s.omega, s.vy), strict=True)
            )
            self.state = unicycle_arc(s, v, omega, TICK, vy)
            poses.append(self.state)
        return poses
