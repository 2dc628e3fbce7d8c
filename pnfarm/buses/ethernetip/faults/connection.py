"""The cyclic connections of a drive on EtherNet/IP, as injections see them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects.connection import Connection, ProviderConnection, Status

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.buses.ethernetip.device.device import EthernetIpDevice
    from pnfarm.engine.columns import Columns
    from pnfarm.station.device import ChannelCounts

__all__ = ["AdapterConnection"]

#: Octets of the response assembly (AKD EtherNet/IP manual 6.2.3.2, 6.2.3.3), their bits, and the bit's value: General
#: Fault; Enabled, which a drive that cannot be enabled lacks.  There is none for warnings.
_STATUS_WORD_1 = 0
_STATUS_BITS = {Status.FAULT: (_STATUS_WORD_1, 3, 1), Status.INHIBITED: (_STATUS_WORD_1, 7, 0)}


class AdapterConnection(ProviderConnection):
    """See :class:`~pnfarm.faults.effects.connection.ConnectionPart`; no code on the wire says why a connection
    ended."""

    def __init__(self, device: EthernetIpDevice, columns: Columns, settle: Callable[[int], None]) -> None:
        super().__init__(columns, settle)
        self._device = device

    @property
    def providers(self) -> list[int]:
        return [one.provider for one in self._device.channels.open.values() if one.provider is not None]

    @property
    def closed(self) -> ChannelCounts:
        return self._device.closed

    def now(self) -> Connection | None:
        opened = self._device.channels.open
        if not opened:
            return None
        return Connection(
            keys=frozenset(self._device.boots << 32 | number for number in opened),
            established=any(one.established for one in opened.values()),
            cycle_ns=min(one.production_ns for one in opened.values()),
            # the originator's: the interval of what it gets, with the multiplier of the connection
            watchdog_ns=max(one.production_ns << 2 + one.connection.timeout_multiplier for one in opened.values()),
            next_ns=self.next_ns,
        )

    def abort(self, code: int, now: int) -> int:
        del code
        numbers = list(self._device.channels.open)
        for number in numbers:
            self._device.adapter.close(number, now)
        self._settle(now)
        return sum(number not in self._device.channels.open for number in numbers)

    def expire(self, now: int) -> int:
        opened = [one for one in self._device.channels.open.values() if one.established]
        for one in opened:
            # as the drive would report it: silence for the time of its timeout
            self._device.connections.expired(one.consumer, one.connection.timeout_ns, now)
        self._settle(now)
        return sum(one.connection.number not in self._device.channels.open for one in opened)

    def reports(self, status: Status) -> bool:
        return status in _STATUS_BITS

    def sent_status(self, status: Status, since: int) -> bool:
        if status not in _STATUS_BITS:
            return False
        octet, bit, value = _STATUS_BITS[status]
        for number in self.providers:
            row = self._columns.ppm[number]
            place = int(row.data_offset) + octet
            if int(row.last_ns) >= since and int(self._columns.frames[number][place]) >> bit & 1 == value:
                return True
        return False
