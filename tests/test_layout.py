"""How files depend on each other, the package's and the tests' own, and how many a folder has."""

from __future__ import annotations

import ast
from graphlib import TopologicalSorter
from pathlib import Path

TESTS = Path(__file__).resolve().parent
PACKAGE = TESTS.parent / "pnfarm"
#: Folders that are lists of like things: they may be long.
LISTS = {"faults/kinds", "firmware/records"}
MOST_MODULES = 20


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


def test_no_modules_import_each_other_in_a_circle_not_even_for_types():
    files = {
        ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__"): path
        for path in PACKAGE.rglob("*.py")
    }
    graph = {name: (imported(path) & files.keys()) - {name} for name, path in files.items()}
    assert sum(map(len, graph.values())) > 5000
    # raises CycleError, which names the circle
    TopologicalSorter(graph).prepare()


def test_no_folder_has_more_modules_than_a_reader_takes_in():
    counts = {
        folder.relative_to(PACKAGE).as_posix(): sum(path.stem != "__init__" for path in folder.glob("*.py"))
        for folder in PACKAGE.rglob("*")
        if folder.is_dir()
    }
    assert len(counts) > 50
    assert {name: count for name, count in counts.items() if count > MOST_MODULES and name not in LISTS} == {}
    assert counts.keys() >= LISTS


def test_no_bits_of_the_wire_are_flags_that_keep_each_combination_for_ever():
    """``IntFlag(value)`` keeps a member for each value that it ever had: with what others send, memory grows."""
    kept = {"enum.IntFlag", "enum.Flag"}
    users = {path.relative_to(PACKAGE).as_posix() for path in PACKAGE.rglob("*.py") if imported(path) & kept}
    assert users == {"protocols/profinet/records/directory.py"}, "whose combinations are those of its table"
