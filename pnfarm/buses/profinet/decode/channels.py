"""Layouts of cyclic channels from a capture's Connect or a farm file, and the state of each channel so far."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias

from pnfarm.buses.decoding.channel import SummedChannel
from pnfarm.captures.drive_words import Words, words_of
from pnfarm.wire.rtc import SEND_CLOCK_NS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.captures.conversations import CyclicChannel
    from pnfarm.drives.description.model import Model
    from pnfarm.drives.telegrams.telegram import Telegram
    from pnfarm.protocols.profinet.cm.ar import IocrLayout

__all__ = ["Channel", "Telegrams", "Template", "make_template", "telegrams_of"]

#: The telegrams of a drive's axes, by how far their slots are after the model's.
Telegrams: TypeAlias = "Mapping[int, Telegram]"
#: PROFIdrive's API: its telegrams begin with STW1 and ZSW1 (PROFIdrive 4.x, standard telegrams).
PROFIDRIVE_API = 0x3A00


@dataclass(frozen=True, slots=True)
class AxisWords:
    """One axis's part of a frame: octets of ``words`` are counted in the C_SDU.

    ``place`` is its slot where there are several axes; ``bits`` names of bits by word, where the drive's model has
    them.
    """

    place: str
    telegram: int | None
    words: Words
    bits: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Template:
    """How to read one channel's frames.

    ``axes``: those with words; ``statuses`` (``IOPS`` or ``IOCS``, slot, subslot, octet).
    """

    layout: IocrLayout
    axes: tuple[AxisWords, ...]
    statuses: tuple[tuple[str, int, int, int], ...]

    @property
    def telegram(self) -> int | None:
        """The number of the only telegram."""
        return self.axes[0].telegram if len(self.axes) == 1 else None


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


def telegrams_of(modules: Mapping[int, tuple[int, Mapping[int, int]]], model: Model | None) -> Telegrams:
    """The telegrams of a drive of this model.

    ``modules``: slot -> ident of the expected module, and those of its submodules by subslot.
    """
    found: dict[int, Telegram] = {}
    if model is None:
        return found
    for slot, (module, idents) in modules.items():
        telegram = model.profidrive.telegram_by_module(module, idents)
        if telegram is not None:
            found.setdefault(slot - telegram.module.slot, telegram)
    return found


def make_template(layout: IocrLayout, telegrams: Telegrams, model: Model | None = None) -> Template:
    """Names for the words of ``layout``; without a telegram only those that PROFIdrive defines for all telegrams."""
    axes = [
        found
        for shift, telegram in telegrams.items()
        if (found := _words(layout, telegram, shift, model, several=len(telegrams) > 1)) is not None
    ]
    if not axes:
        place = next((d for d in layout.data if d.api == PROFIDRIVE_API and d.data_length >= 2), None)
        if place is not None:
            first = "ZSW1" if layout.is_input else "STW1"
            names = (first if n == 0 else f"word {n + 1}" for n in range(place.data_length // 2))
            number = next((telegram.number for telegram in telegrams.values()), None)
            words = tuple((name, place.data_offset + 2 * n, 2, False) for n, name in enumerate(names))
            axes = [AxisWords("", number, words)]
    statuses = [("IOPS", d.slot, d.subslot, d.iops_offset) for d in layout.data if d.iops_offset is not None]
    statuses += [("IOCS", c.slot, c.subslot, c.iocs_offset) for c in layout.iocs if c.iocs_offset is not None]
    return Template(layout, tuple(axes), tuple(statuses))


def _words(
    layout: IocrLayout, telegram: Telegram, shift: int, model: Model | None, *, several: bool
) -> AxisWords | None:
    """An axis's words in this direction, None where its data is not in the frame."""
    is_input = layout.is_input
    slot = telegram.module.slot + shift
    words: list[tuple[str, int, int, bool]] = []
    if layout.data_of(slot, telegram.module.data.subslot) is None:
        return None
    for each in (telegram, *(model.profidrive.supplements.values() if model is not None else ())):
        place = layout.data_of(slot, each.module.data.subslot)
        if place is not None:
            signals = each.input if is_input else each.output
            named = words_of(signals, place.data_offset)
            words += [word for word in named if word[1] + word[2] <= place.data_offset + place.data_length]
    bits = {}
    if model is not None:
        bits = {name: found for name, *_ in words if (found := model.profidrive.bit_names(name, telegram.number))}
    return AxisWords(f"slot {slot}" if several else "", telegram.number, tuple(words), bits)
