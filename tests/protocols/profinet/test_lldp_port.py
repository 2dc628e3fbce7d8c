from collections import Counter
from dataclasses import replace
from ipaddress import IPv4Address

import pytest

from pnfarm.protocols.profinet.lldp.agent import (
    MAXIMUM_NEIGHBOURS,
    SEND_INTERVAL_NS,
    TIME_TO_LIVE,
    LldpPort,
    LocalPort,
    LocalSystem,
    NeighbourAppeared,
    NeighbourChanged,
    NeighbourGone,
    local_lldpdu,
    spread_phase,
)
from pnfarm.protocols.profinet.wire.lldp.pdu import LLDP_MULTICAST, Lldpdu, NameMode, emit_lldp, parse_lldp
from pnfarm.protocols.profinet.wire.lldp.tlvs import (
    ChassisId,
    ChassisMac,
    MacPhyStatus,
    ManagementAddress,
    PortId,
    PortStatus,
    SystemCapabilities,
    SystemName,
)
from pnfarm.wire.ethernet import ETHERTYPE_LLDP, EthernetFrame, parse_ethernet

SECOND = 1_000_000_000
T0 = 1_000 * SECOND
DRIVE = bytes.fromhex("020000000001")
PLC = bytes.fromhex("02cc00000001")


def system(**fields):
    return LocalSystem(**{"mac": DRIVE, "name": "axis-01", "address": IPv4Address("10.77.0.11"), **fields})


def agent(phase_ns=0, **fields):
    return LldpPort(system(**fields), LocalPort(1, DRIVE, "X11"), phase_ns=phase_ns)


def plc(name="plc", port=1, **fields):
    return LldpPort(LocalSystem(**{"mac": PLC, "name": name, **fields}), LocalPort(port, PLC))


def said(frame):
    return parse_lldp(parse_ethernet(frame).payload)


def heard(machine, frame, now):
    return machine.receive(parse_ethernet(frame), now)


def run(machine, start, end):
    """(time, frame) of everything sent, the machine being called when it asks for it only."""
    sent = [(start, frame) for frame in machine.to_send(start)]
    while (due := machine.next_deadline()) is not None and due <= end:
        machine.handle_timeout(due)
        sent += [(due, frame) for frame in machine.to_send(due)]
    return sent


# -- sending


def test_it_sends_every_five_seconds_and_keeps_the_frame():
    sent = run(agent(), T0, T0 + 60 * SECOND)
    assert [now for now, _ in sent] == [T0 + i * 5 * SECOND for i in range(13)]
    assert len({id(frame) for _, frame in sent}) == 1
    frame = parse_ethernet(sent[0][1])
    assert (frame.destination, frame.source, frame.ethertype) == (LLDP_MULTICAST, DRIVE, ETHERTYPE_LLDP)


def test_what_a_drive_says():
    (frame,) = agent().to_send(T0)
    pdu = said(frame)
    assert pdu.chassis == ChassisId(7, b"axis-01")
    assert pdu.port == PortId(7, b"port-001")
    assert pdu.time_to_live == TIME_TO_LIVE
    assert PortStatus(0, 0) in pdu.tlvs
    assert ChassisMac(DRIVE) in pdu.tlvs
    assert MacPhyStatus(3, 0x6C00, 0x10) in pdu.tlvs
    assert ManagementAddress(1, bytes([10, 77, 0, 11]), 2, 1) in pdu.tlvs
    assert SystemCapabilities(0x80, 0x80) in pdu.tlvs


def test_a_drive_without_name_and_address_is_identified_by_its_mac_address():
    pdu = said(agent(name="", address=None).to_send(T0)[0])
    assert pdu.chassis == ChassisId(4, DRIVE)
    assert ManagementAddress(6, DRIVE, 2, 1) in pdu.tlvs
    assert not [tlv for tlv in pdu.tlvs if isinstance(tlv, SystemName)]


def test_the_newer_names_when_the_controller_asked_for_them():
    newer = system(name_mode=NameMode.PORT_AND_STATION, description="AKD  AKD-P00306  V  1 17  0")
    pdu = local_lldpdu(newer, LocalPort(2, DRIVE))
    assert pdu.port == PortId(7, b"port-002.axis-01")
    assert pdu.chassis == ChassisId(7, b"AKD  AKD-P00306  V  1 17  0")
    assert local_lldpdu(replace(newer, name=""), LocalPort(1, DRIVE)).port == PortId(7, b"port-001.02-00-00-00-00-01")


def test_a_thousand_drives_do_not_burst():
    phases = sorted(spread_phase(index) for index in range(1000))
    assert 0 <= phases[0] < phases[-1] < SEND_INTERVAL_NS
    slots = [0] * 100
    for phase in phases:
        slots[phase * 100 // SEND_INTERVAL_NS] += 1
    assert max(slots) <= 13
    first, second = (now for now, _ in run(agent(phase_ns=phases[500]), T0, T0 + 8 * SECOND))
    assert 0 <= first - T0 - phases[500] < SECOND // 10
    assert second - first == SEND_INTERVAL_NS


def test_agents_of_a_farm_send_in_few_turns_of_its_event_loop():
    firsts = [run(agent(phase_ns=spread_phase(index)), T0, T0 + 5 * SECOND)[0][0] for index in range(1000)]
    turns = Counter(firsts)
    assert len(turns) <= 51
    assert max(turns.values()) <= 26


def test_a_late_caller_gets_one_frame_and_the_agent_keeps_its_place():
    machine = agent()
    machine.to_send(T0)
    assert len(machine.to_send(T0 + 17 * SECOND)) == 1
    assert machine.next_deadline() == T0 + 20 * SECOND


def test_a_new_name_goes_out_at_once_but_not_more_often_than_once_a_second():
    machine = agent()
    machine.to_send(T0)
    now = T0 + 3 * SECOND
    machine.update(system(name="axis-02"), now)
    assert machine.next_deadline() == now
    assert said(machine.to_send(now)[0]).chassis.value == b"axis-02"
    for step in range(5):
        machine.update(system(name=f"axis-{step + 3:02}"), now + step)
    assert machine.to_send(now + 10) == []
    assert machine.next_deadline() == now + SECOND
    (frame,) = machine.to_send(now + SECOND)
    assert said(frame).chassis.value == b"axis-07"
    assert machine.next_deadline() == now + 6 * SECOND


def test_what_did_not_change_sends_nothing_more():
    machine = agent()
    machine.to_send(T0)
    machine.update(system(), T0 + SECOND)
    assert machine.next_deadline() == T0 + 5 * SECOND


def test_a_change_before_the_first_frame_waits_for_its_turn():
    machine = agent(phase_ns=2 * SECOND)
    assert machine.to_send(T0) == []
    machine.update(system(name="other"), T0 + 1)
    assert machine.next_deadline() == T0 + 2 * SECOND


def test_a_port_that_is_shut_down_says_good_bye_once():
    machine = agent()
    machine.to_send(T0)
    machine.shut_down(T0 + SECOND)
    (frame,) = machine.to_send(T0 + SECOND)
    assert said(frame) == Lldpdu(ChassisId(7, b"axis-01"), PortId(7, b"port-001"), 0)
    assert machine.to_send(T0 + 100 * SECOND) == []
    assert machine.next_deadline() is None


def test_a_port_that_never_spoke_says_no_good_bye():
    machine = agent(phase_ns=SECOND)
    machine.to_send(T0)
    machine.shut_down(T0 + 1)
    assert machine.to_send(T0 + 1) == []


def test_a_boundary_stops_the_sending_and_not_the_hearing():
    machine, peer = agent(), plc()
    machine.to_send(T0)
    machine.send_frames(False, T0)
    assert machine.next_deadline() is None
    assert machine.to_send(T0 + 60 * SECOND) == []
    assert heard(machine, peer.to_send(T0)[0], T0)
    machine.send_frames(True, T0 + SECOND)
    assert len(machine.to_send(T0 + SECOND)) == 1


# -- neighbours


def test_two_ends_know_each_other():
    drive, controller = agent(), plc(address=IPv4Address("10.77.0.1"))
    (hello,), (answer,) = drive.to_send(T0), controller.to_send(T0)
    assert heard(drive, answer, T0 + 5)
    assert heard(controller, hello, T0 + 5)
    (seen,) = drive.neighbours
    assert (seen.port, seen.port_name, seen.station_name) == ("port-001", "port-001", "plc")
    assert (seen.mac, seen.chassis_mac, seen.ip) == (PLC, PLC, IPv4Address("10.77.0.1"))
    assert seen.alias == "port-001.plc"
    assert seen.mau_type == 0x10
    assert [type(event) for event in drive.events()] == [NeighbourAppeared]
    assert controller.neighbours[0].port_description == "X11"
    assert controller.neighbours[0].system_name == "axis-01"


def test_a_neighbour_that_repeats_itself_is_only_seen_again():
    drive, controller = agent(), plc()
    drive.to_send(T0)
    for now, frame in run(controller, T0, T0 + 60 * SECOND):
        heard(drive, frame, now)
        drive.handle_timeout(now)
    assert [type(event) for event in drive.events()] == [NeighbourAppeared]
    assert drive.neighbours[0].changed_ns == T0
    assert drive.neighbours[0].seen_ns == T0 + 60 * SECOND


def test_a_silent_neighbour_ages_out_after_its_time_to_live():
    drive, controller = agent(), plc()
    drive.send_frames(False, T0)
    heard(drive, controller.to_send(T0)[0], T0)
    assert drive.next_deadline() == T0 + 20 * SECOND
    drive.handle_timeout(T0 + 20 * SECOND - 1)
    assert len(drive.neighbours) == 1
    drive.handle_timeout(T0 + 20 * SECOND)
    assert drive.neighbours == ()
    _, gone = drive.events()
    assert (type(gone), gone.reason, gone.neighbour.station_name) == (NeighbourGone, "aged-out", "plc")
    assert drive.next_deadline() is None


def test_a_neighbour_that_shuts_down_is_gone_at_once():
    drive, controller = agent(), plc()
    heard(drive, controller.to_send(T0)[0], T0)
    controller.shut_down(T0 + SECOND)
    (bye,) = controller.to_send(T0 + SECOND)
    assert heard(drive, bye, T0 + SECOND)
    assert drive.neighbours == ()
    assert drive.events()[-1].reason == "shutdown"
    assert not heard(drive, bye, T0 + 2 * SECOND)
    assert drive.events() == []


def test_a_neighbour_with_another_address_has_changed_and_one_with_another_name_is_another():
    drive, controller = agent(), plc()
    heard(drive, controller.to_send(T0)[0], T0)
    controller.update(LocalSystem(PLC, "plc", address=IPv4Address("10.0.0.9")), T0 + 2 * SECOND)
    assert heard(drive, controller.to_send(T0 + 2 * SECOND)[0], T0 + 2 * SECOND)
    controller.update(LocalSystem(PLC, "plc-2"), T0 + 4 * SECOND)
    assert heard(drive, controller.to_send(T0 + 4 * SECOND)[0], T0 + 4 * SECOND)
    assert [type(event) for event in drive.events()] == [NeighbourAppeared, NeighbourChanged, NeighbourAppeared]
    assert [n.station_name for n in drive.neighbours] == ["plc", "plc-2"]


def test_a_neighbour_that_moves_to_another_interface_and_back_has_changed_twice():
    drive, spare = agent(), bytes([*PLC[:5], PLC[5] ^ 1])
    (frame,) = plc().to_send(T0)
    moved = frame[:6] + spare + frame[12:]
    for at, each in enumerate((frame, moved, frame, frame)):
        heard(drive, each, T0 + at * SECOND)
    assert [type(event) for event in drive.events()] == [NeighbourAppeared, NeighbourChanged, NeighbourChanged]
    (seen,) = drive.neighbours
    assert (seen.mac, seen.seen_ns) == (PLC, T0 + 3 * SECOND)
    drive.handle_timeout(T0 + 22 * SECOND)
    assert len(drive.neighbours) == 1


def test_a_neighbour_that_is_gone_appears_again_with_the_same_frame():
    drive = agent()
    (frame,) = plc().to_send(T0)
    heard(drive, frame, T0)
    drive.link_down()
    assert heard(drive, frame, T0 + SECOND)
    assert [type(event) for event in drive.events()] == [NeighbourAppeared, NeighbourGone, NeighbourAppeared]


def test_two_neighbours_on_one_port_are_both_known_and_age_apart():
    drive = agent()
    heard(drive, plc("a").to_send(T0)[0], T0)
    heard(drive, plc("a", port=2).to_send(T0)[0], T0 + 7 * SECOND)
    assert [n.port_name for n in drive.neighbours] == ["port-001", "port-002"]
    drive.handle_timeout(T0 + 21 * SECOND)
    assert [n.port_name for n in drive.neighbours] == ["port-002"]


def test_a_pulled_cable_clears_the_neighbour():
    drive = agent()
    heard(drive, plc("a").to_send(T0)[0], T0)
    heard(drive, plc("b").to_send(T0)[0], T0)
    drive.link_down()
    assert drive.neighbours == ()
    assert [e.reason for e in drive.events() if isinstance(e, NeighbourGone)] == ["link-down", "link-down"]


def test_a_flood_of_neighbours_is_bounded():
    drive = agent()
    for index in range(100):
        heard(drive, plc(f"stranger-{index}").to_send(T0)[0], T0)
    assert len(drive.neighbours) == MAXIMUM_NEIGHBOURS
    assert drive.dropped["too-many-neighbours"] == 100 - MAXIMUM_NEIGHBOURS


def test_our_own_frame_come_back_is_no_neighbour():
    drive = agent()
    assert not heard(drive, drive.to_send(T0)[0], T0)
    assert drive.neighbours == ()
    assert drive.dropped["own-frame"] == 1


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"", "short"),
        (emit_lldp(Lldpdu(ChassisId(7, b"x"), PortId(7, b"y"), 20))[:5], "short"),
        (emit_lldp(Lldpdu(ChassisId(7, b"x"), PortId(7, b"y"), 20))[:-2] + bytes.fromhex("06020000"), "duplicate"),
        (bytes.fromhex("0602001402020778"), "bad-order"),
    ],
)
def test_a_hostile_lldpdu_is_counted_and_makes_no_neighbour(payload, reason):
    drive = agent()
    assert not drive.receive(EthernetFrame(LLDP_MULTICAST, PLC, ETHERTYPE_LLDP, payload), T0)
    assert drive.dropped == {reason: 1}
    assert drive.neighbours == ()
    assert drive.events() == []
