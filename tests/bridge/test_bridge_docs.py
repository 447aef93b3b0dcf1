"""The docs say what the code does."""

import re
from pathlib import Path

from firmware_bridge.cli import COMMANDS
from firmware_bridge.robot_file import SECTIONS, ControlOptions, LinkOptions
from firmware_bridge.safety.gate_table import diagram, legend
from firmware_bridge.safety.settings import GateSettings
from kmpc_lite.cli.command import build_parser, known_commands

DOCS = Path(__file__).parents[2] / "docs"
BRIDGE = (DOCS / "howto" / "bridge.md").read_text()


def test_the_state_machine_in_the_docs_is_the_one_in_the_code():
    assert f"```mermaid\n{diagram()}\n```" in BRIDGE
    assert legend() in BRIDGE


def test_links_between_the_pages_lead_somewhere():
    for page in DOCS.rglob("*.md"):
        for target in re.findall(r"\]\(([^)#]+)\)", page.read_text()):
            assert target.startswith("http") or (page.parent / target).exists(), (
                f"{page.name}: {target}"
            )


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


def test_the_commands_of_the_docs_parse():
    commands = [
        line.split("#")[0].strip()
        for page in DOCS.rglob("*.md")
        for line in page.read_text().splitlines()
        if line.startswith("    kmpc-bridge ")
    ]
    assert len(commands) >= 8
    for command in commands:
        words = command.split()[1:]
        assert build_parser(known_commands(COMMANDS), words).parse_args(words)
