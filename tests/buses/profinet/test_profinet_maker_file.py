"""A drive under its maker's file: the file's texts name its diagnoses, and it has the file's parameter records."""

import pytest
from drive_object_gsdml import drive_object_gsdml

from pnfarm.farm.views.readiness import Readiness
from pnfarm.protocols.profinet.errors import AccessError, RecordError
from pnfarm.testing import Line

FARM = """
farm: x
link: {{kind: memory}}
drives:
  - {{name: a, model: profidrive, gsdml: maker.xml, ip: 10.77.0.1/24, telegram: 3{keys}}}
controller: {{name: plc, ip: 10.77.0.100/24{controller}}}
"""
API = 0x3A00


@pytest.fixture
def line_of(tmp_path):
    (tmp_path / "maker.xml").write_text(drive_object_gsdml())
    path = tmp_path / "x.pnfarm.yml"

    def made(keys="", controller=""):
        path.write_text(FARM.format(keys=keys, controller=controller))
        return Line.from_file(path)

    return made


def records_of(line):
    return line.core.axis("a").device.kind.records


def test_a_fault_has_the_name_of_the_makers_file_in_the_drives_log_and_at_the_controller(line_of):
    with line_of() as line:
        line.wait_connected(5)
        line.core.axis("a").raise_fault(9, hold=True)
        line.run(0.5)
        (appears,) = line.events("diagnosis appears")
        assert appears.data["diagnosis"] == "Fieldbus of the Servo silent"
        assert "Fieldbus of the Servo silent (fault, appears)" in str(line.controller_events())


def test_what_the_file_does_not_name_has_the_profiles_text(line_of):
    with line_of() as line:
        line.wait_connected(5)
        line.core.axis("a").raise_fault(12, hold=True)
        line.run(0.5)
        (appears,) = line.events("diagnosis appears")
        assert appears.data["diagnosis"] == "internal communication"
        assert "nternal communication (fault, appears)" in str(line.controller_events())


def test_a_diagnosis_is_injected_by_its_name_in_the_file(line_of):
    with line_of() as line:
        line.wait_connected(5)
        line.inject("diagnosis", "a", error="motor too hot")
        line.run(0.5)
        assert [one.error_type for one in line.core.axis("a").device.cm.diagnosis] == [0x0100]
        assert [one.data["diagnosis"] for one in line.events("diagnosis appears")] == ["Motor too hot"]


def test_the_controller_writes_the_records_of_the_file_and_the_drive_keeps_them(line_of):
    with line_of(controller=', records: [{api: 0x3A00, slot: 1, subslot: 1, index: 5, data: "0007"}]') as line:
        assert records_of(line).read(None, API, 1, 1, 5, 100, 0) == b"\x00\x03", "the file's default"
        line.wait_connected(5)
        assert records_of(line).read(None, API, 1, 1, 5, 100, 0) == b"\x00\x07"
    with line_of() as line:
        written = []
        records = records_of(line).further
        keep, records.write = records.write, lambda *call: written.append(call[1:6]) or keep(*call)
        line.wait_connected(5)
        assert written == [(API, 1, 1, 5, b"\x00\x03")]


@pytest.mark.parametrize(
    ("subslot", "index", "data", "code", "reason"),
    [(1, 5, b"\x00\x0a", AccessError.INVALID_PARAMETER, "record 5, Gain of the filter: 10 is written, allowed is 1..9"),
     (1, 5, b"\x00", AccessError.WRITE_LENGTH_ERROR, "record 5 has 1 octets, shorter than its 2"),
     (3, 5, b"\x00\x03", AccessError.INVALID_INDEX, "the file names no record 5 there"),
     (1, 6, b"\x00\x03", AccessError.INVALID_INDEX, "the file names no record 6 there")],
)  # fmt: skip
def test_a_record_that_the_file_does_not_allow_is_refused_with_the_parameters_name(
    line_of, subslot, index, data, code, reason
):
    with line_of() as line:
        answer = records_of(line).write(None, API, 1, subslot, index, data, 0)
        assert isinstance(answer, RecordError)
        assert answer.error_code1 == code
        assert [one.data["reason"] for one in line.events("record refused")] == [reason]
    with line_of(", limits: lax") as line:
        assert records_of(line).write(None, API, 1, subslot, index, data, 0) is None
        assert records_of(line).read(None, API, 1, subslot, index, 100, 0) == data
        assert [one.data["reason"] for one in line.events("record accepted though it is wrong")] == [reason]


@pytest.mark.parametrize(("limits", "word"), [("strict", "refused"), ("lax", "taken though they are wrong")])
def test_a_wrong_record_of_the_start_up_is_named_with_what_the_file_allows(line_of, limits, word):
    controller = ", records: [{api: 0x3A00, slot: 1, subslot: 1, index: 5, data: 000A}]"
    with line_of(f", limits: {limits}", controller) as line:
        line.run(3)
        seen = Readiness(line.core)
        seen.update(1000)
        (station,) = seen.view(line.now_ns)["stations"]
        texts = {refusal["text"] for visit in station["visits"] for refusal in visit["refusals"]}
        why = "record 5, Gain of the filter: 10 is written, allowed is 1..9"
        assert texts == {f"parameters of submodule 1.0x0001 {word}: {why}"}


def test_a_power_cycle_brings_the_default_back_and_parameter_access_is_as_before(line_of):
    with line_of() as line:
        station = line.core.axis("a").station
        assert records_of(line).write(None, API, 1, 1, 5, b"\x00\x08", 0) is None
        station.power_cycle(0)
        line.core.settle(station, 0)
        assert records_of(line).read(None, API, 1, 1, 5, 100, 0) == b"\x00\x03"
        assert records_of(line).write(None, API, 1, 1, 0xB02E, bytes.fromhex("070100011001039A0000"), 0) is None
        assert records_of(line).read(None, API, 1, 1, 0xB02E, 100, 0)[:5] == bytes.fromhex("0701000106")
