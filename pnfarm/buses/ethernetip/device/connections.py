"""The connections of one station: turns the events of its Connection Manager into rows of the channel tables, a
drive's own fault, and log entries.

* an accepted Forward_Open opens rows, the end of a connection closes them;
* silence beyond the timeout, reported by the engine, ends the connection;
* the loss of the exclusive owner is its kind's affair: a drive raises a fault.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from pnfarm.buses.ethernetip.device import events as happened
from pnfarm.buses.ethernetip.device.refused import of_forward_open
from pnfarm.protocols.enip.connection import (
    CloseReason,
    ConnectionClosed,
    ConnectionOpened,
    ConnectionRefused,
    ProductionMoved,
    originator_name,
)
from pnfarm.protocols.enip.connection_check import Refusal
from pnfarm.protocols.enip.status import ConnectionStatus, status_text
from pnfarm.station.events import StartUpPhase, WatchdogExpired
from pnfarm.station.lateness import Lateness, budget_ns
from pnfarm.station.visits import Caller
from pnfarm.table.channel import W_START

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pnfarm.buses.ethernetip.device.channels import IoChannels, StationChannels
    from pnfarm.buses.ethernetip.device.kind import Kind
    from pnfarm.engine.lateness import LatenessRecord
    from pnfarm.protocols.enip.adapter import Adapter
    from pnfarm.protocols.enip.connection import Connection, ManagerEvent
    from pnfarm.protocols.enip.wire.forward_open import ForwardOpen
    from pnfarm.station.station import Station

__all__ = ["StationConnections", "nobody"]

#: A receiver whose MAC address the kernel does not know yet is looked up again after this time.
RETRY_NS = 5_000_000
#: A connection lost because nothing came at all, beside the reasons of :class:`CloseReason`.
NO_DATA = "no-data"


def nobody(request: ForwardOpen) -> None:
    """Refuses no client."""
    del request


class StationConnections:
    """See the module's docstring.  The counters survive a power cycle; ``adapter`` is a new one after each."""

    def __init__(
        self,
        station: Station,
        channels: StationChannels,
        lateness: LatenessRecord,
        adapter: Callable[[], Adapter],
        kind: Kind,
    ) -> None:
        self._station = station
        self._channels = channels
        self._lateness = lateness
        self._adapter = adapter
        self._kind = kind
        self.connects = 0
        #: Cyclic connections that ended without Forward_Close, by reason.
        self.lost: Counter[str] = Counter()
        self.watchdog_expirations = 0
        #: The last owner was lost, and there is no new one.
        self.lost_owner = False
        #: Those of both that the farm's own lateness caused.
        self.lost_by_farm: Counter[str] = Counter()
        self.watchdog_expirations_by_farm = 0
        #: Set by injections: asked before each Forward_Open; what refuses it, or None.
        self.refuse: Callable[[ForwardOpen], Refusal | None] = nobody
        #: Called with (event, now) for each event of the manager, after it has been handled.
        self.listeners: list[Callable[[ManagerEvent, int], None]] = []
        self._expired: dict[int, Lateness] = {}
        self._retry_ns: int | None = None
        self._leaving = False

    def built(self) -> None:
        """The drive was powered on."""
        self._adapter().manager.admit = self._admit
        self._adapter().manager.configure = self._kind.configure
        self._expired.clear()
        self._retry_ns = None
        self._leaving = False
        self.lost_owner = False

    def leave(self) -> None:
        """The farm stops: the connections that end now are not lost."""
        self._leaving = True

    def _admit(self, request: ForwardOpen) -> Refusal | None:
        if (refused := self.refuse(request)) is not None:
            return refused
        if request.transport.transport == 1 and not self._channels.room():
            return Refusal(ConnectionStatus.OUT_OF_CONNECTIONS)
        return None

    # -- the manager's events ----------------------------------------------------------------------------------------

    def take(self, events: Sequence[ManagerEvent], now: int) -> None:
        """All that happened in the machines, in order."""
        for place, event in enumerate(events):
            match event:
                case ConnectionOpened(connection) if not connection.explicit:
                    self._opened(connection, now)
                case ConnectionClosed(connection) if not connection.explicit:
                    following = events[place + 1] if place + 1 < len(events) else None
                    if isinstance(following, ProductionMoved) and following.source is connection:
                        self._hand_over(following, now)
                    self._closed(event, now)
                case ConnectionRefused(status, extended, request, ip):
                    key, triad = self._adapter().manager.settings.key, request.triad
                    caller = Caller(str(ip), name=originator_name(triad))
                    refusal = of_forward_open(event, key, self._kind)
                    self._station.visits.refused(caller, [refusal], attempt=True)
                    meaning = status_text(status, extended)
                    self._station.note(now, happened.ForwardOpenRefused(ip, status, extended, meaning))
                case _:
                    pass
            for listener in self.listeners:
                listener(event, now)

    def _opened(self, connection: Connection, now: int) -> None:
        channels = self._channels.add(connection, now)
        if channels.awaits_mac:
            self._retry_ns = now + RETRY_NS
        self._set_pace()
        if channels.feeds:
            self.lost_owner = False
            self._kind.fed(connection.timeout_ns, channels.cycle_ns)
        caller = Caller(str(connection.originator), name=connection.originator_name)
        self._station.visits.opened(caller, connection.number, channels.cycle_ns, connection.timeout_ns, now)
        self._station.note(
            now,
            happened.IoConnectionOpened(
                connection.kind.value,
                connection.originator,
                connection.originator_name,
                channels.cycle_ns,
                channels.production_ns,
                connection.timeout_ns,
                connection.multicast,
                connection=connection.number,
            ),
        )

    def _hand_over(self, moved: ProductionMoved, now: int) -> None:
        source, heir = (self._channels.open.get(one.number) for one in (moved.source, moved.connection))
        if source is not None and heir is not None:
            self._channels.hand_over(source, heir)
            self._station.note(now, happened.ProductionMoved(heir.production_ns))

    def _closed(self, event: ConnectionClosed, now: int) -> None:
        connection = event.connection
        number, kind = connection.number, connection.kind.value
        own = self._lateness_of_loss(event, now)
        channels = self._channels.remove(number)
        self._set_pace()
        if channels is None:
            return
        if channels.feeds:
            self._kind.unfed()
        released = event.reason is CloseReason.FORWARD_CLOSE or (event.reason is CloseReason.ENDED and self._leaving)
        if released:
            self._station.note(now, happened.IoConnectionReleased(kind, connection=number))
            return
        reason = NO_DATA if event.before_data else event.reason.value
        self.lost[reason] += 1
        self.lost_owner = self.lost_owner or channels.feeds
        if own is not None and own.late:
            self.lost_by_farm[reason] += 1
        self._station.note(now, happened.IoConnectionLost(reason, kind, lateness=own, connection=number))
        if channels.feeds and channels.established:
            self._kind.lost()

    def _set_pace(self) -> None:
        self._kind.paced(min((channels.cycle_ns for channels in self._channels.open.values()), default=None))

    def forget(self, now: int) -> None:
        """The supply is off: connections end without a word."""
        del now
        for number in list(self._channels.open):
            channels = self._channels.remove(number)
            if channels is not None and channels.feeds:
                self._kind.unfed()
        self._set_pace()
        self._retry_ns = None

    # -- time --------------------------------------------------------------------------------------------------------

    def next_deadline(self) -> int | None:
        """When a receiver is looked up again."""
        return self._retry_ns

    def handle_timeout(self, now: int) -> None:
        if self._retry_ns is None or self._retry_ns > now:
            return
        waiting = [channels for channels in self._channels.open.values() if not self._channels.produce(channels)]
        self._retry_ns = now + RETRY_NS if waiting else None

    # -- the engine's events -----------------------------------------------------------------------------------------

    def session_registered(self, now: int) -> None:
        """A peer is on its way to a connection."""
        if not self._channels.open:
            self._station.note(now, StartUpPhase("identify"))

    def first_frame(self, row: int, now: int) -> None:
        """Valid data arrived on this consumer for the first time."""
        channels = self._channels.of_consumer(row)
        if channels is None or channels.established:
            return
        channels.established = True
        connection = channels.connection
        self._adapter().data_received(connection.number, now)
        if channels.feeds:
            self.connects += 1
        self._station.note(
            now,
            happened.IoConnectionEstablished(
                connection.kind.value, connection.originator, connection=connection.number
            ),
        )

    def expired(self, row: int, silent_ns: int, now: int, when: int | None = None) -> None:
        """The timeout of this consumer ran out, at ``when`` if that is not now."""
        channels = self._channels.of_consumer(row)
        if channels is None:
            return
        at = now if when is None else when
        number, hold_ns = channels.connection.number, channels.connection.originator_timeout_ns
        own = self._lateness.of_silence(
            at - silent_ns, at, _budget(channels), hold_ns, channels.cycle_ns, loop_ns=now - at
        )
        self._expired[number] = own
        self.watchdog_expirations += 1
        self.watchdog_expirations_by_farm += own.late
        self._station.note(at, WatchdogExpired(silent_ns, own, connection=number))
        self._adapter().expired(number, now)

    def catch_up(self, now: int) -> None:
        """Events of the engine were lost: read from the rows what happened."""
        for row in [channels.consumer for channels in self._channels.open.values()]:
            consumer = self._channels.table.columns.cpm[row]
            if consumer.state == W_START:
                self.expired(row, now - int(consumer.last_ns), now)
            elif consumer.received:
                self.first_frame(row, now)

    def _lateness_of_loss(self, event: ConnectionClosed, now: int) -> Lateness | None:
        """The farm's own lateness before a connection ended."""
        number = event.connection.number
        if (told := self._expired.pop(number, None)) is not None:
            return told
        channels = self._channels.open.get(number)
        if channels is None:
            return None
        budget = _budget(channels)
        begin = now - channels.connection.timeout_ns - 2 * budget
        return self._lateness.between(begin, now, budget, by_loop=True)


def _budget(channels: IoChannels) -> int:
    """How late the farm may be on this connection, ns."""
    return budget_ns(channels.cycle_ns, channels.connection.timeout_ns)
