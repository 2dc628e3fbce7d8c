"""``gsdml: FILE`` of a drive whose maker has telegrams as submodules of one module, and supplementary telegrams."""

import os
from pathlib import Path

import pytest
from drive_gsdml_sweep import DriveSweep
from drive_object_gsdml import EMPTY, PROFISAFE, SERVO, VECTOR, drive_object_gsdml
from hand_plc import HandPlc
from hypothesis import given
from hypothesis import strategies as st
from profidrive_plc import FULL, RUN

from pnfarm.buses.profinet.binding import describe_device
from pnfarm.buses.profinet.maker_identity import identity_of
from pnfarm.drives.catalogue import model
from pnfarm.drives.description.identity import with_identity
from pnfarm.farm.farm import model_of
from pnfarm.farm.file.reading import FarmFileError, expand, parse_farm
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml
from pnfarm.testing import Line

FARM = """
farm: x
link: {{kind: memory}}
drives:
  - {{name: a, model: profidrive, ip: 10.77.0.1/24{keys}}}
controller: {{name: plc, ip: 10.77.0.100/24}}
"""
FOUND = (1, 3, 7, 20, 105, 111)


@pytest.fixture
def file(tmp_path):
    """A farm file with these keys of the drive, beside the maker's file."""
    (tmp_path / "maker.xml").write_text(drive_object_gsdml())

    def made(keys=""):
        path = tmp_path / "x.pnfarm.yml"
        path.write_text(FARM.format(keys=f", gsdml: maker.xml{keys}"))
        return path

    return made


def drive_of(**options):
    gsdml = parse_gsdml(drive_object_gsdml(**options).encode())
    found = identity_of(gsdml, model("profidrive"))
    return with_identity(model("profidrive"), found.overrides), found.notes


@pytest.mark.parametrize(
    ("telegram", "supplement"),
    [*((number, "") for number in FOUND), (1, ", supplementary: 750"), (105, ", supplementary: 750")],
)
def test_a_controller_plugs_each_telegram_of_the_file_and_exchanges(file, telegram, supplement):
    with Line.from_file(file(f", telegram: {telegram}{supplement}")) as line:
        line.wait_connected(5)
        axis = line.core.axis("a")
        assert axis.device.connection().exchanging
        assert axis.device.cm.ars[0].module_diff is None
        assert axis.store.telegram_number == telegram
        plugged = axis.device.cm.plugged
        assert plugged.module(1).module_ident == (VECTOR if telegram == 20 else SERVO)
        idents = {one.subslot: one.submodule_ident for one in plugged.module(1).submodules}
        assert idents == {1: 0xFFFF, 3: telegram, 4: 750 if supplement else EMPTY}


def test_a_telegram_of_a_second_drive_object_is_taken_too():
    drive, _ = drive_of()
    assert [module.ident for module in drive.profidrive.telegrams[1].modules] == [SERVO, VECTOR]


def test_what_the_file_lacks_is_told_and_the_drive_does_not_have_it(file):
    config = parse_farm(file().read_text(), file())
    without = "2, 4, 5, 6, 9, 81, 82, 83, 102, 103, 106, 110, 112, 116, 352, 353, 354, 370, 371, 390, 391, 392, 999"
    told = f"it has no module for telegrams {without} by length and name; the drive does not have them"
    assert config.notes == (
        "a: maker.xml: of its 2 access points, Full (0x20) is taken; `access_point:` chooses another",
        f"a: maker.xml: {told}",
    )
    assert tuple(model_of(expand(config)[0]).profidrive.telegrams) == FOUND


@pytest.mark.parametrize(
    ("keys", "field", "what"),
    [(", telegram: 102", "telegram", "profidrive under its maker's file has no telegram 102"),
     (", supplementary: 751", "supplementary", "profidrive under its maker's file has no supplementary telegram 751"),
     (", access_point: None at all", "access_point", "no access point is called 'None at all'; it has Basic, Full"),
     (", identity: {gsdml: maker.xml}", "gsdml", "is given twice")],
)  # fmt: skip
def test_what_the_file_does_not_allow_is_refused_at_its_key(file, keys, field, what):
    with pytest.raises(FarmFileError) as caught:
        parse_farm(file(keys).read_text(), file(keys))
    (issue,) = caught.value.issues
    assert (issue.line, issue.field.rpartition(".")[2]) == (5, field)
    assert what in issue.what


def test_an_access_point_needs_a_file():
    with pytest.raises(FarmFileError, match="is that of a maker's file, and there is none"):
        parse_farm(FARM.format(keys=", access_point: Full"))


@pytest.mark.parametrize("name", ["Basic", "DR-1", "0x10"])
def test_an_access_point_is_chosen_by_name_order_number_or_ident(file, name):
    with Line.from_file(file(f", access_point: {name}, telegram: 20")) as line:
        line.wait_connected(5)
        seen = line.core.axis("a").model
        assert (seen.dap.ident, seen.profidrive.identity.order_id) == (0x10, "DR-1")
        assert tuple(seen.profidrive.telegrams) == (1, 20)


def test_profisafe_is_no_submodule_of_the_drive_and_the_telegram_runs(file):
    """A real drive without the option answers like this."""
    with Line.from_file(file(", telegram: 3")) as line:
        cm = line.core.axis("a").device.cm
        cm.plugged.follow(1, SERVO, {2: PROFISAFE, 3: 105})
        assert cm.plugged.get((1, 2)) is None
        assert cm.plugged[1, 3].submodule_ident == 105


def test_a_file_that_always_has_profisafe_is_told():
    _, notes = drive_of(safe='AllowedInSubslots="2" FixedInSubslots="2')
    told = "its PROFIsafe telegram 30 has data and is always in SERVO: the drive has no such submodule"
    assert told in notes


def test_a_supplement_that_is_longer_has_words_without_meaning():
    drive, notes = drive_of(supplement=(4, 1))
    assert any(note.startswith("its telegram 750 has 8 octets out and 2 in, the drive's 6 and 2") for note in notes)
    found = drive.profidrive.supplements[750]
    assert [signal and signal.name for signal in found.output] == ["M_ADD1", "M_LIMIT_POS", "M_LIMIT_NEG", None]
    drive, notes = drive_of(supplement=(2, 1))
    assert not drive.profidrive.supplements
    assert any("750 by length and name" in note for note in notes)


DRIVE_OBJECT = describe_device(drive_of()[0], bytes(6), strict=True).module(1, SERVO)

# telegram 750


@pytest.mark.parametrize("more", ["", "gsdml: {file}"])
def test_the_words_of_telegram_750_limit_and_add_torque_beside_any_telegram(tmp_path, more):
    (tmp_path / "maker.xml").write_text(drive_object_gsdml(supplement=(4, 1)))
    keys = ["supplementary: 750", more.format(file=tmp_path / "maker.xml")]
    plc = HandPlc("profidrive", 3, keys=keys)
    plc.put(M_LIMIT_POS=FULL, M_LIMIT_NEG=-FULL)
    plc.switch_on(operation=RUN)
    plc.put(M_LIMIT_POS=FULL // 10, NSOLL_B=FULL << 15, wait=20)
    assert float(plc.axis.motor.torque) == pytest.approx(0.45, abs=0.01)
    assert plc["M_ACT"] == pytest.approx(FULL // 10, abs=40)
    plc.put(M_LIMIT_POS=FULL, wait=400)
    assert plc.axis.motor.velocity == pytest.approx(1500.0, abs=2.0)


def test_torque_is_not_limited_where_the_controller_plugs_no_telegram_750(file):
    """The drive has it in its slot; nobody expects it, so that its words are not zero but none."""
    path = file(", supplementary: 750, telegram: 3")
    with Line.from_file(path) as line:
        axis = line.core.axis("a")
        axis.device.kind.follow_modules()
        assert [one.name for one in axis.store.mapping(setpoint=True) if one][-1] == "G1_STW"
        line.wait_connected(5)
        assert [one.name for one in axis.store.mapping(setpoint=True) if one][-1] == "M_LIMIT_NEG"


def test_each_axis_has_telegrams_of_its_own(file):
    keys = ", limits: lax, axes: [{name: x, telegram: 105, supplementary: 750}, {name: y, telegram: 3}]"
    with Line.from_file(file(keys)) as line:
        line.wait_connected(5)
        x, y = line.core.axis("a.x"), line.core.axis("a.y")
        assert (x.store.telegram_number, y.store.telegram_number) == (105, 3)
        assert len(x.store.output_words()) == 13
        assert len(y.store.output_words()) == 5
        assert x.device.cm.ars[0].module_diff is None


@given(st.dictionaries(st.integers(1, 5), st.sampled_from([0xFFFF, EMPTY, PROFISAFE, 1, 3, 7, 105, 111, 750, 751])))
def test_whatever_submodules_a_controller_expects_the_drive_has_one_in_each_subslot(idents):
    module = DRIVE_OBJECT
    taken = module.taking(idents)
    assert len({one.subslot for one in taken.submodules}) == len(taken.submodules)
    known = {(one.subslot, one.submodule_ident) for one in (*module.submodules, *module.choices)}
    for place, ident in idents.items():
        found = taken.submodule(place)
        assert (found is not None and found.submodule_ident == ident) == ((place, ident) in known)
    # what was there before can come back
    assert {(s.subslot, s.submodule_ident) for s in (*taken.submodules, *taken.choices)} == known


FILES = sorted(Path(os.environ["PNFARM_GSDML_FILES"]).rglob("*.xml")) if "PNFARM_GSDML_FILES" in os.environ else []


@pytest.mark.parametrize("path", [None, *FILES], ids=lambda path: "example" if path is None else path.name)
def test_a_drive_connects_by_each_access_point_and_telegram_of_a_file(tmp_path, path):
    """``PNFARM_GSDML_FILES`` names a folder with more files, such as ``python -m tests.public_gsdml`` fetches."""
    if path is None:
        path = tmp_path / "maker.xml"
        path.write_text(drive_object_gsdml())
    found = DriveSweep(path, parse_gsdml(path.read_bytes(), path.name))
    assert found.findings == []
    if path.name == "maker.xml":
        assert found.counts == {"drives' access points": 2, "telegrams connected": 2 * (2 + 6)}
