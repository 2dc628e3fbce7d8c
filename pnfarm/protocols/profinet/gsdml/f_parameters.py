"""F parameters of a PROFIsafe submodule (F_ParameterRecordDataItem), as the parameter record that a controller writes.

Layout after the PROFIsafe profile, V2: F_Prm_Flag1, F_Prm_Flag2, F_Source_Add, F_Dest_Add, F_WD_Time, F_WD_Time_2 and
F_iPar_CRC where the file has them, F_Par_CRC.  Defaults of attributes are those of PI's schema V2.44.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.gsdml.records import ParameterRecord, ParameterRef
from pnfarm.protocols.profinet.gsdml.values import Numbers, parse_number

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.protocols.profinet.gsdml.safe_xml import Node
    from pnfarm.protocols.profinet.gsdml.versions import Attributes

__all__ = ["read_f_parameters"]

_U16 = 0xFFFF
_CHECK = {"NoCheck": 0, "Check": 1}


@dataclass(frozen=True, slots=True)
class _Flag:
    """Bits of one of the two octets of flags; ``words`` where the file has words for its numbers."""

    element: str
    octet: int
    bit: int
    bits: int
    default: str
    allowed: str
    words: Mapping[str, int] = field(default_factory=dict)
    changeable: bool = False


_FLAGS = (
    _Flag("F_Check_SeqNr", 0, 0, 1, "NoCheck", "Check NoCheck", _CHECK),
    _Flag("F_Check_iPar", 0, 1, 1, "NoCheck", "Check NoCheck", _CHECK),
    _Flag("F_SIL", 0, 2, 2, "SIL3", "SIL1 SIL2 SIL3 NoSIL", {"SIL1": 0, "SIL2": 1, "SIL3": 2, "NoSIL": 3}, True),
    _Flag("F_CRC_Length", 0, 4, 2, "3-Byte-CRC", "3-Byte-CRC", {"3-Byte-CRC": 0, "2-Byte-CRC": 1, "4-Byte-CRC": 2}),
    _Flag("F_CRC_Seed", 0, 6, 1, "CRC-Seed24/32", "CRC-Seed24/32", {"CRC-Seed24/32": 1}),
    _Flag("F_Passivation", 1, 0, 1, "Device/Module", "Device/Module", {"Device/Module": 0, "Channel": 1}),
    _Flag("F_Block_ID", 1, 3, 3, "0", "0..7"),
    _Flag("F_Par_Version", 1, 6, 2, "1", "1"),
)
#: Element, type, octets, default, allowed values.
_NUMBERS = (
    ("F_Source_Add", "Unsigned16", 2, "1", "1..65534"),
    ("F_Dest_Add", "Unsigned16", 2, "1", "1..65534"),
    ("F_WD_Time", "Unsigned16", 2, "150", "1..65535"),
    ("F_WD_Time_2", "Unsigned16", 2, "450", "1..65535"),
    ("F_iPar_CRC", "Unsigned32", 4, "0", "0..4294967295"),
    ("F_Par_CRC", "Unsigned16", 2, "53356", "0..65535"),
)
#: Parameters that are in the record whether or not the file names them.
_ALWAYS = {"F_Source_Add", "F_Dest_Add", "F_WD_Time", "F_Par_CRC"}


def _coded(node: Node, attribute: str, text: str, words: Mapping[str, int]) -> str:
    """Words as their numbers."""
    if not words:
        return text
    if any(word not in words for word in text.split()):
        node.fail(attribute, ", ".join(words))
    return " ".join(str(words[word]) for word in text.split())


def _number(node: Node, text: str, maximum: int) -> str:
    try:
        return str(parse_number(text, maximum))
    except ValueError as exc:
        node.fail("DefaultValue", str(exc))


def _numbers(node: Node, text: str, maximum: int) -> str:
    try:
        return Numbers.parse(text, maximum).emit()
    except ValueError as exc:
        node.fail("AllowedValues", str(exc))


def _flag_ref(node: Node, flag: _Flag) -> ParameterRef:
    most = (1 << flag.bits) - 1
    default = _coded(node, "DefaultValue", node.text("DefaultValue") or flag.default, flag.words)
    allowed = _coded(node, "AllowedValues", node.text("AllowedValues") or flag.allowed, flag.words)
    return ParameterRef(
        data_type="BitArea",
        byte_offset=flag.octet,
        bit_offset=flag.bit,
        bit_length=flag.bits,
        default=_number(node, default, most),
        allowed=_numbers(node, allowed, most),
        name=flag.element,
        changeable=flag.changeable,
        texts=tuple((str(number), word) for word, number in flag.words.items()),
    )


def read_f_parameters(attributes: Attributes, node: Node) -> ParameterRecord:
    """The F parameter record with its defaults; a :class:`DecodeError` for a value that none of them has."""
    refs = []
    for flag in _FLAGS:
        child = node.child(flag.element)
        if child is not None:
            refs.append(_flag_ref(child, flag))
    offset = 2
    for element, data_type, octets, default, allowed in _NUMBERS:
        child = node.child(element)
        if child is None:
            if element not in _ALWAYS:
                continue
            child = node
        most = (1 << 8 * octets) - 1
        refs.append(
            ParameterRef(
                data_type=data_type,
                byte_offset=offset,
                default=_number(child, child.text("DefaultValue") or default, most),
                allowed=_numbers(child, child.text("AllowedValues") or allowed, most),
                name=element,
            )
        )
        offset += octets
    return ParameterRecord(
        index=attributes.number(node, "Index", _U16),
        length=offset,
        name="F parameters",
        transfer_sequence=attributes.number(node, "TransferSequence", _U16),
        refs=tuple(refs),
    )
