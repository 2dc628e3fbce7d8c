"""How the tests' own files depend on each other."""

from __future__ import annotations

import ast
from pathlib import Path

TESTS = Path(__file__).resolve().parent


def imported(path: Path) -> set[str]:
    """The modules that a file imports, and the names that it takes from them."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {node.module or "", *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found


def test_no_module_imports_a_test_module():
    files = list(TESTS.rglob("*.py"))
    tests = {path.stem for path in files if path.stem.startswith("test_")}
    assert len(tests) > 100
    for path in files:
        shared = {part for name in imported(path) for part in name.split(".")} & tests
        assert not shared, f"{path.relative_to(TESTS)} imports {shared}: what several share belongs into tests/support"


def test_no_two_modules_have_one_name():
    """The folders of tests are no packages: pytest imports their modules by their names."""
    folders = [path.parent for path in TESTS.rglob("test_*.py")]
    names = [path.stem for folder in {*folders, TESTS / "support"} for path in folder.glob("*.py")]
    twice = {name for name in names if names.count(name) > 1}
    assert twice <= {"conftest", "__main__"}
