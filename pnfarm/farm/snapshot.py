"""A drive and a farm as they are now, as plain JSON values: what the API, the command line and Python code show.

Snapshots read the table and the stations; they never write (rule R8).  Times are seconds on the way out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.drives.model_parts import fault_label
from pnfarm.drives.word_bits import STW1_BITS, ZSW1_BITS
from pnfarm.faults.manager import RunState
from pnfarm.firmware.causes import NUMBER_MASK
from pnfarm.protocols.profinet.ar import CmdevState
from pnfarm.protocols.profinet.errors import abort_status, describe_status
from pnfarm.table.axis import FAULT_SITUATIONS, FAULT_SLOTS
from pnfarm.table.channel import DISCARDS
from pnfarm.wire.mac import format_mac

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pnfarm.buses.profinet.device.channels import ArChannels
    from pnfarm.buses.profinet.device.station import DriveStation
    from pnfarm.farm.core import FarmCore
    from pnfarm.faults.manager import FaultManager

__all__ = [
    "NO_AR",
    "active_ar",
    "ar_state",
    "bits_in_words",
    "discards",
    "drive_snapshot",
    "farm_snapshot",
    "injected_faults",
]

#: State of a connection that is not there; the others are :class:`CmdevState`'s.
NO_AR = "NO_AR"


def bits_in_words(word: int, names: Sequence[str]) -> list[str]:
    """The names of the bits that are set, bit 0 first; a bit without a name is ``bit_11``."""
    named = [*names, *[""] * (16 - len(names))]
    return [named[bit] or f"bit_{bit}" for bit in range(16) if word >> bit & 1]


def active_ar(station: DriveStation) -> tuple[int, ArChannels] | None:
    """Key and channels of the connection that carries IO data; None while there is none."""
    for key, ar in station.ars.items():
        if ar.providers:
            return key, ar
    return next(iter(station.ars.items()), None)


def ar_state(station: DriveStation) -> CmdevState | None:
    """State of the connection with IO data, or of the only other one; None while there is none."""
    found = active_ar(station)
    machine = station.cm.ar(found[0]) if found is not None else None
    if machine is None:
        machine = next(iter(station.cm.ars), None)
    return machine.state if machine is not None else None


def discards(core: FarmCore, station: DriveStation) -> dict[str, int]:
    """Frames that the drive dropped, by reason: cyclic ones since the start, and those of the protocol machines."""
    cyclic = station.channels.closed.discarded.copy()
    for ar in station.ars.values():
        for row, _ in ar.consumers:
            cyclic += core.columns.cpm[row].discarded
    total = station.discards()
    for reason, count in zip(DISCARDS, cyclic.tolist(), strict=True):
        total[reason] = total.get(reason, 0) + count
    return total


def injected_faults(manager: FaultManager | None) -> dict[str, list[str]]:
    """Ids of the faults that wait or are in force, by drive."""
    found: dict[str, list[str]] = {}
    for fault in manager.list() if manager is not None else ():
        for drive, run in fault.runs.items():
            if run.state is not RunState.ENDED:
                found.setdefault(drive, []).append(fault.id)
    return found


def drive_snapshot(
    core: FarmCore, station: DriveStation, now: int, *, injected: Mapping[str, list[str]] | None = None
) -> dict[str, Any]:
    """One drive.  ``injected`` saves asking the fault manager again for each of many drives."""
    axis = station.handle.axis
    powered = station.powered
    state = int(axis.state)
    zsw1, stw1 = int(axis.zsw1), int(axis.stw1)
    telegram = station.store.telegram_number
    codes = [int(code) & NUMBER_MASK for code in axis.fault_code if code]
    found = active_ar(station)
    ar = found[1] if found is not None else None
    machine_state = ar_state(station) if powered else None
    sent, suppressed, received = _frames(core, station)
    address = station.dcp.address
    if injected is None:
        injected = injected_faults(core.faults)
    return {
        "name": station.configured_name,
        "station_name": station.name,
        "model": station.model.name,
        "behaviour": dict(station.model.readings),
        "mac": format_mac(station.port.mac),
        "ip": str(address) if address is not None else None,
        "gateway": str(station.dcp.gateway) if station.dcp.gateway is not None else None,
        "ip_conflict": format_mac(conflict) if (conflict := station.addressing.conflict_mac) is not None else None,
        "powered": powered,
        "state": _state_word(powered, state),
        "zsw1": f"0x{zsw1:04X}",
        "zsw1_bits": bits_in_words(zsw1, station.model.bit_names("ZSW1", telegram) or ZSW1_BITS),
        "stw1": f"0x{stw1:04X}",
        "stw1_bits": bits_in_words(stw1, station.model.bit_names("STW1", telegram) or STW1_BITS),
        "telegram": telegram,
        "ar_state": machine_state.value if machine_state is not None else NO_AR,
        "controller": {"name": ar.initiator, "ip": str(ar.ip), "mac": format_mac(ar.mac)} if ar is not None else None,
        "cycle_seconds": ar.cycle_ns / 1e9 if ar is not None else None,
        "watchdog_seconds": ar.watchdog_ns / 1e9 if ar is not None else None,
        "connected_seconds": (now - ar.connected_ns) / 1e9 if ar is not None else None,
        "frames_sent": sent,
        "frames_suppressed": suppressed,
        "frames_received": received,
        "frames_discarded": {reason: count for reason, count in discards(core, station).items() if count},
        "watchdog_expirations": station.watchdog_expirations,
        "connects": station.connects,
        "aborts": {describe_status(abort_status(*codes)): count for codes, count in station.aborts.items()},
        "fault": _fault(station, codes[0]) if codes else None,
        "faults": [_fault(station, code) for code in codes],
        "last_fault": _last_fault(station),
        "neighbours": _neighbours(station, now),
        "fault_counts": {fault_label(number): count for number, count in sorted(station.fault_counts.items())},
        "warning": _fault(station, int(axis.warning_code)) if axis.warning_code else None,
        "setpoint_rpm": float(axis.setpoint),
        "velocity_rpm": float(axis.velocity),
        "position_revolutions": float(axis.position) - float(axis.origin),
        "pitch_millimetres": station.model.pitch or None,
        "current_amperes": float(axis.current),
        "following_error_revolutions": float(axis.following_error),
        "torque_newton_metres": float(axis.torque),
        "bus_volts": float(axis.bus_voltage),
        "thermal_load": float(axis.thermal_load),
        "signalling": powered and station.dcp.signalling,
        "lamps": _lamps(station, machine_state),
        "signalled_seconds_ago": ((now - station.signalled_ns) / 1e9 if station.signalled_ns is not None else None),
        "realism": station.flaws.shown(),
        "faults_injected": list(injected.get(station.configured_name, ())),
    }


def _lamps(station: DriveStation, ar_state: CmdevState | None) -> dict[str, str]:
    lamps = station.model.lamps
    if lamps is None:
        return {}
    return lamps.show(
        powered=station.powered,
        booting=int(station.handle.axis.state) == 0,
        exchanging=ar_state is CmdevState.DATA,
        signalling=station.dcp.signalling,
    )


def farm_snapshot(core: FarmCore, now: int) -> dict[str, Any]:
    """The farm, its engine, and every drive in the farm file's order."""
    injected = injected_faults(core.faults)
    return {
        "farm": core.name,
        "link": core.link.kind,
        "engine": engine_snapshot(core),
        "drives": [drive_snapshot(core, station, now, injected=injected) for station in core.stations],
    }


def engine_snapshot(core: FarmCore) -> dict[str, Any]:
    """The engine's own counters."""
    engine = core.columns.engine[0]
    return {
        "cycles": int(engine.cycles),
        "overruns": int(engine.overruns),
        "lateness_max_seconds": int(engine.lateness_max_ns) / 1e9,
        "frames_sent": int(engine.sent),
        "frames_received": int(engine.received),
        "frames_unknown": int(engine.unknown),
        "frames_malformed": int(engine.malformed),
        "send_errors": int(engine.send_errors),
        "events_lost": core.events_lost,
    }


def _state_word(powered: bool, state: int) -> str:
    if not powered:
        return "off"
    return f"S{state}" if state else "boot"


def _frames(core: FarmCore, station: DriveStation) -> tuple[int, int, int]:
    """Cyclic frames sent, kept back by a fault, received, over all connections since the start."""
    closed = station.channels.closed
    sent, suppressed, received = closed.sent, closed.suppressed, closed.received
    for ar in station.ars.values():
        for row, _ in ar.providers:
            sent += int(core.columns.ppm[row].sent)
            suppressed += int(core.columns.ppm[row].suppressed)
        for row, _ in ar.consumers:
            received += int(core.columns.cpm[row].received)
    return sent, suppressed, received


def _neighbours(station: DriveStation, now: int) -> list[dict[str, Any]]:
    """Who is at the other end of the drive's cable, as LLDP says it."""
    if not station.powered:
        return []
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


def _fault(station: DriveStation, number: int) -> dict[str, Any]:
    known = station.model.faults.get(number)
    return {"number": number, "name": known.name if known is not None else ""}


def _last_fault(station: DriveStation) -> dict[str, Any] | None:
    """First fault of the newest situation: the active one, or the one acknowledged last."""
    axis = station.handle.axis
    buffer = axis.fault_buffer
    for place in range(0, FAULT_SLOTS * FAULT_SITUATIONS, int(axis.fault_places) or FAULT_SLOTS):
        if buffer[place]:
            return _fault(station, int(buffer[place]) & NUMBER_MASK)
    return None
