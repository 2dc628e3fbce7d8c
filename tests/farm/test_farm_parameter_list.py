"""``parameter_lists`` of a farm file: over the wire on the drives of its model, and what is said of a wrong one."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from parameter_requests import change_request, read_request
from record_line import access
from virtual_line import VirtualLine

from pnfarm.config.known import catalogue
from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.drives.profiles.profidrive.base_mode import ParameterAddress, ParameterValues, emit_request
from pnfarm.farm.farm import model_of
from pnfarm.farm.file.lists import MAX_OCTETS
from pnfarm.farm.file.reading import FarmFileError, expand, load_farm, parse_farm
from pnfarm.farm.file.schema import farm_schema

LIST = "number,name,type,max,default,unit\nPt200,Speed loop gain,uint16,20000,400,0.1 Hz\nPt300..Pt30F,,,,,\n"
FARM = """\
farm: line-1
link: {kind: memory}
parameter_lists: {hiwin-e1: e1.csv}
drives:
  - {name: "press-{n}", model: e1, count: 2, ip: 10.0.0.1/24, params: {Pt200: 500, speed loop gain: 600}}
  - {name: spindle, model: moog-msd, ip: 10.0.0.9/24}
"""
GAIN = 0x2200


@pytest.fixture
def write(tmp_path: Path):
    def write(farm: str = FARM, listed: str | bytes = LIST) -> Path:
        (tmp_path / "e1.csv").write_bytes(listed if isinstance(listed, bytes) else listed.encode())
        path = tmp_path / "a.pnfarm.yml"
        path.write_text(farm)
        return path

    return write


def told(path: Path) -> list[str]:
    with pytest.raises(FarmFileError) as caught:
        load_farm(path)
    return [str(issue).replace(f"{path.parent}/", "") for issue in caught.value.issues]


# over the wire


def line_of(tmp_path: Path, memory: VolatileMemory, text: str = LIST) -> VirtualLine:
    file = tmp_path / "e1.csv"
    file.write_text(text)
    return VirtualLine(
        model="hiwin-e1", telegram=3, cycle="1ms", memory=memory, top=f"parameter_lists: {{hiwin-e1: {file}}}\n"
    )


def read_value(line: VirtualLine, pnu: int, index: int = 0xB02F) -> str:
    return access(line, emit_request(read_request(1, [ParameterAddress(pnu, 0, 0)])), index=index).hex()


def change_value(line: VirtualLine, pnu: int, value: int, index: int = 0xB02F) -> str:
    request = change_request(2, [(ParameterAddress(pnu, 0, 0), ParameterValues(0x06, (value,)))])
    return access(line, emit_request(request), index=index).hex()


@pytest.mark.parametrize("index", [0xB02E, 0xB02F])
def test_a_listed_pt_parameter_is_read_and_written_by_records_and_outlives_a_power_cycle(tmp_path, index):
    line = line_of(tmp_path, VolatileMemory())
    line.connect()
    assert read_value(line, GAIN, index) == "01010001" + "0601" + f"{400:04x}"
    assert read_value(line, 0x230F, index) == "01010001" + "0601" + "0000", "of the run"
    assert change_value(line, GAIN, 1234, index) == "02020001"
    assert read_value(line, GAIN, index) == "01010001" + "0601" + f"{1234:04x}"
    assert change_value(line, GAIN, 20_001, index) == "02820001" + "4401" + "0002", "limit"
    assert read_value(line, 0x2201, index) == "01810001" + "4401" + "0000", "not listed"
    station = line.farm.axes[0]
    station.station.power_cycle(line.world.now)
    line.farm.settle(station.station, line.world.now)
    line.run(0.2)
    line.connect()
    assert read_value(line, GAIN, index) == "01010001" + "0601" + f"{1234:04x}"
    again = line_of(tmp_path, line.memory)
    again.connect()
    assert read_value(again, GAIN, index) == "01010001" + "0601" + f"{1234:04x}", "another run of the farm"


def test_a_kept_value_of_a_parameter_that_is_no_longer_listed_is_reported_and_left_out(tmp_path):
    line = line_of(tmp_path, VolatileMemory())
    line.connect()
    change_value(line, GAIN, 7)
    again = line_of(tmp_path, line.memory, "number\nPt201\n")
    again.connect()
    assert "memory not taken" in again.events("axis-01")
    assert read_value(again, GAIN) == "01810001" + "4401" + "0000"
    assert read_value(again, 0x2201) == "01010001" + "0601" + "0000"


# in the farm file


def test_the_drives_of_the_model_share_the_list_and_others_have_none_of_it(write):
    config = load_farm(write())
    first, second, spindle = expand(config)
    assert first.listed is second.listed
    assert spindle.listed is None
    parameter = model_of(first).resolve("Pt200")[0]
    assert (parameter.default, parameter.source) == (400, "e1.csv:2")
    assert GAIN not in model_of(spindle).parameters
    installed = catalogue().model("hiwin-e1")
    assert installed is not None
    assert installed.described is not None
    assert GAIN not in installed.described.parameters, "the list is that of this farm file alone"


def test_params_give_listed_parameters_values_within_their_limits(write):
    assert told(write(FARM.replace("Pt200: 500", "Pt200: 20001"))) == [
        "a.pnfarm.yml:5: drives[0].params.Pt200: is 20001; allowed: a whole number from 0 to 20000"
    ]


def test_what_is_wrong_in_a_list_is_reported_by_its_own_file_and_line_after_the_farm_files(write):
    farm = FARM.replace("model: moog-msd", "model: moog")
    assert [line.split(";")[0] for line in told(write(farm, LIST + "Pt20G,,,,,\nPt201,,uint7,,,\n"))] == [
        "a.pnfarm.yml:6: drives[1].model: 'moog' is not a model of this version, did you mean moog-msd?",
        "e1.csv:4: number: 'Pt20G' is not the number of a parameter",
        "e1.csv:5: type: 'uint7' is not a type",
    ]


@pytest.mark.parametrize(
    ("lists", "what"),
    [
        ("{hiwin: e1.csv}", "parameter_lists.hiwin: 'hiwin' is not a model of this version, did you mean hiwin-e1?"),
        ("{hiwin-e1: e1.csv, e1: e1.csv}", "parameter_lists.e1: hiwin-e1 has a list already"),
        ("{hiwin-e1: e2.csv}", "'e2.csv' cannot be read: no such file or directory"),
        ("{hiwin-e1: .}", "cannot be read: it is a folder"),
        ('{hiwin-e1: "e\\0.csv"}', "holds a NUL character"),
        ("{hiwin-e1: 5}", "parameter_lists.hiwin-e1: is 5"),
        ("{hiwin-e1: ''}", "parameter_lists.hiwin-e1: "),
        ("e1.csv", "parameter_lists: is 'e1.csv'"),
    ],
)
def test_a_wrong_list_is_reported_at_its_key(write, lists, what):
    farm = FARM.replace("{hiwin-e1: e1.csv}", lists).replace(", params: {Pt200: 500, speed loop gain: 600}", "")
    (line,) = told(write(farm))
    assert line.startswith("a.pnfarm.yml:3: parameter_lists")
    assert what in line


@pytest.mark.parametrize(
    ("data", "what"),
    [
        (b"number\n" + b"#" * MAX_OCTETS, f"is longer than {MAX_OCTETS} octets"),
        (b"number\nPt200\nPt2\xff\n", "is not UTF-8 in line 3"),
    ],
)
def test_a_file_that_is_no_list_is_reported_at_its_key(write, data, what):
    (line,) = told(write(FARM.replace(", params: {Pt200: 500, speed loop gain: 600}", ""), data))
    assert what in line


def test_a_pipe_is_not_waited_for(write, tmp_path):
    path = write(FARM.replace(", params: {Pt200: 500, speed loop gain: 600}", "").replace("e1.csv", "pipe"))
    os.mkfifo(tmp_path / "pipe")
    (line,) = told(path)
    assert "it is a pipe" in line


def test_a_list_of_a_spreadsheet_begins_with_a_byte_order_mark(write):
    config = load_farm(write(listed=b"\xef\xbb\xbf" + LIST.replace(",", ";").encode()))
    assert model_of(expand(config)[0]).resolve("Pt30F")[0].pnu == 0x230F


def test_a_setting_from_outside_reads_the_list_again(write):
    path = write()
    config = load_farm(path)
    (path.parent / "e1.csv").write_text(LIST.replace(",400,", ",401,"))
    again = config.with_overrides({"api": "127.0.0.1:9000"})
    assert model_of(expand(again)[0]).resolve("Pt200")[0].default == 401


def test_a_file_without_lists_needs_none():
    config = parse_farm(
        FARM.replace("parameter_lists: {hiwin-e1: e1.csv}\n", "").replace("Pt200: 500, speed loop gain: 600", "")
    )
    assert all(drive.listed is None for drive in expand(config))


def test_the_schema_has_the_key():
    field = farm_schema()["properties"]["parameter_lists"]
    assert field["additionalProperties"]["type"] == "string"
    assert "relative to this file" in field["description"]
