"""A PROFINET device's state for metrics and snapshots; read-only."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

from pnfarm.protocols.profinet.ar import CmdevState
from pnfarm.protocols.profinet.errors import abort_label, abort_status, describe_status
from pnfarm.station.device import ConnectionView
from pnfarm.wire.mac import format_mac

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.buses.profinet.device.channels import ArChannels
    from pnfarm.buses.profinet.device.parts import DeviceParts

__all__ = ["CONNECTION_STATES", "USUAL_LOSSES", "connection_of", "losses_in_words", "losses_of", "view_of"]

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
