"""What README, pages and examples say is run, as it stands there; where they lead exists."""

import ast
import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from pages import (
    DOCS,
    PAGES,
    ROOT,
    all_commands,
    anchors,
    blocks,
    command_lines,
    links,
    name_of,
    prose,
    read,
    table_rows,
)

import kmpc_lab as lab
import kmpc_lite as kl
from kmpc_lite.cli.command import build_parser, known_commands
from kmpc_lite.cli.main import main as kmpc
from kmpc_lite.scenario.files import Scenario

README = ROOT / "README.md"
RESULTS = [page for page in sorted((DOCS / "results").glob("*.md")) if page.name != "index.md"]
GALLERY = [p for p in sorted((ROOT / "examples" / "gallery").glob("*.py")) if p.stem != "drawing"]
EXAMPLES = [*sorted((ROOT / "examples").glob("*.py")), *GALLERY]
SLOW = ("animate_drive",)  # examples that draw for long
PROGRAMS = ("kmpc", "kmpc-bridge")
PATH = re.compile(r"`((?:kmpc_lite|firmware_bridge|lab|tests|examples|docs)/[\w/.-]*)`")
"""Files and folders that a page names; those with NAME in capitals are to be made by the reader."""
WITH_PROGRAMS = [page for page in PAGES if blocks(read(page), "python", "sh")]


def parse(words: list[str]) -> Any:
    """Parse a command line; the parser raises, and the test fails, where it is none."""
    return build_parser(known_commands(), words[1:]).parse_args(words[1:])


def test_the_readme_is_short() -> None:
    text = read(README)
    assert len(text.splitlines()) <= 150
    assert len(text.split()) <= 900
    (program,) = blocks(text, "python")
    assert len([line for line in program.text.splitlines() if line.strip()]) <= 15
    assert not program.long


@pytest.mark.parametrize("page", WITH_PROGRAMS, ids=name_of)
def test_the_programs_and_commands_of_a_page_run_in_order(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    namespace: dict[str, Any] = {"__name__": "__page__"}
    for block in blocks(read(page), "python", "sh"):
        if block.language == "python":
            # as many lines before it as in the page, so that a traceback points there
            code = compile("\n" * block.line + block.text, str(page), "exec")
            if not block.long:
                exec(code, namespace)
            continue
        for words in command_lines(block.text):
            if not block.long:
                monkeypatch.setattr(sys, "argv", words)
                assert words[0] in PROGRAMS
                status = kmpc(words[1:])
                assert status == 0, capsys.readouterr().err


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_the_commands_of_a_page_parse(page: Path) -> None:
    for words in all_commands(read(page)):
        assert parse(words), words


def test_there_are_commands_to_check() -> None:
    assert sum(len(all_commands(read(page))) for page in PAGES) >= 40
    assert len(WITH_PROGRAMS) >= 8


def test_the_scenario_tables_of_the_pages_are_scenarios() -> None:
    checked = 0
    for page in PAGES:
        for block in blocks(read(page), "toml"):
            table = tomllib.loads(block.text)
            if "map" in table:
                where = f"{name_of(page)}, line {block.line}"
                assert Scenario.from_table(table, name_of(page), where).problem()
                checked += 1
    assert checked


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_the_links_of_a_page_lead_somewhere(page: Path) -> None:
    for target in links(read(page)):
        path, _, anchor = target.partition("#")
        file = page if not path else (page.parent / path).resolve()
        assert file.exists(), f"{name_of(page)}: {target} does not exist"
        if anchor:
            assert anchor in anchors(read(file)), f"{name_of(page)}: no heading for {target}"


@pytest.mark.parametrize("page", [p for p in PAGES if p.name != "CHANGELOG.md"], ids=name_of)
def test_the_files_that_a_page_names_exist(page: Path) -> None:
    for path in PATH.findall(prose(read(page))):
        known = (ROOT / path).exists() or "NAME" in path
        assert known, f"{name_of(page)} names {path}, which is not there"


def test_every_page_is_in_the_sites_navigation() -> None:
    navigation = read(ROOT / "mkdocs.yml").partition("\nnav:")[2]
    missing = [
        str(page.relative_to(DOCS))
        for page in DOCS.rglob("*.md")
        if f": {page.relative_to(DOCS)}\n" not in navigation
    ]
    assert not missing, f"add a line under `nav` in mkdocs.yml for each of {missing}"


def test_the_api_reference_documents_the_public_names_and_no_others() -> None:
    documented = re.findall(r"^::: (\w+\.\w+)$", read(DOCS / "reference" / "api.md"), re.M)
    public = [f"{package.__name__}.{name}" for package in (kl, lab) for name in package.__all__]
    assert sorted(documented) == sorted(public)


@pytest.mark.parametrize("page", RESULTS, ids=name_of)
def test_a_command_stands_above_every_table_of_the_results(page: Path) -> None:
    text = read(page)
    assert "Measured with version" in text
    for section in re.split(r"^## ", text, flags=re.MULTILINE):
        if "\n|---" in section:
            above = section[: section.index("\n|---")]
            assert "```sh" in above, (
                f"{name_of(page)}: no command above the table of {section[:40]!r}"
            )


def test_the_readmes_highlights_stand_in_the_results_with_their_command() -> None:
    rows = [row for row in table_rows(read(README)) if "docs/results/" in row]
    assert len(rows) == 5
    for row in rows:
        (page,) = re.findall(r"\((docs/results/\w+\.md)\)", row)
        text, command = read(ROOT / page), row.rstrip("| ").split("| `")[-1].rstrip("`")
        assert command in text, f"{page} has no {command}"
        figures = re.findall(r"\*\*([^*]+)\*\*", row)
        assert figures
        for figure in figures:
            assert re.search(rf"(?<![\d.,]){re.escape(figure)}(?![\d.,]*\d)", text), (
                f"{page} has no {figure}"
            )


def test_what_the_readme_says_of_the_package_is_what_the_package_says() -> None:
    project = tomllib.loads(read(ROOT / "pyproject.toml"))["project"]
    assert f"License: {project['license']}." in read(README)
    assert f"Python: {project['requires-python'].removeprefix('>=')} or newer" in read(README)
    needed = {re.split(r"[<>=]", name)[0] for name in project["dependencies"]}
    sentence = re.search(r"Needs ([^.]*)\.", read(README))
    assert sentence and set(re.split(r", | and ", sentence[1])) == needed
    assert project["version"] == kl.__version__
    assert f"\nversion: {kl.__version__}\n" in read(ROOT / "CITATION.cff")
    heading = "Unreleased" if ".dev" in kl.__version__ else kl.__version__
    assert f"\n## [{heading}]" in read(ROOT / "CHANGELOG.md")


@pytest.mark.parametrize(
    "example",
    [
        pytest.param(path, id=path.stem, marks=[pytest.mark.long] * (path.stem in SLOW))
        for path in EXAMPLES
    ],
)
def test_examples_run_and_end_in_a_number_or_a_picture(example: Path, tmp_path: Path) -> None:
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    done = subprocess.run(
        [sys.executable, str(example)],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert re.search(r"\d", done.stdout)
    assert {path.name for path in tmp_path.iterdir()} <= {"out"}
    assert (compile(example.read_text(), str(example), "exec").co_consts[0] or "").strip(), (
        "an example begins with what it shows"
    )


def test_what_examples_import_of_the_project_is_public() -> None:
    notebook = json.loads(read(ROOT / "examples" / "learn_and_drive.ipynb"))
    cells = ("".join(c["source"]) for c in notebook["cells"] if c["cell_type"] == "code")
    files = [p for p in (ROOT / "examples").rglob("*.py") if p.parent.name != "own_board"]
    programs = [*map(read, files), *cells]
    imported = {
        f"{node.module}.{name.name}" if isinstance(node, ast.ImportFrom) else name.name
        for program in programs
        for node in ast.walk(ast.parse(program))
        if isinstance(node, ast.Import | ast.ImportFrom)
        for name in node.names
    }
    ours = {name for name in imported if name.startswith(("kmpc_", "firmware_bridge"))}
    names = {f"{package.__name__}.{name}" for package in (kl, lab) for name in package.__all__}
    assert "kmpc_lite" in ours and ours <= {"kmpc_lite", "kmpc_lab", *names}


def test_the_gallery_shows_every_example_of_its_folder() -> None:
    page = read(DOCS / "gallery.md")
    assert len(GALLERY) == 6
    for example in GALLERY:
        assert f"<!-- example: gallery/{example.stem} -->" in page
        assert f"](gallery/{example.stem}.png)" in page
