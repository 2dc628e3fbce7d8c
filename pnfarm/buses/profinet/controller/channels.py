"""The cyclic channels of the controller's sessions: rows of the tables, and what of a frame can be used."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.controllers.channels import ChannelRows
from pnfarm.buses.profinet.frame_layout import Carrier, frame_layout, row_keys
from pnfarm.engine.channels.schedule import ConsumerPlan, ProviderPlan

if TYPE_CHECKING:
    from collections.abc import Container

    from pnfarm.buses.profinet.controller.session import DeviceSession
    from pnfarm.buses.profinet.frame_layout import FrameLayout
    from pnfarm.protocols.profinet.cm.ar import ExpectedKey, IocrLayout
    from pnfarm.protocols.profinet.cm.controller.events import Connected

__all__ = ["SessionChannels"]


class SessionChannels(ChannelRows):
    """See :class:`pnfarm.buses.controllers.channels.ChannelRows`."""

    def open(self, session: DeviceSession, event: Connected) -> None:
        """A drive accepted the Connect: all channels start, the controller's data are still BAD."""
        self.close(session)
        for row in session.rows:
            self._columns.image[row].good = 0
        session.layouts = event.layouts
        for layout in event.layouts:
            frame = _layout(session, layout, ())
            common = row_keys(layout, frame) | {
                "image": session.row,
                "port": self._port.index,
                "plain": session.index,
            }
            if layout.is_input:
                consumer = ConsumerPlan(
                    **common,
                    destination=self._port.mac,
                    source=event.device_mac,
                    data_hold_factor=layout.data_hold_factor,
                )
                session.consumers.append(self._table.open_consumer(consumer))
            else:
                provider = ProviderPlan(
                    **common,
                    destination=event.device_mac,
                    source=self._port.mac,
                    constants=frame.constants,
                    phase=max(0, layout.phase - 1),
                    tag=layout.tag_header,
                )
                session.providers.append(self._table.open_provider(provider))

    def relayout(self, session: DeviceSession, unusable: Container[ExpectedKey]) -> None:
        """Submodules came or went: what is unusable carries no word and BAD status, in both directions.

        A drive of which no data is left counts as one that sends none: its axis program pauses.
        """
        # the input CRs come first
        for layout, row in zip(session.layouts, (*session.consumers, *session.providers), strict=True):
            frame = _layout(session, layout, unusable)
            parts: dict[str, Any] = {"riders": frame.riders, "pieces": frame.pieces}
            if layout.is_input:
                feeds = _feeds(layout, session.plan.slots, unusable)
                self._table.relayout_consumer(row, frame.words, frame.iops, feeds=feeds, **parts)
            else:
                self._table.relayout_provider(row, frame.words, frame.iops, frame.constants, **parts)

    def close(self, session: DeviceSession) -> None:
        """All channels end, and what they knew of the drive's submodules."""
        self.close_rows(session)
        session.layouts = ()
        session.unusable = {}


def _feeds(layout: IocrLayout, slots: Container[int] | None, unusable: Container[ExpectedKey]) -> bool:
    """Whether an axis has data that can be used, or none at all."""
    own = [d for d in layout.data if d.data_length and (slots is None or d.slot in slots)]
    return not own or any((d.api, d.slot, d.subslot) not in unusable for d in own)


def _layout(session: DeviceSession, layout: IocrLayout, unusable: Container[ExpectedKey]) -> FrameLayout:
    """One frame: words of axes, or the plain data of a device without."""
    if session.plan.plain is None:
        return frame_layout(layout, _carriers(session, layout, unusable), unusable)
    outputs, inputs = session.plan.plain
    places = (inputs if layout.is_input else outputs).places
    return frame_layout(layout, (), unusable, places, receives=layout.is_input)


def _carriers(session: DeviceSession, layout: IocrLayout, unusable: Container[ExpectedKey]) -> list[Carrier]:
    """The axes' parts of a frame."""
    return [
        Carrier(
            plan.input_words if layout.is_input else plan.output_words,
            plan.slots,
            session.row + number,
            _feeds(layout, plan.slots, unusable),
        )
        for number, (_, plan) in enumerate(session.plan.axes)
    ]
