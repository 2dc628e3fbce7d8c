"""A drive's view with everything in it, and a manager that asks an agent in memory."""

from __future__ import annotations

from dataclasses import replace
from ipaddress import IPv4Address

from pnfarm.protocols.profinet.lldp.agent import LocalPort, LocalSystem, Neighbour
from pnfarm.protocols.profinet.rpc.fragments import Peer
from pnfarm.protocols.profinet.snmp.agent import SnmpAgent
from pnfarm.protocols.profinet.snmp.view import (
    InterfaceCounters,
    InterfaceView,
    LldpPortStatistics,
    LldpPortView,
    LldpStatistics,
    LldpView,
    NeighbourView,
    SnmpView,
    SystemView,
)
from pnfarm.protocols.profinet.wire.lldp.tlvs import (
    Capability,
    ChassisId,
    MacPhyStatus,
    MeasuredDelays,
    PortDescription,
    PortId,
    SystemCapabilities,
    SystemDescription,
    SystemName,
    ipv4_management,
)
from pnfarm.protocols.profinet.wire.snmp.message import (
    END_OF_MIB_VIEW,
    GET,
    GET_BULK,
    GET_NEXT,
    NULL_VALUE,
    RESPONSE,
    SET,
    SNMP_PORT,
    VERSION_1,
    VERSION_2C,
    Pdu,
    SnmpMessage,
    VarBind,
    emit_snmp,
    parse_snmp,
)

__all__ = ["NEIGHBOUR", "PEER", "VIEW", "Manager"]

PEER = Peer(IPv4Address("10.77.0.9"), 40_000)
MAC = bytes.fromhex("020000000001")

NEIGHBOUR = NeighbourView(
    time_mark_ns=12_340_000_000,
    port=1,
    index=3,
    neighbour=Neighbour(
        "port-001",
        bytes(6),
        ChassisId(7, b"plc"),
        PortId(7, b"port-002"),
        20,
        (
            PortDescription(b"X1 P2"),
            SystemName(b"plc"),
            SystemDescription(b"a controller"),
            SystemCapabilities(0x94, Capability.STATION),
            ipv4_management(IPv4Address("10.77.0.9"), 7),
            MacPhyStatus(3, 0x6C00, 30),
            MeasuredDelays(rx_local=310, tx_local=300, cable_local=120),
        ),
        0,
        0,
        0,
    ),
)
#: Without PROFINET's and IEEE 802.3's TLVs, and without an address.
OTHER = replace(NEIGHBOUR.neighbour, chassis=ChassisId(7, b"other"), tlvs=NEIGHBOUR.neighbour.tlvs[:4])
_MAC_PHY = LocalPort(1, MAC).mac_phy

VIEW = SnmpView(
    system=SystemView("AKD and so on", 98_765_432_109, contact="me", name="axis-01", location="hall 1"),
    interfaces=(
        InterfaceView(
            1,
            "Port X11",
            "port-001",
            MAC,
            counters=InterfaceCounters(*range(2**32 - 5, 2**32 + 7)),
        ),
        InterfaceView(2, "Port X12", "port-002", MAC, up=False),
        InterfaceView(3, "Interface", "interface", MAC, has_connector=False),
    ),
    lldp=LldpView(
        system=LocalSystem(MAC, "axis-01", "AKD and so on", IPv4Address("10.77.0.11"), 3),
        ports=(
            LldpPortView(1, PortId(7, b"port-001"), "Port X11", _MAC_PHY, statistics=LldpPortStatistics(1, 2, 3, 4, 5)),
            LldpPortView(2, PortId(7, b"port-002"), "Port X12", _MAC_PHY),
        ),
        neighbours=(NEIGHBOUR, replace(NEIGHBOUR, index=4, neighbour=OTHER)),
        statistics=LldpStatistics(12_340_000_000, 2, 1, 0, 1),
    ),
)


class Manager:
    """Asks ``agent`` and unpacks what it answers; ``view`` may be replaced between two requests."""

    def __init__(self, view: SnmpView = VIEW, **options) -> None:
        self.view = view
        self.views = 0
        self.agent = SnmpAgent(self._view, **options)
        self.now = 0
        self._ids = 0

    def _view(self, now):
        self.views += 1
        self.seen_at = now
        return self.view

    def send(self, data):
        """The datagrams that answer these octets."""
        self.now += 1
        self.agent.receive(PEER, data, self.now)
        return self.agent.to_send(self.now)

    def ask(self, tag, *varbinds, version=VERSION_2C, community=b"public", status=0, index=0):
        """The PDU of the answer; names alone are variables without a value."""
        self._ids += 1
        bound = tuple(item if isinstance(item, VarBind) else VarBind(item, NULL_VALUE) for item in varbinds)
        request = SnmpMessage(version, community, Pdu(tag, self._ids, status, index, bound))
        (datagram,) = self.send(emit_snmp(request))
        assert (datagram.local_port, datagram.peer) == (SNMP_PORT, PEER)
        answer = parse_snmp(datagram.data)
        assert (answer.version, answer.community) == (version, community)
        assert (answer.pdu.tag, answer.pdu.request_id) == (RESPONSE, self._ids)
        self.size = len(datagram.data)
        return answer.pdu

    def get(self, *names, **options):
        return self.ask(GET, *names, **options)

    def next(self, *names, **options):
        return self.ask(GET_NEXT, *names, **options)

    def bulk(self, *names, repetitions, single=0):
        return self.ask(GET_BULK, *names, status=single, index=repetitions)

    def set(self, *pairs, community=b"private", version=VERSION_2C):
        return self.ask(SET, *(VarBind(*pair) for pair in pairs), community=community, version=version)

    def walk(self, *, version=VERSION_2C, repetitions=None, start=(0, 0)):
        """Every variable behind ``start``; with ``repetitions`` by GetBulk."""
        found, name = [], start
        while True:
            pdu = (
                self.next(name, version=version)
                if repetitions is None
                else self.bulk(name, repetitions=repetitions)
            )  # fmt: skip
            if pdu.error_status:
                assert version == VERSION_1
                return found
            assert pdu.varbinds, "an answer without variables would make a manager ask for ever"
            for varbind in pdu.varbinds:
                if varbind.value.tag == END_OF_MIB_VIEW:
                    return found
                assert varbind.name > name, "OID not increasing"
                name = varbind.name
                found.append(varbind)
