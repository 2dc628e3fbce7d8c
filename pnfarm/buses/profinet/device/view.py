"""A PROFINET device's state for metrics and snapshots; read-only."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

from pnfarm.protocols.profinet.cm.ar import CmdevState
from pnfarm.protocols.profinet.errors import abort_label, abort_status, describe_status
from pnfarm.protocols.profinet.wire.cm.connect import ArType
from pnfarm.station.device import ConnectionView
from pnfarm.wire.mac import format_mac

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pnfarm.buses.profinet.device.ar_channels import ArChannels
    from pnfarm.buses.profinet.device.parts import DeviceParts
    from pnfarm.protocols.profinet.cm.ar import IocrLayout

__all__ = [
    "CONNECTION_STATES",
    "USUAL_LOSSES",
    "connection_of",
    "details_of",
    "losses_in_words",
    "losses_of",
    "view_of",
]

#: States of a connection in the order of their numbers in ``pnfarm_ar_state``, from 1.
CONNECTION_STATES = tuple(state.value for state in CmdevState)
#: The usual reason for losing a connection.
USUAL_LOSSES = ("consumer-dht-expired", "cmi-timeout", "re-run-aborts-existing", "abort-request")


def _with_data(station: DeviceParts) -> tuple[int, ArChannels] | None:
    """Key and channels of the AR that carries IO data, else of any AR; None without an AR."""
    for key, ar in station.ars.items():
        if ar.providers:
            return key, ar
    return next(iter(station.ars.items()), None)


def connection_of(station: DeviceParts) -> ConnectionView | None:
    """The AR with IO data, or the only other one.

    An AR without channels (device access, or one that is being connected) has only a state.
    """
    found = _with_data(station)
    machine = station.cm.ar(found[0]) if found is not None else None
    if machine is None:
        machine = next(iter(station.cm.ars), None)
    state = machine.state.value if machine is not None else ""
    exchanging = machine is not None and machine.state is CmdevState.DATA
    if found is None:
        return ConnectionView(state, exchanging=exchanging) if state else None
    ar = found[1]
    return ConnectionView(
        state,
        ar.initiator,
        ar.ip,
        ar.mac,
        ar.cycle_ns,
        ar.watchdog_ns,
        ar.connected_ns,
        cyclic=bool(ar.providers),
        exchanging=exchanging,
    )


def losses_of(aborts: Mapping[tuple[int, int], int]) -> Counter[str]:
    """Aborted ARs by the ERR-RTA's codes."""
    return Counter({abort_label(*codes): count for codes, count in aborts.items()})


def losses_in_words(station: DeviceParts) -> dict[str, int]:
    """The same, as text."""
    return {describe_status(abort_status(*codes)): count for codes, count in station.aborts.items()}


def view_of(station: DeviceParts, now: int) -> dict[str, Any]:
    """Name, address, neighbours: a drive's data that only PROFINET has."""
    address, conflict = station.dcp.address, station.addressing.conflict_mac
    return {
        "station_name": station.name,
        "ip": str(address) if address is not None else None,
        "gateway": str(station.dcp.gateway) if station.dcp.gateway is not None else None,
        "ip_conflict": format_mac(conflict) if conflict is not None else None,
        "neighbours": _neighbours(station, now) if station.powered else [],
        "signalling": station.powered and station.dcp.signalling,
    }


def _neighbours(station: DeviceParts, now: int) -> list[dict[str, Any]]:
    """The neighbour at the other end of the drive's cable, from LLDP."""
    return [
        {
            "port": neighbour.port,
            "station": neighbour.station_name,
            "chassis": neighbour.chassis.text,
            "port_id": neighbour.port_id.text,
            "system_name": neighbour.system_name or None,
            "mac": format_mac(neighbour.mac),
            "ip": str(neighbour.ip) if neighbour.ip is not None else None,
            "seen_seconds_ago": (now - neighbour.seen_ns) / 1e9,
        }
        for neighbour in station.neighbours.lldp.neighbours
    ]


def details_of(station: DeviceParts) -> dict[str, Any]:
    """Each AR as its Connect has it, and the layout of its frames; the records that were taken and are ignored."""
    ignored = [f"0x{index:04X}" for index in station.records.ignored.written]
    return {
        **({"ignored_records": ignored} if ignored else {}),
        "connections": [
            {
                "controller": ar.initiator_name,
                "ip": str(ar.peer_ip),
                "state": ar.state.value,
                "ar_type": _AR_TYPES.get(ar.ar_type, f"0x{ar.ar_type:04X}"),
                "ar_uuid": str(ar.uuid),
                "session_key": ar.session_key,
                "start_up": "advanced" if ar.advanced_startup else "legacy",
                "channels": [_channel(channel) for channel in ar.iocrs],
            }
            for ar in station.cm.ars
        ],
    }


_AR_TYPES: Mapping[int, str] = {
    ArType.IOCAR_SINGLE: "IO controller",
    ArType.IOSAR: "IO supervisor",
    ArType.IOCAR_SINGLE_RT_CLASS_3: "IO controller, RT class 3",
    ArType.IOCAR_SR: "IO controller, system redundancy",
}


def _channel(channel: IocrLayout) -> dict[str, Any]:
    """One IO CR; offsets are those of the C_SDU, after the frame id."""
    return {
        "direction": "sent" if channel.is_input else "received",
        "id": f"0x{channel.frame_id:04X}",
        "octets": channel.data_length,
        "cycle_seconds": channel.cycle_ns / 1e9,
        "timeout_seconds": None if channel.is_input else channel.data_hold_ns / 1e9,
        "send_clock_factor": channel.send_clock_factor,
        "reduction_ratio": channel.reduction_ratio,
        "phase": channel.phase,
        "places": sorted(_places(channel), key=lambda place: int(place["offset"])),
    }


def _places(channel: IocrLayout) -> Iterator[dict[str, Any]]:
    for data in channel.data:
        place = f"slot {data.slot}, subslot 0x{data.subslot:04X}"
        if data.data_length:
            yield {"of": place, "what": "data", "offset": data.data_offset, "octets": data.data_length}
        if data.iops_offset is not None:
            yield {"of": place, "what": "provider status", "offset": data.iops_offset, "octets": 1}
    for status in channel.iocs:
        if status.iocs_offset is not None:
            place = f"slot {status.slot}, subslot 0x{status.subslot:04X}"
            yield {"of": place, "what": "consumer status", "offset": status.iocs_offset, "octets": 1}
