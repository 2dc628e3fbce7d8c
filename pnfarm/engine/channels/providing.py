"""What a provider puts into a frame that is due: telegram words, provider status, header and trailer.

It is made once for each framing, as in :mod:`pnfarm.engine.channels.consuming`.
"""

from __future__ import annotations

from typing import Any

from pnfarm.engine.channels import class1, rtc
from pnfarm.engine.channels.plain_data import put_pieces
from pnfarm.table.channel import FRAMING_CLASS1, FRAMING_RTC, IOXS_BAD, IOXS_GOOD
from pnfarm.table.compiling.compiled import compiled, inlined
from pnfarm.table.signals import PART_HIGH, WORD_NONE

__all__ = ["pack", "pack_rtc"]


def _made_for(framing: Any, first: int) -> Any:
    """``first`` is 1 where the more significant octet of a telegram word is the second one."""

    @inlined
    def _put(provider: Any, image: Any, frame: Any) -> None:
        """The telegram words of one axis, and their provider status."""
        for i in range(provider.words):
            code = int(provider.word_code[i])
            word = 0
            if code != WORD_NONE:
                value = int(image.sent[code >> 2])
                word = (value >> 16) & 0xFFFF if code & 3 == PART_HIGH else value & 0xFFFF
            place = provider.word_offset[i]
            frame[place + first] = word >> 8
            frame[place + (1 - first)] = word & 0xFF
        status = IOXS_GOOD if image.good else IOXS_BAD
        for i in range(provider.iops_count):
            frame[provider.iops_offset[i]] = status

    @compiled
    def _pass_on(providers: Any, images: Any, first: int, frame: Any) -> None:
        """The parts of a frame of the further axes of a station."""
        following = first
        while following > 0:
            rider = providers[following - 1]
            following = rider.rider
            image = images[rider.image]
            _put(rider, image, frame)
            image.filled = (int(image.filled) + 1) & 0xFFFFFFFF

    @inlined
    def _pack(provider: Any, images: Any, providers: Any, stored: Any, pieces: Any, frame: Any) -> None:
        image = images[provider.image]
        _put(provider, image, frame)
        image.filled = (int(image.filled) + 1) & 0xFFFFFFFF
        if provider.rider:
            _pass_on(providers, images, int(provider.rider), frame)
        if provider.pieces:
            put_pieces(provider, pieces, stored, frame, image.good)
        framing.seal(provider, frame)

    return _pack


pack_rtc = _made_for(rtc, 0)
_pack_class1 = _made_for(class1, 1)


@compiled
def pack(provider: Any, images: Any, providers: Any, stored: Any, pieces: Any, frame: Any) -> None:
    """Process images and plain data into a complete frame; a row with an unknown framing keeps the frame as it is."""
    if provider.framing == FRAMING_RTC:
        pack_rtc(provider, images, providers, stored, pieces, frame)
    elif provider.framing == FRAMING_CLASS1:
        _pack_class1(provider, images, providers, stored, pieces, frame)
