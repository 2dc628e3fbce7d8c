"""``pnfarm import`` of a plant's start as taps and mirror ports have it: restarts, VLANs, fragments, several files."""

import tracemalloc
from dataclasses import replace
from ipaddress import IPv4Address
from uuid import UUID

import pytest
import yaml
from cip_tape import MANAGER, Tape, connect, forward_open
from edited_capture import in_fragments, tagged
from imported import check_found, comments
from recorded import record, write_frames
from seen_stations import ADDRESS, DEVICE, HEAD, ISLAND, PLC, SECOND, SeenPlant

from pnfarm.buses import registry
from pnfarm.buses.ethernetip.bus import ETHERNETIP
from pnfarm.buses.profibus.bus import PROFIBUS
from pnfarm.buses.profinet.bus import PROFINET
from pnfarm.buses.profinet.decode.shared import Call
from pnfarm.captures.packet import Packet
from pnfarm.captures.reading import CapturedFrame, FrameReader
from pnfarm.protocols.enip.status import Service
from pnfarm.protocols.enip.wire.cpf import emit_items
from pnfarm.protocols.enip.wire.encapsulation import Command, EncapsulationPdu, emit_encapsulation
from pnfarm.protocols.enip.wire.forward_open import NetworkParameters, emit_forward_open
from pnfarm.protocols.enip.wire.identity import IdentityItem
from pnfarm.protocols.enip.wire.message import message_request
from pnfarm.protocols.profibus.wire.dp import Parameters, PrmStatus
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml
from pnfarm.protocols.profinet.rpc.fragments import Reassembly
from pnfarm.protocols.profinet.wire.dcp import blocks as dcp
from pnfarm.protocols.profinet.wire.records.iod import IodWriteReqHeader, RecordWrite, WriteRequest
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    RPC_PORT,
    UUID_PNIO_DEVICE,
    Opnum,
    PacketType,
    PnioStatus,
    ResponseArgs,
    RpcPdu,
    emit_response_args,
    emit_rpc,
    object_uuid,
)
from pnfarm.wire.ethernet import ETHERTYPE_IPV4, parse_ethernet
from pnfarm.wire.ipv4 import PROTOCOL_UDP, Ipv4Packet, emit_ipv4
from pnfarm.wire.udp import UdpDatagram, emit_udp

PLC_ADDRESS = IPv4Address("10.77.0.1")
PLANT = """
farm: plant
link: {kind: memory}
drives:
  - {name: infeed, model: akd-profinet, ip: 10.77.0.11/24}
  - {name: gripper, model: hiwin-e1, ip: 10.77.0.12/24, limits: lax}
  - {name: press, model: moog-msd, ip: 10.77.0.13/24, limits: lax}
controller: {name: plc, ip: 10.77.0.1/24, cycle: 16ms}
"""


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    """The start of three drives in virtual time, without its cyclic frames: they say nothing more."""
    file = tmp_path_factory.mktemp("plant") / "plant.pcapng"
    record(PLANT, file, epoch_ns=10**18)
    return [one for one in FrameReader(file) if parse_ethernet(one.data).payload[:1] not in {b"\x80", b"\xc0"}]


@pytest.fixture
def imported(pnfarm, tmp_path):
    """A function that imports frames, as devices and with one file for each list; result and groups by name."""

    def run(*lists, options=()):
        files = [
            write_frames(tmp_path / f"cell-{number}.pcapng", [(each.data, each.time_ns) for each in one])
            for number, one in enumerate(lists)
        ]
        out = tmp_path / "cell.pnfarm.yml"
        result = pnfarm("import", *files, "-o", out, "--force", "--name", "cell", "--devices", *options)
        assert result.code == 0, result.err
        return result, {one["name"]: one for one in yaml.safe_load(out.read_text()).get("devices", ())}, out

    return run


@pytest.fixture
def usual(imported, frames):
    result, groups, _ = imported(frames)
    assert (result.err, sorted(groups)) == ("", ["gripper", "infeed", "press"])
    return groups


def calls(frames):
    return [one for one in frames if parse_ethernet(one.data).ethertype == 0x0800]


# -- networks ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("vids", "told"), [((5,), "on VLAN 5:"), ((7, 5), "on VLANs 7 and 5:")])
def test_stations_on_a_vlan_also_within_a_second_tag_are_found_and_the_vlan_is_reported(
    imported, frames, usual, vids, told
):
    _, groups, out = imported([tagged(one, *vids) for one in frames])
    assert groups == usual
    assert comments(out).count(told) == 3


def test_a_station_whose_frames_were_captured_on_two_vlans_is_one(imported, frames, usual):
    both = [copy for one in frames for copy in (tagged(one, 5), tagged(one, 7))]
    result, groups, out = imported(both)
    assert (result.err, groups) == ("", usual)
    assert comments(out).count("on VLANs 5 and 7:") == 3


def test_frames_captured_twice_in_fragments_are_no_damage(imported, frames, usual):
    fragments = [part for one in frames for part in in_fragments(one, 200)]
    result, groups, _ = imported([copy for one in fragments for copy in (one, replace(one, time_ns=one.time_ns + 9))])
    assert (result.err, groups) == ("", usual)


# -- fragments ---------------------------------------------------------------------------------------------------------


def test_fragments_in_any_order_and_of_many_datagrams_at_a_time_are_joined(imported, frames, usual):
    rows = [in_fragments(one, 64) for one in frames]
    backwards = [part for parts in rows for part in reversed(parts)]
    assert imported(backwards)[1] == usual
    # each controller's call to each station is on the wire at the same time
    at_once = []
    for at in range(0, len(rows), 12):
        group = rows[at : at + 12]
        at_once += [parts[n] for n in range(max(map(len, group))) for parts in group if n < len(parts)]
    result, groups, _ = imported(at_once)
    assert (result.err, groups) == ("", usual)


def connects(frames):
    """Connects by their devices: the first call to each that is long."""
    found = {}
    for one in calls(frames):
        if len(one.data) > 350:
            found.setdefault(one.data[:6], one)
    return found


def test_a_datagram_that_lacks_a_fragment_is_reported_and_the_other_stations_are_found(imported, frames, usual):
    torn = next(iter(connects(frames).values()))
    parts = in_fragments(torn, 64)
    damaged = [part for one in frames for part in ([*parts[:1], *parts[2:]] if one is torn else [one])]
    result, groups, _ = imported(damaged)
    assert "1 fragmented IP packet" in result.err
    assert len(groups) == 2
    assert all(usual[name] == one for name, one in groups.items())


def test_fragments_that_overlap_are_not_believed(imported, frames):
    torn = next(iter(connects(frames).values()))
    parts = in_fragments(torn, 64)
    early = replace(parts[2], data=parts[2].data[:20] + parts[1].data[20:22] + parts[2].data[22:])
    damaged = [part for one in frames for part in ([parts[0], parts[1], early, *parts[3:]] if one is torn else [one])]
    result, groups, _ = imported(damaged)
    assert "incomplete" in result.err
    assert len(groups) == 2


def test_a_call_that_lacks_a_fragment_is_reported_with_its_station():
    plant = SeenPlant()
    plant.connect()
    plant.decoder.shared.calls[UUID(int=1), 1] = Call(
        "Write", Opnum.WRITE, PLC, DEVICE, 0, parts={True: Reassembly(100)}
    )
    (one,) = plant.found()
    assert "1 calls to it lack fragments: their contents are not known" in one.facts


def test_fragments_without_end_take_bounded_memory():
    decoder = registry.decoder()
    PROFINET.observe(decoder.buses["profinet"])
    head = bytes.fromhex("0200000000410200000000010800")
    tracemalloc.start()
    for number in range(30_000):
        source = IPv4Address(0x0A000000 + number % 5000)
        part = Ipv4Packet(source, IPv4Address("10.77.0.41"), 17, bytes(1480), more_fragments=True,
                          identification=number & 0xFFFF, fragment_offset=1480 * (number % 40))  # fmt: skip
        decoder.feed(CapturedFrame(number, 10**18 + number * 1000, head + emit_ipv4(part)))
    used, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert used < 30_000_000
    assert decoder.capture.incomplete > 1000


# -- several captures of one plant -------------------------------------------------------------------------------------


def test_captures_of_both_directions_are_one_in_whatever_order_they_are_given(imported, frames, usual):
    devices = {parse_ethernet(one.data).destination for one in calls(frames)}
    plc = max(devices, key=lambda mac: sum(parse_ethernet(one.data).destination == mac for one in calls(frames)))
    out, back = ([one for one in frames if (one.data[:6] == plc) is way] for way in (False, True))
    assert imported(out, back)[1] == usual
    assert imported(back, out)[1] == usual


def test_captures_of_parts_of_the_time_and_of_parts_of_the_plant_are_one(imported, frames, usual):
    middle = len(frames) // 2
    assert imported(frames[middle:], frames[:middle])[1] == usual
    device = next(iter(connects(frames)))
    one = [frame for frame in frames if device in {frame.data[:6], frame.data[6:12]}]
    assert imported(frames, one)[1] == usual


def test_a_project_among_several_files_is_refused_with_how_to_join_it(pnfarm, tmp_path, frames):
    file, project = write_frames(tmp_path / "cell.pcapng", [(frames[0].data, 0)]), tmp_path / "cell.aml"
    project.write_text("<CAEXFile/>")
    refused = pnfarm("import", file, project)
    assert (refused.code, "with --merge" in refused.err) == (2, True)


# -- restarts and changes ----------------------------------------------------------------------------------------------


def told(one):
    return " | ".join((*one.notes, *one.facts))


def test_a_controller_that_begins_with_the_same_call_numbers_after_its_restart_is_heard(imported, frames):
    """One whose numbers do not depend on the time: its second project has another cycle."""
    hour = 3600 * 10**9
    again = []
    for one in frames:
        data = one.data
        if parse_ethernet(data).ethertype == 0x0800:
            # send clock factor 32, ratio 16, phase 1: the ratio is doubled
            data = data.replace(bytes.fromhex("002000100001"), bytes.fromhex("002000200001"))
        again.append(replace(one, data=data, time_ns=one.time_ns + hour))
    _, groups, _ = imported(frames)
    assert {one["cycle"] for one in groups.values()} == {"16ms"}
    _, groups, out = imported([*frames, *again])
    assert "cycle 32 ms" in comments(out)


def test_modules_of_an_earlier_project_stay_and_that_is_reported():
    plant = SeenPlant()
    plant.connect()
    plant.connect(ISLAND[:-1])
    (one,) = check_found(plant.found()).devices
    assert sorted(one.keys["slots"]) == [1, 2, 3]
    assert "only an earlier connection has slot 3: what was there stays" in told(one)


def test_controllers_with_devices_of_their_own_and_one_that_they_share_are_all_named():
    plant = SeenPlant()
    other, shared = bytes((2, 0, 0, 0, 0, 0x42)), bytes((2, 0, 0, 0, 0, 0x43))
    plant.connect()
    plant.connect(device=other, plc=SECOND)
    plant.connect((*HEAD, ISLAND[3]), device=shared)
    plant.connect((ISLAND[4],), device=shared, plc=SECOND, send_clock_factor=64)
    found = {one.keys["mac"][-2:]: told(one) for one in plant.found()}
    assert "connected by plc-1" in found["41"]
    assert "plc-2" not in found["41"]
    assert "connected by plc-2" in found["42"]
    assert "also connected by plc-1: cycle 1 ms" in found["43"]


def test_the_last_name_and_address_of_a_station_count_and_the_earlier_ones_are_reported():
    plant = SeenPlant()
    suite = [
        dcp.IpParameterBlock(IPv4Address(ip), IPv4Address("255.255.255.0"), IPv4Address(0))
        for ip in ("10.77.0.41", "0.0.0.0", "10.77.0.51", "0.0.0.0")
    ]
    plant.observed.said(DEVICE, (dcp.NameBlock(""), suite[1]))
    plant.observed.said(DEVICE, (dcp.NameBlock("island"), suite[0]))
    plant.connect()
    plant.observed.said(DEVICE, (dcp.NameBlock("island-2"), suite[2]))
    # it was restarted: a temporary address is gone
    plant.observed.said(DEVICE, (dcp.NameBlock("island-2"), suite[3]))
    (one,) = check_found(plant.found()).devices
    assert (one.name, one.keys["ip"]) == ("island-2", "10.77.0.51/24")
    assert "it was called island, then island-2: the last one counts" in told(one)
    assert "it had the address 10.77.0.41, then 10.77.0.51: the last one counts" in told(one)


def test_two_stations_with_one_name_are_two_and_that_is_reported():
    """A device that was replaced, or a cell like this one on another network."""
    plant = SeenPlant()
    for number in (0x41, 0x42):
        plant.connect(device=bytes((2, 0, 0, 0, 0, number)))
        plant.observed.said(bytes((2, 0, 0, 0, 0, number)), (dcp.NameBlock("island"),))
    made = check_found(plant.found())
    assert [one.name for one in made.devices] == ["island", "island-2"]
    assert "its name was 'island', which another station has, too" in made.devices[1].notes


def test_devices_behind_one_interface_are_not_mixed():
    """As those of a proxy, which has an instance for each."""
    plant = SeenPlant()
    plant.connect()
    (connection,) = plant.observed.connections.values()
    plant.observed.asked(connection.request, SECOND, DEVICE, (object_uuid(4, 9, 0xFF00), IPv4Address("10.77.0.41")), 1)
    made = check_found(plant.found())
    assert [len(made.devices), len(made.others)] == [1, 1]
    assert "vendor 0xFF00, device 0x0009, behind the interface of MAC 02:00:00:00:00:41" in made.others[0].facts
    assert "refuses" not in told(made.devices[0])


@pytest.mark.parametrize(("why", "status"), [("connection unknown", 0xDF814005), ("access denied", 0xDF80B600)])
def test_a_record_is_a_parameter_unless_the_device_refused_the_record_itself(why, status):
    plant = SeenPlant()
    plant.connect()
    plant.write(1, 100, b"\1")
    header = IodWriteReqHeader(1, UUID(int=1), 0, 1, 1, 100, 1)
    activity = UUID(int=5)
    plant.decoder.shared.calls[activity, 2] = Call(
        "Write", Opnum.WRITE, PLC, DEVICE, 0, write=WriteRequest(header, (RecordWrite(header, b"\1"),))
    )
    body = emit_response_args(ResponseArgs(PnioStatus.from_int(status), b"", 0), little_endian=True)
    answer = RpcPdu(PacketType.RESPONSE, UUID_PNIO_DEVICE, activity, sequence=2, opnum=Opnum.WRITE, body=body)
    datagram = emit_udp(UdpDatagram(RPC_PORT, 50_000, emit_rpc(answer)), ADDRESS, PLC_ADDRESS)
    packet = emit_ipv4(Ipv4Packet(ADDRESS, PLC_ADDRESS, PROTOCOL_UDP, datagram))
    list(plant.decoder.describe("rpc", Packet(1, PLC, DEVICE, ETHERTYPE_IPV4, packet)))
    (one,) = check_found(plant.found()).devices
    records = parse_gsdml(one.file.octets).modules[0].submodules[0].records
    assert [record.index for record in records] == ([100] if why == "connection unknown" else [])
    assert ("records that the device refused were written" in told(one)) == (why == "access denied")


# -- other buses -------------------------------------------------------------------------------------------------------


def adapters(tape):
    decoder = registry.decoder()
    ETHERNETIP.observe(decoder.buses["ethernetip"])
    for number, (frame, time_ns) in enumerate(zip(tape.frames, tape.times, strict=True), 1):
        decoder.feed(CapturedFrame(number, time_ns, frame))
    return list(ETHERNETIP.found(decoder.buses["ethernetip"]))


def identity(tape):
    item = IdentityItem(IPv4Address("10.77.0.11"), 452, 16, 1, (1, 13), 0x30, 1, b"AKD", 3)
    tape.udp(1, emit_encapsulation(EncapsulationPdu(Command.LIST_IDENTITY, emit_items((item,)))), (44818, 50_000))


def test_another_device_at_an_adapter_s_address_is_reported():
    tape = Tape(opened=False)
    identity(tape)
    identity(tape)
    tape.frames[1] = tape.frames[1][:6] + bytes.fromhex("020000000099") + tape.frames[1][12:]
    (one,) = check_found(adapters(tape)).drives
    assert "its address was at MAC 02:00:00:00:00:99, too: another device in its place, or on another network" in told(
        one
    )


def test_a_scanner_that_was_restarted_with_another_connection_counts_with_the_last_one():
    tape = Tape()
    identity(tape)
    connect(tape, forward_open(o_to_t_rpi_us=20_000, t_to_o_rpi_us=20_000))
    connect(tape, forward_open(o_to_t_rpi_us=50_000, t_to_o_rpi_us=50_000))
    other = forward_open(t_to_o=NetworkParameters(10), o_to_t=NetworkParameters(4))
    tape.ask(message_request(Service.FORWARD_OPEN, MANAGER, emit_forward_open(other)))
    (one,) = check_found(adapters(tape)).drives
    assert one.keys["rpi"] == "50ms"
    assert "connected by 10.77.0.1: 70 octets to it every 50 ms" in told(one)
    assert "also connected by 10.77.0.1: 4 octets to it" in told(one)


def test_a_slave_that_its_masters_configure_in_several_ways_is_reported():
    decoder = registry.decoder().buses["profibus"]
    PROFIBUS.observe(decoder)
    observed = decoder.shared.observed
    for master, octets in ((1, b"\x11"), (1, b"\x11"), (2, b"\x21\x11")):
        observed.parametrised(7, master, Parameters(PrmStatus.LOCK_REQ, (1, 1), 11, 0x0A8E))
        observed.configured(7, octets)
        observed.answered(7)
    (one,) = check_found(PROFIBUS.found(decoder)).drives
    assert "its masters sent 2 different parameters, one after the other: the last count" in told(one)
    assert "its masters sent 2 different configurations, one after the other: the last count" in told(one)
