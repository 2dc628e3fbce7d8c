"""``behaviour`` of a farm file: which readings its drives have, and what is said of a wrong one."""

from __future__ import annotations

import pytest
from virtual_line import VirtualLine

from pnfarm.farm.farm import model_of
from pnfarm.farm.file.reading import FarmFileError, expand, parse_farm
from pnfarm.farm.file.schema import farm_schema
from pnfarm.farm.views.snapshot import drive_snapshot

FILE = """\
farm: line-1
link: {{kind: memory}}
drives:
  - name: axis-{{n}}
    count: 2
    model: {model}
    behaviour: {behaviour}
  - name: press
    model: akd-profinet
"""


def drives(behaviour: str, model: str = "akd-profinet"):
    return expand(parse_farm(FILE.format(model=model, behaviour=behaviour)))


def the_issue(behaviour: str, model: str = "akd-profinet") -> str:
    with pytest.raises(FarmFileError) as caught:
        drives(behaviour, model)
    (issue,) = caught.value.issues
    return str(issue)


def test_the_drives_of_a_group_have_its_readings_and_the_others_the_defaults():
    first, second, press = map(model_of, drives("{mode-change: disabled-only}"))
    assert first.access.disabled_only == second.access.disabled_only == (2117, 2135)
    assert press.access.disabled_only == (2117,)
    assert first.readings == {"mode-change": "disabled-only"}


def test_a_running_drive_shows_the_readings_that_its_file_chose():
    line = VirtualLine(2, behaviour="{control-by-plc: coast}")
    assert drive_snapshot(line.farm, line.farm.axes[1], line.world.now)["behaviour"] == {"control-by-plc": "coast"}
    assert line.farm.columns.axis[1].profidrive.settings.without_control == 1


def test_a_reading_goes_with_the_motor_and_the_identity_of_the_file():
    text = FILE.format(model="hiwin-e1", behaviour="{tasks-before-homing: refused}").replace(
        "    model: hiwin-e1\n", "    model: hiwin-e1\n    motor: {kind: linear}\n    identity: {device: 7}\n"
    )
    described = model_of(expand(parse_farm(text))[0])
    assert described.firmware["homing.required"] == 1
    assert (described.pitch, described.profidrive.identity.device_id) == (32.0, 7)


@pytest.mark.parametrize(
    ("behaviour", "said"),
    [
        (
            "{mode-chnge: at-once}",
            "drives[0].behaviour.mode-chnge: is not an open point of akd-profinet, did you mean mode",
        ),
        ("{mode-change: at-one}", "drives[0].behaviour.mode-change: has no reading 'at-one', did you mean at-once?"),
        ("{mode-change: 1}", "drives[0].behaviour.mode-change: is 1; allowed: a word"),
        ("[mode-change]", "drives[0].behaviour: is a list; allowed: a mapping"),
        ("{homing-bit: levl}", "drives[0].behaviour.homing-bit: "),
    ],
)
def test_what_is_wrong_is_reported_with_its_line_and_the_nearest_word(behaviour, said):
    issue = the_issue(behaviour)
    assert issue.startswith("<text>:7: ")
    assert said in issue


def test_allowed_is_what_the_model_has():
    assert "allowed: at-once, disabled-only" in the_issue("{mode-change: never}")
    assert "mode-change" in the_issue("{nothing-of-the-kind: x}").partition("allowed: ")[2]


def test_an_unknown_model_brings_no_second_complaint():
    assert "is not a model of this version" in the_issue("{mode-change: never}", model="akd-profibus")


def test_the_schema_names_the_points_and_readings_of_each_model():
    drive = farm_schema()["$defs"]["DriveGroup"]
    assert drive["properties"]["behaviour"]["type"] == "object"
    points = {rule["if"]["properties"]["model"]["enum"][0]: rule["then"] for rule in drive["allOf"]}
    behaviour = points["akd-profinet"]["properties"]["behaviour"]
    assert behaviour["additionalProperties"] is False
    assert behaviour["properties"]["mode-change"] == {"enum": ["at-once", "disabled-only"], "default": "at-once"}
    aliases = next(rule["if"] for rule in drive["allOf"] if "akd-profinet" in str(rule["if"]))
    assert "akd" in aliases["properties"]["model"]["enum"]
