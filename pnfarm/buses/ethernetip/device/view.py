"""The state of a device on EtherNet/IP for metrics and snapshots; read-only."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.ethernetip.device.connections import NO_DATA
from pnfarm.protocols.enip.connection import CloseReason
from pnfarm.protocols.enip.connection_states import ConnectionState
from pnfarm.station.device import ConnectionView
from pnfarm.wire.mac import format_mac

if TYPE_CHECKING:
    from pnfarm.buses.ethernetip.device.channels import IoChannels
    from pnfarm.buses.ethernetip.device.parts import DeviceParts
    from pnfarm.protocols.enip.connection import Connection

__all__ = ["CONNECTION_STATES", "USUAL_LOSSES", "connection_of", "details_of", "losses_in_words", "view_of"]

#: States of a connection in the order of their numbers, from 1.
CONNECTION_STATES = tuple(state.value for state in ConnectionState)
#: The usual reasons for losing a connection.
USUAL_LOSSES = (CloseReason.TIMED_OUT.value, NO_DATA, CloseReason.OWNER_GONE.value, CloseReason.ENDED.value)

_WORDS = {
    CloseReason.TIMED_OUT.value: "the originator sent nothing for longer than the timeout",
    NO_DATA: "no data came after Forward_Open",
    CloseReason.STREAM_CLOSED.value: "the TCP connection closed",
    CloseReason.OWNER_GONE.value: "the connection that it listened to ended",
    CloseReason.ENDED.value: "the drive ended it",
}


def _main(device: DeviceParts) -> IoChannels | None:
    """The owner's connection, else the oldest one."""
    opened = list(device.channels.open.values())
    return next((one for one in opened if one.feeds), opened[0] if opened else None)


def connection_of(device: DeviceParts) -> ConnectionView | None:
    """The owner's cyclic connection, or another one; a class 3 connection has only a state."""
    channels = _main(device)
    if channels is None:
        explicit = next(iter(device.adapter.manager.connections.values()), None)
        if explicit is None:
            return None
        return ConnectionView(explicit.state.value, explicit.originator_name, explicit.originator)
    connection = channels.connection
    return ConnectionView(
        connection.state.value,
        connection.originator_name,
        connection.originator,
        device.next_hop(connection.originator) or b"",
        channels.cycle_ns,
        connection.timeout_ns,
        channels.connected_ns,
        cyclic=True,
        exchanging=channels.established,
    )


def losses_in_words(device: DeviceParts) -> dict[str, int]:
    """Lost connections, by the reason in words."""
    return {_WORDS[reason]: count for reason, count in device.connections.lost.items()}


def view_of(device: DeviceParts) -> dict[str, Any]:
    """Name and address: a drive's data that only EtherNet/IP has."""
    config = device.config
    return {
        "station_name": device.name,
        "ip": str(config.ip) if config.ip is not None else None,
        "gateway": str(config.gateway) if config.gateway is not None else None,
        "ip_conflict": format_mac(mac) if (mac := device.address.conflict_mac) is not None else None,
    }


def details_of(device: DeviceParts) -> dict[str, Any]:
    """Sessions, and each row of the Connection Manager's table."""
    return {
        "sessions": device.adapter.encapsulation.sessions,
        "connections": [
            {
                "kind": connection.kind.value,
                "ip": str(connection.originator),
                "originator": connection.originator_name,
                "serial": f"0x{connection.triad.serial:04X}",
                "state": connection.state.value,
                "rpi_seconds": connection.o_to_t_api_us / 1e6,
                "production_seconds": connection.t_to_o_api_us / 1e6,
                "timeout_seconds": connection.timeout_ns / 1e9,
                "multicast": connection.multicast,
                "channels": list(_channels(connection)),
            }
            for connection in device.adapter.manager.connections.values()
        ],
    }


def _channels(connection: Connection) -> list[dict[str, Any]]:
    """Both directions of a connection; none of an explicit one."""
    offer = connection.offer
    if offer is None:
        return []
    received = _places(offer.consumed, connection.consumed_octets, header=offer.consumed_header)
    sent = _places(offer.produced, connection.produced_octets, header=offer.produced_header)
    return [
        {
            "direction": "received",
            "id": f"0x{connection.o_to_t_id:08X}",
            "octets": connection.o_to_t_size,
            "cycle_seconds": connection.o_to_t_api_us / 1e6,
            "timeout_seconds": connection.timeout_ns / 1e9,
            "places": received,
        },
        {
            "direction": "sent",
            "id": f"0x{connection.t_to_o_id:08X}",
            "octets": connection.t_to_o_size,
            "cycle_seconds": connection.t_to_o_api_us / 1e6,
            "timeout_seconds": None,
            "places": sent,
        },
    ]


def _places(assembly: int, octets: int, *, header: bool) -> list[dict[str, Any]]:
    """What is where in a connected data item: sequence count, run/idle header, data of the assembly."""
    found: list[dict[str, Any]] = [{"of": "", "what": "sequence count", "offset": 0, "octets": 2}]
    if header and octets:
        found.append({"of": "", "what": "run/idle header", "offset": 2, "octets": 4})
    if octets:
        found.append({"of": f"assembly {assembly}", "what": "data", "offset": 2 + 4 * header, "octets": octets})
    return found
