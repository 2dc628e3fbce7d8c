"""The coverage tables name every section of every manual, and tests that exist."""

import ast
import re
from pathlib import Path

import manual_coverage
import pytest
from manuals import manual_text

from pnfarm.drives.catalogue import model as drive_model

ROOT = Path(__file__).resolve().parents[2]

MODELS = [model for model in manual_coverage.MANUALS if (manual_coverage.FOLDER / f"{model}.csv").exists()]


def _tests_of(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)}


@pytest.mark.parametrize("model", MODELS)
def test_every_test_that_a_coverage_row_names_exists(model):
    known = {}
    for row in manual_coverage.rows(model):
        for name in row.proof:
            file, _, function = name.partition("::")
            if file not in known:
                known[file] = _tests_of(ROOT / file) if (ROOT / file).is_file() else set()
            assert function in known[file], f"{model}, section {row.section}: {name}"


def test_every_test_that_the_page_on_failures_of_the_machine_names_exists():
    named = set(re.findall(r"`(test_[a-z0-9_]+)`", (ROOT / "docs/machine-failures.md").read_text(encoding="utf-8")))
    known = set().union(*(_tests_of(path) for path in (ROOT / "tests").rglob("test_*.py")))
    assert named
    assert named <= known


@pytest.mark.parametrize("model", MODELS)
def test_every_numbered_section_table_and_figure_of_the_manual_has_a_row(model):
    text = manual_text(manual_coverage.MANUALS[model])
    listed = [row.section for row in manual_coverage.rows(model)]
    assert len(listed) == len(set(listed)), "a section stands twice"
    assert manual_coverage.numbered(text) <= set(listed)


def test_the_test_of_readings_exists():
    file, _, function = manual_coverage.READINGS_TEST.partition("::")
    assert function in _tests_of(ROOT / file)


@pytest.mark.parametrize("model", MODELS)
def test_every_open_point_names_a_section_of_the_manual_or_no_section(model):
    listed = {row.section.lower() for row in manual_coverage.rows(model)}
    for point in [point for name in manual_coverage.sharing(model) for point in drive_model(name).behaviour]:
        sections = set(point.source.lower().split(", ")) - {"not in the manual"}
        assert sections <= listed, point.name
        assert all(point.name in manual_coverage.left_open(model, section) for section in sections)


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("5.4,STW1,done,,", "status 'done'"),
        ("5.4,STW1,implemented,,", "without a test"),
        ("5.4,STW1,assumed,tests/a.py::test_b,", "without a reason"),
        ("5.4,STW1,not supported,,", "without a reason"),
    ],
)
def test_a_coverage_row_without_what_its_status_needs_is_refused(line, reason, tmp_path, monkeypatch):
    (tmp_path / "m.csv").write_text("section,title,status,proof,note\n" + line + "\n")
    monkeypatch.setattr(manual_coverage, "FOLDER", tmp_path)
    with pytest.raises(ValueError, match=reason):
        manual_coverage.rows("m")
