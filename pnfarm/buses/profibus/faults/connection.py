"""The hold that a master has on a slave, as injections see it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pnfarm.faults.effects.connection import Connection, ConnectionPart, Status
from pnfarm.protocols.profibus.slave import LEFT, WATCHDOG
from pnfarm.protocols.profibus.wire.dp import NO_MASTER, DpState
from pnfarm.table.signals import ZSW1

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.buses.profibus.device.device import ProfibusDevice

__all__ = ["SlaveConnection"]

#: Bits of ZSW1, and their value: fault present, warning present, not ready to switch on.
_BITS: Final = {Status.FAULT: (3, 1), Status.WARNING: (7, 1), Status.INHIBITED: (0, 0)}


class SlaveConnection(ConnectionPart):
    """See :class:`~pnfarm.faults.effects.connection.ConnectionPart`; no code on the wire says why a slave left."""

    def __init__(self, device: ProfibusDevice, settle: Callable[[int], None]) -> None:
        self._device = device
        self._settle = settle

    def now(self) -> Connection | None:
        slave = self._device.slave
        if slave.master == NO_MASTER:
            return None
        cycle_ns = self._device.cycle_ns
        return Connection(
            keys=frozenset({self._device.boots << 32 | self._device.number}),
            established=slave.exchanging,
            cycle_ns=cycle_ns,
            # the master's retries are its own: a slave knows the watchdog that it was given
            watchdog_ns=slave.watchdog_ns,
            next_ns=int(self._device.station.image.frame_ns) + cycle_ns,
        )

    def cycles(self) -> int:
        return self._device.image.counts.sent

    def abort(self, code: int, now: int) -> int:
        del code
        return self._leave(LEFT, now)

    def expire(self, now: int) -> int:
        return self._leave(WATCHDOG, now) if self._device.slave.exchanging else 0

    def _leave(self, why: str, now: int) -> int:
        if self._device.slave.state is DpState.WAIT_PRM:
            return 0
        self._device.slave.leave(why)
        self._settle(now)
        return 1

    def sent_data(self, since: int) -> bool:
        return self._device.image.sent_ns >= since

    def sent_status(self, status: Status, since: int) -> bool:
        bit, value = _BITS[status]
        word = int(self._device.station.image.sent[ZSW1])
        return self.sent_data(since) and word >> bit & 1 == value

    def reports(self, status: Status) -> bool:
        return status in _BITS and bool(self._device.station.axes)
