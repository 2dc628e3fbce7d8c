"""From the text of an electronic data sheet to what it describes (CIP volume 1, chapter 7-3.6).

=====================  ===========================================================================================
section                what is read of its entries
=====================  ===========================================================================================
File                   nothing
Device                 VendCode, VendName, ProdType, ProdCode, MajRev, MinRev, ProdName, Catalog
Device Classification  ClassN: the networks
Params, Enum           ParamN, EnumN
Assembly               AssemN
Connection Manager     ConnectionN
Port                   PortN: the name of the first one
Capacity               MaxIOConnections, MaxMsgConnections, MaxCIPConnections
=====================  ===========================================================================================

All else is left alone.  A connection that cannot be followed is noted in ``unusable``: another one may do.
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.connection_check import Refusal, read_path
from pnfarm.protocols.enip.eds.document import NO_DATA, Assembly, Connection, Limits, Member, Parameter, Sheet, Way
from pnfarm.protocols.enip.eds.text import EdsString, parse_eds, whole
from pnfarm.protocols.enip.message_router import object_path
from pnfarm.protocols.enip.wire.epath import ElectronicKey
from pnfarm.wire.value_types import ValueType

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.protocols.enip.eds.text import Eds, EdsEntry
    from pnfarm.wire.value_types import Value

__all__ = ["LONGEST_DATA", "parse_sheet"]

#: Octets of data that a frame has room for.
LONGEST_DATA: Final = 1400
_MOST_MEMBERS, _DEEPEST = 4096, 8
#: Octets of one parameter.
_LONGEST_VALUE: Final = 500
_U8, _U16 = 0xFF, 0xFFFF

# Fields of ParamN, from 0.
_PATH, _DESCRIPTOR, _TYPE, _SIZE, _NAME, _UNIT, _HELP, _MINIMUM, _MAXIMUM, _DEFAULT, _SCALING = range(2, 13)
_DECIMALS = 20
# Fields of AssemN.
_ASSEMBLY_PATH, _ASSEMBLY_SIZE, _MEMBERS = 1, 2, 6
# Fields of ConnectionN: trigger and transport, parameters; RPI, size and format of each direction; name, help, path.
_TRANSPORT, _PARAMETERS, _OUTPUTS, _INPUTS = 0, 1, 2, 5
_CONFIGURATIONS = ((8, 9), (10, 11))
_CONNECTION_NAME, _CONNECTION_HELP, _CONNECTION_PATH = 12, 13, 14

_SIGNED = frozenset({0xC2, 0xC3, 0xC4, 0xC5, 0xCC, 0xD6, 0xD7, 0xD8, 0xDB})
_FLOATS = {0xCA: 4, 0xCB: 8}
#: Types that are no numbers, whatever their length.
_TEXTS = frozenset({0xD0, 0xD5, 0xD9, 0xDA, 0xDC, 0xDE})
_NUMBERED = re.compile(r"(param|assem|enum|connection|class|port)([0-9]{1,5})", re.IGNORECASE)
_PATH_PART = re.compile(r"\s*(?:([0-9a-f]{2})|\[?(param[0-9]{1,5})\]?)\s*", re.IGNORECASE)


def _refusal(entry: EdsEntry, what: str) -> DecodeError:
    return DecodeError("bad-entry", f"line {entry.line}: {entry.keyword}: {what}")


def parse_sheet(data: bytes) -> Sheet:
    """A whole file.  Raises :class:`DecodeError` with line and reason."""
    return _SheetReader(parse_eds(data)).sheet()


class _SheetReader:
    """Reads sections of one file; parameters and assemblies are read when they are asked for first."""

    def __init__(self, eds: Eds) -> None:
        self._eds = eds
        self._entries = {kind: self._numbered(section, kind) for section, kind in (
            ("Params", "param"), ("Assembly", "assem"), ("Connection Manager", "connection"),
        )}  # fmt: skip
        self._enums = self._all_enums()
        self._parameters: dict[int, Parameter] = {}
        self._assemblies: dict[int, Assembly] = {}

    def _numbered(self, section: str, kind: str) -> dict[int, EdsEntry]:
        """The entries ``kindN`` of a section; the first of a number counts."""
        found: dict[int, EdsEntry] = {}
        known = self._eds.section(section)
        for entry in known.entries if known is not None else ():
            match = _NUMBERED.fullmatch(entry.keyword)
            if match is not None and match[1].casefold() == kind:
                found.setdefault(int(match[2]), entry)
        return found

    def sheet(self) -> Sheet:
        device = self._eds.section("Device")
        if device is None:
            raise DecodeError("bad-section", "there is no section Device")

        def number(keyword: str, most: int) -> int:
            entry = device.entry(keyword)
            return 0 if entry is None else self._whole(entry, 0, 0, most)

        def text(keyword: str) -> str:
            entry = device.entry(keyword)
            return "" if entry is None else entry.text(0).strip()

        key = ElectronicKey(
            number("VendCode", _U16), number("ProdType", _U16), number("ProdCode", _U16),
            number("MajRev", 0x7F), number("MinRev", _U8),
        )  # fmt: skip
        parameters = {number: self._parameter(number) for number in sorted(self._entries["param"])}
        assemblies = {number: self._assembly(number) for number in sorted(self._entries["assem"])}
        connections, unusable = self._connections()
        ports = self._numbered("Port", "port")
        return Sheet(
            key=key,
            vendor=text("VendName"),
            product=text("ProdName"),
            catalog=text("Catalog"),
            networks=tuple(
                entry.text(0).strip() for entry in self._numbered("Device Classification", "class").values()
            ),
            port=next((entry.text(1).strip() for entry in ports.values()), ""),
            parameters=parameters,
            assemblies=assemblies,
            connections=tuple(connections),
            unusable=unusable,
            io_connections=self._capacity("MaxIOConnections") or self._capacity("MaxCIPConnections"),
            explicit_connections=self._capacity("MaxMsgConnections"),
        )

    def _capacity(self, keyword: str) -> int:
        section = self._eds.section("Capacity")
        entry = None if section is None else section.entry(keyword)
        return 0 if entry is None else self._whole(entry, 0, 0, _U16)

    # -- numbers -----------------------------------------------------------------------------------------------------

    def _whole(self, entry: EdsEntry, place: int, default: int, most: int, *, what: str = "its number") -> int:
        """A field; ``default`` for an empty one."""
        text = entry.text(place).strip()
        if not text:
            return default
        found = whole(text)
        if found is None:
            raise _refusal(entry, f"{what} {text!r} is not a number")
        if not 0 <= found <= most:
            raise _refusal(entry, f"{what} is {found}, not 0 to {most}")
        return found

    def _limits(self, entry: EdsEntry, text: str, most: int, what: str) -> Limits:
        """A number, or a parameter whose value is one."""
        found = whole(text)
        if found is not None:
            limits = Limits(found, found, found)
        else:
            match = _NUMBERED.fullmatch(text)
            named = match is not None and match[1].casefold() == "param" and int(match[2]) in self._entries["param"]
            parameter = self._parameter(int(match[2])) if match is not None and named else None
            if parameter is None or not isinstance(parameter.default, int):
                raise _refusal(entry, f"{what} {text!r} is not a number, and no default of a parameter")
            default = parameter.default
            least, greatest = parameter.minimum, parameter.maximum
            low, high = (int(default if one is None else one) for one in (least, greatest))
            limits = Limits(default, min(low, default), max(high, default))
        if not 0 <= limits.least <= limits.default <= most:
            raise _refusal(entry, f"{what} is {limits.default}, not 0 to {most}")
        return Limits(limits.default, limits.least, min(limits.most, most))

    def _octets(self, entry: EdsEntry, text: str) -> Limits:
        """A size."""
        try:
            return self._limits(entry, text, LONGEST_DATA, "the size")
        except DecodeError as exc:
            number = whole(text)
            if number is None or number < 0:
                raise
            raise _refusal(entry, f"{number} octets of data do not fit into a frame") from exc

    # -- parameters --------------------------------------------------------------------------------------------------

    def _all_enums(self) -> dict[int, dict[int, str]]:
        """``EnumN = value, "text", ...``; the older ``ParamN = "text", ...`` counts from 0."""
        found: dict[int, dict[int, str]] = {}
        for name, kind in (("Params", "enum"), ("Enum", "enum"), ("EnumPar", "param")):
            for number, entry in self._numbered(name, kind).items():
                texts: dict[int, str] = {}
                value: int | None = None
                for place, one in enumerate(entry.fields):
                    if isinstance(one, EdsString):
                        texts.setdefault(len(texts) if value is None else value, one.value.strip())
                        value = None
                    elif isinstance(one, str) and one and (value := whole(one)) is None:
                        raise _refusal(entry, f"field {place + 1}, {one!r}, is neither a number nor a text")
                found.setdefault(number, texts)
        return found

    def _parameter(self, number: int) -> Parameter:
        if number not in self._parameters:
            self._parameters[number] = self._read_parameter(number, self._entries["param"][number])
        return self._parameters[number]

    def _read_parameter(self, number: int, entry: EdsEntry) -> Parameter:
        code = self._whole(entry, _TYPE, 0, _U8, what="its data type")
        size = self._whole(entry, _SIZE, 0, _LONGEST_VALUE, what="its data size") or _FLOATS.get(code, 1)
        kind = _type_of(code, size)
        default = self._value(entry, _DEFAULT, kind)
        least, greatest = self._bounds(entry, kind)
        multiplier, divisor, base = (
            self._whole(entry, _SCALING + place, 1, _U16, what="its scaling") for place in range(3)
        )
        offset = self._value(entry, _SCALING + 3, ValueType("int", 4))
        return Parameter(
            number=number,
            name=entry.text(_NAME).strip() or f"Param{number}",
            path=self._path(entry, _PATH),
            descriptor=self._whole(entry, _DESCRIPTOR, 0, 0xFFFF_FFFF, what="its descriptor"),
            code=code,
            type=kind,
            unit=entry.text(_UNIT).strip(),
            help=entry.text(_HELP).strip(),
            minimum=least,
            maximum=greatest,
            default=kind.decode(bytes(size)) if default is None else default,
            scaling=(multiplier, divisor, base, offset if isinstance(offset, int) else 0),
            decimals=self._whole(entry, _DECIMALS, 0, _U8, what="its precision"),
            enums=self._enums.get(number, {}),
        )

    def _bounds(self, entry: EdsEntry, kind: ValueType) -> tuple[int | float | None, int | float | None]:
        """Minimum and maximum; both the same, or the wrong way round, means none (files have 0 and 0)."""
        found = [self._value(entry, place, kind) for place in (_MINIMUM, _MAXIMUM)]
        least, greatest = (one if isinstance(one, int | float) else None for one in found)
        if least is not None and greatest is not None and least >= greatest:
            return None, None
        return least, greatest

    def _value(self, entry: EdsEntry, place: int, kind: ValueType) -> Value | None:
        """A value of a type; None for an empty field.  A hexadecimal one has the bits of a negative number."""
        text = entry.text(place).strip()
        if not text:
            return None
        if kind.kind == "octets":
            return text.encode("latin-1", "replace")[: kind.octets].ljust(kind.octets, b"\0")
        if kind.kind == "float":
            try:
                number = float(text)
            except ValueError:
                number = math.nan
            if not math.isfinite(number) or not kind.limits[0] <= number <= kind.limits[1]:
                raise _refusal(entry, f"its value {text!r} is not a number of {kind.name}")
            return number
        found = whole(text)
        if found is None:
            raise _refusal(entry, f"its value {text!r} is not a number")
        least, most = (int(limit) for limit in kind.limits)
        if kind.kind == "int" and text.lower().startswith("0x") and most < found <= most - least:
            found += least - most - 1
        if not least <= found <= most:
            raise _refusal(entry, f"its value {text} is outside of {kind.name}")
        return found

    def _path(self, entry: EdsEntry, place: int) -> bytes:
        """Octets in hexadecimal, among them the defaults of parameters."""
        text = entry.text(place).strip()
        found, at = bytearray(), 0
        while at < len(text):
            match = _PATH_PART.match(text, at)
            if match is None or (match[2] and self._numbered_in(match[2]) is None):
                raise _refusal(entry, f"its path {text!r} is not octets alone")
            if match[1]:
                found.append(int(match[1], 16))
            else:
                parameter = self._parameter(int(match[2][5:]))
                found += parameter.encode(parameter.default)
            at = match.end()
        if len(found) % 2:
            raise _refusal(entry, f"its path {text!r} is not whole words")
        return bytes(found)

    def _numbered_in(self, keyword: str) -> EdsEntry | None:
        """The entry of a parameter by which a path is completed; a parameter's own path has none."""
        number = int(keyword[5:])
        return self._entries["param"].get(number) if number in self._parameters else None

    # -- assemblies --------------------------------------------------------------------------------------------------

    def _assembly(self, number: int, depth: int = 0) -> Assembly:
        if number not in self._assemblies:
            self._assemblies[number] = self._read_assembly(number, self._entries["assem"][number], depth)
        return self._assemblies[number]

    def _read_assembly(self, number: int, entry: EdsEntry, depth: int) -> Assembly:
        if depth > _DEEPEST:
            raise _refusal(entry, f"it holds itself, or assemblies are nested deeper than {_DEEPEST}")
        members: list[Member] = []
        place = 0
        for at in range(_MEMBERS, len(entry.fields), 2):
            for member in self._members(entry, at, depth):
                members.append(Member(place, member.bits, member.parameter))
                place += member.bits
            if len(members) > _MOST_MEMBERS:
                raise _refusal(entry, f"it has more than {_MOST_MEMBERS} members")
        text = entry.text(_ASSEMBLY_SIZE).strip()
        size = self._octets(entry, text) if text else Limits(*3 * [-(-place // 8)])
        if place > 8 * size.most:
            raise _refusal(entry, f"its members have {place} bits, its size is {size.most} octets")
        if place > 8 * LONGEST_DATA:
            raise _refusal(entry, f"{-(-place // 8)} octets of data do not fit into a frame")
        return Assembly(number, entry.text(0).strip(), self._instance(entry), size, tuple(members))

    def _members(self, entry: EdsEntry, at: int, depth: int) -> Iterator[Member]:
        """One pair of fields: bits, and what they are."""
        text = entry.text(at + 1).strip()
        match = _NUMBERED.fullmatch(text)
        kind, number = (match[1].casefold(), int(match[2])) if match is not None else ("", 0)
        if kind in {"param", "assem"} and number not in self._entries[kind]:
            raise _refusal(entry, f"there is no {text}")
        if kind == "assem":
            yield from self._assembly(number, depth + 1).members
            return
        parameter = self._parameter(number) if kind == "param" else None
        usual = 8 * parameter.type.octets if parameter is not None else 0
        bits = self._limits(
            entry, entry.text(at).strip() or str(usual), 8 * LONGEST_DATA, "the size of a member"
        ).default
        if bits:
            yield Member(0, bits, parameter)

    def _instance(self, entry: EdsEntry) -> int | None:
        path = self._path(entry, _ASSEMBLY_PATH)
        if not path:
            return None
        try:
            return object_path(path).instance_id
        except DecodeError as exc:
            raise _refusal(entry, f"its path {path.hex(' ').upper()!r} cannot be read: {exc}") from exc

    # -- connections -------------------------------------------------------------------------------------------------

    def _connections(self) -> tuple[list[Connection], dict[str, str]]:
        found: list[Connection] = []
        unusable: dict[str, str] = {}
        for _, entry in sorted(self._entries["connection"].items()):
            try:
                found.append(self._connection(entry))
            except DecodeError as exc:
                # another connection of the file may do; the user hears of it where this one is asked for
                unusable[entry.keyword.casefold()] = exc.detail or exc.reason
        return found, unusable

    def _connection(self, entry: EdsEntry) -> Connection:
        transport = self._whole(entry, _TRANSPORT, 0, 0xFFFF_FFFF, what="trigger and transport")
        parameters = self._whole(entry, _PARAMETERS, 0, 0xFFFF_FFFF, what="connection parameters")
        parts = [self._way(entry, size, form) for size, form in _CONFIGURATIONS]
        path = self._path(entry, _CONNECTION_PATH)
        class_id, points = _points(path)
        return Connection(
            keyword=entry.keyword,
            name=entry.text(_CONNECTION_NAME).strip(),
            help=entry.text(_CONNECTION_HELP).strip(),
            transport=transport,
            parameters=parameters,
            path=path,
            class_id=class_id,
            points=points,
            outputs=self._way(entry, _OUTPUTS + 1, _OUTPUTS + 2, _OUTPUTS),
            inputs=self._way(entry, _INPUTS + 1, _INPUTS + 2, _INPUTS),
            configuration=_joined(parts),
        )

    def _way(self, entry: EdsEntry, size: int, form: int, rpi: int | None = None) -> Way:
        text, described = entry.text(size).strip(), entry.text(form).strip()
        members: tuple[Member, ...] = ()
        octets = Limits(0, 0, 0)
        match = _NUMBERED.fullmatch(described)
        kind, number = (match[1].casefold(), int(match[2])) if match is not None else ("", 0)
        if kind in {"param", "assem"} and number not in self._entries[kind]:
            raise _refusal(entry, f"there is no {described}")
        if kind == "assem":
            assembly = self._assembly(number)
            members, octets = assembly.members, assembly.size
        elif kind == "param":
            parameter = self._parameter(number)
            members = (Member(0, 8 * parameter.type.octets, parameter),)
            octets = Limits(*3 * [parameter.type.octets])
        if text:
            octets = self._octets(entry, text)
        interval = entry.text(rpi).strip() if rpi is not None else ""
        return Way(
            octets,
            tuple(one for one in members if one.place + one.bits <= 8 * octets.most),
            self._limits(entry, interval, 0xFFFF_FFFF, "the packet interval") if interval else None,
        )


def _points(path: bytes) -> tuple[int, tuple[int, ...]]:
    """Class and connection points; 0 and none for a path of another form."""
    try:
        found = read_path(path)
    except Refusal:
        return 0, ()
    return found.class_id, found.points


def _type_of(code: int, size: int) -> ValueType:
    """Little-endian data of this size; a type that is not known, or has another size than its own, is a number."""
    if _FLOATS.get(code) == size:
        return ValueType("float", size)
    if code in _TEXTS or size > 8:
        return ValueType("octets", size)
    return ValueType("int" if code in _SIGNED else "uint", size)


def _joined(parts: list[Way]) -> Way:
    """The parts of a configuration, one behind the other."""
    first, second = parts
    if not second.size.most:
        return first if first.size.most else NO_DATA
    shift = 8 * first.size.default
    size = Limits(*(getattr(first.size, name) + getattr(second.size, name) for name in ("default", "least", "most")))
    behind = tuple(Member(one.place + shift, one.bits, one.parameter) for one in second.members)
    return Way(size, first.members + behind)
