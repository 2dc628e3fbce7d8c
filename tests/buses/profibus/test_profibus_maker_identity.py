"""``gsd: FILE``: a drive under ident number and identifiers of its maker's own file."""

import os
import re
from pathlib import Path

import pytest
from gsd_sweep import gsd_files

from pnfarm.buses.profibus.description.sheet import describe_model
from pnfarm.buses.profibus.maker_identity import identity_of
from pnfarm.drives.catalogue import model, models
from pnfarm.drives.description.identity import with_identity
from pnfarm.farm.file.reading import FarmFileError, expand, parse_farm
from pnfarm.protocols.profibus.gsd.reader import parse_gsd_file
from pnfarm.protocols.profibus.gsd.writer import emit_gsd
from pnfarm.protocols.profibus.wire.dp import StationStatus
from pnfarm.testing import Line

DP = model("profidrive-dp")
NAMES = sorted(name for name, entry in models().items() if entry.bus == "profibus")
#: More files, as for test_gsd_sweep.py.
FOLDER = os.environ.get("PNFARM_GSD_FILES")
MORE = gsd_files(Path(FOLDER)) if FOLDER else []
HEAD = """#Profibus_DP
GSD_Revision = 5
Vendor_Name = "Maker"
Model_Name = "DRIVE 20"
Revision = "1"
OrderNumber = "MAKER-0815"
Ident_Number = 0x4711
Protocol_Ident = 0
Station_Type = 0
9.6_supp = 1
1.5M_supp = 1
MaxTsdr_9.6 = 60
MaxTsdr_1.5M = 150
Modular_Station = 1
Max_Module = {slots}
Max_Input_Len = 64
Max_Output_Len = 64
Max_Data_Len = 128
Max_Diag_Data_Len = {diagnosis}
{v1}
Max_User_Prm_Data_Len = 5
Ext_User_Prm_Data_Const(0) = 0x00,0x00,0x08,0x22,0x33
"""
TELEGRAMS = """
Module = "Standard telegram 1, PZD-2/2" 0xF1
1
EndModule
Module = "Standard Telegramm  20, PZD-2/6" 0xC0,0xC1,0xC5
2
EndModule
Module = "SIEMENS telegram 352, PZD-6/6" 0xC3,0xC5,0xC5,0xFD,0x01,0x60
3
EndModule
Module = "Std. Telegram 3:   5/9  PZD" 0xE4,0xD8,0x01,0xFE
4
EndModule
Module = "Positioning" 0xC0,0xC9,0xC4
5
EndModule
Module = "PKW 4/4 + PZD-2/2 (PPO 1)" 0xF3,0xF1
6
EndModule
"""


def file(telegrams=TELEGRAMS, *, slots=1, diagnosis=32, v1="DPV1_Slave = 1"):
    return (HEAD.format(slots=slots, diagnosis=diagnosis, v1=v1) + telegrams).encode()


def found(*args, **keys):
    return identity_of(parse_gsd_file(file(*args, **keys)), DP)


@pytest.mark.parametrize("name", NAMES)
def test_every_telegram_of_a_model_is_found_in_its_own_file_under_another_ident_number(name):
    own = model(name)
    text = re.sub(rb"(Ident_Number = )0x\w+", rb"\1 0x4711", emit_gsd(describe_model(own)))
    seen = identity_of(parse_gsd_file(text), own)
    assert seen.notes == ()
    drive = with_identity(own, seen.overrides)
    assert drive.profidrive.identity.device_id == 0x4711
    assert {number: one.identifiers for number, one in drive.profidrive.telegrams.items()} == {
        number: one.identifiers for number, one in own.profidrive.telegrams.items()
    }


def test_telegrams_are_found_by_name_and_lengths_and_the_others_are_not_the_drive_s():
    seen = found()
    assert seen.overrides["device"] == 0x4711
    assert (seen.overrides["order_number"], seen.overrides["station_type"]) == ("MAKER-0815", "DRIVE 20")
    assert seen.overrides["telegrams"] == {
        1: "f1", 3: "e4 d8 01 fe", 9: "c0 c9 c4", 20: "c0 c1 c5", 352: "c3 c5 c5 fd 01 60",
    }  # fmt: skip
    assert seen.overrides["parameters"] == "00 00 08 22 33"
    (note,) = seen.notes
    assert note.startswith("it has no module for telegrams 2, 4, 5, 6, 7, 81")
    assert note.endswith("; the drive does not have them")


def test_what_the_file_cannot_give_is_a_note():
    twice = TELEGRAMS + 'Module = "Standard telegram 1, whole" 0xC0,0xC1,0xC1\n9\nEndModule\n'
    notes = found(twice, diagnosis=6, v1="DPV1_Slave = 0").notes
    for said in (
        "of its modules for telegram 1, 'Standard telegram 1, PZD-2/2' is taken, and not Standard telegram 1, whole",
        "the drive's diagnosis has up to 11 octets, the file allows 6",
        "it is of a slave without DP-V1, whose parameters no record has",
    ):
        assert any(said in note for note in notes), said
    alike = TELEGRAMS + 'Module = "Standard telegram 7, PZD-2/2" 0xF1\n9\nEndModule\n'
    assert any("telegram 7 has the identifiers of telegram 1" in note for note in found(alike).notes)
    assert found("").overrides == {"device": 0x4711, "order_number": "MAKER-0815", "station_type": "DRIVE 20"}


def test_identifiers_have_the_slot_that_takes_the_telegram_and_what_is_preset():
    slots = TELEGRAMS + (
        'Module = "PKW" 0xF3\n8\nEndModule\n'
        'SlotDefinition\nSlot(1) = "PKW" 8 8\nSlot(2) = "PZD" 1 1-6\nEndSlotDefinition\n'
    )
    seen = found(slots, slots=2)
    assert "telegrams" not in seen.overrides
    assert "other modules of each station have data, too" in seen.notes[0]
    empty = TELEGRAMS + (
        'Module = "Empty" 0x00\n8\nEndModule\n'
        'SlotDefinition\nSlot(1) = "Safety" 8 8\nSlot(2) = "PZD" 1 1-6\nEndSlotDefinition\n'
    )
    assert found(empty, slots=2).overrides["telegrams"][1] == "00 f1"


FARM = """
farm: x
link: {{kind: memory}}
drives:
  - {{name: a, model: profidrive-dp, address: 5, {key}{more}}}
controller:
  {{name: plc, {telegram}cycle: 5ms, reconnect: {{after: 100ms}}, program: {{kind: constant, speed_rpm: 300}}}}
"""


def run(folder, number):
    """Exchange data by a telegram of the maker's file in a folder; identifiers, and how many octets came."""
    farm = folder / f"{number}.pnfarm.yml"
    farm.write_text(FARM.format(key="gsd: maker.gsd", more="", telegram=f"telegram: {number}, "))
    with Line.from_file(farm) as line:
        line.wait_connected(5)
        line.run(0.2)
        station = line._line.plc.master.stations[0]
        assert line.core.axis("a").store.read(922)[0] == number
        return station.plan.identifiers, len(station.inputs)


def test_each_telegram_of_the_file_is_configured_by_its_identifiers(tmp_path):
    (tmp_path / "maker.gsd").write_bytes(file())
    for number, identifiers in found().overrides["telegrams"].items():
        octets = 2 * len(DP.profidrive.telegrams[number].input)
        assert run(tmp_path, number) == (bytes.fromhex(identifiers), octets)


if MORE:

    @pytest.mark.parametrize("path", MORE, ids=[path.name for path in MORE])
    def test_each_telegram_of_another_maker_s_file_is_configured_by_its_identifiers(tmp_path, path):
        data = path.read_bytes()
        (tmp_path / "maker.gsd").write_bytes(data)
        for number, identifiers in identity_of(parse_gsd_file(data), DP).overrides.get("telegrams", {}).items():
            assert run(tmp_path, number)[0] == bytes.fromhex(identifiers)


@pytest.mark.parametrize("key", ["gsd: maker.gsd", "identity: {gsd: maker.gsd}"])
def test_a_master_that_has_the_maker_s_file_alone_exchanges_data(tmp_path, key):
    (tmp_path / "maker.gsd").write_bytes(file())
    farm = tmp_path / "x.pnfarm.yml"
    farm.write_text(FARM.format(key=key, more="", telegram=""))
    with Line.from_file(farm) as line:
        line.wait_running(5)
        axis, station = line.core.axis("a"), line._line.plc.master.stations[0]
        assert (station.plan.ident, station.plan.identifiers) == (0x4711, b"\xf1")
        assert station.plan.user.hex(" ") == "80 00 08 22 33"
        assert axis.device.connected
        assert list(axis.model.profidrive.telegrams) == [1, 3, 9, 20, 352]


def test_octets_of_set_prm_that_the_file_has_and_a_master_does_not_send_are_asked_for(tmp_path):
    (tmp_path / "maker.gsd").write_bytes(file())
    farm = tmp_path / "x.pnfarm.yml"
    for limits, refused in (("strict", True), ("lax", False)):
        farm.write_text(FARM.format(key="gsd: maker.gsd", more=f", limits: {limits}", telegram=""))
        with Line.from_file(farm) as line:
            station = line._line.plc.master.stations[0]
            object.__setattr__(station.plan, "user", b"\x80\0\0")
            line.run(1.0)
            assert bool(station.diagnosis.status & StationStatus.PRM_FAULT) == refused
            assert line.core.axis("a").device.connected != refused


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("gsd: none.gsd", "none.gsd"),
        ("gsd: 7", "gsd"),
        ("gsd: wrong.gsd", "wrong.gsd"),
        ("gsd: maker.gsd, identity: {gsd: maker.gsd}", "is given twice"),
        ("identity: {gsdml: maker.gsd}", "is no key of a drive on PROFIBUS"),
        ("identity: {telegrams: {1: F1 F1}}", "telegram 1 has 4 octets of outputs and 4 of inputs"),
        ("identity: {telegrams: {1: F}}", "is not 1 to 244 octets in hexadecimal"),
        ("identity: {telegrams: {8: F1}}", "has no telegram 8"),
        ("identity: {telegrams: {1: F1, 7: F1}}", "two telegrams have the same identifiers"),
        ("identity: {parameters: ''}", "is not 1 to 237 octets in hexadecimal"),
        ("identity: {without: [8]}", "has no telegram 8"),
    ],
)
def test_a_wrong_identity_is_reported_with_its_key(tmp_path, key, message):
    (tmp_path / "maker.gsd").write_bytes(file())
    (tmp_path / "wrong.gsd").write_bytes(b"\x00nothing")
    with pytest.raises(FarmFileError, match=re.escape(message)):
        parse_farm(FARM.format(key=key, more="", telegram=""), tmp_path / "x.pnfarm.yml")


def test_what_the_file_does_not_have_is_a_note_of_the_farm_file(tmp_path):
    (tmp_path / "maker.gsd").write_bytes(file())
    config = parse_farm(FARM.format(key="gsd: maker.gsd", more="", telegram=""), tmp_path / "x.pnfarm.yml")
    assert any(note.startswith("a: maker.gsd: it has no module for telegrams 2, 4") for note in config.notes)
    assert expand(config)[0].identity["device"] == 0x4711
