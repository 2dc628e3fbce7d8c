"""Layouts of cyclic channels from a capture's Connect or a farm file, and the state of each channel so far."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pnfarm.buses.decoding.channel import SummedChannel
from pnfarm.captures.drive_words import words_of
from pnfarm.protocols.profinet.cm.device.diff import expected_idents
from pnfarm.wire.rtc import SEND_CLOCK_NS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pnfarm.captures.conversations import CyclicChannel
    from pnfarm.drives.description.model import Model
    from pnfarm.drives.telegrams.telegram import Telegram
    from pnfarm.protocols.profinet.cm.ar import IocrLayout
    from pnfarm.protocols.profinet.wire.cm.expected import ExpectedApi

__all__ = ["Channel", "Template", "make_template", "telegram_of"]

#: PROFIdrive's API: its telegrams begin with STW1 and ZSW1 (PROFIdrive 4.x, standard telegrams).
PROFIDRIVE_API = 0x3A00


@dataclass(frozen=True, slots=True)
class Template:
    """How to read one channel's frames.

    ``words`` are (name, octet in the C_SDU, octets); ``statuses`` (``IOPS`` or ``IOCS``, slot, subslot, octet);
    ``bits`` names of bits by word, where the drive's model has them.
    """

    layout: IocrLayout
    telegram: int | None
    words: tuple[tuple[str, int, int], ...]
    statuses: tuple[tuple[str, int, int, int], ...]
    bits: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass(slots=True, eq=False)
class Channel(SummedChannel):
    """One direction of a connection; times in nanoseconds."""

    frame_id: int
    template: Template | None
    cycle_ns: int = 0
    hold_ns: int = 0
    partner: Channel | None = None
    counter: int = 0
    status: int = 0
    received: int = 0
    step: int = 0

    def __post_init__(self) -> None:
        if self.template is not None:
            layout = self.template.layout
            self.cycle_ns, self.hold_ns = layout.cycle_ns, layout.data_hold_ns
            self.step = self.cycle_ns // SEND_CLOCK_NS

    def summary(self) -> CyclicChannel:
        """For the summary of the capture."""
        telegram = self.template.telegram if self.template is not None else None
        return self.figures(f"0x{self.frame_id:04X}", telegram, self.cycle_ns)


def telegram_of(expected: Iterable[ExpectedApi], model: Model | None) -> Telegram | None:
    """The telegram of the module that a Connect expects of a drive of this model."""
    if model is None:
        return None
    wanted = expected_idents(expected).values()
    found = (model.profidrive.telegram_by_module(module, idents) for module, idents in wanted)
    return next((telegram for telegram in found if telegram is not None), None)


def make_template(layout: IocrLayout, telegram: Telegram | None, model: Model | None = None) -> Template:
    """Names for the words of ``layout``; without a telegram only those that PROFIdrive defines for all telegrams."""
    words: list[tuple[str, int, int]] = []
    is_input = layout.is_input
    first = "ZSW1" if is_input else "STW1"
    place = None
    if telegram is not None:
        holder = telegram.module.data
        place = layout.data_of(holder.slot, holder.subslot)
        for each in (telegram, *(model.profidrive.supplements.values() if model is not None else ())):
            data = layout.data_of(holder.slot, each.module.data.subslot)
            signals = each.input if is_input else each.output
            if data is not None:
                named = words_of((s.name if s is not None else "" for s in signals), data.data_offset)
                words += [word for word in named if word[1] + word[2] <= data.data_offset + data.data_length]
    if place is None:
        place = next((d for d in layout.data if d.api == PROFIDRIVE_API and d.data_length >= 2), None)
        if place is not None:
            count = place.data_length // 2
            words = [(first if n == 0 else f"word {n + 1}", place.data_offset + 2 * n, 2) for n in range(count)]
    statuses = [("IOPS", d.slot, d.subslot, d.iops_offset) for d in layout.data if d.iops_offset is not None]
    statuses += [("IOCS", c.slot, c.subslot, c.iocs_offset) for c in layout.iocs if c.iocs_offset is not None]
    number = telegram.number if telegram is not None else None
    bits = {}
    if model is not None and number is not None:
        bits = {name: found for name, _, _ in words if (found := model.profidrive.bit_names(name, number))}
    return Template(layout, number, tuple(words), tuple(statuses), bits)
