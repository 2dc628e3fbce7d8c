"""The cyclic channels of the controller's sessions: rows of the tables, and what of a frame can be used."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.controllers.channels import ChannelRows
from pnfarm.buses.profinet.frame_layout import Carrier, frame_layout
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
        """A drive accepted the Connect: both channels start, the controller's data are still BAD."""
        self.close(session)
        for row in session.rows:
            self._columns.image[row].good = 0
        output, inputs = event.output_layout, event.input_layout
        session.layouts = (output, inputs)
        sent = _layout(session, output, ())
        taken = _layout(session, inputs, ())
        common: dict[str, Any] = {"image": session.row, "port": self._port.index, "plain": session.index}
        session.provider = self._table.open_provider(
            ProviderPlan(
                **common,
                **_clock(output),
                destination=event.device_mac,
                source=self._port.mac,
                frame_id=output.frame_id,
                data_length=output.data_length,
                words=sent.words,
                iops=sent.iops,
                constants=sent.constants,
                riders=sent.riders,
                pieces=sent.pieces,
                phase=max(0, output.phase - 1),
                tag=output.tag_header,
            )
        )
        session.consumer = self._table.open_consumer(
            ConsumerPlan(
                **common,
                **_clock(inputs),
                destination=self._port.mac,
                source=event.device_mac,
                frame_id=inputs.frame_id,
                data_length=inputs.data_length,
                data_hold_factor=inputs.data_hold_factor,
                words=taken.words,
                iops=taken.iops,
                riders=taken.riders,
                pieces=taken.pieces,
            )
        )

    def relayout(self, session: DeviceSession, unusable: Container[ExpectedKey]) -> None:
        """Submodules came or went: what is unusable carries no word and BAD status, in both directions.

        A drive of which no data is left counts as one that sends none: its axis program pauses.
        """
        if session.provider is None or session.consumer is None or session.layouts is None:
            return
        output, inputs = session.layouts
        sent = _layout(session, output, unusable)
        self._table.relayout_provider(
            session.provider, sent.words, sent.iops, sent.constants, riders=sent.riders, pieces=sent.pieces
        )
        taken = _layout(session, inputs, unusable)
        feeds = _feeds(inputs, session.plan.slots, unusable)
        self._table.relayout_consumer(
            session.consumer, taken.words, taken.iops, feeds=feeds, riders=taken.riders, pieces=taken.pieces
        )

    def close(self, session: DeviceSession) -> None:
        """Both channels end, and what they knew of the drive's submodules."""
        self.close_rows(session)
        session.layouts = None
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


def _carriers(session: DeviceSession, layout: IocrLayout, unusable: Container[ExpectedKey] = ()) -> list[Carrier]:
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


def _clock(layout: IocrLayout) -> dict[str, Any]:
    return {"send_clock_factor": layout.send_clock_factor, "reduction_ratio": layout.reduction_ratio}
