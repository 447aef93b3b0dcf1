"""Habits that a machine can hold: files of one concept, short functions, and no circle of imports.

Ruff holds the others: lines of 100 columns, functions of 12 branches.
"""

import ast
from pathlib import Path

ROOT = Path(__file__).parent.parent
FILES = sorted(
    path
    for room in ("kmpc_lite", "firmware_bridge", "lab/kmpc_lab")
    for path in (ROOT / room).rglob("*.py")
)
LINES, FUNCTION = 500, 60
REASON = "# long: "
"""Stands beside the `def` of a function that is longer for a reason, with the reason."""
LONG_FILES: dict[str, int] = {}
"""Files that are still to be divided, and how many lines they may have until then."""
LONG_FUNCTIONS: dict[str, int] = {}
"""Functions that are still to be divided, and how many lines they may have until then."""


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def length(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines of a function but for its docstring: what it does, not what is said of it."""
    assert function.end_lineno is not None
    lines = function.end_lineno - function.lineno + 1
    first = function.body[0]
    told = ast.get_docstring(function) is not None and isinstance(first, ast.Expr)
    return lines - ((first.end_lineno or 0) - first.lineno + 1 if told else 0)


def functions(text: str) -> list[ast.FunctionDef | ast.AsyncFunctionDef]:
    tree = ast.walk(ast.parse(text))
    return [node for node in tree if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]


def test_files_are_short() -> None:
    for path in FILES:
        lines = path.read_text(encoding="utf-8").splitlines()
        assert len(lines) <= LONG_FILES.get(name_of(path), LINES), name_of(path)


def test_functions_are_short_or_say_why_not() -> None:
    for path in FILES:
        text = path.read_text(encoding="utf-8")
        lines = text.splitlines()
        for function in functions(text):
            beside = lines[function.lineno - 2 : function.body[0].lineno - 1]
            if length(function) > FUNCTION and not any(REASON in line for line in beside):
                name = f"{name_of(path)}:{function.name}"
                assert length(function) <= LONG_FUNCTIONS.get(name, FUNCTION), name


def module_of(path: Path) -> str:
    name = name_of(path).removeprefix("lab/").removesuffix(".py").removesuffix("/__init__")
    return name.replace("/", ".")


def modules() -> dict[str, Path]:
    return {module_of(path): path for path in FILES}


def imported(path: Path, known: dict[str, Path]) -> set[str]:
    """Modules that a file imports when it is loaded; what a function imports comes later."""
    found: set[str] = set()
    waiting: list[ast.AST] = [ast.parse(path.read_text(encoding="utf-8"))]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            continue
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            parts = {f"{node.module}.{alias.name}" for alias in node.names}
            inner = parts & known.keys()
            found |= inner if len(inner) == len(parts) else inner | {node.module}
        waiting += ast.iter_child_nodes(node)
    return found & known.keys()


def test_no_file_imports_itself_in_a_circle() -> None:
    known = modules()
    graph = {name: imported(path, known) for name, path in known.items()}
    while leaves := {name for name, needed in graph.items() if not needed}:
        graph = {name: needed - leaves for name, needed in graph.items() if name not in leaves}
    assert not graph, f"imports in a circle, or above one: {sorted(graph)}"
