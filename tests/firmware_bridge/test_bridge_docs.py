"""The docs say what the code does."""

from pathlib import Path

from firmware_bridge.robot_file import SECTIONS, ControlOptions, LinkOptions
from firmware_bridge.safety.gate_settings import GateSettings
from firmware_bridge.safety.gate_table import diagram, legend

DOCS = Path(__file__).parents[2] / "docs"
BRIDGE = (DOCS / "howto" / "bridge.md").read_text()


def test_the_state_machine_in_the_docs_is_the_one_in_the_code():
    assert f"```mermaid\n{diagram()}\n```" in BRIDGE
    assert legend() in BRIDGE


def test_every_section_and_key_of_a_robot_file_is_named():
    assert all(f"`[{section}]`" in BRIDGE for section in SECTIONS)
    for options in (LinkOptions, ControlOptions):
        assert all(f"`{name}`" in BRIDGE for name in options.__dataclass_fields__)
    assert all(f"`{name}`" in BRIDGE for name in GateSettings().limits.__dataclass_fields__)
    assert all(
        f"`{name}`" in BRIDGE
        for name in GateSettings.__dataclass_fields__
        if name not in ("limits", "pilot")
    )
