"""The built-in scanner with devices that it knows from an EDS file only; the scanner's keys of the farm file."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scanner_line import ScannerLine

from pnfarm.buses.ethernetip.config.controller import EthernetIpController
from pnfarm.buses.ethernetip.controller.plan import plan_controller
from pnfarm.errors import ConfigError, DecodeError
from pnfarm.farm.file.reading import FarmFileError, parse_farm
from pnfarm.protocols.enip.connection import ConnectionKind
from pnfarm.protocols.enip.eds.document import Limits
from pnfarm.protocols.enip.eds.reader import parse_sheet
from pnfarm.protocols.enip.wire.epath import DataSegment, ElectronicKey, parse_epath

DEVICE = """
[Device]
        VendCode = 452; VendName = "Kollmorgen"; ProdType = 16; ProdCode = 1; MajRev = 1; MinRev = 13;
        ProdName = "AKD by its file";
"""
EDS = (
    DEVICE
    + """
[Params]
        Param1 = 0, , , 0, 0xC7, 2, "Size", "", "", 0, 500, 64;
[Assembly]
        Assem101 = "Command", "20 04 24 65 30 03", 64, , , , 512, ;
        Assem102 = "Response", "20 04 24 66 30 03", Param1, , , , 512, ;
[Connection Manager]
        Connection1 = 0x02010002, 0x44640305, , 0, , , , Assem102, , , , , "Inputs", "", "20 04 24 64 2C FE 2C 66";
        Connection2 = 0x04010002, 0x44640405, , , Assem101, , 64, , , , , , "Owner", "", "20 04 24 64 2C 65 2C 66";
        Connection3 = 0x04010002, 0x44440405, , 64, , , 64, , 0, , 4, , "Config", "", "20 04 24 64 2C 65 2C 66";
        Connection4 = 0x04010008, 0x44640405, , 64, , , 64, , , , , , "Class 3", "", "20 04 24 64 2C 65 2C 66";
"""
)
PARAMETER = '        Param2 = 0, , , 0, 0xC8, 4, "Interval", "", "", 20000, , 30000;\n[Assembly]'
FILE = """
controller:
  interface: eth9
  ip: 10.77.1.250/23
  {rpi}
  devices:
    - {{name: servo, eds: akd.eds, ip: 10.77.0.11/23{more}}}
"""


def plan_of(folder, more="", eds=EDS, rpi="rpi: 20ms"):
    (folder / "akd.eds").write_text(eds, encoding="latin-1")
    config = parse_farm(FILE.format(more=more, rpi=rpi), folder / "plc.pnfarm.yml")
    assert isinstance(config.controller, EthernetIpController)
    return plan_controller(config.controller, [], [], folder)


def line_of(folder, more=""):
    (folder / "akd.eds").write_text(EDS, encoding="latin-1")
    line = ScannerLine(start=False)
    config = parse_farm(FILE.format(more=more, rpi="rpi: 20ms"), folder / "plc.pnfarm.yml")
    line.drives = []
    line.plc = line.scanner(config.controller, number=2, folder=folder)
    return line


# -- EDS files ---------------------------------------------------------------------------------------------------------


def test_a_connection_has_what_its_fields_say():
    sheet = parse_sheet(EDS.encode())
    owner = sheet.connection()
    assert (owner.keyword, owner.name, owner.kind) == ("Connection2", "Owner", ConnectionKind.EXCLUSIVE_OWNER)
    assert (owner.outputs.size.default, owner.inputs.size.default) == (64, 64)
    assert (owner.output_header, owner.input_header) == (True, False)
    assert (owner.multicast, owner.point_to_point, owner.configuration.size.default) == (True, True, 0)
    assert owner.path == bytes.fromhex("200424642C652C66")
    inputs = sheet.connection("inputs")
    assert (inputs.kind, inputs.outputs.size.default) == (ConnectionKind.INPUT_ONLY, 0)
    assert inputs.inputs.size == Limits(64, 0, 500)
    assert sheet.connection("CONNECTION3").configuration.size.default == 4
    assert (sheet.key, sheet.product) == (ElectronicKey(452, 16, 1, 1, 13), "AKD by its file")


@pytest.mark.parametrize(
    ("eds", "words"),
    [
        ("[File]\n", "no section Device"),
        (DEVICE, "no connection of class 1"),
        (DEVICE + "[Connection Manager] Connection1 = 0x04010002, x,,,,,,,,,,,,,;", "not a number"),
        (DEVICE + "[Connection Manager] Connection1 = 0x04020002, 0x44640405,,,,,,,,,,,,,;", "no cyclic"),
        (DEVICE + '[Connection Manager] Connection1 = 0x04010002, 1,,,,,,,,,,,"","","SYMBOL_ANSI";', "octets alone"),
        (DEVICE + '[Connection Manager] Connection1 = 0x04010002, 1,,,,,,,,,,,"","","20 04 24";', "whole words"),
        (
            DEVICE + '[Connection Manager] Connection1 = 0x04010002, 1,,,Assem9,,,,,,,,"","","20 04";',
            "there is no Assem9",
        ),
        (
            DEVICE + '[Connection Manager] Connection1 = 0x04010002, 1,,Param9,,,,,,,,,"","","20 04";',
            "'Param9' is not a number",
        ),
        (
            DEVICE + '[Connection Manager] Connection1 = 0x04010002, 1,,2000,,,,,,,,,"","","20 04";',
            "do not fit into a frame",
        ),
        ("[Device", "line 1"),
    ],
)
def test_a_file_that_cannot_be_followed_is_told_with_its_name(tmp_path, eds, words):
    with pytest.raises(ConfigError, match=words) as told:
        plan_of(tmp_path, eds=eds)
    assert "device servo" in str(told.value)
    assert "akd.eds" in str(told.value)


def test_a_missing_file_is_told(tmp_path):
    config = parse_farm(FILE.format(more="", rpi="rpi: 20ms"), tmp_path / "plc.pnfarm.yml")
    with pytest.raises(ConfigError, match="cannot be read"):
        plan_controller(config.controller, [], [], tmp_path)


@given(
    st.lists(
        st.sampled_from(["0x04010002", "0x44640405", "", "64", "Assem101", "Param1", '"20 04 24 64"', '"x"', "{1, 2}"]),
        max_size=17,
    )
)
def test_any_entry_gives_a_connection_or_an_error_of_the_user(fields):
    text = EDS.split("[Connection Manager]")[0] + f"[Connection Manager] Connection1 = {', '.join(fields)};"
    try:
        found = parse_sheet(text.encode()).connection()
    except (ConfigError, DecodeError):
        return
    assert len(found.path) % 2 == 0
    assert 0 <= found.outputs.size.default <= 1400


# -- plans -------------------------------------------------------------------------------------------------------------


def test_the_plan_of_a_device_is_that_of_its_file(tmp_path):
    (device,) = plan_of(tmp_path).devices
    assert (device.name, device.model, device.rpi_ns) == ("servo", "AKD by its file", 20_000_000)
    assert (device.connection.output_size, device.connection.input_size) == (70, 66)
    key, *_ = parse_epath(device.connection.path)
    assert key == ElectronicKey(452, 16, 1, 1, 13, compatible=True)
    assert not device.connection.multicast
    (other,) = plan_of(tmp_path, ", multicast: true, rpi: 50ms, connection: Inputs").devices
    assert (other.connection.multicast, other.rpi_ns, other.connection.kind) == (True, 50_000_000, "input-only")
    assert (other.connection.output_size, other.connection.input_size) == (2, 66)


def test_a_device_runs_at_the_packet_interval_of_its_file_where_none_is_given(tmp_path):
    eds = EDS.replace("0x44640305, , 0", "0x44640305, 25000, 0").replace("[Assembly]", PARAMETER)
    eds = eds.replace("0x44640405, , , Assem101", "0x44640405, Param2, , Assem101")
    for connection, rpi_ns in (("Inputs", 25_000_000), ("Owner", 30_000_000), ("Config", 10_000_000)):
        more = f", connection: {connection}, configuration: '{'00000000' if connection == 'Config' else ''}'"
        (device,) = plan_of(tmp_path, more, eds, rpi="keying: compatible").devices
        assert device.rpi_ns == rpi_ns


def test_a_configuration_goes_with_forward_open(tmp_path):
    with pytest.raises(ConfigError, match="4 octets of configuration"):
        plan_of(tmp_path, ", connection: Config")
    (device,) = plan_of(tmp_path, ", connection: Config, configuration: '01020304'").devices
    assert parse_epath(device.connection.path)[-1] == DataSegment(bytes.fromhex("01020304"))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (", connection: Other", "there is no connection 'Other'"),
        (", connection: Config, configuration: '01020304', multicast: true", "no multicast"),
        (f", outputs: '{'00' * 65}'", "64 octets of outputs"),
    ],
)
def test_what_a_device_does_not_have_is_told(tmp_path, more, words):
    with pytest.raises(ConfigError, match=words):
        plan_of(tmp_path, more)


def test_long_data_are_asked_for_by_a_large_forward_open(tmp_path):
    text = EDS.replace("Assem101, , 64,", "Assem101, , 600,")
    (device,) = plan_of(tmp_path, eds=text).devices
    assert device.connection.large
    assert device.connection.input_size == 602


# -- exchange ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("more", ["", ", multicast: true", ", rpi: 40ms"])
def test_a_device_exchanges_data_by_its_file_alone(tmp_path, more):
    line = line_of(tmp_path, more)
    line.connect()
    line.plc.put_outputs("servo", bytes([0x80, 0, 0x20, 0x20]))
    line.run(1.0)
    assert line.plc.inputs("servo")[0] & 0x80, "the drive is enabled by the octets that were put"
    assert len(line.plc.inputs("servo")) == 64
    (row,) = line.plc.snapshot()
    assert (row["state"], row["model"], row["losses"]) == ("DATA", "AKD by its file", 0)
    assert line.plc.all_running
    with pytest.raises(ConfigError, match="64 octets"):
        line.plc.put_outputs("servo", bytes(65))


def test_outputs_of_the_file_are_sent_from_the_start(tmp_path):
    line = line_of(tmp_path, ", outputs: '80002020'")
    line.connect()
    line.run(0.5)
    assert line.plc.inputs("servo")[0] & 0x80


# -- keys --------------------------------------------------------------------------------------------------------------

KEYS = """
farm: cip
link: {{kind: memory}}
drives:
  - {{name: axis-1, model: akd-ethernetip, ip: 10.77.0.11/23{group}}}
controller: {{name: plc, ip: 10.77.1.250/23, {keys}}}
"""


@pytest.mark.parametrize(
    ("keys", "group", "words"),
    [
        ("rpi: 5ms", "", "5ms is faster than akd-ethernetip can"),
        ("rpi: 1us", "", "1ms to 10s"),
        ("timeout_multiplier: 5", "", "timeout_multiplier"),
        ("connection: input-only, program: {kind: constant}", "", "sends no commands"),
        ("program: {python: own.py}", "", "not possible on EtherNet/IP"),
        ("request_timeout: 1ms", "", "10ms to 60s"),
        ("devices: [{name: axis-1, eds: x, ip: 10.77.0.12/23}]", "", "belongs to 'axis-1' of controller"),
        ("devices: [{name: x, eds: x, ip: 10.77.0.11/23}]", "", "10.77.0.11 belongs to"),
        ("devices: [{name: x, eds: x, ip: 10.88.0.11/23}]", "", "not in the subnet"),
        ("devices: [{name: x, eds: x}]", "", "ip"),
        ("ip: 10.99.0.1/24", "", "cannot reach"),
    ],
)
def test_wrong_keys_are_told(keys, group, words):
    text = KEYS.format(keys=keys, group=group)
    if keys.startswith("ip:"):
        text = text.replace("ip: 10.77.1.250/23, ", "")
    with pytest.raises(FarmFileError, match=words):
        parse_farm(text)


def test_a_faster_interval_is_possible_with_lax_limits():
    config = parse_farm(KEYS.format(keys="rpi: 5ms", group=", limits: lax"))
    assert config.controller.rpi_ns == 5_000_000
