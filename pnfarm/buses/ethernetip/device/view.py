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
    from pnfarm.buses.ethernetip.device.device import EthernetIpDevice

__all__ = ["CONNECTION_STATES", "USUAL_LOSSES", "connection_of", "losses_in_words", "view_of"]

#: States of a connection in the order of their numbers, from 1.
CONNECTION_STATES = tuple(state.value for state in ConnectionState)
#: The usual reasons for losing a connection.
USUAL_LOSSES = (CloseReason.TIMED_OUT.value, NO_DATA, CloseReason.OWNER_GONE.value, CloseReason.ENDED.value)

_WORDS = {
    CloseReason.TIMED_OUT.value: "the originator fell silent for longer than the timeout",
    NO_DATA: "no data came after Forward_Open",
    CloseReason.STREAM_CLOSED.value: "the TCP connection closed",
    CloseReason.OWNER_GONE.value: "the connection that it listened to ended",
    CloseReason.ENDED.value: "the drive ended it",
}


def _main(device: EthernetIpDevice) -> IoChannels | None:
    """The owner's connection, else the oldest one."""
    opened = list(device.channels.open.values())
    return next((one for one in opened if one.feeds), opened[0] if opened else None)


def connection_of(device: EthernetIpDevice) -> ConnectionView | None:
    """The owner's cyclic connection, or another one; a class 3 connection has only a state."""
    channels = _main(device)
    if channels is None:
        explicit = next(iter(device.adapter.manager.connections.values()), None)
        return ConnectionView(explicit.state.value, ip=explicit.originator) if explicit is not None else None
    connection = channels.connection
    return ConnectionView(
        connection.state.value,
        device.originator_name(connection),
        connection.originator,
        device.next_hop(connection.originator) or b"",
        channels.cycle_ns,
        connection.timeout_ns,
        channels.connected_ns,
        cyclic=True,
        exchanging=channels.established,
    )


def losses_in_words(device: EthernetIpDevice) -> dict[str, int]:
    """Lost connections, by the reason in words."""
    return {_WORDS[reason]: count for reason, count in device.connections.lost.items()}


def view_of(device: EthernetIpDevice) -> dict[str, Any]:
    """Address, sessions, connections: a drive's data that only EtherNet/IP has."""
    config = device.config
    return {
        "station_name": device.name,
        "ip": str(config.ip) if config.ip is not None else None,
        "gateway": str(config.gateway) if config.gateway is not None else None,
        "ip_conflict": format_mac(mac) if (mac := device.address.conflict_mac) is not None else None,
        "sessions": device.adapter.encapsulation.sessions,
        "connections": [
            {
                "kind": connection.kind.value,
                "ip": str(connection.originator),
                "originator": device.originator_name(connection),
                "state": connection.state.value,
                "rpi_seconds": connection.o_to_t_api_us / 1e6,
                "production_seconds": connection.t_to_o_api_us / 1e6,
                "timeout_seconds": connection.timeout_ns / 1e9,
                "multicast": connection.multicast,
            }
            for connection in device.adapter.manager.connections.values()
        ],
    }
