"""The cyclic channels of one station: rows of the channel tables, AR by AR."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.profinet.device.ar_channels import ArChannels
from pnfarm.buses.profinet.frame_layout import row_keys
from pnfarm.engine.channels.closed_channels import ClosedChannels
from pnfarm.engine.channels.schedule import ConsumerPlan, ProviderPlan
from pnfarm.protocols.profinet.description import MAX_SUPERVISOR_ARS
from pnfarm.protocols.profinet.records.store import IoData
from pnfarm.table.channel import IOXS_GOOD, STATUS_GOOD, STATUS_NO_PROBLEM

if TYPE_CHECKING:
    from pnfarm.buses.profinet.device.kind import Kind
    from pnfarm.engine.channels.impairments import ImpairmentTable
    from pnfarm.engine.channels.schedule import ChannelTable
    from pnfarm.links.base import Port
    from pnfarm.protocols.profinet.cm.ar import ExpectedKey, IocrLayout
    from pnfarm.protocols.profinet.cm.device.events import ArConnected

__all__ = ["StationChannels", "channel_rows"]


def channel_rows(io_controllers: int, crs: int = 1) -> int:
    """Rows that a station owns in each channel table: for the CRs of each AR with IO data, and of one that is closing.

    ``crs``: the most of one direction of an AR.
    """
    return (io_controllers + MAX_SUPERVISOR_ARS + 1) * crs


class StationChannels:
    """Opens and closes the rows of a station's ARs.

    ``index`` is its process image, the first of its axes, ``kind`` says what is in the frames.  ``rows``: its share of
    each table, ``crs``: the most that an AR takes of them; ``drift``: of its clock; ``closed`` holds the sums of closed
    rows.
    """

    def __init__(
        self,
        index: int,
        kind: Kind,
        port: Port,
        channels: ChannelTable,
        impairments: ImpairmentTable,
        rows: int,
        crs: int,
        drift: float = 0.0,
    ) -> None:
        self.ars: dict[int, ArChannels] = {}
        self.closed = ClosedChannels()
        self._index = index
        self._kind = kind
        self._rows = rows
        self._crs = crs
        self._drift = drift
        self._port = port
        self._channels = channels
        self._impairments = impairments

    def move(self, port: Port) -> None:
        """The station has another address; no row is open."""
        self._port = port

    @property
    def any_cyclic(self) -> bool:
        """Whether some AR carries IO data."""
        return any(ar.providers for ar in self.ars.values())

    def room(self) -> bool:
        """Whether there are rows for one more AR; those of a closed AR are free again after the engine's next tick."""
        standing = 1 + sum(bool(ar.providers) for ar in self.ars.values())
        return standing * self._crs + self._channels.resting(self._index) <= self._rows

    def of_consumer(self, row: int) -> tuple[int, IocrLayout] | None:
        """The key of the AR whose consumer has this row, and the CR."""
        return next(((key, cr) for key, ar in self.ars.items() for number, cr in ar.consumers if number == row), None)

    def open(self, event: ArConnected, now: int) -> ArChannels:
        """Open rows for every CR of a connected AR."""
        ar = ArChannels(
            initiator=event.initiator_name,
            ip=event.initiator_ip,
            mac=event.initiator_mac,
            cycle_ns=min(cr.cycle_ns for cr in event.iocrs),
            watchdog_ns=min((cr.data_hold_ns for cr in event.iocrs if not cr.is_input), default=0),
            hold_ns=min((cr.data_hold_ns for cr in event.iocrs if cr.is_input), default=0),
            set_point_cycle_ns=min((cr.cycle_ns for cr in event.iocrs if not cr.is_input), default=0),
            unusable=event.unusable,
            connected_ns=now,
        )
        ar.expected = frozenset(
            [(p.api, p.slot, p.subslot) for cr in event.iocrs for p in cr.data]
            + [(p.api, p.slot, p.subslot) for cr in event.iocrs for p in cr.iocs]
        )
        ar.feeds = self._kind.feeds(ar)
        self.ars[event.ar_key] = ar
        for cr in event.iocrs:
            self._open_row(ar, cr)
        return ar

    def _open_row(self, ar: ArChannels, cr: IocrLayout) -> None:
        frame = self._kind.layout(cr, ar, ar.bad)
        common = row_keys(cr, frame) | {
            "image": self._index,
            "port": self._port.index,
            "plain": self._kind.plain_row,
            "drift": self._drift,
        }
        if cr.is_input:
            provider = ProviderPlan(
                **common,
                destination=ar.mac,
                source=self._port.mac,
                constants=frame.constants,
                iocs=[status.iocs_offset for status in cr.iocs if status.iocs_offset is not None],
                # a controller that leaves every phase at 1 gets its drives' frames spread nevertheless
                phase=cr.phase - 1 if cr.phase > 1 else self._index,
                tag=cr.tag_header,
            )
            row = self._channels.open_provider(provider)
            ar.providers.append((row, cr))
        else:
            consumer = ConsumerPlan(
                **common,
                destination=self._port.mac,
                source=ar.mac,
                data_hold_factor=cr.data_hold_factor,
                feeds=0 in ar.feeds,
                zeroes=True,
            )
            row = self._channels.open_consumer(consumer)
            ar.consumers.append((row, cr))
        self._impairments.channel_opened(self._index, "out" if cr.is_input else "in", row)

    def rewrite(self) -> None:
        """Apply a new mapping to the open channels, in place."""
        for ar in self.ars.values():
            for name, channels in (("ppm", ar.providers), ("cpm", ar.consumers)):
                for row, cr in channels:
                    layout = self._kind.layout(cr, ar, ar.bad)
                    for axis, words in enumerate((layout.words, *(rider.words for rider in layout.riders))):
                        self._channels.rewrite_words(name, row, words, axis)

    def relayout(self, key: int, unusable: frozenset[ExpectedKey], *, ready: bool) -> None:
        """Submodules came or went, or the application is ``ready``: recompute an AR's open channels, in place."""
        ar = self.ars.get(key)
        if ar is None:
            return
        ar.unusable = unusable
        ar.ready = ar.ready or ready
        ar.feeds = self._kind.feeds(ar)
        for row, cr in ar.providers:
            layout = self._kind.layout(cr, ar, ar.bad)
            self._channels.relayout_provider(
                row, layout.words, layout.iops, layout.constants, riders=layout.riders, pieces=layout.pieces
            )
        for row, cr in ar.consumers:
            layout = self._kind.layout(cr, ar, ar.bad)
            self._channels.relayout_consumer(
                row, layout.words, layout.iops, feeds=0 in ar.feeds, riders=layout.riders, pieces=layout.pieces
            )

    def problem(self, key: int, *, there: bool) -> None:
        """Set or clear the problem indicator in the DataStatus of an AR's frames."""
        status = STATUS_GOOD & ~STATUS_NO_PROBLEM if there else STATUS_GOOD
        for row, _ in self.ars[key].providers:
            self._channels.columns.ppm[row].data_status = status

    def close(self, key: int) -> ArChannels | None:
        """Close the rows of one AR; their counters are added to :attr:`closed`."""
        ar = self.ars.pop(key, None)
        if ar is None:
            return None
        for row, _ in ar.providers:
            self._impairments.channel_closed(self._index, "out", row)
            self._channels.close_provider(row)
            self.closed.add_provider(self._channels, row)
        for row, _ in ar.consumers:
            self._impairments.channel_closed(self._index, "in", row)
            self._channels.close_consumer(row)
            self.closed.add_consumer(self._channels, row)
        return ar

    def io_data(self, slot: int, subslot: int, output: bool) -> IoData | None:
        """One submodule's cyclic data as on the wire, for the records that return it; of several ARs the owner's."""
        found = None
        for ar in self.ars.values():
            iocs_places = {(c.slot, c.subslot): (row, c.iocs_offset) for row, cr in ar.providers for c in cr.iocs}
            for row, cr in ar.consumers if output else ar.providers:
                place = cr.data_of(slot, subslot)
                if place is None or (found is not None and (place.api, slot, subslot) in ar.bad):
                    continue
                octets = self._channels.consumed(row) if output else self._channels.provided(row)
                data = octets[place.data_offset : place.data_offset + place.data_length]
                # a status that no frame carries is GOOD
                iops = IOXS_GOOD if place.iops_offset is None else octets[place.iops_offset]
                provider, where = iocs_places.get((slot, subslot), (0, None)) if output else (0, None)
                iocs = IOXS_GOOD if where is None else self._channels.provided(provider)[where]
                found = IoData(data, iops, iocs)
        return found
