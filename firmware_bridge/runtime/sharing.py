"""A vehicle that the bridge drives, shared with ground stations."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from firmware_bridge.link import Transport, open_transport
from firmware_bridge.link.ration import Ration
from firmware_bridge.link.shared import SharedTransport
from firmware_bridge.robot_file import Robot
from firmware_bridge.safety.gate_table import DRIVING, GateState

if TYPE_CHECKING:
    from firmware_bridge.runtime.loop import ControlLoop
    from firmware_bridge.runtime.session import Session

SHARE, BYTES = 0.1, 1e5
"""Share of a core, and bytes per second, that reading all stations may use for long."""


def share(robot: Robot, transport: Transport, holds: Callable[[], bool]) -> SharedTransport:
    """Share a robot's link with the stations of its file.

    Parameters
    ----------
    robot : Robot
        An autopilot's.
    transport : Transport
        The link, not yet started.
    holds : callable
        Whether the bridge drives the vehicle now.
    """
    from firmware_bridge.drivers.mavlink.options import MavlinkOptions
    from firmware_bridge.drivers.mavlink.stations import StationRules

    options = MavlinkOptions.from_table(robot.driver_table()["board"])
    urls = (robot.link.forward or "").split()
    stations = [
        open_transport(url, Ration(share=SHARE / len(urls), most=BYTES / len(urls))) for url in urls
    ]
    rules = StationRules((options.system, options.component), holds)
    return SharedTransport(transport, stations, rules)


def drives(session: Session) -> bool:
    """Whether the vehicle is the bridge's now: driven, or ready to be.

    While it waits for a pilot to choose GUIDED, or has been given back, a pilot may steer it.
    """
    loop: ControlLoop | None = getattr(session, "loop", None)
    if loop is None or session.by_hand:
        return False
    ready = loop.snapshot is not None and loop.snapshot.status.ready
    state = loop.gate.state
    return state in DRIVING or (state is GateState.WAITING and ready)
