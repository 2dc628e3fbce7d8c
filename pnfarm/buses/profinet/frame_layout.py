"""The frames of a connection in the engine's form: telegram words of axes, plain data, status octets."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.engine.channels.parts import Piece, Rider
from pnfarm.table.channel import IOXS_BAD, IOXS_GOOD
from pnfarm.wire.value import value_class

if TYPE_CHECKING:
    from collections.abc import Container, Mapping, Sequence

    from pnfarm.buses.plain_layout import PlainPlace
    from pnfarm.protocols.profinet.cm.ar import ExpectedKey, IocrLayout

__all__ = ["Carrier", "FrameLayout", "frame_layout", "row_keys"]


@value_class
class Carrier:
    """One axis's part of a frame: the ``words`` of its telegram in its ``slots``, None for all; its process image."""

    words: Sequence[int]
    slots: Container[int] | None = None
    image: int = 0
    feeds: bool = True


@value_class
class FrameLayout:
    """Offsets count from the first octet of IO data.

    ``words``: (code, offset) of the first axis; ``iops``: provider status of its submodules; ``riders``: the other
    axes; ``pieces``: plain data; ``constants``: (offset, octet) of all other status octets.
    """

    words: tuple[tuple[int, int], ...]
    iops: tuple[int, ...]
    constants: tuple[tuple[int, int], ...]
    riders: tuple[Rider, ...] = ()
    pieces: tuple[Piece, ...] = ()


def frame_layout(
    layout: IocrLayout,
    carriers: Sequence[Carrier],
    unusable: Container[ExpectedKey],
    plain: Mapping[tuple[int, int], PlainPlace] | None = None,
    *,
    receives: bool = False,
) -> FrameLayout:
    """Place the telegrams' words in the frame of ``layout``, in the order of the submodules with data of each axis.

    ``plain``: the submodules with plain data, by slot and subslot.  A submodule that the device does not have
    (``unusable``) carries nothing and BAD status, unless its status octets are discarded; of one that ``receives`` such
    plain data they get BAD status.
    """
    words: list[list[tuple[int, int]]] = [[] for _ in carriers]
    iops: list[list[int]] = [[] for _ in carriers]
    pieces: list[Piece] = []
    constants: list[tuple[int, int]] = []
    waiting = [list(carrier.words) for carrier in carriers]
    for place in sorted(layout.data, key=lambda d: (d.slot, d.subslot)):
        key = (place.api, place.slot, place.subslot)
        kept = None if plain is None else plain.get(key[1:])
        axis = next(
            (number for number, one in enumerate(carriers) if one.slots is None or place.slot in one.slots), None
        )
        if kept is not None and receives and key in unusable:
            pieces.append(Piece(place.data_offset, kept.place, 0, None, kept.status, taken=False))
            continue
        if key in unusable or not place.data_length:
            if kept is None and axis is not None:
                # its words are nowhere: those of a submodule after it stay that one's
                del waiting[axis][: place.data_length // 2]
            if place.iops_offset is not None:
                constants.append((place.iops_offset, IOXS_BAD if key in unusable else IOXS_GOOD))
            continue
        if kept is not None:
            pieces.append(
                Piece(
                    place.data_offset,
                    kept.place,
                    min(kept.length, place.data_length),
                    place.iops_offset,
                    kept.status,
                )
            )
            continue
        if axis is None:
            if place.iops_offset is not None:
                constants.append((place.iops_offset, IOXS_GOOD))
            continue
        if place.iops_offset is not None:
            iops[axis].append(place.iops_offset)
        for offset in range(place.data_offset, place.data_offset + place.data_length - 1, 2):
            if not waiting[axis]:
                break
            words[axis].append((waiting[axis].pop(0), offset))
    for status in layout.iocs:
        if status.iocs_offset is None:
            continue
        good = (status.api, status.slot, status.subslot) not in unusable
        constants.append((status.iocs_offset, IOXS_GOOD if good else IOXS_BAD))
    riders = tuple(
        Rider(carrier.image, tuple(words[number]), tuple(iops[number]), carrier.feeds)
        for number, carrier in enumerate(carriers)
        if number
    )
    first = (tuple(words[0]), tuple(iops[0])) if carriers else ((), ())
    return FrameLayout(*first, tuple(constants), riders, tuple(pieces))


def row_keys(channel: IocrLayout, frame: FrameLayout) -> dict[str, Any]:
    """What a row has of a CR and its frames, by the fields of a provider's plan and of a consumer's."""
    return {
        "frame_id": channel.frame_id,
        "data_length": channel.data_length,
        "send_clock_factor": channel.send_clock_factor,
        "reduction_ratio": channel.reduction_ratio,
        "words": frame.words,
        "iops": frame.iops,
        "riders": frame.riders,
        "pieces": frame.pieces,
    }
