"""``identity: {gsdml: FILE}``: a drive under the idents of its maker's own file."""

import dataclasses

import pytest
from gsdml_versions import VERSIONS, file_name, gsdml_of

from pnfarm.buses.described import AccessPointError
from pnfarm.buses.profinet.maker_identity import identity_of
from pnfarm.buses.profinet.model_gsdml import describe_model
from pnfarm.drives.catalogue import model, models
from pnfarm.drives.description.identity import with_identity
from pnfarm.farm.farm import model_of
from pnfarm.farm.file.reading import FarmFileError, expand, parse_farm
from pnfarm.protocols.profinet.gsdml.document import ItemRef
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml
from pnfarm.protocols.profinet.gsdml.values import Numbers
from pnfarm.protocols.profinet.gsdml.writer import emit_gsdml
from pnfarm.testing import Line

NAMES = sorted(name for name, entry in models().items() if entry.bus == "profinet")
MOVED = 0x0070_0000


def maker_s_file(name, keep=None, rename=str):
    """A file as the drive's maker could have it: other idents everywhere, the same data."""
    document = describe_model(model(name))

    def other(part):
        named = {"info": dataclasses.replace(part.info, name=rename(part.info.name))} if hasattr(part, "info") else {}
        return dataclasses.replace(part, ident=part.ident + MOVED, **named)

    def others(parts):
        return tuple(map(other, parts))

    modules = [
        other(dataclasses.replace(module, submodules=others(module.submodules)))
        for module in document.modules
        if keep is None or keep(module)
    ]
    (dap,) = document.daps
    known = {module.id for module in modules}
    dap = dataclasses.replace(
        other(dap),
        submodules=others(dap.submodules),
        interfaces=others(dap.interfaces),
        ports=others(dap.ports),
        info=dataclasses.replace(dap.info, order_number="MAKER-0815"),
        modules=tuple(ref for ref in dap.modules if ref.target in known),
    )
    changes = {"vendor_id": 0x0123, "device_id": 0x4567, "modules": tuple(modules), "daps": (dap,)}
    changes["submodules"] = others(document.submodules)
    return emit_gsdml(dataclasses.replace(document, **changes))


def idents(drive_model):
    return {
        number: [(module.ident, [submodule.ident for submodule in module.submodules]) for module in telegram.modules]
        for number, telegram in drive_model.profidrive.telegrams.items()
    }


@pytest.mark.parametrize("name", NAMES)
def test_every_telegram_of_a_model_is_found_in_a_file_with_other_idents(name):
    own = model(name)
    found = identity_of(parse_gsdml(maker_s_file(name).encode()), own)
    assert found.notes == ()
    drive = with_identity(own, found.overrides)
    assert (drive.profidrive.identity.vendor_id, drive.profidrive.identity.device_id) == (0x0123, 0x4567)
    assert drive.profidrive.identity.order_id == "MAKER-0815"
    assert drive.dap.ident == own.dap.ident + MOVED
    assert [one.ident for one in drive.dap.submodules] == [one.ident + MOVED for one in own.dap.submodules]
    for number, found in idents(own).items():
        assert idents(drive)[number] == [(ident + MOVED, [one + MOVED for one in below]) for ident, below in found]


FARM = """
farm: x
link: {{kind: memory}}
drives:
  - {{name: a, model: {model}, {address}, identity: {{gsdml: {file}{more}}}}}
controller: {{name: plc, ip: 10.77.0.100/24}}
"""


def farm(folder, name="hiwin-e1", file="maker.xml", more="", address="ip: 10.77.0.1/24"):
    return parse_farm(FARM.format(model=name, file=file, more=more, address=address), folder / "x.pnfarm.yml")


def test_a_controller_that_has_the_maker_s_file_alone_connects(tmp_path):
    (tmp_path / "maker.xml").write_text(maker_s_file("hiwin-e1"))
    own = model_of(expand(farm(tmp_path))[0])
    file = tmp_path / "x.pnfarm.yml"
    file.write_text(FARM.format(model="hiwin-e1", file="maker.xml", more="", address="ip: 10.77.0.1/24"))
    with Line.from_file(file) as line:
        line.wait_connected(5)
        seen = line.core.axis("a")
        assert seen.model.dap.ident == own.dap.ident > MOVED
        assert seen.device.connection().exchanging


@pytest.mark.parametrize("version", VERSIONS)
def test_a_drive_takes_its_identity_from_a_file_of_each_version_and_is_connected(tmp_path, version):
    (tmp_path / file_name(version)).write_text(gsdml_of(version), encoding="utf-8")
    file = tmp_path / "x.pnfarm.yml"
    file.write_text(
        FARM.format(model="akd-profinet", file=file_name(version), more="", address="ip: 10.77.0.1/24, telegram: 1")
    )
    with Line.from_file(file) as line:
        line.wait_connected(5)
        seen = line.core.axis("a")
        assert seen.device.connection().exchanging
        own, telegrams = seen.model.profidrive.identity, seen.model.profidrive.telegrams
        assert (own.vendor_id, own.device_id, own.order_id) == (0xFEED, 0x0A1D, "SW-4711")
        assert [telegrams[number].module.ident for number in (1, 9)] == [0x101, 0x109]
        assert [telegrams[number].module.data.ident for number in (1, 9)] == [0x12, 0x12]
        # V1.0 describes neither interfaces and ports, of which the drive keeps its own, nor parameter access points
        kept = model("akd-profinet") if version == "1.0" else None
        assert [one.ident for one in telegrams[1].module.submodules] == ([0x12] if kept else [0x11, 0x12])
        system = [one.ident for one in kept.dap.submodules[1:]] if kept else [2, 3]
        assert [one.ident for one in seen.model.dap.submodules] == [1, *system]


def test_of_two_access_points_the_one_with_the_drives_interface_and_port_is_taken():
    """Makers of older files have another one for controllers that know neither."""
    document = parse_gsdml(gsdml_of("2.1").encode())
    (dap,) = document.daps
    bare = dataclasses.replace(dap, id="Bare", ident=0x99, interfaces=(), ports=())
    for daps in ((dap, bare), (bare, dap)):
        found = identity_of(dataclasses.replace(document, daps=daps), model("akd-profinet"))
        assert (found.overrides["dap"], found.overrides["dap_submodules"]) == (0x10, {1: 1, 0x8000: 2, 0x8001: 3})


def test_what_the_file_lacks_for_its_version_is_among_the_notes():
    text = gsdml_of("2.25").replace(' ID="Port"', "")
    notes = identity_of(parse_gsdml(text.encode()), model("akd-profinet")).notes
    assert notes[0].startswith("line 15: PortSubmoduleItem/@ID is missing; V2.25 and later ask for it, nothing refers")


def test_keys_of_the_farm_file_count_before_those_of_the_file(tmp_path):
    (tmp_path / "maker.xml").write_text(maker_s_file("hiwin-e1"))
    more = ", vendor: 0x777, telegrams: {9: {module: 0x99}}"
    drive = model_of(expand(farm(tmp_path, more=more))[0])
    assert drive.profidrive.identity.vendor_id == 0x777
    assert drive.profidrive.identity.device_id == 0x4567
    telegrams = drive.profidrive.telegrams
    assert telegrams[9].module.ident == 0x99
    assert (
        telegrams[9].module.submodules[1].ident
        == model("hiwin-e1").profidrive.telegrams[9].module.submodules[1].ident + MOVED
    )
    assert telegrams[3].module.ident == model("hiwin-e1").profidrive.telegrams[3].module.ident + MOVED


def test_what_the_file_lacks_is_told(tmp_path):
    (tmp_path / "maker.xml").write_text(maker_s_file("akd-profinet", keep=lambda module: "7" not in module.info.name))
    config = farm(tmp_path, "akd-profinet")
    told = "it has no module for telegram 7 by length and name; the drive does not have it"
    assert config.notes == (f"a: maker.xml: {told}",)
    telegrams = model_of(expand(config)[0]).profidrive.telegrams
    assert telegrams[1].module.ident > MOVED
    assert 7 not in telegrams


def test_a_telegram_without_a_number_in_its_name_is_found_if_no_other_has_its_lengths():
    text = maker_s_file("hiwin-e1", rename=lambda name: name.replace("elegram", "ata").rstrip("0123456789 "))
    assert identity_of(parse_gsdml(text.encode()), model("hiwin-e1")).notes == ()


def test_two_modules_that_fit_alike_are_not_guessed():
    text = maker_s_file("moog-msd", rename=lambda name: "A module")
    found = identity_of(parse_gsdml(text.encode()), model("moog-msd"))
    assert any(note.startswith("it has no module for telegrams") for note in found.notes)


@pytest.mark.parametrize(
    ("options", "words"),
    [({"file": "nothing.xml"}, "cannot be read"), ({"file": "x.txt"}, "x.txt"), ({"file": "[1]"}, "is a list"),
     ({"more": ", vendor: no"}, "identity.vendor"),
     ({"name": "moog-msd-dp", "address": "address: 4"}, "is no key of a drive on PROFIBUS")],
)  # fmt: skip
def test_a_file_that_is_none_is_told_with_its_place(tmp_path, options, words):
    (tmp_path / "maker.xml").write_text(maker_s_file("hiwin-e1"))
    (tmp_path / "x.txt").write_text("no xml")
    with pytest.raises(FarmFileError) as caught:
        farm(tmp_path, **options)
    (issue,) = [issue for issue in caught.value.issues if "identity" in issue.field]
    assert words in f"{issue.field} {issue.what}"
    assert issue.line == 5


def test_an_access_point_is_chosen_by_its_ident():
    text = maker_s_file("hiwin-e1").encode()
    with pytest.raises(AccessPointError, match=r"^no access point is called 0x77; it has DAP \(HIWIN E1"):
        identity_of(parse_gsdml(text), model("hiwin-e1"), 0x77)
    chosen = model("hiwin-e1").dap.ident + MOVED
    assert identity_of(parse_gsdml(text), model("hiwin-e1"), chosen).overrides["dap"] == chosen


def test_telegrams_that_are_submodules_of_one_module_are_found():
    document = describe_model(model("hiwin-e1"))
    data = [one for module in document.modules for one in module.submodules if one.input_octets]
    first, (dap,) = document.modules[0], document.daps
    shared = dataclasses.replace(
        first,
        info=dataclasses.replace(first.info, name="Drive object"),
        submodules=(),
        useable=tuple(ItemRef(one.id, allowed=Numbers.of([2])) for one in data),
    )
    dap = dataclasses.replace(dap, modules=(ItemRef(shared.id),))
    file = dataclasses.replace(document, modules=(shared,), submodules=tuple(data), daps=(dap,))
    found = identity_of(file, model("hiwin-e1"))
    assert not [note for note in found.notes if "telegram" in note]
    drive = with_identity(model("hiwin-e1"), found.overrides)
    assert {telegram.module.ident for telegram in drive.profidrive.telegrams.values()} == {first.ident}
    assert {one.module.data.ident for one in drive.profidrive.telegrams.values()} == {one.ident for one in data}
