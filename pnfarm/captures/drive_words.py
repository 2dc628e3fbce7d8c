"""The words of a drive's telegram as text (PROFIdrive 4.x, general state machine), whichever bus carries them."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from pnfarm.drives.telegrams.word_bits import STW1_BITS, ZSW1_BITS

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from pnfarm.drives.telegrams.telegram import Signal

__all__ = ["Words", "control_word", "values_text", "word_changes", "word_of", "words_of"]

#: Reported bits of control words, of status words with the drive's state, and of words whose upper four bits are the
#: sign of life.
CONTROL_MASKS = {"STW1": 0xFFFF, "E_STW1": 0xFFFF}
STATUS_MASKS = {"ZSW1": 0x02FF, "E_ZSW1": 0x1AFF}
SECOND_MASKS = dict.fromkeys(("STW2", "ZSW2", "STW2_ENC", "ZSW2_ENC", "CU_STW1", "CU_ZSW1"), 0x0FFF)
STATE_MASK = 0x0047
FAULT_PRESENT = 0x0008
#: Prefixes of the names of words that hold bits, task numbers or codes instead of quantities.
BIT_WORDS = (
    "STW", "ZSW", "E_STW", "E_ZSW", "CU_STW", "CU_ZSW", "POS_STW", "POS_ZSW", "G1_STW", "G1_ZSW", "G2_STW", "G2_ZSW",
    "MELDW", "MELD_NAMUR", "PKW_HEAD", "SATZANW", "AKTSATZ", "MDI_MOD", "FAULT_CODE", "WARN_CODE", "DRIVE_INPUTS",
    "DRIVE_MOTION_STATUS", "E_DIGITAL", "A_DIGITAL", "word",
)  # fmt: skip
#: (name, octet, octets) of each word, and whether it is a number of single precision.
Words = tuple[tuple[str, int, int, bool], ...]

_STATES = {
    0x40: "S1 switching on inhibited",
    0x01: "S2 ready for switching on",
    0x03: "S3 switched on",
    0x07: "S4 operation",
}


def drive_state(zsw1: int, stw1: int | None) -> str:
    """The drive's state; S5 looks like S3 or S4 in ZSW1 and is recognised by its cause, the control word or a fault."""
    state = _STATES.get(zsw1 & STATE_MASK, "")
    stopping = bool(zsw1 & FAULT_PRESENT) or (stw1 is not None and stw1 & 0x05 != 0x05)
    if zsw1 & 0x03 == 0x03 and stopping:
        return "S5 switching off"
    return state


def words_of(signals: Iterable[Signal | None], offset: int = 0) -> Words:
    """Words from ``offset`` on; consecutive ones of one name are a double word, those without are left out."""
    found: list[tuple[str, int, int, bool]] = []
    for signal in signals:
        if signal is not None and found and found[-1][:3] == (signal.name, offset - 2, 2):
            found[-1] = (signal.name, offset - 2, 4, signal.real)
        elif signal is not None:
            found.append((signal.name, offset, 2, False))
        offset += 2
    return tuple(found)


def values_text(words: Words, data: bytes) -> str:
    """Each word of a telegram with its value, as far as there are data."""
    texts = []
    for name, offset, width, real in words:
        if len(data) < offset + width:
            break
        if real:
            texts.append(f"{name} {struct.unpack_from('>f', data, offset)[0]:.7g}")
            continue
        value = int.from_bytes(data[offset : offset + width], "big")
        is_bits = name.startswith(BIT_WORDS)
        signed = value - (1 << 8 * width) if value >> (8 * width - 1) else value
        texts.append(f"{name} 0x{value:0{2 * width}X}" if is_bits else f"{name} {signed}")
    return " ".join(texts)


def word_of(words: Words, name: str, data: bytes) -> int | None:
    """The value of one of the words, None where the telegram does not have it."""
    place = next((offset for known, offset, *_ in words if known == name), None)
    return None if place is None or len(data) < place + 2 else int.from_bytes(data[place : place + 2], "big")


def control_word(words: Words, data: bytes) -> int | None:
    """The word with the bits of STW1, None where the telegram has none."""
    found = (word_of(words, name, data) for name in CONTROL_MASKS)
    return next((word for word in found if word is not None), None)


def word_changes(
    words: Words, bits: Mapping[str, Sequence[str]], before: bytes, after: bytes, stw1: int | None
) -> Iterator[tuple[str, str, dict[str, int]]]:
    """What changed in control and status words: the word's name, text, and details.

    ``bits``: names of bits by word, where they are not the usual ones; ``stw1``: the control word, if it is known.
    """
    for name, mask in (CONTROL_MASKS | STATUS_MASKS | SECOND_MASKS).items():
        old, new = word_of(words, name, before), word_of(words, name, after)
        if old is None or new is None or old == new:
            continue
        if name in STATUS_MASKS:
            text = zsw1_text(old, new, stw1, bits.get(name, ZSW1_BITS), mask)
        else:
            text = bits_text(old, new, bits.get(name, STW1_BITS if name in CONTROL_MASKS else ()), mask)
        if text:
            yield name, f"0x{old:04X} -> 0x{new:04X}: {text}", {"before": old, "after": new}


def zsw1_text(old: int, new: int, stw1: int | None, names: Sequence[str], mask: int) -> str:
    """What changed in the bits ``mask`` of ZSW1, the drive's state first; empty for nothing of interest."""
    changed = (old ^ new) & mask
    if not changed:
        return ""
    texts = []
    if changed & STATE_MASK:
        was, now = drive_state(old, stw1), drive_state(new, stw1)
        texts.append(f"{was.partition(' ')[0] or '?'} -> {now or '?'}")
    rest = bits_text(old, new, names, mask & ~STATE_MASK)
    return "; ".join([*texts, *([rest] if rest else [])])


def bits_text(old: int, new: int, names: Sequence[str], mask: int) -> str:
    """Bits that were set or reset, by name."""
    texts = []
    for bit in range(16):
        if (old ^ new) & mask & 1 << bit:
            name = names[bit].replace("_", " ") if bit < len(names) and names[bit] else f"bit {bit}"
            texts.append(f"{name} {'set' if new & 1 << bit else 'reset'}")
    return ", ".join(texts)
