"""Bytes <-> frames of the serial motor controllers: pure functions, and bounded decoders."""

from firmware_bridge.link.framing.cobs import CobsFrames, cobs_body, cobs_frame
from firmware_bridge.link.framing.crc import crc16
from firmware_bridge.link.framing.lines import LINE_BYTES, Lines, odrive_line, odrive_text, xor8
from firmware_bridge.link.framing.roboclaw import (
    ROBOCLAW_ACK,
    ROBOCLAW_BYTES,
    RoboClawPackets,
    RoboClawReplies,
    roboclaw_packet,
    roboclaw_reply,
    roboclaw_request,
)
from firmware_bridge.link.framing.vesc import VescPackets, vesc_packet

__all__ = [
    "CobsFrames",
    "LINE_BYTES",
    "Lines",
    "ROBOCLAW_ACK",
    "ROBOCLAW_BYTES",
    "RoboClawPackets",
    "RoboClawReplies",
    "VescPackets",
    "cobs_body",
    "cobs_frame",
    "crc16",
    "odrive_line",
    "odrive_text",
    "roboclaw_packet",
    "roboclaw_reply",
    "roboclaw_request",
    "vesc_packet",
    "xor8",
]
