"""``behaviour: {set: NAME}``: a profile drive with a maker's fault codes and readings."""

from __future__ import annotations

import pytest
from hand_plc import HandPlc
from hypothesis import given
from hypothesis import strategies as st
from model_copy import copy_model, rewrite
from profidrive_plc import RUN

from pnfarm.config.known import Known, catalogue
from pnfarm.drives.catalogue import model
from pnfarm.drives.description.behaviour import with_behaviour
from pnfarm.drives.description.loader import load_model
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import FarmFileError, parse_farm

MODEL = model("profidrive")
SETS = sorted(MODEL.behaviour_sets)
FILE = """
farm: x
link: {{kind: memory}}
drives:
  - {{name: a, model: {model}, ip: 10.77.0.1/24, behaviour: {{{behaviour}}}}}
"""


def test_there_are_the_four_sets():
    assert SETS == ["festo-cmmt", "generic", "sinamics-g120", "sinamics-s120"]


@pytest.mark.parametrize("name", SETS)
def test_every_entry_of_a_set_names_one_of_its_sources(name):
    found = MODEL.behaviour_sets[name]
    told = [fact.source for fact in found.readings.values()] + [fault.source for fault in found.faults]
    assert all(any(source.startswith(short) for short in found.sources) for source in told)
    assert found.title
    assert found.gaps


@pytest.mark.parametrize(
    ("name", "code"), [("generic", 37), ("sinamics-s120", 7901), ("sinamics-g120", 7901), ("festo-cmmt", 128)]
)
def test_a_plc_sees_the_maker_s_code_in_the_telegram_and_in_the_fault_buffer(name, code):
    plc = HandPlc("profidrive", 111, behaviour=f"{{set: {name}}}")
    plc.switch_on(operation=RUN)
    plc.inject("drive-fault", fault=37)
    plc.wait(20)
    assert plc["FAULT_CODE"] == code
    assert [plc.store.read(pnu)[0] for pnu in (945, 947)] == [code, code]


def test_a_warning_has_the_maker_s_number():
    plc = HandPlc("profidrive", 111, behaviour="{set: sinamics-s120}")
    plc.inject("drive-warning", warning=7012)
    plc.wait(20)
    assert plc["WARN_CODE"] == 7012


@pytest.mark.parametrize(
    ("behaviour", "code"),
    [("set: sinamics-s120", 8501), ("set: sinamics-s120, fault-on-plc-stop: no-fault", 0), ("set: generic", 0)],
)
def test_a_single_point_wins_over_the_set(behaviour, code):
    plc = HandPlc("profidrive", 111, behaviour=f"{{{behaviour}}}")
    plc.switch_on(operation=RUN)
    plc.stop_controller()
    plc.wait(50)
    assert plc["FAULT_CODE"] == code


def test_without_a_set_and_with_the_generic_one_a_drive_is_the_same():
    generic = with_behaviour(MODEL, {"set": "generic"})
    assert (generic.faults, generic.firmware, generic.readings) == (MODEL.faults, MODEL.firmware, {})


@pytest.mark.parametrize(
    ("name", "behaviour", "what"),
    [("profidrive", "set: sinamics-s12", "profidrive has no set 'sinamics-s12', did you mean sinamics-s120?"),
     ("akd-profinet", "set: generic", "akd-profinet has no set 'generic'")],
)  # fmt: skip
def test_an_unknown_set_is_refused_with_a_sentence(name, behaviour, what):
    with pytest.raises(FarmFileError) as caught:
        parse_farm(FILE.format(model=name, behaviour=behaviour))
    (issue,) = caught.value.issues
    assert (issue.line, issue.field.rpartition(".")[2]) == (5, "set")
    assert what in issue.what


def test_the_farm_file_s_schema_knows_the_sets():
    known: Known = catalogue()
    facts = known.model("profidrive")
    assert sorted(facts.open_points["set"]) == SETS
    assert facts.open_points["set"][0] == "generic"


@given(st.dictionaries(st.sampled_from(["set", "sign-of-life", "x"]), st.sampled_from([*SETS, "watched", "", "x"])))
def test_any_choice_makes_a_model_or_is_refused_with_a_sentence(chosen):
    allowed = {"set": SETS, "sign-of-life": ["watched"], "x": []}
    if all(reading in allowed[name] for name, reading in chosen.items()):
        assert with_behaviour(MODEL, chosen).readings.get("sign-of-life") in {None, "watched", "isochronous-only"}
        return
    with pytest.raises(ConfigError, match=r"^profidrive has no (set|behaviour) "):
        with_behaviour(MODEL, chosen)


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [("fault = 37", "fault = 38", "the model has no fault 38"),
     ("fault = 37", "fault = 17", "one is given twice"),
     ("code = 128", "code = 70000", "70000 is not within 1..65535"),
     ("code = 258", "code = 12", "12 is the number of another fault"),
     ("code = 128", 'code = 128\nreaction = "slow"', "'slow' is not one of coast, quick-stop"),
     ("code = 128", "code = 128\ndiagnosis = 70000", "not a ChannelErrorType"),
     ("code = 128", "code = 128\ncolour = 1", "colour: unknown"),
     ('title = "Festo CMMT-AS"', "", "title: missing"),
     ("[sources]", '[behaviour]\nsign-of-life = { reading = "never", source = "x" }\n[sources]', "no reading 'never'")],
)  # fmt: skip
def test_a_mistake_in_a_set_is_told_with_file_and_entry(tmp_path, old, new, what):
    folder = copy_model("profidrive", tmp_path / "model")
    rewrite(folder, "sets/festo-cmmt.toml", old, new)
    with pytest.raises(ConfigError, match=r"sets/festo-cmmt\.toml, ") as caught:
        load_model(folder)
    assert what in str(caught.value)
