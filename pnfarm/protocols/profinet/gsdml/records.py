"""Parameter records: what a controller writes to a submodule before the end of parametrisation.

A ``ParameterRecordDataItem`` has a length, constants that fill it, and references (``Ref``) that lay values over
them.  Octets without either are zero.  Values of several octets are big-endian, as everything in PROFINET; bits count
from the least significant one of the octet at the offset.  A bit area that crosses its octet is not supported: makers
and tools disagree on where it continues.
"""

from __future__ import annotations

import math
import struct
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.gsdml.languages import Languages
from pnfarm.protocols.profinet.gsdml.values import parse_octets

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.protocols.profinet.gsdml.file_texts import FileTexts
    from pnfarm.protocols.profinet.gsdml.safe_xml import Node
    from pnfarm.protocols.profinet.gsdml.versions import Attributes

__all__ = ["MAX_RECORD", "Complaint", "ParameterConst", "ParameterRecord", "ParameterRef", "parse_record", "read_ref"]

_ONE_LANGUAGE = Languages()
#: Octets of one record; the standard's own default for a device is 4068.
MAX_RECORD = 0x10000
#: Octets of types with a fixed length, and how they are packed (IEC 61158-6-10, basic data types).
_PACKED = {
    "Integer8": ">b",
    "Integer16": ">h",
    "Integer32": ">i",
    "Integer64": ">q",
    "Unsigned8": ">B",
    "Unsigned16": ">H",
    "Unsigned32": ">I",
    "Unsigned64": ">Q",
    "Float32": ">f",
    "Float64": ">d",
    "Unsigned8_S": ">B",
    "Unsigned16_S": ">H",
    "Integer16_S": ">h",
}
_OCTET_STRINGS = ("OctetString", "OctetString_S")
_LISTED = (*_OCTET_STRINGS, "VisibleString", "UnicodeString8")


@dataclass(frozen=True, slots=True)
class ParameterConst:
    """Constant octets from ``byte_offset`` on."""

    data: bytes
    byte_offset: int = 0


@dataclass(frozen=True, slots=True)
class ParameterRef:
    """One value inside a record; ``default`` and ``allowed`` are as the file writes them.

    ``bit_offset`` and ``bit_length`` are for Bit and BitArea; ``length`` (octets) for strings.  ``texts`` are values
    with what they mean.
    """

    data_type: str
    byte_offset: int = 0
    bit_offset: int = 0
    bit_length: int = 1
    length: int = 0
    default: str = ""
    allowed: str = ""
    name: str = ""
    changeable: bool = True
    visible: bool = True
    texts: tuple[tuple[str, str], ...] = ()

    @property
    def is_bits(self) -> bool:
        return self.data_type in {"Bit", "BitArea"}

    @property
    def bits(self) -> int:
        """Of a Bit, a BitArea or a Boolean."""
        return self.bit_length if self.data_type == "BitArea" else 1

    @property
    def octets(self) -> int | None:
        """Octets from ``byte_offset`` on; None for a type whose length is not known here."""
        if self.is_bits:
            return max(1, (self.bit_offset + self.bits + 7) // 8)
        if self.data_type in _PACKED:
            return struct.calcsize(_PACKED[self.data_type])
        if self.data_type == "Boolean":
            return 1
        return self.length if self.length or self.data_type in _LISTED else None

    def _held(self, number: float) -> float:
        """A number as it is in the record: a Float32 has none that is exactly 0.7."""
        if self.data_type != "Float32":
            return number
        try:
            held: float = struct.unpack(">f", struct.pack(">f", number))[0]
        except OverflowError:
            return number
        return held

    def check(self, value: float) -> str | None:
        """What is wrong with a number for this value, as a sentence's end, or None."""
        if not self.allowed:
            return None
        for word in self.allowed.split():
            low, dots, high = word.partition("..")
            try:
                first = _numeric(low)
                last = _numeric(high) if dots else first
            except ValueError:
                return None  # the maker's own notation: the device decides
            if self._held(first) <= self._held(value) <= self._held(last):
                return None
        return f"allowed is {self.allowed}"

    def put(self, octets: bytearray, text: str, *, checked: bool) -> None:
        """Put the value that ``text`` gives into a record's octets.  Raises :class:`ValueError` with what is allowed.

        ``checked``: compare it with ``allowed``; a maker's own default is not checked.
        """
        if self.data_type in _LISTED:
            if self.data_type == "VisibleString" and not text.isascii():
                raise ValueError("an ASCII text")
            data = parse_octets(text) if self.data_type in _OCTET_STRINGS else text.encode()
            if len(data) > self.length:
                raise ValueError(f"at most {self.length} octets")
            octets[self.byte_offset : self.byte_offset + self.length] = data.ljust(self.length, b"\0")
            return
        value = _numeric(text)
        if checked and self.check(value) is not None:
            raise ValueError(self.allowed)
        if self.is_bits or self.data_type == "Boolean":
            bits = self.bits
            if self.is_bits and self.bit_offset + bits > 8:
                raise ValueError("a bit area inside one octet; of this one the whole record has to be given")
            if value not in range(1 << bits):
                raise ValueError(f"a number from 0 to {(1 << bits) - 1}")
            _lay_bits(octets, self.byte_offset, self.bit_offset if self.is_bits else 0, bits, int(value))
            return
        code = _PACKED.get(self.data_type)
        if code is None:
            raise ValueError(f"a value of another type than {self.data_type}, which is given as the whole record only")
        try:
            packed = struct.pack(code, value if code[1] in "fd" else _whole(value))
        except (struct.error, OverflowError):
            raise ValueError(f"what {self.data_type} holds") from None
        octets[self.byte_offset : self.byte_offset + len(packed)] = packed

    def content(self, text: str, languages: Languages = _ONE_LANGUAGE) -> str:
        """The value that a text of its ValueItem stands for, in any language; ``text`` itself where there is none."""
        return next((content for content, named in self.texts if languages.called(named, text)), text)

    def value(self, octets: bytes) -> float | bytes | None:
        """The value there; None where it does not fit, or is of a type that is not supported."""
        size = self.octets
        if size is None or self.byte_offset + size > len(octets):
            return None
        place = octets[self.byte_offset : self.byte_offset + size]
        if self.is_bits or self.data_type == "Boolean":
            if size > 1:
                return None  # it crosses its octet, see the module's docstring
            return place[0] >> (self.bit_offset if self.is_bits else 0) & (1 << self.bits) - 1
        code = _PACKED.get(self.data_type)
        found: float | bytes = place if code is None else struct.unpack(code, place)[0]
        return found


def _numeric(text: str) -> float:
    """A number, decimal, with 0x or as a fraction; integers stay exact."""
    word = text.strip()
    if word.lower() in {"true", "false"}:
        return int(word.lower() == "true")
    if len(word) > 64:
        raise ValueError("a number")
    for read in (lambda: int(word, 16 if word[:2].lower() == "0x" else 10), lambda: float(word)):
        try:
            return read()
        except ValueError:
            continue
    raise ValueError("a number")


def _whole(value: float) -> int:
    if not math.isfinite(value) or int(value) != value:
        raise OverflowError
    return int(value)


def _lay_bits(octets: bytearray, byte_offset: int, bit_offset: int, bits: int, value: int) -> None:
    mask = ((1 << bits) - 1) << bit_offset
    octets[byte_offset] = octets[byte_offset] & ~mask | value << bit_offset


@dataclass(frozen=True, slots=True)
class Complaint:
    """What is wrong with a written record, as a sentence; ``ref`` is the value that is not allowed, None for a wrong
    length."""

    text: str
    ref: ParameterRef | None = None

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True, slots=True)
class ParameterRecord:
    """A record's index, length in octets, and contents; ``transfer_sequence`` orders records that have one."""

    index: int
    length: int
    name: str = ""
    transfer_sequence: int = 0
    consts: tuple[ParameterConst, ...] = ()
    refs: tuple[ParameterRef, ...] = ()

    def _constants(self) -> bytearray:
        octets = bytearray(self.length)
        for const in self.consts:
            octets[const.byte_offset : const.byte_offset + len(const.data)] = const.data
        return octets

    def defaults(self) -> bytes:
        """The record before anything was written; a default that is not supported (see above) leaves its octets."""
        octets = self._constants()
        for ref in self.refs:
            if ref.default:
                with suppress(ValueError):
                    ref.put(octets, ref.default, checked=False)
        return bytes(octets)

    def complaint(self, octets: bytes) -> Complaint | None:
        """What is wrong with ``octets`` as this record: its length, or the first value that is not allowed."""
        if len(octets) != self.length:
            than = "shorter" if len(octets) < self.length else "longer"
            return Complaint(f"record {self.index} has {len(octets)} octets, {than} than its {self.length}")
        for ref in self.refs:
            value = ref.value(octets)
            wrong = ref.check(value) if isinstance(value, int | float) else None
            if wrong is not None:
                named = f"{value:g}" if isinstance(value, float) else str(value)
                return Complaint(f"record {self.index}, {ref.name or ref.data_type}: {named} is written, {wrong}", ref)
        return None

    def octets(self, values: Mapping[str, str | float] | None = None) -> bytes:
        """The record with its defaults, and ``values`` by the names of its references.

        Raises :class:`ConfigError` for an unknown name, and for a value that is not allowed.
        """
        given = dict(values or {})
        octets = self._constants()
        for ref in self.refs:
            value = given.pop(ref.name, None)
            text = ref.default if value is None else ref.content(str(value))
            if not text and value is None:
                continue
            try:
                ref.put(octets, text, checked=value is not None)
            except ValueError as exc:
                raise ConfigError(
                    f"record {self.index}, {ref.name or ref.data_type}: {text!r} is given, allowed is {exc}"
                ) from exc
        if given:
            known = ", ".join(ref.name for ref in self.refs) or "no value at all"
            raise ConfigError(f"record {self.index} has no value {next(iter(given))!r}, it has {known}")
        return bytes(octets)


def _const(attributes: Attributes, node: Node, length: int) -> ParameterConst:
    offset = attributes.number(node, "ByteOffset", 0xFFFF)
    try:
        data = parse_octets(attributes.text(node, "Data"))
    except ValueError as exc:
        node.fail("Data", str(exc))
    if offset + len(data) > length:
        node.fail("Data", f"octets up to the record's length of {length}")
    return ParameterConst(data, offset)


def read_ref(attributes: Attributes, node: Node, length: int, texts: FileTexts) -> ParameterRef:
    """A Ref of something that has ``length`` octets."""
    ref = ParameterRef(
        data_type=attributes.word(node, "DataType"),
        byte_offset=attributes.number(node, "ByteOffset", 0xFFFF),
        bit_offset=attributes.number(node, "BitOffset", 0xFF),
        bit_length=attributes.number(node, "BitLength", 64),
        length=attributes.number(node, "Length", MAX_RECORD),
        default=attributes.text(node, "DefaultValue"),
        allowed=attributes.text(node, "AllowedValues"),
        name=texts.text(node),
        changeable=attributes.flag(node, "Changeable"),
        visible=attributes.flag(node, "Visible"),
        texts=texts.assigned(node),
    )
    if ref.byte_offset + (ref.octets or 0) > length:
        node.fail("ByteOffset", f"a place inside the record's {length} octets")
    return ref


def parse_record(attributes: Attributes, node: Node, texts: FileTexts) -> ParameterRecord:
    """A ParameterRecordDataItem."""
    length = attributes.number(node, "Length", MAX_RECORD)
    if length == 0:
        node.refuse("Length", "a record has octets")
    return ParameterRecord(
        index=attributes.number(node, "Index", 0xFFFF),
        length=length,
        name=texts.text(node.child("Name")),
        transfer_sequence=attributes.number(node, "TransferSequence", 0xFFFF),
        consts=tuple(_const(attributes, const, length) for const in node.all("Const")),
        refs=tuple(read_ref(attributes, ref, length, texts) for ref in node.all("Ref")),
    )
