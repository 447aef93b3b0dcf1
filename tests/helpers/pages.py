"""The README and the documentation's pages: their blocks, commands, tables and links."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [*sorted(ROOT.glob("*.md")), ROOT / "lab" / "README.md", *sorted(DOCS.rglob("*.md"))]
LONG = "<!-- long -->"
"""Stands before a block that is not run: only its commands are parsed, its Python compiled."""
COMMANDS = ("kmpc", "kmpc-bridge")


class Block(NamedTuple):
    """A fenced block of a page."""

    language: str
    text: str
    line: int  # of its first line in the page, counted from 1
    long: bool  # marked as not to be run


def name_of(page: Path) -> str:
    """Path of a page as messages show it."""
    return str(page.relative_to(ROOT))


def read(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def blocks(text: str, *languages: str) -> list[Block]:
    """Fenced blocks of some languages, in order."""
    found = []
    for match in re.finditer(r"^```(\w+)[^\n]*\n(.*?)^```\s*$", text, re.MULTILINE | re.DOTALL):
        if match[1] in languages:
            marked = text[: match.start()].rstrip().endswith(LONG)
            found.append(Block(match[1], match[2], text.count("\n", 0, match.start()) + 1, marked))
    return found


def command_lines(shell: str) -> list[list[str]]:
    """Words of every command of the project's own in lines of shell."""
    joined = shell.replace("\\\n", " ")
    lines = [shlex.split(line.removeprefix("$ "), comments=True) for line in joined.splitlines()]
    return [words for words in lines if words and words[0] in COMMANDS]


def all_commands(text: str) -> list[list[str]]:
    """Commands of a page: in blocks of shell, and in lines that are indented by four blanks."""
    shell = "".join(block.text for block in blocks(text, "sh"))
    indented = "".join(re.findall(r"^    (kmpc.*\n)", text, re.MULTILINE))
    return command_lines(shell) + command_lines(indented)


def prose(text: str) -> str:
    """Text without its fenced blocks, in which brackets are no links and hashes no headings."""
    return re.sub(r"^```.*?^```\s*$", "", text, flags=re.MULTILINE | re.DOTALL)


def links(text: str) -> list[str]:
    """Targets of links and pictures that lead to files of the repository."""
    targets = re.findall(r"\]\(([^)\s]+)\)", prose(text))
    return [target for target in targets if "://" not in target and "mailto:" not in target]


def anchors(text: str) -> set[str]:
    """Anchors of a page's headings, as GitHub and mkdocs both name them."""
    found = set()
    for heading in re.findall(r"^#+ (.+)$", prose(text), re.MULTILINE):
        words = re.sub(r"[^\w\s-]", "", heading.lower())
        found.add(re.sub(r"\s+", "-", words.strip()))
    return found


def table_rows(text: str) -> list[str]:
    """Rows of a page's tables, without headers and rules."""
    found = []
    for table in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
        found += table.splitlines()[2:]
    return found
