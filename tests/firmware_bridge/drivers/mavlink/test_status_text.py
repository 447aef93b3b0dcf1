"""Texts of the autopilot: whole ones out of chunks, and why it does not arm."""

from types import SimpleNamespace

from mavlink_rig import Rig

from firmware_bridge.drivers.mavlink.status_text import StatusTexts

LONG = "Battery 1 below minimum arming voltage and the compass is not calibrated, calibrate it"


def chunk(text: str, number: int = 0, sequence: int = 0) -> SimpleNamespace:
    return SimpleNamespace(severity=4, text=text, id=number, chunk_seq=sequence)


def test_a_long_refusal_is_reported_whole_in_the_autopilots_own_words() -> None:
    """The firmware sends it in chunks of 50; it was cut, and the reason with it."""
    rig = Rig()
    rig.run(4.0)
    rig.rover.autopilot.arming_failure = LONG
    rig.core.take(rig.now)
    rig.run(3.0)
    assert f"arming is refused for now: Arm: {LONG}" in rig.faults
    rig.rover.autopilot.arming_failure = ""
    rig.until(lambda: rig.ready, 5.0)
    assert rig.core.refusals(rig.now) == ()


def test_chunks_in_any_order_and_texts_of_whole_chunks() -> None:
    words = StatusTexts()
    assert words.on_text(chunk("b" * 50, 7, 1), 0.0) == ""
    assert words.on_text(chunk("", 7, 2), 0.1) == ""
    assert words.on_text(chunk("a" * 50, 7, 0), 0.2) == "a" * 50 + "b" * 50
    assert words.on_text(chunk("short"), 0.3) == "short"


def test_a_lost_chunk_leaves_a_gap_and_not_silence() -> None:
    words = StatusTexts()
    words.on_text(chunk("a" * 50, 7, 0), 0.0)
    words.on_text(chunk("the end", 7, 2), 0.1)
    words.tick(2.0)
    assert words.texts[-1][1] == "a" * 50 + " ... " + "the end"
