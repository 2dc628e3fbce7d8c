"""`pnfarm import` of a line's capture: slaves by address as drives of a farm file, the others in comments."""

import random

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from imported import check_found
from recorded import record, write_frames

from pnfarm.buses import registry
from pnfarm.buses.imports import FoundDrive
from pnfarm.buses.profibus.bus import PROFIBUS
from pnfarm.captures.reading import CapturedFrame
from pnfarm.cli.main import main
from pnfarm.farm.file.reading import expand, parse_farm
from pnfarm.protocols.profibus.wire.dp import Diagnosis, Parameters, PrmStatus, StationStatus
from pnfarm.protocols.profibus.wire.telegram import Sap, ShortAck, Telegram, emit_telegram
from pnfarm.testing import Line
from tests.fuzz.mutate import mutated

FARM = """
farm: dp
link: {kind: memory}
drives:
  - {name: 'axis-{n:02}', count: 2, model: moog-msd-dp, address: 11}
  - {name: gantry, model: moog-msd-dp, address: 40, identity: {device: 0x0777}}
controller:
  {name: plc, address: 3, cycle: 5ms, watchdog: 50ms, program: {kind: constant, speed_rpm: 100}}
"""
PROFIBUS_DL, MS = 257, 1_000_000
IDENT = 0x0A8E
SRD = 0x6D


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """The start-up of a line in virtual time."""
    file = tmp_path_factory.mktemp("dp") / "hall 3.pcapng"
    record(FARM, file)
    return file


def imported(capsys, file, code=0):
    assert main(["import", str(file)]) == code
    said = capsys.readouterr()
    assert bool(said.err) == bool(code)
    return said.err if code else said.out


def plain(text):
    return " ".join(text.replace("#", " ").split())


def asked(address, dsap, data=b"", source=3):
    return Telegram(address, source, SRD, dsap, Sap.MASTER, data)


def answered(address, dsap, data, to=3):
    return Telegram(to, address, 0x08, Sap.MASTER, dsap, data)


def written(tmp_path, *telegrams):
    timed = [(emit_telegram(one), 10**18 + place * MS) for place, one in enumerate(telegrams)]
    return write_frames(tmp_path / "line.pcapng", timed, "", PROFIBUS_DL)


def test_slaves_of_a_capture_become_drives_that_the_same_master_connects(capsys, capture):
    text = imported(capsys, capture)
    values = yaml.safe_load(text)
    assert (values["farm"], values["link"]) == ("hall-3", {"kind": "serial", "pty": "auto"})
    drives = expand(parse_farm(text))
    assert [(one.name, one.model, one.address) for one in drives] == [
        ("drive-11", "moog-msd-dp", 11), ("drive-12", "moog-msd-dp", 12),
    ]  # fmt: skip
    seen = plain(text)
    assert "Set_Prm by master 3: lock req; watchdog 50 ms" in seen
    assert "configuration: telegram 1, " in seen
    assert "polled every 5" in seen
    here = text.replace("{kind: serial, pty: auto}", "{kind: memory}").replace("api: 127.0.0.1:8702\n", "")
    with Line.from_text(here + "controller: {address: 3, cycle: 5ms}\n") as line:
        line.wait_connected(5)


def test_a_slave_with_an_ident_number_of_no_model_is_listed_with_the_model_that_could_stand_for_it(capsys, capture):
    seen = plain(imported(capsys, capture).partition("Other stations, without a model")[2])
    assert "station 40: address 40, ident 0x0777" in seen
    assert "telegram 1 of moog-msd-dp has the same identifiers" in seen
    assert "identity: {device: 0x0777}" in seen


def test_a_slave_is_told_by_its_diagnosis_alone_and_one_that_never_answered_is_not_there(capsys, tmp_path):
    told = Diagnosis(StationStatus.PRM_REQ | StationStatus.ALWAYS_1, 255, IDENT).emit()
    parameters = Parameters(PrmStatus.LOCK_REQ, (0, 0), 11, IDENT).emit()
    file = written(
        tmp_path, asked(7, Sap.SLAVE_DIAGNOSIS), answered(7, Sap.SLAVE_DIAGNOSIS, told),
        asked(8, Sap.SET_PARAMETERS, parameters), asked(8, Sap.SET_PARAMETERS, parameters),
        Telegram(2, 3, 0x49), Telegram(3, 2, 0x20),
    )  # fmt: skip
    text = imported(capsys, file)
    (drive,) = expand(parse_farm(text))
    assert (drive.address, drive.name) == (7, "drive-7")
    assert "station" not in text
    assert "last diagnosis: prm req; no master" in plain(text)


def test_what_get_cfg_tells_and_a_master_with_another_ident_number_are_noted(capsys, tmp_path):
    told = Diagnosis(StationStatus.PRM_FAULT | StationStatus.ALWAYS_1, 255, 0x1234).emit()
    file = written(
        tmp_path, asked(9, Sap.SET_PARAMETERS, Parameters(PrmStatus.LOCK_REQ, (0, 0), 11, IDENT).emit()), ShortAck(),
        asked(9, Sap.SLAVE_DIAGNOSIS), answered(9, Sap.SLAVE_DIAGNOSIS, told),
        asked(9, Sap.GET_CONFIGURATION), answered(9, Sap.GET_CONFIGURATION, b"\x13\x21"),
    )  # fmt: skip
    text = imported(capsys, file)
    values = yaml.safe_load(text)
    assert "drives" not in values
    assert values["link"]["kind"] == "serial"
    seen = plain(text)
    assert "ident 0x1234" in seen
    assert "its master takes it for one with ident 0x0A8E" in seen
    assert "configuration: 2 octets of outputs, 4 of inputs (13 21)" in seen


def test_a_drive_without_an_address_is_one_whose_switches_are_off(capsys, tmp_path):
    told = Diagnosis(StationStatus.PRM_REQ | StationStatus.ALWAYS_1, 255, IDENT).emit()
    text = imported(capsys, written(tmp_path, asked(126, 60), answered(126, 60, told)))
    (drive,) = expand(parse_farm(text))
    assert drive.address is None
    assert "it had address 126" in plain(text)


def test_a_line_without_an_answer_shows_no_device(capsys, tmp_path):
    assert "Set_Prm" in imported(capsys, written(tmp_path, asked(7, 60), asked(8, 60)), code=2)


def test_drives_of_a_network_and_of_a_line_have_both_in_their_link():
    dp = FoundDrive("drive-7", "moog-msd-dp", {"address": 7}, line="profibus")
    net = FoundDrive("infeed", "akd-profinet", {"ip": "10.77.0.11/24"})
    text = check_found([net, dp]).text
    assert len(expand(parse_farm(text))) == 2
    assert yaml.safe_load(text)["link"]["lines"] == {"profibus": {"pty": "auto"}}


def _pool():
    told = Diagnosis(StationStatus.ALWAYS_1, 3, IDENT, bytes((12, 0x81, *range(10)))).emit()
    parameters = Parameters(PrmStatus.LOCK_REQ | PrmStatus.WD_ON, (10, 1), 11, IDENT, 1, b"\x80\0\0").emit()
    for address in (7, 126):
        yield from (
            asked(address, 61, parameters), ShortAck(), asked(address, 62, bytes.fromhex("F3F1")), ShortAck(),
            asked(address, 60), answered(address, 60, told), asked(address, 59), answered(address, 59, b"\xc0\xcd\xcd"),
            Telegram(address, 3, SRD, None, None, bytes(12)), Telegram(3, address, 0x0A, None, None, bytes(12)),
        )  # fmt: skip


@settings(max_examples=150, deadline=None)
@given(st.lists(st.integers(0, 2**32), min_size=20, max_size=60))
def test_whatever_is_in_a_capture_the_farm_file_can_be_read(seeds):
    decoder = registry.decoder()
    PROFIBUS.observe(decoder.buses["profibus"])
    octets = [emit_telegram(one) for one in _pool()]
    for number, seed in enumerate(seeds):
        frame = octets[number % len(octets)]
        chosen = random.Random(seed)
        if seed % 2 and len(frame) > 6:
            # behind a right check sum, so that it reaches the services
            begin = 4 if frame[0] == 0x68 else 1
            body = mutated(chosen, frame[begin:-2], [one[begin:-2] for one in octets])[:249]
            end = bytes((sum(body) & 0xFF, 0x16))
            frame = bytes((0x68, len(body), len(body), 0x68)) + body + end
        decoder.feed(CapturedFrame(number + 1, 10**18 + number * chosen.randrange(MS), frame, link_type=PROFIBUS_DL))
    check_found(PROFIBUS.found(decoder.buses["profibus"]))
