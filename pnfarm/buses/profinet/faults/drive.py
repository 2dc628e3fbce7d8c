"""A PROFINET drive as injections see it: the parts of any drive, and those that only PROFINET has."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from pnfarm.buses.profinet.faults.alarms import ALARMS, Alarms
from pnfarm.buses.profinet.faults.connection import ArKeys, ProfinetConnection
from pnfarm.buses.profinet.faults.diagnosis import DIAGNOSES, Diagnoses
from pnfarm.buses.profinet.faults.frame_class import CLASSES, RPC, frame_class
from pnfarm.buses.profinet.faults.frames import PROFINET_FRAMES
from pnfarm.buses.profinet.faults.modules import MODULES, Modules
from pnfarm.buses.profinet.faults.records import RECORDS, Records
from pnfarm.buses.profinet.faults.second_station import NEIGHBOUR, Neighbour
from pnfarm.buses.profinet.faults.set_up import SET_UP, SetUp
from pnfarm.buses.profinet.faults.wire_breaks import wire_break_of
from pnfarm.faults.effects.adapter import ADAPTER, Adapter
from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.effects.requests import CONNECT_REQUESTS, PARAMETER_ACCESS
from pnfarm.faults.effects.sign_of_life import LIFE, SignOfLife
from pnfarm.faults.effects.supply import Supply
from pnfarm.faults.effects.wire import AGREED_LENGTH, MESSAGES, WIRE, Wire
from pnfarm.faults.signals import SIGNALS, Signals
from pnfarm.faults.stations import injected_station

if TYPE_CHECKING:
    from pnfarm.buses.bus import InjectionHost
    from pnfarm.buses.profinet.device.device import ProfinetDevice
    from pnfarm.faults.effects.parts import DrivePart, InjectedDrive, Part
    from pnfarm.station.axis import Axis

__all__ = ["injected_drives"]


def injected_drives(station: ProfinetDevice, host: InjectionHost) -> list[InjectedDrive]:
    """Everything here is outside of the station: rows of the engine's table, the gate, hooks of its machines."""
    name, port = station.configured_name, station.port.index
    host.gate.classify(port, frame_class)
    keys = ArKeys(station)

    def carrier_changed(up: bool) -> None:
        station.neighbours.set_link(up=up)

    wire = Wire(
        name,
        station.index,
        port,
        host.impairments,
        host.gate,
        host.carriers,
        carrier_changed,
        classes=CLASSES,
        messages=frozenset({RPC}),
    )
    supply = Supply(station.station, settle=host.settle, goes_off=wire.forget)
    diagnoses = Diagnoses(station, host.settle)
    modules = Modules(station, keys, host.settle, diagnoses.put)
    set_up = SetUp(station, host.settle)
    records = Records(station, host.settle)
    parts: dict[Part[Any], DrivePart] = {
        WIRE: wire,
        ADAPTER: Adapter(name, port, station.port.mac, host.addresses, supply, station.change_mac),
        PROFINET_FRAMES: wire,
        CONNECTION: ProfinetConnection(station, host.columns, keys, host.settle),
        NEIGHBOUR: Neighbour(station),
        MESSAGES: wire,
        AGREED_LENGTH: wire,
        SET_UP: set_up,
        CONNECT_REQUESTS: set_up,
        MODULES: modules,
        DIAGNOSES: diagnoses,
        ALARMS: Alarms(station, host.impairments, keys, host.settle),
        RECORDS: records,
        PARAMETER_ACCESS: records,
    }
    if station.station.signals is not None:
        parts[SIGNALS] = Signals(station.station.signals, partial(wire_break_of, diagnoses, modules))

    def of_axis(axis: Axis) -> dict[Part[Any], DrivePart]:
        return {
            LIFE: SignOfLife(axis, host.columns),
            CONNECTION: ProfinetConnection(station, host.columns, keys, host.settle, axis.number),
        }

    return injected_station(
        station.station, parts, supply, lambda: station.cm, bus_name=lambda: station.name, of_axis=of_axis
    )
