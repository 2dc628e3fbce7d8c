"""A PROFINET drive's cyclic connection: its ARs with IOCRs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.faults.effects.connection import Connection, ProviderConnection, Status
from pnfarm.table.access.riders import row_of_axis
from pnfarm.table.signals import PART_HIGH, WORD_NONE, ZSW1

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.buses.profinet.device.device import ProfinetDevice
    from pnfarm.engine.columns import Columns
    from pnfarm.station.device import ChannelCounts

__all__ = ["ArKeys", "ProfinetConnection"]

#: ZSW1 (PROFIdrive profile, status word 1).
_ZSW1_BITS = {Status.FAULT: 3, Status.INHIBITED: 6, Status.WARNING: 7}


class ArKeys:
    """Unique keys of a drive's ARs: a drive that boots restarts its own keys."""

    def __init__(self, station: ProfinetDevice) -> None:
        self._station = station
        self._cm = station.cm
        self._boots = 0

    def unique(self, key: int) -> int:
        if self._station.cm is not self._cm:
            self._cm = self._station.cm
            self._boots += 1
        return self._boots << 32 | key


class ProfinetConnection(ProviderConnection):
    """See :class:`~pnfarm.faults.effects.connection.ConnectionPart`; error codes are those of an ERR-RTA-PDU."""

    def __init__(
        self, station: ProfinetDevice, columns: Columns, keys: ArKeys, settle: Callable[[int], None], axis: int = 0
    ) -> None:
        super().__init__(columns, settle)
        self._station = station
        self._axis = axis
        self._keys = keys

    @property
    def providers(self) -> list[int]:
        return [number for ar in self._station.ars.values() for number, _ in ar.providers]

    @property
    def closed(self) -> ChannelCounts:
        return self._station.closed

    def now(self) -> Connection | None:
        cyclic = {key: ar for key, ar in self._station.ars.items() if ar.providers}
        if not cyclic:
            return None
        crs = [cr for ar in cyclic.values() for _, cr in ar.providers]
        return Connection(
            keys=frozenset(map(self._keys.unique, cyclic)),
            established=any(ar.established for ar in cyclic.values()),
            cycle_ns=min(cr.cycle_ns for cr in crs),
            # a controller may use either of the two; they are equal in practice
            watchdog_ns=max(cr.cycle_ns * max(cr.watchdog_factor, cr.data_hold_factor) for cr in crs),
            next_ns=self.next_ns,
        )

    def abort(self, code: int, now: int) -> int:
        keys = [key for key, ar in self._station.ars.items() if ar.providers]
        for key in keys:
            self._station.cm.abort(key, code, now)
        self._settle(now)
        return sum(key not in self._station.ars for key in keys)

    def expire(self, now: int) -> int:
        ended = 0
        for key, ar in list(self._station.ars.items()):
            if ar.established and ar.consumers:
                row, cr = ar.consumers[0]
                # as the drive would report it: silence for the time of its timer
                self._station.connections.expired(row, cr.data_hold_ns, now)
                ended += key not in {a.key for a in self._station.cm.ars}
        self._settle(now)
        return ended

    def sent_status(self, status: Status, since: int) -> bool:
        bit = _ZSW1_BITS[status]
        for number in self.providers:
            row = self._columns.ppm[number]
            if int(row.last_ns) < since:
                continue
            part = row_of_axis(self._columns.ppm, row, self._axis)
            if part is not None and _status_word(part, self._columns.frames[number]) >> bit & 1:
                return True
        return False


def _status_word(provider: Any, frame: Any) -> int:
    """ZSW1 in a provider's frame; 0 when the telegram has none."""
    for i in range(int(provider.words)):
        code = int(provider.word_code[i])
        if code != WORD_NONE and code >> 2 == ZSW1 and code & 3 != PART_HIGH:
            place = int(provider.word_offset[i])
            return int(frame[place]) << 8 | int(frame[place + 1])
    return 0
