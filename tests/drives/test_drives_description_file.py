"""What a model's data may say for its description file, and for limits that only some drives have."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from model_copy import drop_section, rewrite

from pnfarm.drives.catalogue import model
from pnfarm.drives.description.as_json import as_json
from pnfarm.drives.description.loader import load_model
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.drives.description.model import Model

ALARMS = 'alarms = { value = false, source = "5.13"'


def loaded(folder: Path, old: str, new: str, more: str = "") -> Model:
    path = rewrite(folder, "model.toml", old, new)
    path.write_text(path.read_text(encoding="utf-8") + more, encoding="utf-8")
    return load_model(folder)


def test_a_model_without_the_optional_values_has_their_defaults(folder: Path) -> None:
    drop_section(folder, "description_file")
    rewrite(folder, "model.toml", "alarms = {", "# alarms = {")
    bare = load_model(folder)
    assert (bare.limits.max_cycle_ns, bare.limits.alarms, bare.diagnoses) == (0, False, {})
    assert bare.description_file is None
    sources = as_json(bare)["limits"]["sources"]
    assert sources["alarms"]["source"] == sources["max_cycle_ns"]["source"] == "default"
    assert sources["min_cycle_ns"]["source"] == "4.2.2"


@pytest.mark.parametrize("name", ["akd-profinet", "akd-profinet-2012"])
def test_the_akd_sends_no_alarms_by_its_manual(name: str) -> None:
    akd = model(name)
    assert akd.limits.alarms is False
    assert akd.facts["limits.alarms"].source == "5.13"


def test_a_slowest_cycle_alarms_and_diagnosis_come_from_data(folder: Path) -> None:
    more = '\n[diagnosis]\n702 = { value = 0x0100, source = "x" }\n130 = { value = 0x9003, source = "x" }\n'
    slow = 'max_cycle_ns = { value = 32_000_000, source = "x" }\nalarms = { value = true, source = "x"'
    found = loaded(folder, ALARMS, slow, more)
    assert (found.limits.max_cycle_ns, found.limits.alarms) == (32_000_000, True)
    assert found.diagnoses == {702: 0x0100, 130: 0x9003}
    assert as_json(found)["diagnosis"]["702"]["value"] == 0x0100


@pytest.mark.parametrize(
    ("old", "new", "more", "message"),
    [
        (ALARMS, 'alarms = { value = "no", source = "x"', "", r"limits\.alarms: 'no' is neither true nor false"),
        (ALARMS, 'max_cycle_ns = { value = 1, source = "x" }\n' + ALARMS, "", r"max_cycle_ns: 1 is below min_cycle_ns"),
        (
            ALARMS,
            'send_clocks = { value = [4, 32], source = "x" }\n' + ALARMS,
            "",
            r"send_clocks: \[4, 32\] are not all among",
        ),
        ("date = { value = 20261124", "date = { value = 20261321", "", r"date: 20261321 is not a date such as"),
        (
            'family = { value = "AKD (virtual, pnfarm)"',
            'family = { value = ""',
            "",
            r"family: '' is not a text of one line",
        ),
        (
            'family = { value = "AKD (virtual',
            'family = { value = "AKD\\n(virtual',
            "",
            r"family: '.*' is not a text of one line",
        ),
        ("family = {", "kin = {", "", r"description_file: .*kin"),
        (ALARMS, ALARMS, '\n[diagnosis]\n702 = { value = 256, source = "x" }\n', r"needs limits\.alarms"),
        (ALARMS, ALARMS, '\n[diagnosis]\n1 = { value = 256, source = "x" }\n', r"diagnosis\.1: there is no fault 1"),
        (ALARMS, ALARMS, '\n[diagnosis]\nx = { value = 256, source = "x" }\n', r"'x' is not a number"),
        (ALARMS, ALARMS, '\n[diagnosis]\n702 = { value = 1, source = "x" }\n', r"1 is not within 0x0100\.\.0x7FFF"),
        (ALARMS, ALARMS, '\n[diagnosis]\n702 = { value = 256, source = "assumed" }\n', r"needs its reason"),
    ],
)
def test_a_mistake_in_them_is_named(folder: Path, old: str, new: str, more: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        loaded(folder, old, new, more)
