"""What is known of a vehicle, as the rest of the bridge asks for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from firmware_bridge.drivers.mavlink.options import MOCAP
from firmware_bridge.drivers.mavlink.streams import EKF_STATUS
from firmware_bridge.messages import LinkStatus

if TYPE_CHECKING:
    from firmware_bridge.drivers.mavlink.core import MavlinkCore


def vehicle_status(core: MavlinkCore, now: float, connected: bool) -> LinkStatus:
    """Say whether the vehicle obeys, whether its pose is to be trusted, and what is wrong."""
    distrust, authority = core.pose.faults(now, core.streams.rate(EKF_STATUS)), core.authority
    pose_stamp = core.pose.oldest_part
    if core.options.pose == MOCAP:
        # the EKF's output looks valid for 7 s after its source has stopped: the source's own
        # stamp tells
        pose_stamp = min(pose_stamp, core.mocap.stamp)
    faults = [*distrust, *(f"the vehicle refuses {name}" for name in core.streams.refused())]
    if core.wrong_vehicle:
        faults.append(core.wrong_vehicle)
    if authority.refusal:
        faults.append(": ".join((authority.refusal, *_why_not_armed(core, now))))
    faults += core.others.faults(now)
    fresh = authority.fresh(now)
    ready = authority.obeys and fresh and not core.wrong_vehicle
    # a vehicle that sends poses but no HEARTBEAT is not heard: it may obey us still, so it is
    # braked, not left to a pilot
    heard = core.heard if fresh else authority.heard
    return LinkStatus(
        connected,
        heard,
        pose_stamp,
        ready,
        not distrust,
        authority.armed,
        authority.mode_name,
        tuple(faults),
        core.counters,
        core.frame.doubt,
    )


def _why_not_armed(core: MavlinkCore, now: float) -> tuple[str, ...]:
    said = core.status_texts.refusals(now) if "arm" in core.authority.refusal else ()
    return ("; ".join(said),) if said else ()
