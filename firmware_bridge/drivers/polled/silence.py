"""Why a board could not be set up, in words that a user can act on."""

from __future__ import annotations

from collections.abc import Mapping


def why_silent(
    down: str, counters: Mapping[str, int], faults: tuple[str, ...], timeout: float, hint: str
) -> str:
    """Say what is missing.

    Parameters
    ----------
    down : str
        Why the link is down; empty where it is up.
    counters : mapping
        Of the link and of the exchange.
    faults : tuple of str
        What the board complains of.
    timeout : float
        How long was waited [s].
    hint : str
        What a user of this board should look at.
    """
    if down:
        return down
    if faults and counters["frames"]:
        return f"answers, but cannot drive: {'; '.join(faults)}"
    if counters["bytes_in"] == 0:
        return f"no answer within {timeout:g} s: {hint}"
    if counters["frames"] == 0:
        return (
            f"{counters['bytes_in']} bytes came and none made sense: "
            f"wrong baud rate or protocol? {hint}"
        )
    missing = f"{counters['timeouts']} are missing"
    return f"answers come, but too few within {timeout:g} s: {missing}: {hint}"
