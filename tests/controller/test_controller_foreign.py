"""The built-in controller with devices that it knows from a GSDML file only."""

import asyncio
from dataclasses import replace
from ipaddress import IPv4Interface

import pytest
from gsdml_versions import VERSIONS, file_name, gsdml_of
from virtual_line import VirtualLine

from pnfarm.buses.controller import ControllerHost
from pnfarm.buses.profinet.controller.core import ProfinetCore
from pnfarm.buses.profinet.controller.device_plan import ProfinetPlan
from pnfarm.buses.profinet.controller.plan import plan_devices
from pnfarm.buses.profinet.model_gsdml import describe_model
from pnfarm.cli.farm_file import summary
from pnfarm.controller.plan import plan_controllers
from pnfarm.drives.catalogue import model
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import FarmFileError, parse_farm
from pnfarm.links.base import PortSpec
from pnfarm.protocols.profinet.gsdml.document import ModuleItem
from pnfarm.protocols.profinet.gsdml.records import ParameterConst, ParameterRecord, ParameterRef
from pnfarm.protocols.profinet.gsdml.values import Numbers
from pnfarm.protocols.profinet.gsdml.writer import emit_gsdml
from pnfarm.station.event_log import EventLog

FILE = """
controller:
  interface: eth9
  ip: 10.77.1.250/23
  devices:
    - {{name: {name}, gsdml: drive.xml, ip: 10.77.0.11/23{more}}}
"""


def write(folder, gsdml=None):
    (folder / "drive.xml").write_text(emit_gsdml(gsdml or describe_model(model("akd"))), encoding="utf-8")


def plans(folder, more="", name="axis-01", text=FILE):
    config = parse_farm(text.format(name=name, more=more), folder / "plc.pnfarm.yml")
    return plan_devices(config.controller, [], [], config.path.parent)


class Line:
    """A drive, and a controller that knows it from its file."""

    def __init__(self, planned, identity="{}"):
        farm = VirtualLine(controller=False, identity=identity)
        self.world, self.station = farm.world, farm.farm.axes[0]
        self.log = EventLog(quiet=True)
        link = self.world.link()
        (port,) = asyncio.run(link.open([PortSpec("plc", bytes.fromhex("0200000000fe"))]))
        plan = ProfinetPlan("plc", IPv4Interface("10.77.1.250/23"), planned)
        self.plc = ProfinetCore(plan, ControllerHost(link, port, self.log, b"x"))
        self.world.join(self.plc, [port])
        self.plc.start(self.world.now)

    def connect(self, within=5.0):
        return self.world.run(within, until=lambda: self.plc.all_connected)


@pytest.mark.parametrize("more", ["", ", startup: advanced", ", modules: {1: TELEGRAM_353}, cycle: 32ms"])
def test_a_device_is_connected_and_exchanges_data_by_its_file_alone(tmp_path, more):
    write(tmp_path)
    line = Line(plans(tmp_path, more))
    assert line.connect(), line.plc.sessions[0].measures.last_reason
    line.world.run(1.0)
    (row,) = line.plc.snapshot()
    assert (row["state"], row["model"], row["losses"]) == ("DATA", "Kollmorgen AKD, PROFINET RT", 0)
    assert row["frames_received"] > 20
    assert row["cycle_seconds"] == (0.032 if "32ms" in more else 0.016)
    assert line.station.store.telegram_number == (353 if "353" in more else 1)


def plan_of_version(folder, text, version):
    (folder / file_name(version)).write_text(text, encoding="utf-8")
    return plans(folder, text=FILE.replace("drive.xml", file_name(version)))


# the drive has the subslots of a V2.0 device at least: V1.0 has one submodule in each module
@pytest.mark.parametrize("version", VERSIONS[1:])
def test_a_drive_under_a_files_identity_is_connected_by_that_file_alone_whatever_its_version(tmp_path, version):
    planned = plan_of_version(tmp_path, gsdml_of(version), version)
    line = Line(planned, identity=f"{{gsdml: {tmp_path / file_name(version)}}}")
    assert line.connect(), line.plc.sessions[0].measures.last_reason
    line.world.run(1.0)
    (row,) = line.plc.snapshot()
    assert (row["state"], row["model"], row["losses"]) == ("DATA", "Sample servo", 0)
    assert row["frames_received"] > 20
    assert line.station.store.telegram_number == 1


@pytest.mark.parametrize("version", VERSIONS)
def test_a_device_is_planned_by_a_file_of_each_version(tmp_path, version):
    (plan,) = plan_of_version(tmp_path, gsdml_of(version), version)
    assert (plan.vendor_id, plan.device_id, plan.startup, plan.cycle_ns) == (0xFEED, 0x0A1D, "legacy", 16_000_000)
    assert (len(plan.submodules), plan.remarks) == (2 if version == "1.0" else 5, ())


def test_what_a_devices_file_lacks_for_its_version_is_in_the_log(tmp_path):
    text = gsdml_of("2.35").replace(' CheckDeviceID_Allowed="true"', "")
    line = Line(plan_of_version(tmp_path, text, "2.35"))
    (entry,) = [entry for entry in line.log.entries("axis-01") if entry.event == "remark on the GSDML file"]
    assert entry.data["remark"].startswith(f"{file_name('2.35')}, line 15: DeviceAccessPointItem/@CheckDeviceID_Al")


def test_a_device_has_the_time_to_be_ready_that_its_file_names_unless_the_farm_file_says_another(tmp_path):
    write(tmp_path)
    text = (tmp_path / "drive.xml").read_text(encoding="utf-8")
    (usual,) = plans(tmp_path)
    (tmp_path / "drive.xml").write_text(
        text.replace("<DeviceAccessPointItem ", '<DeviceAccessPointItem RemoteApplicationTimeout="90" '),
        encoding="utf-8",
    )
    (named,) = plans(tmp_path)
    (given,) = plans(tmp_path, text=FILE.replace("  devices:", "  application_ready: 5s\n  devices:"))
    seconds = [plan.application_ready_ns // 1_000_000_000 for plan in (usual, named, given)]
    assert seconds == [20, 90, 5]


def test_a_device_whose_file_requires_no_status_octets_is_connected_without_them(tmp_path):
    gsdml = describe_model(model("akd"))
    (dap,) = gsdml.daps
    write(tmp_path, replace(gsdml, daps=(replace(dap, ioxs_required=False),)))
    line = Line(plans(tmp_path))
    assert line.connect(), line.plc.sessions[0].measures.last_reason
    line.world.run(1.0)
    (row,) = line.plc.snapshot()
    assert (row["state"], row["losses"]) == ("DATA", 0)
    # the telegram's data alone have statuses, in both frames
    (ar,) = line.station.device.ars.values()
    inputs, outputs = ar.providers[0][1], ar.consumers[0][1]
    assert [(d.data_offset, d.iops_offset) for d in inputs.data if d.iops_offset is not None] == [(0, 4)]
    assert [(d.data_offset, d.iops_offset) for d in outputs.data if d.iops_offset is not None] == [(0, 4)]
    assert [c.iocs_offset for c in outputs.iocs if c.iocs_offset is not None] == [5]
    (provider, _), (consumer, _) = ar.providers[0], ar.consumers[0]
    columns = line.station.device.channels._channels.columns
    assert [int(o) for o in columns.ppm[provider].iops_offset[: columns.ppm[provider].iops_count]] == [20 + 4]
    assert int(columns.cpm[consumer].iops_count) == 1
    assert int(columns.cpm[consumer].iops) == 0x80


def with_ratio_1(gsdml):
    """The device that names the send clocks of 0.5, 1, 2 and 4 ms and no ratio but 1."""
    (dap,) = gsdml.daps
    relations = replace(dap.relations, send_clocks=Numbers.of([16, 32, 64, 128]), ratios=Numbers.of([1]))
    return replace(gsdml, daps=(replace(dap, interfaces=(replace(dap.interfaces[0], relations=relations),)),))


@pytest.mark.parametrize(("cycle", "pair"), [("500us", (16, 1)), ("1ms", (32, 1)), ("2ms", (64, 1)), ("4ms", (128, 1))])
def test_every_cycle_that_the_file_allows_is_reached_by_naming_it(tmp_path, cycle, pair):
    write(tmp_path, with_ratio_1(describe_model(model("hiwin-e1"))))
    (own,) = plans(tmp_path, f", cycle: {cycle}")
    (controllers,) = plans(tmp_path, text=FILE.replace("  devices:", f"  cycle: {cycle}\n  devices:"))
    assert [(plan.send_clock_factor, plan.reduction_ratio) for plan in (own, controllers)] == [pair, pair]


def test_a_send_clock_that_was_named_is_not_replaced_and_the_usual_cycle_is_made_to_fit(tmp_path):
    write(tmp_path, with_ratio_1(describe_model(model("hiwin-e1"))))
    named = FILE.replace("  devices:", "  send_clock_factor: 32\n  devices:")
    with pytest.raises(ConfigError, match="not support reduction ratio 4; its file names 1"):
        plans(tmp_path, ", cycle: 4ms", text=named)
    write(tmp_path, describe_model(model("hiwin-e1")))
    (usual,) = plans(tmp_path)
    # 16 ms, without the ratio of 16 that the file does not have
    assert (usual.send_clock_factor, usual.reduction_ratio) == (64, 8)


def test_the_outputs_of_an_unknown_device_stay_zero(tmp_path):
    write(tmp_path)
    line = Line(plans(tmp_path))
    assert line.connect()
    line.world.run(1.0)
    axis = line.station.handle.axis
    assert (axis.drive.state, float(axis.motor.velocity)) == (1, 0.0)


def test_parameter_records_of_the_file_are_written_and_the_farm_files_take_their_place(tmp_path):
    gsdml = describe_model(model("akd"))
    module = gsdml.module("TELEGRAM_1")
    access_point, telegram = module.submodules
    records = tuple(ParameterRecord(index, 2, consts=(ParameterConst(bytes([index, 0])),)) for index in (5, 6))
    bent = ModuleItem(
        module.id, module.ident, module.info, submodules=(replace(access_point, records=records), telegram)
    )
    modules = tuple(bent if m.id == module.id else m for m in gsdml.modules)
    write(tmp_path, replace(gsdml, modules=modules))
    own = FILE + "  records:\n    - {{api: 0x3A00, slot: 1, subslot: 1, index: 6, data: 'beef'}}\n"
    own += "    - {{api: 0x3A00, slot: 1, subslot: 1, index: 7, data: '01', on: other-*}}\n"
    (plan,) = plans(tmp_path, text=own)
    assert [(r.index, r.data.hex()) for r in plan.records] == [(5, "0500"), (6, "beef")]


def test_a_record_whose_default_cannot_be_put_together_is_given_as_a_whole(tmp_path):
    gsdml = describe_model(model("akd"))
    across = ParameterRef("BitArea", 0, bit_offset=6, bit_length=4, default="2", name="Mode")
    (dap,) = gsdml.daps
    head = replace(dap.submodules[0], records=(ParameterRecord(7, 2, refs=(across,)),))
    write(tmp_path, replace(gsdml, daps=(replace(dap, submodules=(head, *dap.submodules[1:])),)))
    with pytest.raises(ConfigError, match="of this one the whole record has to be given"):
        plans(tmp_path)
    text = FILE + "  records: [{{slot: 0, subslot: 1, index: 7, data: '80 01'}}]\n"
    (planned,) = plans(tmp_path, text=text)
    assert [(one.index, one.data) for one in planned.records] == [(7, b"\x80\x01")]


def test_a_device_without_an_address_gets_a_free_one(tmp_path):
    write(tmp_path)
    text = FILE.replace(", ip: 10.77.0.11/23", "") + "    - {{name: b, gsdml: drive.xml, ip: 10.77.0.1/23}}\n"
    assert [str(plan.ip) for plan in plans(tmp_path, text=text)] == ["10.77.0.2/23", "10.77.0.1/23"]
    with pytest.raises(ConfigError, match="device axis-01 has no ip and the controller has none"):
        plans(tmp_path, text=text.replace("  ip: 10.77.1.250/23\n", ""))


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        (", cycle: 8ms", r"device axis-01, .*drive\.xml: a cycle of 8 ms is too fast for the device; .* 16 ms"),
        (", dap: X", r"the file has no access point 'X', it has DAP"),
        (
            ", modules: {1: TELEGRAM_2}",
            r"slot 1 takes no module 'TELEGRAM_2', it takes TELEGRAM_0 \(.*\), TELEGRAM_1 \(",
        ),
        (", modules: {2: TELEGRAM_1}", r"slot 2 takes no module 'TELEGRAM_1'"),
        (", submodules: {1: {3: X}}", r"slot 1, subslot 3 takes no submodule 'X', it takes none at all"),
    ],
)
def test_what_the_device_cannot_do_is_reported_with_its_file(tmp_path, more, sentence):
    write(tmp_path)
    with pytest.raises(ConfigError, match=sentence):
        plans(tmp_path, more)


def test_a_configured_start_up_that_the_device_does_not_support_is_reported(tmp_path):
    gsdml = describe_model(model("akd"))
    (dap,) = gsdml.daps
    relations = replace(dap.relations, startup_modes=("Advanced",))
    only = replace(dap, interfaces=(replace(dap.interfaces[0], relations=relations),))
    write(tmp_path, replace(gsdml, daps=(only,)))
    assert plans(tmp_path)[0].startup == "advanced"
    with pytest.raises(ConfigError, match="does not support start-up legacy"):
        plans(tmp_path, text=FILE.replace("controller:\n", "controller:\n  startup: legacy\n"))


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (None, r"the GSDML file .*drive\.xml cannot be read: no such file"),
        ("<a/>", r"drive\.xml, line 1: the file's root is a, that of a GSDML file is ISO15745Profile"),
        ("<!DOCTYPE a><a/>", r"a document type is declared, GSDML files have none"),
    ],
)
def test_a_file_that_is_not_a_gsdml_file_is_reported(tmp_path, content, sentence):
    if content is not None:
        (tmp_path / "drive.xml").write_text(content)
    with pytest.raises(ConfigError, match=sentence):
        plans(tmp_path)


@pytest.mark.parametrize(
    ("text", "line", "sentence"),
    [
        (FILE.format(name="Axis_1", more=""), 6, "'Axis_1' is not a station name"),
        (FILE.format(name="plc", more=""), 6, "'plc' belongs to the controller already"),
        (FILE.format(name="a", more="") + "    - {name: a, gsdml: x}\n", 7, "'a' belongs to 'a' of"),
        (FILE.format(name="a", more="") + "    - {name: b, gsdml: x, ip: 10.77.0.11/23}\n", 7, "10.77.0.11 belongs to"),
        (FILE.format(name="a", more=", modules: {x: DI}"), 6, "'x' is not a slot or subslot"),
        (FILE.format(name="a", more=", module: 1"), 6, "devices[0].module: is not a key"),
        ("controller: {interface: eth9, devices: []}\n", 1, "drives: is missing"),
        ("farm: f\nlink: {kind: memory}\ncontroller: {devices: [{name: a, gsdml: x}]}\n", 1, "drives: is missing"),
    ],
)
def test_a_farm_file_with_wrong_devices_is_refused_with_its_line(text, line, sentence):
    with pytest.raises(FarmFileError) as caught:
        parse_farm(text)
    assert sentence in str(caught.value)
    assert line in {issue.line for issue in caught.value.issues}


def test_validate_counts_the_devices_by_their_kind_of_file():
    config = parse_farm(FILE.format(name="axis-01", more=""))
    assert summary(config) == "controller plc, 1 device by GSDML file"
    config = parse_farm("""
farm: mixed
link: {kind: veth, lines: {profibus: {pty: auto}}}
drives:
  - {name: net, model: akd-profinet, ip: 10.0.0.11/24}
  - {name: eip, model: akd-ethernetip, ip: 10.0.0.12/24}
  - {name: dp, model: moog-msd-dp, address: 5}
controller:
  name: plc
  profinet: {interface: eth8, ip: 10.0.0.1/24, devices: [{name: a, gsdml: a.xml, ip: 10.0.0.21/24}]}
  ethernetip:
    ip: 10.0.0.2/24
    interface: eth9
    devices: [{name: b, eds: b.eds, ip: 10.0.0.22/24}, {name: c, eds: c.eds, ip: 10.0.0.23/24}]
  profibus: {interface: eth7, devices: [{name: d, gsd: d.gsd, address: 9}]}
""")
    counted = summary(config)
    assert "on PROFINET, 1 device by GSDML file" in counted
    assert "on EtherNet/IP, 2 devices by EDS file" in counted
    assert "on PROFIBUS, 1 device by GSD file" in counted


def test_a_controller_of_devices_alone_finds_its_own_address_beside_theirs(tmp_path):
    write(tmp_path)
    text = FILE.replace("  ip: 10.77.1.250/23\n", "").format(name="axis-01", more="")
    plan = plan_controllers(parse_farm(text, tmp_path / "plc.pnfarm.yml"), [])[0].plan
    assert str(plan.ip) == "10.77.0.1/23"
