"""The GSDML file and the device that it describes, model by model: what the file claims the device does, and what the
device does is in the file.

Each model is also taken with other limits than its manual's, so that the file is held to follow the data.
"""

import hashlib
import importlib.util
import sys
from dataclasses import replace
from ipaddress import IPv4Address
from itertools import product
from pathlib import Path
from uuid import UUID
from xml.etree import ElementTree as ET

import pytest
from cm_support import AR_BLOCK, UUID_1, Bench
from cmctl_peers import CONTROLLER_MAC
from dcp_bench import device as dcp_device
from dcp_bench import setting
from gsdml_models import MAC, MS, NAMES, connected, described, plan_of, station_of
from profinet.gsdml import load_gsdml
from virtual_line import VirtualLine

from pnfarm.buses.profinet.binding import describe_device, serial_number
from pnfarm.buses.profinet.device.fault_diagnosis import fault_entry
from pnfarm.buses.profinet.model_gsdml import describe_model, file_name
from pnfarm.drives import catalogue
from pnfarm.drives.axis_handle import AxisHandle
from pnfarm.drives.catalogue import model, models
from pnfarm.drives.description.identity import with_identity
from pnfarm.drives.parameters.store import ParameterStore
from pnfarm.errors import ConfigError
from pnfarm.firmware.axis import AXIS
from pnfarm.protocols.profinet.cm.controller.events import ArEstablished, Connected
from pnfarm.protocols.profinet.cm.controller.frames import plan_frames
from pnfarm.protocols.profinet.cm.controller.plan import ParameterRecord
from pnfarm.protocols.profinet.cm.controller.request import connect_payload
from pnfarm.protocols.profinet.gsdml.planning import from_gsdml
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml
from pnfarm.protocols.profinet.gsdml.writer import emit_gsdml
from pnfarm.protocols.profinet.records.store import Index
from pnfarm.protocols.profinet.wire.any_block import emit_blocks
from pnfarm.protocols.profinet.wire.block import RawBlock, split_blocks
from pnfarm.protocols.profinet.wire.cm.iocr import MIN_C_SDU
from pnfarm.protocols.profinet.wire.dcp.blocks import BlockError, ResetToFactoryBlock
from pnfarm.protocols.profinet.wire.records.identification import IdentificationData, Im0
from pnfarm.table.image import IMAGE
from pnfarm.wire.ethernet import EthernetFrame, emit_ethernet, parse_ethernet
from pnfarm.wire.ipv4 import Ipv4Packet, emit_ipv4, parse_ipv4
from pnfarm.wire.udp import UdpDatagram, emit_udp

#: Those that come with the program.
SHIPPED = [name for name in NAMES if Path(catalogue.__file__).parent in models()[name].folder.parents]
#: What each model's file says, as a digest: a file that says something else needs another date (see the test).
DIGESTS = {
    "GSDML-V2.35-pnfarm-akd-profinet-20261124.xml": "216032423c9d06d9",
    "GSDML-V2.35-pnfarm-moog-msd-20261123.xml": "50ceae05115fd579",
    "GSDML-V2.35-pnfarm-akd-profinet-2012-20261123.xml": "ecdd92587f58fa9a",
    "GSDML-V2.35-pnfarm-hiwin-e1-20261123.xml": "7803ba846ebccf42",
    "GSDML-V2.35-pnfarm-profidrive-20261130.xml": "ff5348760b94a78f",
}


# identity and modules


def test_the_file_names_the_device(drive_model):
    gsdml, device = described(drive_model)
    (dap,) = gsdml.daps
    assert (gsdml.vendor_id, gsdml.device_id) == (device.vendor_id, device.device_id)
    assert (dap.slot, dap.ident, dap.instance) == (device.dap.slot, device.dap.module_ident, device.instance)
    assert list(dap.physical_slots) == sorted(device.slots)
    assert gsdml.vendor_name == drive_model.maker
    assert "virtual" in gsdml.product_family


def test_the_file_has_every_module_and_submodule_of_the_device_and_no_other(drive_model):
    gsdml, device = described(drive_model)
    in_file = set()
    for ref in gsdml.daps[0].modules:
        for slot in ref.allowed:
            plan = from_gsdml(gsdml, modules={slot: ref.target})
            in_file |= {
                (s.slot, s.subslot, s.api, s.module_ident, s.submodule_ident, s.input_bytes, s.output_bytes)
                for s in plan.submodules
            }
    of_device = {
        (s.slot, s.subslot, s.api, m.module_ident, s.submodule_ident, s.input_bytes, s.output_bytes)
        for m in (device.dap, *device.modules)
        for s in m.submodules
    }
    assert in_file == of_device


def test_a_new_project_has_the_module_that_is_plugged_at_power_on(drive_model):
    gsdml, device = described(drive_model)[0], describe_device(drive_model, MAC, strict=True)
    plan = from_gsdml(gsdml)
    first = {slot: device.default_module(slot).module_ident for slot in device.slots}
    assert {s.slot: s.module_ident for s in plan.submodules} == first


@pytest.mark.parametrize("startup", ["legacy", "advanced"])
def test_every_module_connects_as_the_file_says_without_a_difference(drive_model, startup):
    gsdml, device = described(drive_model)
    assert startup in {mode.lower() for mode in gsdml.daps[0].relations.startup_modes}
    for module in gsdml.modules:
        both = station_of(plan_of(gsdml, module.id, startup=startup), device)
        both.start()
        (done,) = [e for e in both.events if isinstance(e, Connected)]
        assert done.module_diff == ()
        assert any(isinstance(e, ArEstablished) for e in both.events)
        answer = both.records.read(both.device.ars[0], 0, 0, 1, Index.REAL_IDENTIFICATION_AR, 4096, 0)
        (block,) = split_blocks(answer)
        real = {
            (api.api, slot.slot, subslot): (slot.module_ident, ident)
            for api in IdentificationData.of(block).apis
            for slot in api.slots
            for subslot, ident in slot.submodules
        }
        assert real == {
            (s.api, s.slot, s.subslot): (s.module_ident, s.submodule_ident) for s in both.controller.plan.submodules
        }


def test_lengths_other_than_the_files_are_refused(drive_model):
    gsdml, device = described(drive_model)
    for module in gsdml.modules:
        plan = plan_of(gsdml, module.id)
        assert connected(plan, device).ok
        longer = tuple(replace(s, input_bytes=s.input_bytes + 2) if s.input_bytes else s for s in plan.submodules)
        assert not connected(replace(plan, submodules=longer), device).ok


def test_signals_are_in_the_file_by_name_and_in_the_order_of_the_telegram(drive_model):
    gsdml, _ = described(drive_model)
    for number, telegram in drive_model.profidrive.telegrams.items():
        data = gsdml.module(f"TELEGRAM_{number}").submodules[-1]
        for items, words in ((data.inputs, telegram.input), (data.outputs, telegram.output)):
            if telegram.free_mapping:
                assert [item.data_type for item in items.items] == ["Unsigned16"] * len(words)
                continue
            names = [name for item in items.items for name in [item.name] * (item.octets // 2)]
            expected = [signal.name if signal else f"Word {n}, without a signal" for n, signal in enumerate(words, 1)]
            assert names == expected
            assert items.whole


def test_a_signal_with_a_sign_is_an_integer_in_the_file():
    """HIWIN E1 manual, table 3.1.1."""
    gsdml, _ = described(model("hiwin-e1"))
    data = [gsdml.module(f"TELEGRAM_{number}").submodules[-1] for number in (3, 9, 111)]
    items = [item for submodule in data for part in (submodule.inputs, submodule.outputs) for item in part.items]
    assert {item.name for item in items if item.data_type == "Integer32"} == {
        "NSOLL_B", "NIST_B", "XIST_A", "MDI_TARPOS", "MDI_VELOCITY",
    }  # fmt: skip
    assert {item.name for item in items if item.data_type == "Integer16"} == {"MDI_ACC", "MDI_DEC"}


def test_the_largest_frames_are_those_of_the_largest_telegram_of_every_axis(drive_model):
    gsdml, _ = described(drive_model)
    sizes = []
    for module in gsdml.modules:
        slots = gsdml.daps[0].modules[0].allowed
        beside = {(slot, place): ref.target for slot in slots for ref in module.useable for place in ref.allowed}
        frames = plan_frames(plan_of(gsdml, module.id, submodules=beside, slots=slots))
        ends = [max([p.iops_offset for p in frame.data] + [p.iocs_offset for p in frame.iocs]) + 1 for frame in frames]
        assert all(frame.data_length == max(end, MIN_C_SDU) for frame, end in zip(frames, ends, strict=True))
        sizes.append(ends)
    (dap,) = gsdml.daps
    assert [dap.max_input, dap.max_output] == [max(column) for column in zip(*sizes, strict=True)]


# records


def test_identification_is_at_the_access_point_as_the_file_says(drive_model):
    gsdml, device = described(drive_model)
    (dap,) = gsdml.daps
    records = Bench(device).records
    (block,) = split_blocks(records.read(None, 0, 0, 1, Index.IM0, 4096, 0))
    im0 = Im0.of(block)
    assert im0.order_id.decode().rstrip() == dap.info.order_number
    assert str(im0.hardware_revision) == dap.info.hardware_release
    prefix, *numbers = im0.software_revision
    assert f"{prefix}{'.'.join(map(str, numbers))}" == dap.info.software_release
    assert im0.serial_number.decode().rstrip() == serial_number(MAC)
    carriers = [
        (slot.slot, subslot)
        for raw in split_blocks(records.read(None, 0, 0, 1, Index.IM0_FILTER_DATA, 4096, 0))
        for api in IdentificationData.of(raw).apis
        for slot in api.slots
        for subslot, _ in slot.submodules
    ]
    assert set(carriers) == {(0, next(iter(dap.submodules[0].fixed)))}


@pytest.mark.parametrize("supported", [0, 0b0000_1110])
def test_the_writeable_identification_records_are_those_of_the_file(drive_model, supported, monkeypatch):
    from pnfarm.buses.profinet import model_gsdml

    real = model_gsdml.describe_device

    def with_im(*args, **options):
        found = real(*args, **options)
        return replace(found, im0=replace(found.im0, im_supported=supported))

    monkeypatch.setattr(model_gsdml, "describe_device", with_im)
    (dap,) = parse_gsdml(emit_gsdml(describe_model(drive_model)).encode()).daps
    bench = Bench(with_im(drive_model, MAC, strict=True))
    takes = [n for n in range(1, 5) if isinstance(bench.records.read(None, 0, 0, 1, Index.IM0 + n, 4096, 0), bytes)]
    assert list(dap.submodules[0].writeable_im) == takes
    others = [s for m in parse_gsdml(emit_gsdml(describe_model(drive_model)).encode()).modules for s in m.submodules]
    assert not any(s.writeable_im for s in others)


def test_multiple_write_is_taken_as_the_file_says(drive_model):
    gsdml, device = described(drive_model)
    assert gsdml.daps[0].multiple_write
    block = RawBlock(0x0202, bytes(8)).emit()
    port = gsdml.daps[0].ports[0].subslot
    written = tuple(ParameterRecord(0, 0, port, index, block) for index in (0x802B, 0x802F))
    both = station_of(replace(plan_of(gsdml), records=written), device)
    both.start()
    assert any(isinstance(e, ArEstablished) for e in both.events)
    assert [both.records.read(None, 0, 0, port, r.index, 4096, 0) for r in written] == [block, block]


def test_the_file_has_no_parameter_records_because_the_drives_parameters_have_another_way(drive_model):
    gsdml, _ = described(drive_model)
    assert not [r for s in gsdml.all_submodules() for r in s.records]


# connections


def test_the_device_takes_as_many_controllers_as_the_file_says(limited):
    gsdml, device = described(limited)
    (dap,) = gsdml.daps
    number = dap.relations.number_of_ars
    assert number == limited.limits.io_controllers
    assert dap.shared_device == (number > 1)
    bench = Bench(device)
    results = []
    for count in range(number + 1):
        plan = plan_of(
            gsdml,
            ar_uuid=UUID(int=UUID_1.int + count),
            session_key=count + 1,
            input_frame_id=0x8000 + count,
            controller_name=f"plc-{count}",
            controller_mac=CONTROLLER_MAC[:5] + bytes([count]),
        )
        results.append(bench.call(0, connect_payload(plan, *plan_frames(plan)))[0].ok)
    assert results == [True] * number + [False]


def test_the_device_takes_as_many_acyclic_connections_as_the_file_says(drive_model):
    gsdml, device = described(drive_model)
    (dap,) = gsdml.daps
    assert dap.device_access
    bench = Bench(device)
    results = []
    for count in range(dap.device_access_ars + 1):
        name, mac = f"tool-{count}".encode(), CONTROLLER_MAC[:5] + bytes([count])
        ar_uuid = UUID(int=UUID_1.int + count)
        tool = replace(AR_BLOCK, ar_uuid=ar_uuid, ar_type=6, properties=0x111, station_name=name, initiator_mac=mac)
        results.append(bench.call(0, emit_blocks((tool,)))[0].ok)
    assert results == [True] * dap.device_access_ars + [False]


# what the station does


def test_reset_modes_are_those_that_dcp_takes(drive_model):
    (dap,) = described(drive_model)[0].daps
    taken = [mode for mode in range(16) if setting(dcp_device(), ResetToFactoryBlock(mode << 1)) == [BlockError.OK]]
    assert taken == list(dap.reset_modes)


def test_the_name_can_be_set_and_no_alarm_is_claimed_that_the_model_denies(drive_model):
    gsdml, _ = described(drive_model)
    assert not gsdml.daps[0].name_not_transferable
    assert not any(s.may_issue_process_alarm for s in gsdml.all_submodules())
    if not drive_model.limits.alarms:
        assert not gsdml.diagnoses


@pytest.fixture(scope="module")
def heard():
    """Everything that a station sends by itself in a minute from power-on, and its answer to SNMP."""
    line = VirtualLine(controller=False)
    frames = []
    mac = bytes.fromhex("020000fffffe")
    line.world.switch.attach(mac, lambda _i, frame, _now: frames.append(parse_ethernet(frame)))
    station = line.farm.axes[0]
    station.station.power_cycle(line.world.now)
    line.farm.settle(station.station, line.world.now)
    line.run(60.0)
    own = station.device.ip.address.ip
    station.device.ip.learn(IPv4Address("10.77.0.200"), mac, line.world.now)
    # GetRequest of sysDescr.0, SNMPv1, community public
    get = bytes.fromhex("302902010004067075626c6963a01c020400000001020100020100300e300c06082b060102010101000500")
    asking = IPv4Address("10.77.0.200")
    packet = emit_ipv4(Ipv4Packet(asking, own, 17, emit_udp(UdpDatagram(50_000, 161, get), asking, own)))
    station.station.receive(emit_ethernet(EthernetFrame(station.port.mac, mac, 0x0800, packet)), line.world.now)
    frames += [parse_ethernet(frame) for frame in station.station.pump(line.world.now)]
    return frames


def test_the_protocols_of_the_file_are_those_of_a_station(drive_model, heard):
    (dap,) = described(drive_model)[0].daps
    speaks = set()
    if any(frame.ethertype == 0x88CC for frame in heard):
        speaks.add("LLDP")
    packets = [parse_ipv4(frame.payload) for frame in heard if frame.ethertype == 0x0800]
    if any(packet.protocol == 17 and packet.payload[:2] == (161).to_bytes(2, "big") for packet in packets):
        speaks.add("SNMP")
    assert set(dap.interfaces[0].protocols) == speaks
    assert dap.lldp_nod == ("LLDP" in speaks)


def test_hello_is_claimed_if_a_station_says_it(drive_model, heard):
    (dap,) = described(drive_model)[0].daps
    said = any(frame.ethertype == 0x8892 and frame.payload[:2] == b"\xfe\xfc" for frame in heard)
    assert dap.interfaces[0].dcp_hello == said


# the file itself


def test_models_of_one_device_id_share_an_ident_only_where_it_means_the_same():
    """A tool knows a family of devices by vendor and device id, its versions by their access points."""
    access_points, parts = {}, {}
    for name in NAMES:
        gsdml, _ = described(model(name))
        family = gsdml.vendor_id, gsdml.device_id
        (dap,) = gsdml.daps
        assert access_points.setdefault((*family, dap.ident), name) == name
        for module in gsdml.modules:
            data = [(s.ident, s.api, s.inputs, s.outputs) for s in module.submodules]
            assert parts.setdefault((*family, module.ident), data) == data
    assert len(access_points) == len(NAMES)


def test_faults_that_are_reported_as_diagnosis_have_their_texts_in_the_file():
    drive_model = model("akd-profinet")
    reporting = replace(
        drive_model,
        limits=replace(drive_model.limits, alarms=True),
        diagnoses={702: 0x0100, 130: 0x9000},
    )
    own, profiles = described(reporting)[0].diagnoses
    assert (own.error_type, own.name, own.api) == (0x0100, drive_model.faults[702].name, None)
    assert (profiles.error_type, profiles.name, profiles.api) == (
        0x9000,
        "Microcontroller software or hardware",
        0x3A00,
    )
    assert described(drive_model)[0].diagnoses == ()


def test_every_diagnosis_that_a_fault_of_the_drive_becomes_is_in_the_file_and_no_other(drive_model):
    gsdml, _ = described(drive_model)
    store = ParameterStore(drive_model, AxisHandle(AXIS.allocate(1)[0], IMAGE.allocate(1)[0]))
    store.power_on()
    store.handle.axis.warnings.code = 0x0002_0014
    coding = drive_model.diagnosis_coding
    channels, units = set(), set()
    for mode, number in product(range(len(coding.modes) if coding else 1), drive_model.faults):
        if coding is not None:
            store.set(coding.mode_parameter, mode)
        entry = fault_entry(store, number)
        if entry is None:
            continue
        if entry.channel_coded:
            channels.add((entry.error_type, entry.api))
            assert entry.ext_error_type == 0  # a file has no entry for it
            (text,) = [d for d in gsdml.diagnoses if d.error_type == entry.error_type]
            assert f"{drive_model.faults[number].label} {drive_model.faults[number].name}" in text.help
        else:
            units.add(entry.usi)
            (unit,) = gsdml.unit_diagnoses
            assert sum(field.octets for field in unit.fields) == len(entry.data) == 8
            assert [field.value(entry.data) for field in unit.fields] == [number >> 16, number & 0xFFFF, 0x0002_0014]
    assert {(d.error_type, d.api) for d in gsdml.diagnoses} == channels
    assert {(d.user_structure, d.api) for d in gsdml.unit_diagnoses} == {(usi, None) for usi in units}


def test_diagnosis_is_where_the_schema_has_it():
    text = emit_gsdml(describe_model(model("moog-msd")))
    process = ET.fromstring(text).find("{*}ProfileBody/{*}ApplicationProcess")

    def names(element):
        return [child.tag.partition("}")[2] for child in element]

    lists = ["DeviceAccessPointList", "ModuleList", "ChannelDiagList", "UnitDiagTypeList", "ExternalTextList"]
    assert names(process) == lists
    channels, (unit,) = process[2], process[3]
    assert {child.tag.partition("}")[2] for child in channels} == {"ProfileChannelDiagItem"}
    assert all(names(child) == ["Name", "Help"] for child in channels)
    fieldbus = next(child for child in channels if child.get("ErrorType") == str(0x9008))
    assert fieldbus.attrib == {"API": str(0x3A00), "ErrorType": str(0x9008)}
    assert (unit.get("UserStructureIdentifier"), names(unit)) == ("1", ["Name", "Ref", "Ref", "Ref"])
    assert [ref.get("ByteOffset") for ref in unit[1:]] == ["0", "2", "4"]


@pytest.mark.parametrize(
    ("name", "dns_name"), [("akd-profinet", "akd-profinet"), ("My_Servo 2", "my-servo-2"), ("+", "drive")]
)
def test_the_name_for_stations_is_one_that_a_station_can_have(name, dns_name):
    (dap,) = describe_model(replace(model("akd-profinet"), name=name)).daps
    assert dap.dns_name == dns_name


def test_a_model_of_another_bus_or_without_texts_has_no_file():
    drive_model = model("akd-profinet")
    with pytest.raises(ConfigError, match="is a drive for profibus"):
        describe_model(replace(drive_model, bus="profibus"))
    with pytest.raises(ConfigError, match="no section description_file"):
        file_name(replace(drive_model, description_file=None))


def test_limits_that_leave_no_send_clock_of_1_ms_cannot_be_described():
    drive_model = model("akd-profinet")
    limits = replace(drive_model.limits, min_cycle_ns=MS // 4, max_cycle_ns=MS // 2)
    with pytest.raises(ConfigError, match="no send clock of 1 ms"):
        describe_model(replace(drive_model, limits=limits))


def test_another_identity_is_in_the_file():
    own = with_identity(model("akd-profinet"), {"device": 0x0777, "telegrams": {1: 0x4711}, "order_number": "X-1"})
    gsdml, _ = described(own)
    assert (gsdml.device_id, gsdml.module("TELEGRAM_1").ident, gsdml.daps[0].info.order_number) == (
        0x0777,
        0x4711,
        "X-1",
    )


def test_the_file_is_the_same_every_time(drive_model):
    assert emit_gsdml(describe_model(drive_model)) == emit_gsdml(describe_model(drive_model))


@pytest.mark.parametrize("name", SHIPPED)
def test_new_contents_of_a_file_have_a_new_date(name):
    """Tools take a file of the same name for the one they have: whoever changes what it says raises the model's
    ``description_file.date``, and puts name and digest in here."""
    text = emit_gsdml(describe_model(model(name)))
    assert DIGESTS.get(file_name(model(name))) == hashlib.sha256(text.encode()).hexdigest()[:16]


def test_the_name_of_the_file_cannot_be_the_makers(drive_model):
    name = file_name(drive_model)
    assert name.startswith("GSDML-V2.35-pnfarm-")
    assert not name.lower().startswith(f"gsdml-v2.35-{drive_model.maker.lower()}")
    assert name.endswith(f"-{drive_model.description_file.date}.xml")


def test_a_foreign_parser_reads_the_same_device(drive_model, tmp_path):
    path = tmp_path / file_name(drive_model)
    path.write_text(emit_gsdml(describe_model(drive_model)), encoding="utf-8")
    foreign = load_gsdml(path)
    device = describe_device(drive_model, MAC, strict=True)
    assert (foreign.vendor_id, foreign.device_id) == (device.vendor_id, device.device_id)
    (dap,) = foreign.daps
    assert dap.module_ident == device.dap.module_ident
    found = [(s.subslot_number, s.submodule_ident) for s in dap.system_submodules]
    assert found == [(s.subslot, s.submodule_ident) for s in device.dap.submodules if s.subslot >= 0x8000]
    by_ident = {m.module_ident: m for m in device.modules}
    assert {m.module_ident for m in foreign.modules.values()} == by_ident.keys()
    for module in foreign.modules.values():
        assert [(s.api, s.submodule_ident, s.input_length, s.output_length) for s in module.submodules] == [
            (s.api, s.submodule_ident, s.input_bytes, s.output_bytes) for s in by_ident[module.module_ident].submodules
        ]


def test_a_second_foreign_parser_reads_the_same_device(drive_model, tmp_path):
    package = importlib.util.find_spec("profinet_mcp")
    if package is None:
        pytest.skip("needs the package industriagents-profinet-mcp")
    # the parser's file alone: its package starts with a server that wants more packages
    place = Path(package.submodule_search_locations[0]) / "gsd_parser.py"
    spec = importlib.util.spec_from_file_location("foreign_gsd_parser", place)
    foreign = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = foreign
    spec.loader.exec_module(foreign)
    path = tmp_path / file_name(drive_model)
    path.write_text(emit_gsdml(describe_model(drive_model)), encoding="utf-8")
    read = foreign.GSDParser().load(path)
    device = describe_device(drive_model, MAC, strict=True)
    identity = int(read.metadata["vendor_id"], 16), int(read.metadata["device_id"], 16)
    assert identity == (device.vendor_id, device.device_id)
    (dap,) = read.device_access_points
    assert int(dap["module_ident_number"], 16) == device.dap.module_ident
    own = [s.subslot for s in device.dap.submodules if s.subslot >= 0x8000]
    assert [s["subslot_number"] for s in dap["system_submodules"]] == own
    found = {
        int(module["module_ident_number"], 16): {
            int(s["submodule_ident_number"], 16): (s["input_bytes"], s["output_bytes"]) for s in module["submodules"]
        }
        for module in read.modules
    }
    assert found == {
        m.module_ident: {s.submodule_ident: (s.input_bytes, s.output_bytes) for s in m.submodules}
        for m in device.modules
    }
