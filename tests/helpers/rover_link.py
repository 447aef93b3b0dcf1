"""How a rover that can be armed at once is made."""

from __future__ import annotations

READY = {"arm_after": 0.2, "uptime": 5.0}  # a rover that can be armed at once
