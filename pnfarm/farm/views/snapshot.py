"""The present state of a drive and the engine, as plain JSON values for the API, the command line and Python code.

Snapshots read the table and the stations; they never write (rule R8).  Times are given in seconds.
"""

from __future__ import annotations

import math
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

import numpy as np

from pnfarm.drives.description.parts import fault_label
from pnfarm.drives.profiles.profidrive.fault_buffer import active_faults
from pnfarm.drives.telegrams.word_bits import STW1_BITS, ZSW1_BITS
from pnfarm.faults.manager import RunState
from pnfarm.station.signals import SIGNALS, STATUS_BITS
from pnfarm.table.axis_codes import FAULT_SITUATIONS, FAULT_SLOTS, NUMBER_MASK
from pnfarm.table.channel import DISCARDS
from pnfarm.wire.mac import format_mac

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.farm.core import FarmCore
    from pnfarm.faults.manager import InjectionManager
    from pnfarm.station.axis import Axis
    from pnfarm.station.device import ConnectionView

__all__ = [
    "NO_AR", "bit_labels", "connection_snapshot", "discards", "drive_snapshot", "engine_snapshot", "injected_kinds",
    "line_snapshot", "state_word",
]  # fmt: skip

#: Keys that a bus shows of a drive (:meth:`pnfarm.station.device.Device.view`) and another may not have.
_NOT_SHOWN: Mapping[str, Any] = {
    "station_name": None,
    "ip": None,
    "gateway": None,
    "ip_conflict": None,
    "neighbours": [],
    "signalling": False,
    "station_address": None,
    "lamps": None,
}
_USUAL_BITS = {"STW1": STW1_BITS, "ZSW1": ZSW1_BITS}
#: State without a connection; the other states are named by the bus.
NO_AR = "NO_AR"


def bit_labels(axis: Axis, word: str) -> list[str]:
    """The names of the bits of STW1 or ZSW1, bit 0 first; a bit without a name is ``bit_11``."""
    names = axis.model.profidrive.bit_names(word, axis.store.telegram_number) or _USUAL_BITS[word]
    return [name or f"bit_{bit}" for bit, name in zip_longest(range(16), names[:16], fillvalue="")]


def _set_bits(axis: Axis, name: str, word: int) -> list[str]:
    return [label for bit, label in enumerate(bit_labels(axis, name)) if word >> bit & 1]


def discards(core: FarmCore, station: Axis) -> dict[str, int]:
    """Frames that the drive dropped, by reason: cyclic ones since the start, and those of the protocol machines."""
    cyclic = station.device.closed.discarded.copy()
    for row in station.device.channel_rows[1]:
        cyclic += core.columns.cpm[row].discarded
    total = dict(station.device.discards())
    for reason, count in zip(DISCARDS, cyclic.tolist(), strict=True):
        total[reason] = total.get(reason, 0) + count
    return total


def injected_kinds(manager: InjectionManager) -> dict[str, list[tuple[str, str]]]:
    """Id and kind of the injections that wait or are in force, by drive."""
    found: dict[str, list[tuple[str, str]]] = {}
    for injection in manager.list():
        for drive, run in injection.runs.items():
            if run.state is not RunState.ENDED:
                found.setdefault(drive, []).append((injection.id, injection.spec.kind.name))
    return found


def _finite(value: Any) -> float:
    """As JSON can have it, also of a motor that something drove out of all bounds: NaN is 0, infinity the largest."""
    number = float(value)
    return number if math.isfinite(number) else float(np.nan_to_num(number))


def drive_snapshot(
    core: FarmCore, station: Axis, now: int, *, injected: Mapping[str, list[tuple[str, str]]] | None = None
) -> dict[str, Any]:
    """One drive.  ``injected`` saves a query of the injection manager for each of many drives."""
    axis = station.handle.axis
    powered = station.powered
    # without its supply a drive says nothing, and only its motor turns on
    zsw1, stw1 = (int(axis.profidrive.zsw1), int(axis.profidrive.stw1)) if powered else (0, 0)
    codes = active_faults(axis) if powered else []
    connection = station.device.connection()
    exchanging = powered and connection is not None and connection.exchanging
    sent, suppressed, received = _frames(core, station)
    seen = {**_NOT_SHOWN, "station_name": station.device.name, **station.device.view(now)}
    if injected is None:
        injected = injected_kinds(core.injections)
    return {
        "name": station.configured_name,
        "station_name": seen["station_name"],
        "model": station.model.name,
        "behaviour": dict(station.model.readings),
        "mac": format_mac(station.port.mac),
        "ip": seen["ip"],
        "gateway": seen["gateway"],
        "ip_conflict": seen["ip_conflict"],
        "station_address": seen["station_address"],
        "powered": powered,
        "state": state_word(station),
        "status": [name for name in STATUS_BITS if SIGNALS[name].read(station)] if powered else [],
        "zsw1": f"0x{zsw1:04X}",
        "zsw1_bits": _set_bits(station, "ZSW1", zsw1),
        "stw1": f"0x{stw1:04X}",
        "stw1_bits": _set_bits(station, "STW1", stw1),
        "telegram": station.store.telegram_number,
        "ar_state": connection.state if powered and connection is not None and connection.state else NO_AR,
        "connected": exchanging,
        **connection_snapshot(connection, now),
        "frames_sent": sent,
        "frames_suppressed": suppressed,
        "frames_received": received,
        "frames_discarded": {reason: count for reason, count in discards(core, station).items() if count},
        "watchdog_expirations": station.device.watchdog_expirations,
        "watchdog_expirations_by_farm": station.device.watchdog_expirations_by_farm,
        "connects": station.device.connects,
        "aborts": dict(station.device.losses_in_words()),
        "aborts_by_farm": sum(station.device.losses_by_farm().values()),
        "fault": _fault(station, codes[0]) if codes else None,
        "faults": [_fault(station, code) for code in codes],
        "last_fault": _last_fault(station),
        "neighbours": seen["neighbours"],
        "fault_counts": {fault_label(number): count for number, count in sorted(station.fault_counts.items())},
        "warning": _fault(station, int(axis.warnings.code)) if axis.warnings.code and powered else None,
        "setpoint_rpm": _finite(axis.ramp.setpoint) if powered else 0.0,
        "velocity_rpm": _finite(axis.motor.velocity),
        "position_revolutions": _finite(float(axis.motor.position) - float(axis.homing.origin)),
        "pitch_millimetres": station.model.pitch or None,
        "current_amperes": _finite(axis.motor.current),
        "following_error_revolutions": _finite(axis.positioning.following_error) if powered else 0.0,
        "torque_newton_metres": _finite(axis.motor.torque),
        "bus_volts": _finite(axis.supply.voltage) if powered else 0.0,
        "thermal_load": _finite(axis.motor.thermal_load),
        "signalling": seen["signalling"],
        "lamps": (
            _lamps(station, exchanging=exchanging, signalling=seen["signalling"])
            if seen["lamps"] is None
            else seen["lamps"]
        ),
        "details": station.device.details(),
        "signalled_seconds_ago": (
            (now - lamp_ns) / 1e9 if (lamp_ns := station.station.signalled_ns) is not None else None
        ),
        "realism": station.station.flaws.shown(),
        "faults_injected": [fault for fault, _ in injected.get(station.configured_name, ())],
    }


def connection_snapshot(connection: ConnectionView | None, now: int) -> dict[str, Any]:
    """The controller and its times; all None without a connection that has either address or cyclic data."""
    if connection is None or (connection.ip is None and not connection.cyclic):
        return dict.fromkeys(("controller", "cycle_seconds", "watchdog_seconds", "connected_seconds"))
    return {
        "controller": _controller(connection),
        "cycle_seconds": connection.cycle_ns / 1e9,
        "watchdog_seconds": connection.watchdog_ns / 1e9,
        "connected_seconds": (now - connection.connected_ns) / 1e9 if connection.connected_ns else None,
    }


def _controller(connection: ConnectionView) -> dict[str, Any]:
    """The controller at the other end."""
    ip = "" if connection.ip is None else str(connection.ip)
    return {"name": connection.controller, "ip": ip, "mac": format_mac(connection.mac) if connection.mac else ""}


def _lamps(station: Axis, *, exchanging: bool, signalling: bool) -> dict[str, str]:
    lamps = station.model.lamps
    if lamps is None:
        return {}
    return lamps.show(
        powered=station.powered,
        booting=int(station.handle.axis.drive.state) == 0,
        exchanging=exchanging,
        signalling=signalling,
    )


def line_snapshot(core: FarmCore, name: str) -> dict[str, Any]:
    """One serial line: where it is, and what went over it."""
    line = core.lines[name]
    octets, replies, telegrams = line.octets, line.replies, line.telegrams
    return {
        "name": name,
        "way": line.way,
        "where": line.where,
        "up": line.is_up,
        "baud": line.baud,
        "telegrams_received": telegrams[0],
        "telegrams_sent": telegrams[1],
        "octets_received": octets.received,
        "octets_sent": octets.sent,
        "octets_lost": dict(octets.lost),
        "interruptions": dict(octets.interruptions),
        "dropped": dict(line.dropped),
        "counts": dict(core.line_counts(name)),
        "answers_withheld": line.withheld,
        "reply_seconds_mean": replies.sum_ns / 1e9 / replies.count if replies.count else None,
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


def state_word(axis: Axis) -> str:
    """``S1`` to ``S5``, ``boot``, or ``off``."""
    state = int(axis.handle.axis.drive.state)
    return "off" if not axis.powered else f"S{state}" if state else "boot"


def _frames(core: FarmCore, station: Axis) -> tuple[int, int, int]:
    """Cyclic frames sent, suppressed by a fault, received, over all connections since the start."""
    closed = station.device.closed
    sent, suppressed, received = closed.sent, closed.suppressed, closed.received
    providers, consumers = station.device.channel_rows
    for row in providers:
        sent += int(core.columns.ppm[row].sent)
        suppressed += int(core.columns.ppm[row].suppressed)
    for row in consumers:
        received += int(core.columns.cpm[row].received)
    return sent, suppressed, received


def _fault(station: Axis, number: int) -> dict[str, Any]:
    known = station.model.faults.get(number)
    return {"number": number, "name": known.name if known is not None else ""}


def _last_fault(station: Axis) -> dict[str, Any] | None:
    """First fault of the newest situation: the active one, or the one acknowledged last."""
    axis = station.handle.axis
    buffer = axis.faults.buffer
    for place in range(0, FAULT_SLOTS * FAULT_SITUATIONS, int(axis.faults.settings.places) or FAULT_SLOTS):
        if buffer[place]:
            return _fault(station, int(buffer[place]) & NUMBER_MASK)
    return None
