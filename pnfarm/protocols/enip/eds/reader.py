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

All else is left alone.  A connection that cannot be followed is noted in ``unusable``: another one may do.  An assembly
that cannot be followed is left out, with a remark: makers' files have some that no connection uses.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.connection_check import Refusal, read_path
from pnfarm.protocols.enip.eds.document import NO_DATA, Assembly, Connection, Limits, Member, Sheet, Way
from pnfarm.protocols.enip.eds.fields import LONGEST_DATA, NUMBERED, FieldReader, numbered, refusal
from pnfarm.protocols.enip.eds.text import parse_eds
from pnfarm.protocols.enip.message_router import object_path
from pnfarm.protocols.enip.wire.epath import ElectronicKey

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.protocols.enip.eds.text import Eds, EdsEntry

__all__ = ["parse_sheet"]

_MOST_MEMBERS, _DEEPEST = 4096, 8
#: Members of all assemblies and connections together: assemblies may hold each other.
_MOST_OF_ALL = 1 << 19
_MOST_REMARKS = 20
_U8, _U16 = 0xFF, 0xFFFF

# Fields of AssemN.
_ASSEMBLY_PATH, _ASSEMBLY_SIZE, _MEMBERS = 1, 2, 6
# Fields of ConnectionN: trigger and transport, parameters; RPI, size and format of each direction; name, help, path.
_TRANSPORT, _PARAMETERS, _OUTPUTS, _INPUTS = 0, 1, 2, 5
_CONFIGURATIONS = ((8, 9), (10, 11))
_CONNECTION_NAME, _CONNECTION_HELP, _CONNECTION_PATH = 12, 13, 14


def parse_sheet(data: bytes) -> Sheet:
    """A whole file.  Raises :class:`DecodeError` with line and reason."""
    return _SheetReader(parse_eds(data)).sheet()


class _SheetReader:
    """Reads the sections of one file; assemblies are read when they are asked for first."""

    def __init__(self, eds: Eds) -> None:
        self._eds = eds
        self._fields = FieldReader(eds)
        self._entries = {
            "param": self._fields.entries,
            "assem": numbered(eds, "Assembly", "assem"),
            "connection": numbered(eds, "Connection Manager", "connection"),
        }
        self._assemblies: dict[int, Assembly] = {}
        self._refused: dict[int, DecodeError] = {}
        self._remarks: list[str] = []
        self._members_read = 0

    def sheet(self) -> Sheet:
        device = self._eds.section("Device")
        if device is None:
            raise DecodeError("bad-section", "there is no section Device")

        def number(keyword: str, most: int) -> int:
            entry = device.entry(keyword)
            return 0 if entry is None else self._fields.whole(entry, 0, 0, most)

        def text(keyword: str) -> str:
            entry = device.entry(keyword)
            return "" if entry is None else entry.text(0).strip()

        key = ElectronicKey(
            number("VendCode", _U16), number("ProdType", _U16), number("ProdCode", _U16),
            number("MajRev", 0x7F), number("MinRev", _U8),
        )  # fmt: skip
        parameters = {number: self._fields.parameter(number) for number in sorted(self._entries["param"])}
        assemblies = self._all_assemblies()
        connections, unusable = self._connections()
        ports = numbered(self._eds, "Port", "port")
        return Sheet(
            key=key,
            vendor=text("VendName"),
            product=text("ProdName"),
            catalog=text("Catalog"),
            networks=tuple(
                entry.text(0).strip() for entry in numbered(self._eds, "Device Classification", "class").values()
            ),
            port=next((entry.text(1).strip() for entry in ports.values()), ""),
            parameters=parameters,
            assemblies=assemblies,
            connections=tuple(connections),
            unusable=unusable,
            remarks=tuple(self._remarks[:_MOST_REMARKS]),
            io_connections=self._capacity("MaxIOConnections") or self._capacity("MaxCIPConnections"),
            explicit_connections=self._capacity("MaxMsgConnections"),
        )

    def _capacity(self, keyword: str) -> int:
        section = self._eds.section("Capacity")
        entry = None if section is None else section.entry(keyword)
        return 0 if entry is None else self._fields.whole(entry, 0, 0, _U16)

    # -- assemblies --------------------------------------------------------------------------------------------------

    def _all_assemblies(self) -> dict[int, Assembly]:
        found: dict[int, Assembly] = {}
        for number in sorted(self._entries["assem"]):
            try:
                found[number] = self._assembly(number)
            except DecodeError as exc:
                self._remarks.append(exc.detail or exc.reason)
            self._check_bound(self._entries["assem"][number])
        return found

    def _check_bound(self, entry: EdsEntry) -> None:
        if self._members_read > _MOST_OF_ALL:
            what = f"{entry.keyword} and those before it have more than {_MOST_OF_ALL} members"
            raise DecodeError("long", f"line {entry.line}: {what}")

    def _assembly(self, number: int, depth: int = 0) -> Assembly:
        if number in self._refused:
            raise self._refused[number]
        if number not in self._assemblies:
            try:
                self._assemblies[number] = self._read_assembly(number, self._entries["assem"][number], depth)
            except DecodeError as exc:
                self._refused[number] = exc
                raise
        return self._assemblies[number]

    def _read_assembly(self, number: int, entry: EdsEntry, depth: int) -> Assembly:
        if depth > _DEEPEST:
            raise refusal(entry, f"it holds itself, or assemblies are nested deeper than {_DEEPEST}")
        members: list[Member] = []
        place = 0
        for at in range(_MEMBERS, len(entry.fields), 2):
            for member in self._members(entry, number, at, depth):
                members.append(Member(place, member.bits, member.parameter))
                place += member.bits
                self._members_read += 1
            if len(members) > _MOST_MEMBERS:
                raise refusal(entry, f"it has more than {_MOST_MEMBERS} members")
        text = entry.text(_ASSEMBLY_SIZE).strip()
        size = self._fields.octets(entry, text) if text else Limits(*3 * [-(-place // 8)])
        if size.most > LONGEST_DATA:
            raise refusal(entry, f"{size.most} octets of data do not fit into a frame")
        if place > 8 * size.most:
            # makers' files have such: the size is what connections use
            what = f"its members have {place} bits, its size is {size.most} octets: it has those that fit"
            self._remarks.append(f"line {entry.line}: {entry.keyword}: {what}")
            members = [one for one in members if one.place + one.bits <= 8 * size.most]
        return Assembly(number, entry.text(0).strip(), self._instance(entry), size, tuple(members))

    def _members(self, entry: EdsEntry, own: int, at: int, depth: int) -> Iterator[Member]:
        """One pair of fields: bits, and what they are; an assembly that names itself there has bits without meaning."""
        text, bits_text = entry.text(at + 1).strip(), entry.text(at).strip()
        match = NUMBERED.fullmatch(text)
        kind, number = (match[1].casefold(), int(match[2])) if match is not None else ("", 0)
        if kind in {"param", "assem"} and number not in self._entries[kind]:
            raise refusal(entry, f"there is no {text}")
        inner = self._assembly(number, depth + 1) if kind == "assem" and not (number == own and bits_text) else None
        parameter = self._fields.parameter(number) if kind == "param" else None
        usual = 8 * (inner.size.default if inner is not None else parameter.type.octets if parameter is not None else 0)
        bits = self._fields.limits(entry, bits_text or str(usual), 8 * LONGEST_DATA, "the size of a member").default
        if inner is not None:
            yield from inner.members
            # what is after its members counts, too
            bits, parameter = bits - sum(one.bits for one in inner.members), None
        if bits > 0:
            yield Member(0, bits, parameter)

    def _instance(self, entry: EdsEntry) -> int | None:
        path = self._fields.path(entry, _ASSEMBLY_PATH)
        if not path:
            return None
        try:
            return object_path(path).instance_id
        except DecodeError as exc:
            raise refusal(entry, f"its path {path.hex(' ').upper()!r} cannot be read: {exc}") from exc

    # -- connections -------------------------------------------------------------------------------------------------

    def _connections(self) -> tuple[list[Connection], dict[str, str]]:
        found: list[Connection] = []
        unusable: dict[str, str] = {}
        for _, entry in sorted(self._entries["connection"].items()):
            try:
                found.append(self._connection(entry))
            except DecodeError as exc:
                # another connection of the file may do; the user gets the reason when this one is asked for
                unusable[entry.keyword.casefold()] = exc.detail or exc.reason
            self._check_bound(entry)
        return found, unusable

    def _connection(self, entry: EdsEntry) -> Connection:
        transport = self._fields.whole(entry, _TRANSPORT, 0, 0xFFFF_FFFF, what="trigger and transport")
        parameters = self._fields.whole(entry, _PARAMETERS, 0, 0xFFFF_FFFF, what="connection parameters")
        parts = [self._way(entry, size, form) for size, form in _CONFIGURATIONS]
        path = self._fields.path(entry, _CONNECTION_PATH)
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
        match = NUMBERED.fullmatch(described)
        kind, number = (match[1].casefold(), int(match[2])) if match is not None else ("", 0)
        if kind in {"param", "assem"} and number not in self._entries[kind]:
            raise refusal(entry, f"there is no {described}")
        if kind == "assem":
            assembly = self._assembly(number)
            members, octets = assembly.members, assembly.size
            self._members_read += len(members)
        elif kind == "param":
            parameter = self._fields.parameter(number)
            members = (Member(0, 8 * parameter.type.octets, parameter),)
            octets = Limits(*3 * [parameter.type.octets])
        if text:
            octets = self._fields.octets(entry, text)
        interval = entry.text(rpi).strip() if rpi is not None else ""
        return Way(
            octets,
            tuple(one for one in members if one.place + one.bits <= 8 * octets.most),
            self._fields.limits(entry, interval, 0xFFFF_FFFF, "the packet interval", free=True) if interval else None,
        )


def _points(path: bytes) -> tuple[int, tuple[int, ...]]:
    """Class and connection points; 0 and none for a path of another form."""
    try:
        found = read_path(path)
    except Refusal:
        return 0, ()
    return found.class_id, found.points


def _joined(parts: list[Way]) -> Way:
    """The parts of a configuration, one after the other."""
    first, second = parts
    if not second.size.most:
        return first if first.size.most else NO_DATA
    shift = 8 * first.size.default
    size = Limits(*(getattr(first.size, name) + getattr(second.size, name) for name in ("default", "least", "most")))
    behind = tuple(Member(one.place + shift, one.bits, one.parameter) for one in second.members)
    return Way(size, first.members + behind)
