"""Which frames concern a device: ARP of its own address, as all else comes by sockets and by the engine."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from pnfarm.buses.ethernetip.device.device import EthernetIpDevice

__all__ = ["EthernetIpSegment"]

ARP = bytes.fromhex("0806")
#: Octets of an ARP packet in a frame.
_SENDER, _TARGET, _END = 28, 38, 42


class EthernetIpSegment:
    """See :class:`pnfarm.buses.bus.Segment`; a drive's address is the farm file's and does not change."""

    def __init__(self, devices: Sequence[EthernetIpDevice]) -> None:
        self._own = {device.port.index: device.interface.ip.packed for device in devices}
        self._ports: dict[bytes, list[int]] = {}
        for port, address in self._own.items():
            self._ports.setdefault(address, []).append(port)

    def admits(self, port: int, frame: bytes, now: int) -> bool:
        del now
        if frame[12:14] != ARP or len(frame) < _END:
            return False
        return self._own[port] in {frame[_SENDER : _SENDER + 4], frame[_TARGET:_END]}

    def audience(self, frame: bytes, besides: Collection[int] = ()) -> Sequence[int]:
        del besides
        if frame[12:14] != ARP or len(frame) < _END:
            return ()
        addresses = dict.fromkeys((frame[_SENDER : _SENDER + 4], frame[_TARGET:_END]))
        return [port for address in addresses for port in self._ports.get(address, ())]

    def settled(self, port: int) -> None:
        del port
