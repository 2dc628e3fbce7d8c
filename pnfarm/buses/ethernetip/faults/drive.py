"""A drive on EtherNet/IP as injections see it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.ethernetip.faults.connection import AdapterConnection
from pnfarm.buses.ethernetip.faults.frames import CIP_FRAMES
from pnfarm.buses.ethernetip.faults.identity import IDENTITY, Identity
from pnfarm.buses.ethernetip.faults.messages import CLASSES, EncapsulationCutter, message_class
from pnfarm.buses.ethernetip.faults.messages import MESSAGES as MESSAGE_CLASSES
from pnfarm.buses.ethernetip.faults.requests import ExplicitAccess, ForwardOpens
from pnfarm.faults.effects.adapter import ADAPTER, Adapter
from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.effects.requests import CONNECT_REQUESTS, PARAMETER_ACCESS
from pnfarm.faults.effects.sockets import SOCKETS, Sockets
from pnfarm.faults.effects.supply import Supply
from pnfarm.faults.effects.wire import AGREED_LENGTH, MESSAGES, WIRE, Wire
from pnfarm.faults.stations import injected_station

if TYPE_CHECKING:
    from pnfarm.buses.bus import InjectionHost
    from pnfarm.buses.ethernetip.device.device import EthernetIpDevice
    from pnfarm.faults.effects.parts import DrivePart, InjectedDrive, Part

__all__ = ["injected_drives"]

#: Acyclic frames of such a drive do not pass the gate; what does is of this class.
OTHER = "other"


def injected_drives(device: EthernetIpDevice, host: InjectionHost) -> list[InjectedDrive]:
    """Parts outside of the device: rows of the engine's table, the gate, hooks of its machines."""
    station = device.station
    name, port = station.configured_name, station.port.index
    host.gate.classify(port, lambda _: OTHER)
    host.sockets.classify(port, message_class, EncapsulationCutter)

    def carrier_changed(up: bool) -> None:
        device.link.up = up

    wire = Wire(
        name,
        station.index,
        port,
        host.impairments,
        host.gate,
        host.carriers,
        carrier_changed,
        classes=CLASSES,
        messages=MESSAGE_CLASSES,
        sockets=host.sockets,
    )
    supply = Supply(station, settle=host.settle, goes_off=wire.forget)
    parts: dict[Part[Any], DrivePart] = {
        WIRE: wire,
        ADAPTER: Adapter(name, port, station.port.mac, host.addresses, supply, device.change_mac),
        CONNECTION: AdapterConnection(device, host.columns, host.settle),
        CIP_FRAMES: wire,
        MESSAGES: wire,
        AGREED_LENGTH: wire,
        SOCKETS: Sockets(host.sockets, port),
        CONNECT_REQUESTS: ForwardOpens(device),
        PARAMETER_ACCESS: ExplicitAccess(device, wire, host.settle),
        IDENTITY: Identity(device),
    }
    return injected_station(station, parts, supply, lambda: device.adapter)
