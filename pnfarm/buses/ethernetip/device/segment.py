"""Which frames concern a device: ARP of its own address, as all else comes by sockets and by the engine."""

from __future__ import annotations

from ipaddress import IPv4Address
from typing import TYPE_CHECKING

from pnfarm.station.absent import FRESH_NS, Absent
from pnfarm.station.visits import Caller
from pnfarm.wire.arp import OPERATION_REQUEST

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence
    from ipaddress import IPv4Network

    from pnfarm.buses.ethernetip.device.device import EthernetIpDevice

__all__ = ["EthernetIpSegment"]

ARP = bytes.fromhex("0806")
#: Octets of an ARP packet in a frame.
_OPERATION, _SENDER_MAC, _SENDER, _TARGET, _END = 20, 22, 28, 38, 42


class EthernetIpSegment:
    """See :class:`pnfarm.buses.bus.Segment`; a drive's address is the farm file's and does not change."""

    def __init__(self, devices: Sequence[EthernetIpDevice]) -> None:
        self._own = {device.port.index: device.interface.ip.packed for device in devices}
        self._ports: dict[bytes, list[int]] = {}
        for port, address in self._own.items():
            self._ports.setdefault(address, []).append(port)
        self.absent = Absent()
        #: The ARP packet that was looked at last, and when.
        self._looked = (b"", 0)
        gateways = [device.config.gateway for device in devices]
        self._known = {*self._ports, *(gateway.packed for gateway in gateways if gateway is not None)}
        self._networks: set[IPv4Network] = {device.interface.network for device in devices}

    def admits(self, port: int, frame: bytes, now: int) -> bool:
        if frame[12:14] != ARP or len(frame) < _END:
            return False
        self._look(frame, now)
        return self._own[port] in {frame[_SENDER : _SENDER + 4], frame[_TARGET:_END]}

    def _look(self, frame: bytes, now: int) -> None:
        """A station looks for an address of this network that no drive and no gateway has."""
        if frame == self._looked[0] and now - self._looked[1] < FRESH_NS:
            # each port has a copy
            return
        self._looked = frame, now
        sender, target = frame[_SENDER : _SENDER + 4], frame[_TARGET:_END]
        if (
            int.from_bytes(frame[_OPERATION:_SENDER_MAC], "big") == OPERATION_REQUEST
            and target not in self._known
            and sender not in self._known
            and any(sender)
            and sender != target
            and any(IPv4Address(target) in network for network in self._networks)
        ):
            caller = Caller(str(IPv4Address(sender)), frame[_SENDER_MAC:_SENDER])
            self.absent.note(str(IPv4Address(target)), caller, now)

    def audience(self, frame: bytes, now: int, besides: Collection[int] = ()) -> Sequence[int]:
        del besides
        if frame[12:14] != ARP or len(frame) < _END:
            return ()
        self._look(frame, now)
        addresses = dict.fromkeys((frame[_SENDER : _SENDER + 4], frame[_TARGET:_END]))
        return [port for address in addresses for port in self._ports.get(address, ())]

    def settled(self, port: int) -> None:
        del port
