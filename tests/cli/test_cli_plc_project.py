"""``pnfarm plc --project``: the built-in controller configured by an engineering project, against its imported farm."""

import shutil

import pytest
from aml_project import HIWIN, ISLAND, at_system, attribute, drive, element, module, plc, project, slave, station
from cell_file import GSDML
from drive_object_gsdml import drive_object_gsdml
from farm_file import CONFIGS
from imported import importing
from l5x_project import connection
from l5x_project import module as l5x_module
from l5x_project import project as l5x_project
from project_line import running
from scapy.contrib.pnio_rpc import ExpectedSubmoduleBlockReq
from scapy.layers.dcerpc import DceRpc4
from scapy.layers.inet import IP, UDP
from scapy.utils import rdpcap

from pnfarm.buses.profinet.controller.plan import plan_devices
from pnfarm.buses.profinet.model_gsdml import describe_model
from pnfarm.cli.projects.plc import project_plc
from pnfarm.drives.catalogue import model
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import load_farm, parse_farm
from pnfarm.protocols.profinet.gsdml.writer import emit_gsdml

DI16, DO8, AI4, CARRIER = (f"GSD:{ISLAND}/M/{name}" for name in ("DI16", "DO8", "AI4", "CARRIER"))
RPC_PORT = 34964


@pytest.fixture
def folder(tmp_path):
    shutil.copy(GSDML, tmp_path)
    (tmp_path / HIWIN).write_text(emit_gsdml(describe_model(model("hiwin-e1"))))
    shutil.copy(CONFIGS / "gsd" / "EXMP1D01.gsd", tmp_path)
    return tmp_path


def expected(capture):
    """The submodules of each Connect's ExpectedSubmoduleBlocks, by the address that it went to, as Scapy reads them."""
    found = {}
    for frame in rdpcap(str(capture)):
        if UDP not in frame or frame[UDP].dport != RPC_PORT:
            continue
        call = DceRpc4(bytes(frame[UDP].payload))
        for block in getattr(call.payload, "blocks", ()):
            for api in block.APIs if isinstance(block, ExpectedSubmoduleBlockReq) else ():
                found.setdefault(frame[IP].dst, {}).update({
                    (api.API, api.SlotNumber, one.SubslotNumber): (
                        api.ModuleIdentNumber, one.SubmoduleIdentNumber,
                        {(int(data.DataDescription), data.SubmoduleDataLength) for data in one.DataDescription},
                    )
                    for one in api.Submodules
                })  # fmt: skip
    return found


def states(controllers):
    """Of each station: its state, and what stands in its way."""
    return {
        row["name"]: (row["state"], row["last_reason"], row.get("alarms_received", 0), row.get("unusable", []))
        for row in controllers.snapshot()
    }


def island(name, ip, *modules, dap="DAP 1"):
    return station(name, ip, f"GSD:{ISLAND}/DAP/{dap}", *modules, kind=f"GSD:{ISLAND}/D")


def telegram(number):
    """The ID of a telegram's module, its ident, and ident, octets of inputs and outputs of each submodule."""
    document, wanted = describe_model(model("hiwin-e1")), model("hiwin-e1").profidrive.telegrams[number].module.ident
    item = next(one for one in document.modules if one.ident == wanted)
    return item.id, item.ident, [(one.ident, one.input_octets, one.output_octets) for one in item.submodules]


#: Of the island's access point, by its file: the head, its interface and two ports.
HEAD = {(0, 0, 1): (1, 1), (0, 0, 0x8000): (1, 0x100), (0, 0, 0x8001): (1, 0x200), (0, 0, 0x8002): (1, 0x200)}

CARRIED = {
    (0, 2, 1): (0x10, 0x11), (0, 4, 1): (0x70, 0x71), (0, 4, 3): (0x70, 0x93), (0, 4, 5): (0x70, 0x92),
}  # fmt: skip


def test_every_device_of_a_project_exchanges_data_and_is_expected_as_the_project_says(pnfarm, folder):
    parts = "".join(
        element(f"part {place}", role="DeviceItem", TypeIdentifier=f"GSD:{ISLAND}/SM/{name}", PositionNumber=place - 1)
        for place, name in ((3, "PLUG_IO8"), (5, "PLUG_OUT4"))
    )
    number, ident, submodules = telegram(111)
    head = describe_model(model("hiwin-e1")).daps[0].id
    _, farm = importing(pnfarm, folder / "line.aml", project)(
        plc(),
        island("island_1", "10.7.0.41", module(1, DI16), module(2, DO8), module(3, AI4)),
        island("Island 2", "10.7.0.42", module(2, DI16), module(4, CARRIER, inside=parts)),
        drive("axis-1", "10.7.0.11", dap=head, module=("Telegram 111", number)),
        links=[at_system("island_1-if"), at_system("Island 2-if")],
    )
    with running(folder / "line.aml", farm, watchdog_factor=5) as (controllers, found, capture):
        assert found.remarks == []
        assert states(controllers) == dict.fromkeys(("islandxb140bf", "islandxa2b1ff", "axis-1"), ("DATA", "", 0, []))
        assert {row["cycle_seconds"] for row in controllers.snapshot()} == {0.002}
        (section,) = found.config.controllers
        assert (section.name, str(section.ip), section.watchdog_factor) == ("plc-1", "10.7.0.1/24", 5)
        asked = expected(capture)
    idents = {ip: {place: one[:2] for place, one in found.items()} for ip, found in asked.items()}
    assert idents["10.7.0.41"] == HEAD | {(0, 1, 1): (0x10, 0x11), (0, 2, 1): (0x20, 0x21), (0, 3, 1): (0x30, 0x31)}
    assert idents["10.7.0.42"] == HEAD | CARRIED
    data = {place: one[2] for place, one in asked["10.7.0.41"].items() if place[1]}
    assert data == {(0, 1, 1): {(1, 2)}, (0, 2, 1): {(2, 1)}, (0, 3, 1): {(1, 8)}}
    own = {place: one for place, one in asked["10.7.0.11"].items() if place[1]}
    assert list(own.values()) == [
        (ident, submodule, {(1, inputs)} | ({(2, outputs)} if outputs else set()))
        for submodule, inputs, outputs in submodules
    ]


def test_a_drive_whose_servo_is_built_in_is_run_with_its_telegram_its_head_s_name_and_the_records_of_its_file(
    pnfarm, tmp_path
):
    name = "GSDML-V2.43-MAKER-DRIVES-20260101.XML"
    text = drive_object_gsdml().replace('"SERVO" AllowedInSlots="1..6"', '"SERVO" AllowedInSlots="1" FixedInSlots="1"')
    record = '<ParameterRecordDataItem Index="1051" Length="1"><Name TextId="Info"/><Const Data="0x00"/>'
    at = text.index("<IOData/>", text.index('ID="Full_1"')) + len("<IOData/>")
    records = f"<RecordDataList>{record}</ParameterRecordDataItem></RecordDataList>"
    (tmp_path / name).write_text(text[:at] + records + text[at:])
    telegram = element("telegram", role="DeviceItem", TypeIdentifier=f"GSD:{name}/SM/S_T111", PositionNumber=2)
    servo = module(1, f"GSD:{name}/DAP/Full#BUILTIN", inside=telegram)
    own = station("Axis_1", "10.7.0.21", f"GSD:{name}/DAP/Full", servo, kind=f"GSD:{name}/D")
    # as TIA Portal writes a station whose name it makes itself
    own = own.replace(attribute("ProfinetDeviceName", "Axis_1"), "")
    file = tmp_path / "line.aml"
    _, farm = importing(pnfarm, file, project)(plc(), own)
    (group,) = load_farm(farm).drives
    assert (group.name, group.model, group.telegram) == ("axisxb19e54", "profidrive", 111)
    with running(file, farm) as (controllers, found, capture):
        assert found.remarks == []
        assert states(controllers) == {"axisxb19e54": ("DATA", "", 0, [])}
        assert expected(capture)["10.7.0.21"][0x3A00, 1, 3][0] == 0x010000B0


def refusals(file, **options):
    """What the command does not run."""
    with project_plc(file, [file.parent], interface="eth1", **options) as found:
        return found.remarks


def test_a_station_that_cannot_be_as_the_project_says_is_not_run_and_the_others_are(folder):
    file = folder / "line.aml"
    file.write_text(
        project(
            plc(),
            island("whole", "10.7.0.41", module(1, DI16)),
            island("other-module", "10.7.0.42", module(1, DI16.replace("DI16", "DI99"))),
            island("other-head", "10.7.0.43", dap="DAP 9"),
            drive("no-file", "10.7.0.11", file="GSDML-V2.3-MAKER-AXIS-20200101.XML"),
        )
    )
    assert refusals(file) == [
        "other-module is not run: slot 1: the file has no module 'DI99' there, which the project plugs",
        "other-head is not run: GSDML-V2.35-Example-Island-20261127.xml has no access point 'DAP 9'",
        "no-file is not run: GSDML-V2.3-MAKER-AXIS-20200101.XML was not found",
    ]


def test_of_several_plcs_the_named_one_runs_its_own_stations(folder):
    file = folder / "line.aml"
    links = [at_system("island-1-if"), at_system("island-2-if", "other")]
    plcs = plc(), plc("PLC_2", "10.7.0.2", system="other")
    file.write_text(project(*plcs, island("island-1", "10.7.0.41"), island("island-2", "10.7.0.42"), links=links))
    with pytest.raises(ConfigError, match="has several PLCs: give --plc; its PLCs are 'PLC_1', 'PLC_2'"):
        refusals(file)
    with pytest.raises(ConfigError, match="has no PLC 'PLC_3'; its PLCs are 'PLC_1', 'PLC_2'"):
        refusals(file, plc="PLC_3")
    with project_plc(file, [folder], interface="eth1", plc="PLC_2") as found:
        (section,) = found.config.controllers
        assert ([one.name for one in section.devices], str(section.ip)) == (["island-2"], "10.7.0.2/24")


def test_slaves_of_a_project_exchange_data_with_the_modules_of_the_project(pnfarm, folder):
    name = "EXMP1D01.GSD"
    parts = [module(slot, f"GSD:{name}/M/{number}", name=f"module {number}") for slot, number in ((1, 2), (2, 1))]
    file = folder / "line.aml"
    _, farm = importing(pnfarm, file, project)(plc(), slave("One", 5, name, *parts), slave("Two", 6, name, *parts))
    with running(file, farm, line="/tmp/line") as (controllers, found, _):
        assert found.remarks == []
        assert states(controllers) == dict.fromkeys(("one", "two"), ("data-exchange", "", 0, []))
        assert [(one.address, one.modules) for one in found.config.controller.devices] == [(5, [2, 1]), (6, [2, 1])]


def test_without_a_way_to_it_a_line_is_not_run(folder):
    file = folder / "line.aml"
    file.write_text(project(plc(), island("island-1", "10.7.0.41"), slave("One", 5, "EXMP1D01.GSD")))
    assert refusals(file) == ["1 on PROFIBUS not run: give --line"]
    with project_plc(file, [folder], line="/tmp/line") as found:
        assert found.remarks == ["1 on PROFINET not run: give --interface"]


def test_modules_of_a_studio_5000_project_exchange_data_by_the_project_s_connections(pnfarm, folder):
    path = "20 04 24 a6 2c 6b 2d 00 56 03"
    camera = connection(
        100, 64, kind="StandardDataDriven", ConnectionPath=path, InputCxnPoint=None, OutputCxnPoint=None, RPI=20000
    )
    file = folder / "line.L5X"
    _, farm = importing(pnfarm, file, l5x_project)(
        l5x_module("Valves", "192.168.1.20", connection(10, 4)),
        l5x_module("Camera", "192.168.1.21", camera, CatalogNumber="CAM-1", Vendor=678, ProductType=43, Major=3),
    )
    with running(file, farm) as (controllers, found, _):
        assert found.remarks == []
        assert states(controllers) == dict.fromkeys(("valves", "camera"), ("DATA", "", 0, []))
        assert [row["cycle_seconds"] for row in controllers.snapshot()] == [0.01, 0.02]


def test_a_module_without_a_connection_is_not_run(folder):
    file = folder / "line.L5X"
    file.write_text(
        l5x_project(l5x_module("Valves", "192.168.1.20", connection()), l5x_module("Switch", "192.168.1.21"))
    )
    assert refusals(file) == ["Switch is not run: the project has no connection with its data"]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ((), "is required with --project"),
        (("--interface", "eth9", "--device", "x"), "needs --gsdml and nothing else"),
        (("--interface", "eth9", "--plc", "PLC_9"), "the project has no PLC 'PLC_9'; its PLCs are 'PLC_1'"),
        (("--interface", "eth9", "--cycle", "3ms"), "3ms is not a PROFINET cycle"),
        (("--line", "host:99999"), "is not like HOST:PORT"),
        (("--interface", "eth9", "--ip", "10.7.0.999/24"), "10.7.0.999"),
    ],
)
def test_options_that_do_not_fit_a_project_are_bad_input(pnfarm, folder, arguments, sentence):
    file = folder / "line.aml"
    file.write_text(project(plc(), island("island-1", "10.7.0.41"), slave("One", 5, "EXMP1D01.GSD")))
    done = pnfarm("plc", "--project", file, *arguments)
    assert (done.code, done.out, sentence in done.err) == (2, "", True)


def test_a_project_without_a_station_that_can_be_run_is_refused(pnfarm, tmp_path):
    file = tmp_path / "line.aml"
    file.write_text(project(plc(), island("island-1", "10.7.0.41")))
    done = pnfarm("plc", "--project", file, "--interface", "eth9")
    assert (done.code, f"{ISLAND} was not found" in done.err) == (2, True)
    assert "has no station to run" in done.err


@pytest.mark.parametrize(
    ("clocks", "interval", "clock", "own"),
    [("32", 32, (32, 16), 2), ("64 128", 64, (64, 8), 2), ("32 64 128", 4096, (32, 128), 128)],
)
def test_a_device_s_usual_cycle_is_one_that_it_can_do(folder, clocks, interval, clock, own):
    text = GSDML.read_text().replace('SendClock="32 64 128"', f'SendClock="{clocks}"')
    (folder / GSDML.name).write_text(text.replace('MinDeviceInterval="32"', f'MinDeviceInterval="{interval}"'))
    section = (
        f"ip: 10.7.0.1/24, interface: eth1, devices: [{{name: a, gsdml: {GSDML.name}, dap: DAP 1, ip: 10.7.0.2/24}}]"
    )
    config = parse_farm(f"controller: {{{section}}}", folder / "any.pnfarm.yml")
    (plan,) = plan_devices(config.controller, [], [], folder)
    assert (plan.send_clock_factor, plan.reduction_ratio) == clock
    file = folder / "line.aml"
    file.write_text(project(plc(), island("island-1", "10.7.0.41", module(1, DI16))))
    with project_plc(file, [folder], interface="eth1") as found:
        assert found.config.controller.devices[0].cycle_ns == own * 1_000_000


@pytest.mark.parametrize("count", [10, 400])
def test_a_generic_module_with_a_configuration_is_run_with_as_many_of_its_400_octets_as_count(folder, count):
    octets = [-100 - one % 28 for one in range(count)] + [0] * (400 - count)
    lines = (",".join(map(str, octets[at : at + 80])) for at in range(0, 400, 80))
    data = "\n\t\t,".join(lines)
    configuration = f"[{count + 4},1,[{data}]]"
    file = folder / "line.L5X"
    file.write_text(l5x_project(l5x_module("Valves", "192.168.1.20", connection(), configuration=configuration)))
    with project_plc(file, [folder], interface="eth1") as found:
        assert found.remarks == []
        (device,) = found.config.controller.devices
        assert device.configuration == bytes(one % 256 for one in octets[:count])
