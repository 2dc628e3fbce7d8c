"""Devices of a farm by the example EDS file: with the built-in scanner, and with a peer that asks for anything."""

import asyncio
import struct

import pytest
from device_cell import CONFIGS, HEAD, Cell, parse
from peer import Rig, io_path

import pnfarm
from pnfarm.buses.ethernetip.described.parameters import ParameterValues, objects_at_paths
from pnfarm.cli.farm_file import described
from pnfarm.farm.file.reading import FarmFileError, expand_devices, parse_farm
from pnfarm.protocols.enip.eds.reader import parse_sheet
from pnfarm.protocols.enip.originator_events import ConnectionMade, ConnectionNotMade
from pnfarm.protocols.enip.status import Service
from pnfarm.protocols.enip.wire.epath import DataSegment, ElectronicKey, emit_epath, logical_path
from pnfarm.protocols.enip.wire.forward_open import ConnectionType, NetworkParameters, TransportClass
from pnfarm.signals.refusal import SignalError

EDS = "eds/Example-Weigher-20261128.eds"
ONE = f"""devices:
  - name: weigher
    eds: {EDS}
    ip: 10.77.0.61/23
    parameters: {{Filter: slow, Window: 75}}
    signals:
      gate: 101.1.8.0
      target: {{at: 101.1.4, type: int32, unit: kg, scale: 0.001}}
      status: {{at: 102.1.0, type: uint16, order: big}}
"""
CONTROLLER = "controller: {name: plc, ip: 10.77.1.250/23, reconnect: {after: 300ms}%s}\n"


class Scanned(Cell):
    """A farm from the text of its file, with its scanner."""

    tail = CONTROLLER
    usual = "weigher"

    def __init__(self, text=ONE, controller=""):
        super().__init__(text, controller)
        self.station = self.farm.station("weigher")

    def sent(self, octets):
        self.plc.put_outputs("weigher", octets)
        self.world.run(0.1)

    @property
    def inputs(self):
        return self.plc.inputs("weigher")


# -- with the built-in scanner -----------------------------------------------------------------------------------------


def test_a_device_exchanges_the_members_of_its_assemblies_by_name():
    cell = Scanned()
    cell.connect()
    assert cell.inputs == bytes(8) + struct.pack("<f", 21.5), "defaults of the file are there from the start"
    cell.signals().set({"slot102_stable": True, "slot102_ready": True, "slot102_weight": -12.345})
    cell.sent(bytes([2, 0, 0, 0]) + struct.pack("<i", 4500) + b"\x05")
    assert cell.inputs[:8] == bytes([0x01, 0x80, 0, 0]) + struct.pack("<i", -12345)
    found = cell.signals().get_all()
    assert (found["slot101_tare"], found["slot101_zero"], found["target"]) == (False, True, 4.5)
    assert [found[name] for name in ("gate", "slot101_gate", "slot101_recipe_1")] == [True, True, True]
    assert found["status"] == 0x0180, "its order of octets is the farm file's"
    assert cell.signals().good("gate")
    (row,) = cell.plc.snapshot()
    assert (row["state"], row["losses"], row["connection"]) == ("DATA", 0, "exclusive-owner")
    assert row["identification"]["name"] == "EX-WGH Weigher"


def test_parameters_of_the_farm_file_go_with_forward_open_and_are_in_the_device():
    cell = Scanned()
    cell.connect()
    (session,) = cell.plc.sessions
    assert session.opened.path.endswith(emit_epath([DataSegment(bytes([2, 75, 0, 0]))]))
    assert [cell.device().kind.values.read(cell.device().kind.values.rows[n]) for n in (5, 6)] == [b"\2", b"\x4b\0"]


def test_outputs_are_bad_while_the_scanner_is_idle_and_when_it_is_gone():
    cell = Scanned()
    cell.connect()
    cell.sent(b"\x01")
    assert cell.signals().get("slot101_tare")
    cell.plc.set_mode(run=False)
    cell.sent(b"\x02")
    assert not cell.signals().good("gate")
    assert cell.signals().get("slot101_tare"), "they keep what came in run mode"
    cell.plc.set_mode(run=True)
    cell.world.run(0.1)
    assert (cell.signals().good("gate"), cell.signals().get("slot101_zero")) == (True, True)
    cell.plc.release(cell.world.now)
    cell.world.run(1.0)
    assert (cell.signals().good("gate"), cell.signals().get("slot101_zero")) == (False, True)


@pytest.mark.parametrize(
    ("keys", "inputs", "first", "behind"),
    [
        ("connection: Input only", 12, 1, b""),
        ("connection: 4", 16, 2, b"\2\2"),
        ("connection: Log, sizes: {inputs: 40}", 40, 2, b"\2\2"),
        ("connection: Connection5", 20, 0, b"\4\3"),
    ],
)
def test_any_connection_of_the_file_can_be_chosen_with_a_size_that_it_allows(keys, inputs, first, behind):
    cell = Scanned(f"devices:\n  - {{name: weigher, eds: {EDS}, ip: 10.77.0.61/23, {keys}}}\n")
    cell.connect()
    assert len(cell.inputs) == inputs
    cell.signals().set({"slot102_stable": True, "slot103_inputs": bytes([2] * 64), "slot104_weighings": 0x304})
    cell.world.run(0.1)
    assert cell.inputs[0] == first
    assert cell.inputs[12:14] == behind


def test_a_listener_gets_the_data_of_the_owner_s_connection():
    text = ONE + CONTROLLER % ", multicast: true"
    rig = Rig(HEAD + text.replace(EDS, str(CONFIGS / EDS)), peers=1)
    rig.world.run(5.0, until=lambda: rig.line.plc.all_connected)
    rig.peer.connect("10.77.0.61")
    made = rig.peer.open(path=io_path(194, 102), o_size=2, t_size=14, multicast=True)
    assert isinstance(made, ConnectionMade)
    rig.farm.station("weigher").signals.set({"slot102_weight": 1.0})
    rig.world.run(0.1)
    assert rig.peer.response[4:8] == struct.pack("<i", 1000)
    alone = rig.peer.open(path=io_path(194, 102), o_size=2, t_size=14)
    assert alone.reply.extended == (0x0124,), "it sends to a group alone"


def test_a_power_cycle_keeps_inputs_and_loses_written_parameters():
    cell = Scanned()
    cell.connect()
    cell.signals().set({"slot102_weight": 2.0})
    asked = cell.plc.set_attribute("weigher", 0x0F, 6, 1, b"\x10\0", cell.world.now)
    cell.world.run(0.1)
    assert asked.done
    window = cell.device().kind.values.rows[6]
    assert cell.device().kind.values.read(window) == b"\x10\0"
    cell.station.power_cycle(cell.world.now)
    cell.farm.settle(cell.station, cell.world.now)
    assert cell.device().kind.values.read(window) == b"\x4b\0"
    cell.connect()
    assert cell.inputs[4:8] == struct.pack("<i", 2000)


def test_faults_that_need_no_servo_act_on_a_device():
    cell = Scanned()
    cell.connect()

    def losses(kind, **params):
        one = cell.farm.injections.inject({"kind": kind, "on": ["model:EX-WGH-1"], **params}, cell.world.now)
        before = cell.plc.sessions[0].measures.losses
        cell.world.run(2.0)
        if one in cell.farm.injections.active():
            cell.farm.injections.clear(one.id, cell.world.now)
        cell.connect()
        return cell.plc.sessions[0].measures.losses - before

    assert losses("power-cycle", params={"off": "1s"}) == 1
    for kind in ("silence", "link-down", "ar-abort", "wrong-connection-id", "mac-change"):
        assert losses(kind, **{"for": "1s"} if kind != "ar-abort" else {}) == 1, kind
    cell.farm.injections.inject(
        {"kind": "signal-stuck", "on": ["weigher"], "params": {"signal": "slot102_weight", "value": 7}}, cell.world.now
    )
    cell.world.run(0.1)
    assert cell.inputs[4:8] == struct.pack("<i", 7000)
    identity = {"kind": "identity-change", "on": ["weigher"], "params": {"product_code": 99}}
    cell.farm.injections.inject(identity, cell.world.now)
    assert cell.device().identity.product_code == 99


def test_drives_and_devices_share_a_farm_and_a_scanner():
    drives = "drives:\n  - {name: axis-1, model: akd-ethernetip, ip: 10.77.0.11/23}\n"
    cell = Scanned(drives + ONE, ", program: {kind: constant, speed_rpm: 60}")
    cell.connect()
    assert cell.world.run(5.0, until=lambda: cell.plc.all_running)
    cell.sent(b"\x01")
    assert cell.signals().get("slot101_tare")
    assert [row["name"] for row in cell.plc.snapshot()] == ["axis-1", "weigher"]


def test_a_scenario_writes_the_inputs_of_a_device(tmp_path):
    path = tmp_path / "one.scenario.yml"
    path.write_text("scenario: one\nsteps:\n  - set: {weigher.slot102_weight: 3.25, weigher.slot102_ready: on}\n")
    farm = pnfarm.Farm.from_text(HEAD + ONE.replace(EDS, str(CONFIGS / EDS)) + CONTROLLER % "", virtual=True)

    async def work():
        async with farm:
            await farm.wait_connected()
            assert (await farm.run_scenario(path)).passed
            return farm.device("weigher").signals["slot102_weight"], farm.device("weigher").connected

    assert asyncio.run(work()) == (3.25, True)


# -- with a peer -------------------------------------------------------------------------------------------------------


def with_peers():
    made = Rig(HEAD + ONE.replace(EDS, str(CONFIGS / EDS)), peers=2)
    for peer in made.peers:
        peer.connect("10.77.0.61")
    return made


@pytest.fixture
def rig():
    return with_peers()


@pytest.fixture(scope="module")
def refusing():
    """One that none of its requests changes."""
    return with_peers()


CONFIGURATION = emit_epath([DataSegment(bytes([1, 50, 0, 0]))])
OWNER = {"path": io_path() + CONFIGURATION, "o_size": 15, "t_size": 14}


def key(**numbers):
    return {"path": emit_epath([ElectronicKey(**numbers)]) + io_path() + CONFIGURATION}


@pytest.mark.parametrize(
    ("changes", "extended"),
    [
        ({"o_size": 16}, (0x0127, 15)),
        ({"t_size": 12}, (0x0128, 14)),
        ({"path": io_path()}, (0x0126, 3)),
        ({"path": io_path() + emit_epath([DataSegment(bytes(6))])}, (0x0126, 3)),
        ({"path": io_path(configuration=99) + CONFIGURATION}, (0x0129,)),
        ({"path": io_path(consumed=99) + CONFIGURATION}, (0x012A,)),
        ({"path": io_path(produced=99) + CONFIGURATION}, (0x012B,)),
        ({"path": b"\x20\x04\x24\x64\xe0\x00"}, (0x0315,)),
        ({"o_to_t_rpi_us": 1_000}, (0x0111,)),
        ({"t_to_o_rpi_us": 2_000_000}, (0x0111,)),
        ({"transport": TransportClass(1, 2)}, (0x0103,)),
        ({"transport": TransportClass(0)}, (0x0103,)),
        ({"o_to_t": NetworkParameters(15, ConnectionType.POINT_TO_POINT, variable=True)}, (0x011F,)),
        ({"t_to_o": NetworkParameters(14, ConnectionType.POINT_TO_POINT, variable=True)}, (0x0120,)),
        ({"path": io_path(195, 103, None), "o_size": 2, "t_size": 2 + 4 + 65}, (0x0128, 70)),
        (key(vendor_id=1), (0x0114,)),
        (key(product_code=18), (0x0114,)),
        (key(device_type=12), (0x0115,)),
        (key(major_revision=3), (0x0116,)),
    ],
)
def test_a_forward_open_that_the_file_does_not_allow_is_refused_with_its_status(refusing, changes, extended):
    made = refusing.peer.open(**OWNER | changes)
    assert isinstance(made, ConnectionNotMade)
    assert (made.reply.status, made.reply.extended) == (1, extended)


def test_configuration_that_the_file_does_not_allow_is_refused_with_its_place_and_changes_nothing(rig):
    wrong = emit_epath([DataSegment(bytes([0, 0, 0, 0]))])
    made = rig.peer.open(**OWNER | {"path": io_path() + wrong})
    assert (made.reply.status, made.reply.extended) == (9, (1,)), "the window is octet 1"
    assert rig.peer.get(0x0F, 5, 1).data == b"\2"


def test_an_owner_keeps_others_out_but_not_those_that_only_read(rig):
    assert isinstance(rig.peer.open(**OWNER, transport=TransportClass(1, 1)), ConnectionMade), "change of state"
    first, second = rig.peers
    assert second.open(**OWNER).reply.extended == (0x0106,)
    assert second.open(path=io_path(194, 102), o_size=2, t_size=14, multicast=True).reply.extended == (0x0119,)
    assert isinstance(second.open(path=io_path(193, 102), o_size=2, t_size=14), ConnectionMade)
    rig.peer.command(bytes([1]))
    rig.world.run(0.1)
    station = rig.farm.station("weigher")
    assert station.signals.get("slot101_tare")
    asked = first.asked(**OWNER)
    first._serial -= 1
    first.silence(1)
    rig.world.run(1.0)
    assert not station.signals.good("slot101_tare")
    assert isinstance(second.open(**OWNER), ConnectionMade), "the silent owner has lost its place"
    assert asked.triad.serial == 2


def test_a_variable_size_is_what_the_originator_asks_for_and_has_a_header_where_the_file_has_one(rig):
    rig.peer.modeless = True
    path = io_path(195, 103, None)
    made = rig.peer.open(path=path, o_size=2, t_size=2 + 4 + 10)
    assert isinstance(made, ConnectionMade)
    rig.farm.station("weigher").signals.set({"slot103_inputs": bytes(range(64))})
    rig.world.run(0.1)
    assert rig.peer.response[:14] == b"\1\0\0\0" + bytes(range(10))
    variable = NetworkParameters(2 + 4 + 64, ConnectionType.POINT_TO_POINT, variable=True)
    assert isinstance(rig.peers[1].open(path=path, o_size=2, t_to_o=variable), ConnectionMade)


def test_objects_have_what_the_file_says(rig):
    peer = rig.peer
    assert peer.get(1, 1, 1).data == (65534).to_bytes(2, "little")
    assert peer.get(1, 1, 7).data == b"\x0eEX-WGH Weigher"
    assert peer.get(4, 102, 4).data == b"\x0c\0"
    assert peer.get(4, 102, 3).data == bytes(8) + struct.pack("<f", 21.5)
    assert peer.get(4, 100, 3).data == bytes([2, 75, 0])
    assert peer.get(0x0F, 0, 2).data == b"\x0d\0"
    assert [peer.get(0x0F, 1, number).data for number in (2, 3, 4, 5, 6)] == [
        b"\6", bytes.fromhex("206424013001"), b"\x14\0", b"\xc4", b"\4",
    ]  # fmt: skip
    assert peer.get(0x0F, 1, 7).data == b"\6Weight"
    assert peer.get(0x0F, 1, 10).data == struct.pack("<i", -100_000)
    assert peer.ask(0x4B, logical_path(0x0F, 5), b"\1\0").data == b"\4fast"
    assert peer.ask(Service.GET_ATTRIBUTES_ALL, logical_path(0x0F, 6)).data[:2] == b"\x4b\0"
    rig.farm.station("weigher").signals.set({"slot102_weight": 1.5})
    assert peer.get(0x64, 1, 1).data == peer.get(0x0F, 1, 1).data == struct.pack("<i", 1500)
    assert peer.get(0xF6, 1, 10).data == b"\6Port 1"


def test_a_class_with_an_instance_of_32_bits_answers_for_its_highest_instance():
    text = b'[Device] VendCode = 1; [Params] Param1 = 0,,"20 64 26 00 00 00 01 00 30 01",0,0xC7,2,X;'
    values = ParameterValues(parse_sheet(text).parameters, lambda one: one.encode(one.default), {}, strict=True)
    (found,) = objects_at_paths(values)
    assert found.get(0, 2).data == b"\xff\xff"


def test_a_parameter_is_written_at_its_path_by_the_object_and_by_the_assembly_and_wrong_values_are_refused(rig):
    peer = rig.peer
    assert peer.set(0x64, 1, 5, b"\0").status == 0
    assert peer.get(0x0F, 5, 1).data == b"\0"
    assert peer.set(0x0F, 6, 1, b"\x10\x27").status == 9
    assert peer.set(0x0F, 6, 1, b"\1").status == 0x13
    assert peer.set(0x0F, 1, 1, bytes(4)).status == 0x0E
    assert peer.set(4, 100, 3, bytes([1, 7, 0])).status == 0
    assert peer.get(0x64, 1, 6).data == b"\7\0"
    assert peer.set(4, 100, 3, bytes(3)).status == 9
    assert peer.set(4, 101, 3, bytes(9)).status == 0x0E


def test_with_lax_limits_intervals_and_values_of_the_file_do_not_count():
    rig = Rig(HEAD + ONE.replace(EDS, f"{CONFIGS / EDS}\n    limits: lax"))
    rig.peer.connect("10.77.0.61")
    wrong = emit_epath([DataSegment(bytes([9, 0, 0, 0]))])
    made = rig.peer.open(**OWNER | {"path": io_path() + wrong, "o_to_t_rpi_us": 1_000})
    assert isinstance(made, ConnectionMade)
    assert rig.peer.get(0x0F, 5, 1).data == b"\x09"


# -- the farm file -----------------------------------------------------------------------------------------------------


def test_what_was_taken_is_said():
    *_, left_out = sentences = list(described(parse(HEAD + ONE)))
    chosen = "Connection1: Exclusive owner, of 5 that controllers may open"
    assert sentences[0] == f"weigher: EX-WGH Weigher (EX-WGH-1), {chosen}"
    assert sentences[1].startswith("weigher: 12 octets of inputs, 9 of outputs, 3 of configuration, 24 signals")
    assert left_out.startswith("weigher: Connection6 is not offered: the real-time format 1")


def test_devices_count_up():
    text = HEAD + f"devices:\n  - {{name: 'w-{{n:02}}', count: 3, eds: {EDS}, ip: 10.77.0.9/24}}\n"
    devices = expand_devices(parse(text))
    assert [(device.name, str(device.ip)) for device in devices][2] == ("w-03", "10.77.0.11/24")
    assert len({device.mac for device in devices}) == 3


@pytest.mark.parametrize(
    ("before", "after", "field", "text"),
    [
        (EDS, "eds/none.eds", "eds", "cannot be read: no such file"),
        (EDS, "cell.pnfarm.yml", "eds", "line 1: no section before '#'"),
        (
            "ip: 10",
            "connection: Owner\n    ip: 10",
            "connection",
            "there is no connection 'Owner' of class 1",
        ),
        ("ip: 10", "connection: 6\n    ip: 10", "connection", "Connection6 cannot be offered"),
        ("ip: 10", "sizes: {inputs: 13}\n    ip: 10", "sizes.inputs", "13 octets are not possible"),
        ("ip: 10", "rpi: 1ms\n    ip: 10", "rpi", "1ms is outside of what its file allows"),
        ("Filter: slow", "Filter: slo", "parameters.Filter", "did you mean slow"),
        ("Filter: slow", "Filtr: slow", "parameters.Filtr", "did you mean"),
        ("Window: 75", "Window: 5001", "parameters.Window", "above 5000"),
        ("101.1.8.0", "101.1.9.0", "signals.gate", "has 9 octets of outputs"),
        ("101.1.8.0", "101.2.8.0", "signals.gate", "101.2 is no assembly with cyclic data"),
        ("    ip: 10.77.0.61/23\n", "", "ip", "a device on EtherNet/IP needs an address"),
        ("name: weigher", "name: we igher", "name", "is not a host name"),
        ("ip: 10", "slots: {1: x}\n    ip: 10", "slots", "is not a key here"),
    ],
)
def test_what_is_wrong_in_devices_is_told_with_its_place(before, after, field, text):
    with pytest.raises(FarmFileError) as failed:
        parse(HEAD + ONE.replace(before, after, 1))
    issues = [(issue.field, issue.line, f"{issue.what}; {issue.allowed}") for issue in failed.value.issues]
    assert any(place == f"devices[0].{field}" and text in what and line > 0 for place, line, what in issues), issues


def test_a_file_of_a_device_on_another_network_is_refused(tmp_path):
    text = (CONFIGS / EDS).read_text().replace("Class1 = EtherNetIP", "Class1 = DeviceNet")
    (tmp_path / "other.eds").write_text(text)
    with pytest.raises(FarmFileError, match="describes a device on DeviceNet"):
        parse_farm(HEAD + ONE.replace(EDS, "other.eds"), tmp_path / "farm.yml")


def test_an_interval_of_the_scanner_that_the_file_does_not_allow_is_refused():
    with pytest.raises(Exception, match="does not allow a packet interval of 1ms, but 2ms to 1s"):
        Scanned(ONE, ", rpi: 1ms")


def test_an_output_is_not_written_by_a_user():
    with pytest.raises(SignalError, match="is an output"):
        Scanned().signals().set({"gate": True})
