"""What the documentation says of the code comes from the code."""

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MODELS = ("akd-ethernetip", "akd-profinet", "akd-profinet-2012", "hiwin-e1", "moog-msd", "profidrive")
NAMES = (
    "table.md", "states.md", "farm-file.md", "coverage.md", "behaviour.md", "bus.md", "faults.md", "metrics.md",
    "plant-models.md",    "api.md", "commands.md", "gsdml.md", "drives/index.md", "drives/makers.md",
    *(f"drives/{m}.md" for m in (*MODELS, "moog-msd-dp", "profidrive-dp")), *(f"parameters/{m}.md" for m in MODELS),
)  # fmt: skip


def _build():
    spec = importlib.util.spec_from_file_location("docs_build", ROOT / "docs" / "build.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _pages():
    return _build().PAGES


def test_every_generated_page_is_looked_at():
    assert set(_pages()) == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_generated_pages_are_up_to_date(name):
    assert (ROOT / "docs" / name).read_text(encoding="utf-8") == _pages()[name](), "run `python docs/build.py`"


@pytest.mark.parametrize("name", ["farm.schema.json", "scenario.schema.json"])
def test_schemas_for_editors_are_up_to_date(name):
    written = (ROOT / "configs" / "schema" / name).read_text(encoding="utf-8")
    assert written == _build().SCHEMAS[name](), "run `python docs/build.py`"


def test_every_field_of_the_table_says_what_it_means_and_who_writes_it():
    from pnfarm.firmware.axis import AXIS
    from pnfarm.table.channel import CPM, PPM
    from pnfarm.table.image import IMAGE
    from pnfarm.table.impairment import IMPAIRMENT
    from pnfarm.table.program import PROGRAM

    for layout in (AXIS, IMAGE, PROGRAM, PPM, CPM, IMPAIRMENT):
        for field in layout.fields.values():
            assert field.doc or field.name == "frame_id", f"{layout.name}.{field.name}"
