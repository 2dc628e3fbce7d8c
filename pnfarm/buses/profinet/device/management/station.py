"""A station's data for SNMP managers: its identity, its interfaces with their counters, its LLDP data.

The interfaces are numbered as PROFINET managers expect: port *n* is interface *n*, as in its LLDP frames, and the
device's own interface, with the IP address, follows the ports (assumed: the standard leaves the numbers to the
device).  A virtual drive has one cable, at port 1; further ports have no link.  Ports have the interface's MAC
address (assumed: the next MAC addresses may belong to the next drive).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pnfarm.buses.profinet.device.management.neighbours import port_numbers
from pnfarm.protocols.profinet.snmp.view import (
    ADMIN_DISABLED,
    ADMIN_RX_ONLY,
    ADMIN_TX_AND_RX,
    InterfaceCounters,
    InterfaceView,
    LldpPortStatistics,
    LldpPortView,
    LldpStatistics,
    LldpView,
    SnmpView,
    SystemText,
    SystemView,
    system_description,
)

if TYPE_CHECKING:
    from pnfarm.buses.profinet.device.management.neighbours import StationNeighbours
    from pnfarm.buses.profinet.device.parts import DeviceParts

__all__ = ["snmp_view"]

#: The optional TLVs: port description, system name, description and capabilities.
_EVERY_TLV = b"\xf0"
#: The first interface's subslot (IEC 61158-6-10, coding of SubslotNumber).
_INTERFACE = 0x8000


def snmp_view(station: DeviceParts, now: int) -> SnmpView:
    """The station at ``now``; it is powered.  Without LLDP its ports are shown as disabled.

    LLDP-MIB's local system data match its frames.
    """
    agent = station.neighbours
    im0 = station.description.im0
    description = system_description(
        station.description.station_type,
        im0.order_id,
        im0.serial_number,
        im0.hardware_revision,
        im0.software_revision[0],
        im0.software_revision[1:],
    )
    texts = station.snmp_texts
    name = texts.get(SystemText.NAME, station.name)
    system = SystemView(
        description=description,
        uptime_ns=max(0, now - station.booted_ns),
        contact=texts.get(SystemText.CONTACT, ""),
        name=name,
        location=texts.get(SystemText.LOCATION, ""),
    )
    mac = station.port.mac
    names = {s.subslot - _INTERFACE: s.name for s in station.description.dap.submodules}
    counters = station.traffic.counters(station.discards())
    numbers = port_numbers(station.description)
    index = numbers[-1] + 1
    interfaces = [
        InterfaceView(
            index=number,
            description=names.get(number) or f"Port {number}",
            name=f"port-{number:03}",
            mac=mac,
            up=number == numbers[0],
            counters=counters if number == numbers[0] else InterfaceCounters(),
        )
        for number in numbers
    ]
    interfaces.append(
        InterfaceView(
            index=index,
            description=names.get(0) or "Interface",
            name="interface",
            mac=mac,
            has_connector=False,
            counters=counters,
        )
    )
    own = agent.lldp.system
    heard = station.neighbour_rows.views(agent.lldp.neighbours, numbers[0], station.booted_ns)
    lldp = LldpView(
        system=own,
        ports=tuple(
            LldpPortView(
                number=number,
                port_id=own.port_id(replace(agent.lldp.port, number=number)),
                description=agent.lldp.port.description if number == numbers[0] else f"port {number}",
                mac_phy=agent.lldp.port.mac_phy,
                admin_status=_admin_status(agent, number),
                tlvs_enabled=_EVERY_TLV if agent.enabled else b"\x00",
                statistics=_lldp_statistics(agent) if number == numbers[0] else LldpPortStatistics(),
            )
            for number in numbers
        ),
        neighbours=tuple(heard),
        statistics=LldpStatistics(
            last_change_ns=max(0, agent.changed_ns - station.booted_ns),
            inserts=agent.came,
            deletes=agent.went,
            drops=agent.lldp.dropped["too-many-neighbours"],
            ageouts=agent.aged_out,
        ),
    )
    return SnmpView(system, lldp, tuple(interfaces))


def _admin_status(agent: StationNeighbours, port: int) -> int:
    """A controller may have muted the port (PeerToPeerBoundary)."""
    if not agent.enabled:
        return ADMIN_DISABLED
    return ADMIN_RX_ONLY if _INTERFACE + port in agent.pdev.mute_ports else ADMIN_TX_AND_RX


def _lldp_statistics(agent: StationNeighbours) -> LldpPortStatistics:
    dropped = agent.lldp.dropped
    return LldpPortStatistics(
        tx_frames=agent.lldp.sent,
        # one that finds no room is received and dropped
        rx_frames=agent.lldp.received + sum(dropped.values()) - dropped["too-many-neighbours"],
        rx_frames_discarded=sum(dropped.values()),
        rx_frames_errors=sum(dropped.values()) - dropped["too-many-neighbours"] - dropped["own-frame"],
        rx_ageouts=agent.aged_out,
    )
