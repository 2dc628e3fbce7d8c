"""A drive on PROFIBUS as injections see it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.profibus.faults.connection import SlaveConnection
from pnfarm.buses.profibus.faults.requests import Records, SetParameters
from pnfarm.buses.profibus.faults.slave import SLAVE, SlavePart
from pnfarm.buses.profibus.faults.wire import ACYCLIC, CYCLIC, LineWire
from pnfarm.errors import DecodeError
from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.effects.requests import CONNECT_REQUESTS, PARAMETER_ACCESS
from pnfarm.faults.effects.supply import Supply
from pnfarm.faults.effects.wire import WIRE
from pnfarm.faults.signals import SIGNALS, Signals
from pnfarm.faults.stations import injected_station
from pnfarm.protocols.profibus.wire.telegram import ShortAck, Telegram, parse_telegram

if TYPE_CHECKING:
    from pnfarm.buses.bus import InjectionHost
    from pnfarm.buses.profibus.device.device import ProfibusDevice
    from pnfarm.faults.effects.parts import DrivePart, InjectedDrive, Part

__all__ = ["injected_drives"]


def injected_drives(device: ProfibusDevice, host: InjectionHost) -> list[InjectedDrive]:
    """Parts outside of the device: the gate, hooks of its slave."""
    station = device.station
    name, port = station.configured_name, station.port.index

    asked = ACYCLIC

    def telegram_class(octets: bytes) -> str:
        """Only telegrams of this slave have a class: a fault of one is none of the others."""
        nonlocal asked
        try:
            telegram = parse_telegram(octets)
        except DecodeError:
            return ACYCLIC
        if isinstance(telegram, ShortAck):
            # it has no address: the answer of a slave without inputs to the request before
            return asked
        if not isinstance(telegram, Telegram):
            return ACYCLIC
        if telegram.is_request and telegram.destination not in {device.slave.address, 127}:
            return "other"
        if not telegram.is_request and telegram.source != device.slave.address:
            return "other"
        found = CYCLIC if telegram.dsap is None and telegram.ssap is None else ACYCLIC
        if telegram.is_request:
            asked = found
        return found

    host.gate.classify(port, telegram_class)

    wire = LineWire(
        name, station.index, port, host.impairments, host.gate, host.carriers, lambda _: None,
        classes=frozenset({CYCLIC, ACYCLIC}),
    )  # fmt: skip
    slave = SlavePart(device, host.settle)
    supply = Supply(station, settle=host.settle, goes_off=wire.forget)
    parts: dict[Part[Any], DrivePart] = {
        WIRE: wire,
        CONNECTION: SlaveConnection(device, host.settle),
        CONNECT_REQUESTS: SetParameters(device),
        PARAMETER_ACCESS: Records(device, host.settle),
        SLAVE: slave,
    }
    if station.signals is not None:
        parts[SIGNALS] = Signals(station.signals, slave.wire_break)
    return injected_station(station, parts, supply, lambda: device.slave)
