"""What a provider puts into a frame that is due: telegram words, provider status, header and trailer.

It is made once for each framing, as in :mod:`pnfarm.engine.channels.consuming`.
"""

from __future__ import annotations

from typing import Any

from pnfarm.engine.channels import class1, rtc
from pnfarm.table.channel import FRAMING_CLASS1, FRAMING_RTC, IOXS_BAD, IOXS_GOOD
from pnfarm.table.compiling.compiled import compiled, inlined
from pnfarm.table.signals import PART_HIGH, WORD_NONE

__all__ = ["pack", "pack_rtc"]


def _made_for(framing: Any, first: int) -> Any:
    """``first`` is 1 where the more significant octet of a telegram word is the second one."""

    @inlined
    def _pack(provider: Any, image: Any, frame: Any) -> None:
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
        framing.seal(provider, frame)

    return _pack


pack_rtc = _made_for(rtc, 0)
_pack_class1 = _made_for(class1, 1)


@compiled
def pack(provider: Any, image: Any, frame: Any) -> None:
    """The process image into a complete frame; a row with an unknown framing keeps the frame as it is."""
    if provider.framing == FRAMING_RTC:
        pack_rtc(provider, image, frame)
    elif provider.framing == FRAMING_CLASS1:
        _pack_class1(provider, image, frame)
