"""What the site prints from the code: help of commands, and examples.

mkdocs calls `on_page_markdown` for every page. A page asks with a comment of its own line:
``<!-- help: kmpc -->`` or ``<!-- example: gallery/car -->``. Mermaid blocks become SVG, so that the
site needs no network; GitHub draws them by itself. Sections between ``<!-- tabs -->`` and
``<!-- /tabs -->`` become tabs; GitHub shows them one below the other.
"""

from __future__ import annotations

import logging
import os
import re
import subprocess
import sys
from collections import Counter
from functools import lru_cache
from pathlib import Path
from typing import Any

from state_diagram import draw

ROOT = Path(__file__).resolve().parents[2]
PROGRAMS = {"kmpc": "kmpc_lite.cli.main"}
MARK = re.compile(r"^<!-- (help|example): ([\w/-]+) -->$", re.MULTILINE)
MERMAID = re.compile(r"^```mermaid\n(.*?)^```$", re.MULTILINE | re.DOTALL)
TABS = re.compile(r"^<!-- tabs -->$(.*?)^<!-- /tabs -->$", re.MULTILINE | re.DOTALL)
SECTION = re.compile(r"^## ([^\n]+)\n(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)
OPTIONS = re.compile(r"[^\n]+:\n  -")
log = logging.getLogger("mkdocs.hooks.site")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Replace the marks and diagrams of a page."""
    markdown = MERMAID.sub(lambda block: draw(block[1]), markdown)
    markdown = TABS.sub(lambda tabs: SECTION.sub(r"/// tab | \1\n\2///\n\n", tabs[1]), markdown)
    shown = {"help": help_texts, "example": program}
    return MARK.sub(lambda mark: shown[mark[1]](mark[2]), markdown)


@lru_cache
def help_of(program: str, *command: str) -> str:
    """Run ``program command --help`` and give what it prints.

    A failure is a warning, which ends a strict build.
    """
    code = (
        f"import sys; from {PROGRAMS[program]} import main; sys.argv[0] = {program!r}; "
        f"main({[*command, '--help']!r})"
    )
    environment = {**os.environ, "COLUMNS": "100", "NO_COLOR": "1", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        log.warning("%s --help fails: %s", " ".join([program, *command]), done.stderr[-300:])
    return done.stdout.rstrip()


def commands_of(program: str, *command: str) -> list[str]:
    """Names of the commands that the help of a program, or of a group of commands, lists."""
    return re.findall(r"^    (\w[\w-]*)(?:\s|$)", help_of(program, *command), re.MULTILINE)


def help_texts(program: str) -> str:
    """Give the help of every command of a program, a section each.

    Groups of options that several commands share come once, at the end.
    """
    names = [(name,) for name in commands_of(program)]
    names += [(name, below) for (name,) in names for below in commands_of(program, name)]
    helps = {name: help_of(program, *name).split("\n\n") for name in sorted(names)}
    counts = Counter(group for groups in helps.values() for group in groups)
    shared = [group for group, count in counts.items() if count > 1 and OPTIONS.match(group)]
    sections = [f"## {program}\n\n```text\n{help_of(program)}\n```"]
    for name, groups in helps.items():
        told = [f"{title(g)}: below" if g in shared else g for g in groups]
        text = "\n\n".join(told)
        sections.append(f"### {program} {' '.join(name)}\n\n```text\n{text}\n```")
    sections.append("## Options of several commands")
    for group in shared:
        users = [f"`{' '.join(name)}`" for name, groups in helps.items() if group in groups]
        sections.append(f"Of {', '.join(users)}:\n\n```text\n{group}\n```")
    return "\n\n".join(sections)


def title(group: str) -> str:
    """Give the heading of a group of options."""
    return group.partition(":\n")[0]


def program(name: str) -> str:
    """Give an example's program, folded."""
    code = (ROOT / "examples" / f"{name}.py").read_text(encoding="utf-8")
    return f"/// details | examples/{name}.py\n\n```python\n{code}```\n\n///\n"
