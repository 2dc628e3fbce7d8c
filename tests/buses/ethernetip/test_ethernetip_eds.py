"""``pnfarm eds``: independent parsers accept the file, and it says what the device answers, attribute by attribute."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from ipaddress import IPv4Address
from pathlib import Path

import pytest
from peer import Rig

from pnfarm.buses.ethernetip.config.controller import EdsDevice
from pnfarm.buses.ethernetip.controller.plan import plan_devices
from pnfarm.buses.ethernetip.description.sheet import RPI_PARAMETER, describe_model, file_name
from pnfarm.buses.ethernetip.device.product import Product
from pnfarm.cli.main import main
from pnfarm.drives.catalogue import model, models
from pnfarm.drives.parameters.parameter import Backing
from pnfarm.farm.farm import model_of
from pnfarm.farm.file.reading import expand, parse_farm
from pnfarm.protocols.enip.eds.reader import parse_sheet
from pnfarm.protocols.enip.eds.text import emit_eds, parse_eds
from pnfarm.protocols.enip.objects.identity import identity_key
from pnfarm.protocols.enip.originator_events import ConnectionMade
from pnfarm.protocols.enip.status import GeneralStatus, Service
from pnfarm.protocols.enip.wire.data_types import TYPES
from pnfarm.protocols.enip.wire.epath import emit_epath, logical_path, parse_epath
from pnfarm.protocols.enip.wire.forward_open import ConnectionType, NetworkParameters
from pnfarm.protocols.enip.wire.message import message_request, parse_reply

MULTICAST, POINT_TO_POINT = ConnectionType.MULTICAST, ConnectionType.POINT_TO_POINT
NAMES = sorted(name for name, entry in models().items() if entry.bus == "ethernetip")
EDS_PIE = """
import io, json, logging, sys
import eds_pie
from eds_pie.eds_pie import CIP_EDS
logging.getLogger().handlers.clear()
said = io.StringIO()
logging.getLogger().addHandler(logging.StreamHandler(said))
logging.getLogger().setLevel(logging.WARNING)
eds = CIP_EDS(sys.stdin.buffer.read())
json.dump({"said": said.getvalue().splitlines(), "protocol": eds.protocol, "eds": eds.to_json()}, sys.stdout)
"""


@pytest.fixture(scope="module")
def rig():
    made = Rig()
    made.peer.connect()
    return made


@pytest.fixture(scope="module")
def sheet():
    return parse_eds(emit_eds(describe_model(model("akd-ethernetip"))))


def numbered(sheet, section, keyword):
    """Entries of one kind by their numbers."""
    return {
        int(entry.keyword.removeprefix(keyword)): entry
        for entry in sheet.section(section).entries
        if entry.keyword.startswith(keyword)
    }


# -- the command


@pytest.mark.parametrize("name", NAMES)
def test_the_file_is_written_and_its_path_printed(name, tmp_path, capsys):
    assert main(["eds", name, "-o", str(tmp_path / "new")]) == 0
    (path,) = (tmp_path / "new").iterdir()
    assert capsys.readouterr().out == f"{path}\n"
    assert path.name == file_name(model(name))
    assert parse_eds(path.read_bytes()) == describe_model(model(name))


def test_a_dash_prints_it(capsys):
    assert main(["eds", "akd-eip", "-o", "-"]) == 0
    out = capsys.readouterr().out
    assert parse_eds(out.encode()).section("Device").entry("VendCode").number(0) == 452
    assert "This is not the maker's file." in out


def test_a_model_on_another_bus_and_a_name_of_a_file_are_refused(tmp_path, capsys):
    assert main(["eds", "akd-profinet"]) == 2
    assert "akd-profinet is a model on profinet" in capsys.readouterr().err
    assert main(["eds", "akd-ethernetip", "-o", str(tmp_path / "akd.eds")]) == 2
    assert "akd.eds is not a folder" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


# -- another parser


def eds_pie(octets: bytes):
    if importlib.util.find_spec("eds_pie") is None:
        pytest.skip("eds-pie is not installed")
    done = subprocess.run([sys.executable, "-c", EDS_PIE], input=octets, capture_output=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr.decode()[-2000:]
    return json.loads(done.stdout)


@pytest.mark.parametrize("name", NAMES)
def test_eds_pie_reads_it_without_a_word_of_complaint(name):
    read = eds_pie(emit_eds(describe_model(model(name))))
    assert read["said"] == []
    assert read["protocol"] == "EtherNetIP"
    product = Product.of(model(name))
    device = read["eds"]["Device"]
    assert [device[key] for key in ("VendCode", "ProdType", "ProdCode", "MajRev", "MinRev")] == [
        product.vendor_id, product.device_type, product.product_code, *product.revision,
    ]  # fmt: skip
    assert set(read["eds"]["Params"]) == {f"Param{n}" for n in (*model(name).cip.instances, RPI_PARAMETER)}


def test_eds_pie_does_complain_about_what_is_wrong():
    octets = emit_eds(describe_model(model("akd-ethernetip")))
    wrong = octets.replace(b"VendCode = 452", b"VendCode = 99999").replace(b"[Assembly]", b"[Assemblage]")
    assert eds_pie(wrong)["said"]


# -- the device


def test_identity_is_the_devices(rig, sheet):
    read = parse_sheet(emit_eds(sheet))
    key, name = read.key, read.product
    device = rig.station().device
    assert key == identity_key(device.identity)
    assert rig.peer.get(1, 1, 7).data == bytes([len(name)]) + name.encode()
    for attribute, keyword in ((1, "VendCode"), (2, "ProdType"), (3, "ProdCode")):
        wanted = sheet.section("Device").entry(keyword).number(0)
        assert int.from_bytes(rig.peer.get(1, 1, attribute).data, "little") == wanted


def test_every_parameters_path_answers_with_its_type_and_size(rig, sheet):
    parameters = numbered(sheet, "Params", "Param")
    rows = model("akd-ethernetip").cip.instances
    assert parameters.keys() == rows.keys() | {RPI_PARAMETER}
    adapter = rig.station().device.adapter
    for number, entry in parameters.items():
        if number == RPI_PARAMETER:
            continue
        path = bytes.fromhex(entry.text(2))
        assert path == emit_epath(logical_path(0x0F, number, 1))
        assert entry.number(1) == len(path)
        kind = TYPES[entry.number(4)]
        assert kind.size == entry.number(5)
        assert attribute(adapter, number, 5).data == bytes([kind.code])
        assert attribute(adapter, number, 6).data == bytes([kind.size])
        answer = attribute(adapter, number, 1)
        assert answer.status == GeneralStatus.SUCCESS, (number, answer)
        assert len(answer.data) == kind.size, number
        lowest, highest, default = (entry.number(place) for place in (9, 10, 11))
        assert lowest <= default <= highest, entry
        for value in (lowest, highest, default):
            kind.emit(value)


def attribute(adapter, instance, number):
    """The Parameter object's answer without a session: 666 parameters take long over one."""
    asked = message_request(Service.GET_ATTRIBUTE_SINGLE, logical_path(0x0F, instance, number)).emit()
    reply, _ = adapter.unconnected(0, 0, (IPv4Address("10.77.1.100"), 50_000), asked, (), 0)
    return parse_reply(reply)


def test_a_drive_comes_with_the_defaults_of_the_file(rig, sheet):
    adapter = rig.station("axis-2").device.adapter
    parameters = numbered(sheet, "Params", "Param")
    found = model("akd-ethernetip")
    checked = 0
    for number, row in found.cip.instances.items():
        parameter = found.parameters[number]
        if parameter.backing is not Backing.STORED or not parameter.writable:
            continue
        checked += 1
        default = int.from_bytes(attribute(adapter, number, 1).data, "little", signed=row.signed)
        assert default == parameters[number].number(11), row
    assert checked > 100


def test_what_is_read_only_in_the_file_cannot_be_written(rig, sheet):
    for number in (133, 8192, 1, 35):
        entry = numbered(sheet, "Params", "Param")[number]
        data = bytes(entry.number(5)) if number != 35 else b"\1"
        status = rig.peer.set(0x0F, number, 1, data).status
        read_only = bool(entry.number(3) & 0x10)
        assert (status == GeneralStatus.ATTRIBUTE_NOT_SETTABLE) == read_only, number


def test_the_assemblies_have_the_devices_sizes(rig, sheet):
    assemblies = numbered(sheet, "Assembly", "Assem")
    assert assemblies.keys() == {100, 101, 102}
    for number, entry in assemblies.items():
        path = bytes.fromhex(entry.text(1))
        answer = rig.peer.ask(Service.GET_ATTRIBUTE_SINGLE, parse_epath(path))
        assert len(answer.data) == entry.number(2)
        assert int.from_bytes(rig.peer.get(4, number, 4).data, "little") == entry.number(2)


@pytest.mark.parametrize(("place", "kind"), [(1, "exclusive-owner"), (2, "input-only"), (3, "listen-only")])
def test_the_connections_of_the_file_can_be_opened_and_no_shorter_ones(sheet, place, kind):
    rig = Rig()
    rig.peer.connect()
    if kind == "listen-only":
        assert isinstance(rig.peer.open(multicast=True), ConnectionMade)
    found = parse_sheet(emit_eds(sheet)).connection(place)
    assert found.kind == kind.replace("-", " ")
    octets = found.outputs.size.default
    outputs = 2 + octets + 4 * (found.output_header and octets > 0)
    inputs = 2 + found.inputs.size.default + 4 * found.input_header
    for multicast in (False, True):
        asked = {
            "path": found.path,
            "o_to_t": NetworkParameters(outputs),
            "t_to_o": NetworkParameters(
                inputs, ConnectionType.MULTICAST if multicast else ConnectionType.POINT_TO_POINT
            ),
        }
        made = rig.peer.open(**asked, multicast=multicast)
        allowed = found.multicast if multicast else found.point_to_point
        assert isinstance(made, ConnectionMade) == allowed
        if isinstance(made, ConnectionMade):
            rig.peer.close(made.request.triad.serial, found.path)
        assert not isinstance(rig.peer.open(**asked | {"o_to_t": NetworkParameters(outputs + 2)}), ConnectionMade)


def test_the_standard_objects_answer_every_attribute_that_the_file_names(rig, sheet):
    for name in ("Identity Class", "QoS Class", "TCP/IP Interface Class", "Ethernet Link Class"):
        section = sheet.section(name)
        class_id = section.entry("Object_Class_Code").number(0)
        assert int.from_bytes(rig.peer.get(class_id, 0, 1).data, "little") == section.entry("Revision").number(0)
        for keyword, instance in (("Class_Attributes", 0), ("Instance_Attributes", 1)):
            entry = section.entry(keyword)
            for place in range(len(entry.fields)):
                answer = rig.peer.get(class_id, instance, entry.number(place))
                assert answer.status == GeneralStatus.SUCCESS, (name, instance, entry.number(place))


def test_the_intervals_limits_are_the_devices(sheet):
    entry = numbered(sheet, "Params", "Param")[RPI_PARAMETER]
    product = Product.of(model("akd-ethernetip"))
    assert entry.number(9) == product.min_rpi_ns // 1000 == 10_000
    assert entry.number(10) >= entry.number(11) >= entry.number(9)


def test_the_built_in_scanner_plans_the_same_by_the_file_as_by_the_model(tmp_path):
    path = tmp_path / "akd.eds"
    path.write_bytes(emit_eds(describe_model(model("akd-ethernetip"))))
    config = parse_farm(
        "farm: a\nlink: {kind: memory}\ndrives:\n  - {name: axis-1, model: akd-ethernetip, ip: 10.77.0.11/24}\n"
        "controller: {name: plc, ip: 10.77.0.1/24}\n"
    )
    drives = expand(config)
    device = EdsDevice(name="foreign", eds=str(path), ip="10.77.0.12/24")
    section = config.controller.model_copy(update={"devices": (device,)})
    own, foreign = plan_devices(section, drives, [model_of(drive) for drive in drives], Path())
    assert (foreign.connection, foreign.key, foreign.rpi_ns) == (own.connection, own.key, own.rpi_ns)
