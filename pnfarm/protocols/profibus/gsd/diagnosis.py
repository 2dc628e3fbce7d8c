"""Diagnoses of a slave by their names: bits of the device's own block, errors of channels (EN 50170 part 2, 8.3.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pnfarm.errors import ConfigError
from pnfarm.protocols.profibus.gsd.values import listed
from pnfarm.protocols.profibus.wire.dp import HEAD_OCTETS
from pnfarm.vocabulary.quoting import did_you_mean

if TYPE_CHECKING:
    from pnfarm.protocols.profibus.gsd.station import PluggedModule, PluggedSlave

__all__ = ["LINE_BREAK", "diagnosis_blocks"]

LINE_BREAK: Final = "line break"
#: Error types of channels that the standard names.
_ERRORS: Final = {
    1: "short circuit", 2: "undervoltage", 3: "overvoltage", 4: "overload", 5: "overtemperature", 6: LINE_BREAK,
    7: "upper limit exceeded", 8: "lower limit exceeded", 9: "error",
}  # fmt: skip
#: The kinds of blocks in their first octets: of identifiers, of a channel.
_IDENTIFIERS: Final = 0x40
_CHANNEL: Final = 0x80
#: Of a channel: it is an input, an output; its data are a bit.
_INPUT: Final = 0x40
_OUTPUT: Final = 0x80
_BIT: Final = 0x20
#: Numbers of modules and of channels have six bits.
_HIGHEST: Final = 63


def diagnosis_blocks(slave: PluggedSlave, name: str, slot: int, channel: int) -> bytes:
    """Blocks after the first six octets: the bit of this name in the device's own block, else the channel's error.

    With a channel's error the block of identifiers says which module has one; modules count as their slots do
    (assumed: one identifier for each).  Raises :class:`ConfigError` for an unknown name, and for what does not fit.
    """
    gsd, word = slave.gsd, name.strip().casefold()
    bits = {text.casefold(): bit for bit, text in reversed(list(gsd.unit_diagnoses.items()))}
    errors = {text.casefold(): number for number, text in (_ERRORS | dict(gsd.channel_errors)).items()}
    if (bit := bits.get(word)) is not None:
        blocks = _own_block(bit)
    elif (error := errors.get(word)) is not None:
        blocks = _channel_blocks(slave, name, error, slot, channel)
    else:
        known = [*gsd.unit_diagnoses.values(), *gsd.channel_errors.values(), *_ERRORS.values()]
        raise ConfigError(f"the file has no diagnosis {name!r}{did_you_mean(name, known)}; it has {listed(known)}")
    if HEAD_OCTETS + len(blocks) > gsd.most_diagnosis:
        what = f"{name!r} makes a diagnosis of {HEAD_OCTETS + len(blocks)} octets"
        raise ConfigError(f"{what}, the file allows {gsd.most_diagnosis}")
    return blocks


def _own_block(bit: int) -> bytes:
    octets = bytearray(bit // 8 + 1)
    octets[-1] = 1 << bit % 8
    return bytes((len(octets) + 1,)) + octets


def _channel_blocks(slave: PluggedSlave, name: str, error: int, slot: int, channel: int) -> bytes:
    module = next((one for one in slave.modules if one.slot == slot), None)
    if module is None:
        raise ConfigError(f"slot {slot} has no module, whose channel could have {name!r}")
    if slot - 1 > _HIGHEST or channel > _HIGHEST:
        raise ConfigError(f"slot {slot}, channel {channel}: a diagnosis counts to {_HIGHEST}")
    marked = bytearray((slave.modules[-1].slot - 1) // 8 + 1)
    marked[(slot - 1) // 8] = 1 << (slot - 1) % 8
    head = bytes((_IDENTIFIERS | len(marked) + 1,)) + marked
    return head + bytes((_CHANNEL | slot - 1, _direction(module) | channel, _BIT | error))


def _direction(module: PluggedModule) -> int:
    return (_INPUT if module.inputs else 0) | (_OUTPUT if module.outputs else 0)
