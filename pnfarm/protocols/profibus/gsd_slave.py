"""A slave as its maker's GSD file describes it: what a master needs to parametrise and to configure it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.gsd_file import GsdBlock, GsdEntry, GsdFile, gsd_number, parse_gsd

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

__all__ = ["GsdSlave", "SlaveModule", "parse_gsd_slave"]

#: Octets behind the first seven of Set_Prm.
MOST_USER: Final = 237
#: Octets of identifiers in Chk_Cfg.
MOST_IDENTIFIERS: Final = 244
_TYPES: Final = {"unsigned8": 1, "unsigned16": 2, "unsigned32": 4, "signed8": 1, "signed16": 2, "signed32": 4}
_AREA: Final = re.compile(r"([0-7])-([0-7])")


@dataclass(frozen=True, slots=True)
class SlaveModule:
    """``user``: what it adds to the user's octets of Set_Prm."""

    name: str
    identifiers: bytes
    user: bytes = b""


@dataclass(frozen=True, slots=True)
class GsdSlave:
    """``user``: the user's octets of Set_Prm of the station itself, with the file's defaults.

    ``modules`` in the file's order; a station that is not modular has one of them.
    """

    name: str
    vendor: str
    ident: int
    modular: bool
    most_modules: int
    modules: tuple[SlaveModule, ...]
    user: bytes
    v1: bool
    freeze: bool
    sync: bool

    def chosen(self, names: Sequence[str]) -> tuple[bytes, bytes]:
        """Identifiers and user's octets of a station with these modules, in the order of its slots.

        Without names: the only module there is.  Raises :class:`DecodeError`.
        """
        known = {module.name.casefold(): module for module in reversed(self.modules)}
        if not names and len(self.modules) == 1:
            found = [self.modules[0]]
        elif not names:
            shown = ", ".join(repr(module.name) for module in self.modules[:8]) or "none"
            raise DecodeError("no-module", f"the file has {len(self.modules)} modules, and one is to be named: {shown}")
        else:
            missing = next((name for name in names if name.casefold() not in known), None)
            if missing is not None:
                shown = ", ".join(repr(module.name) for module in self.modules[:8])
                raise DecodeError("no-module", f"the file has no module {missing!r}; it has {shown}")
            found = [known[name.casefold()] for name in names]
        if len(found) > self.most_modules:
            raise DecodeError("too-many", f"{len(found)} modules, the station has room for {self.most_modules}")
        identifiers = b"".join(module.identifiers for module in found)
        user = self.user + b"".join(module.user for module in found)
        if len(identifiers) > MOST_IDENTIFIERS:
            raise DecodeError("too-long", f"{len(identifiers)} octets of identifiers")
        if len(user) > MOST_USER:
            raise DecodeError("too-long", f"{len(user)} octets of parameters")
        return identifiers, user


def parse_gsd_slave(data: bytes) -> GsdSlave:
    """A whole GSD file.  Raises :class:`DecodeError` where it is none, or of no slave."""
    file = parse_gsd(data)
    ident = _number(file, "Ident_Number")
    if ident is None or not 0 < ident <= 0xFFFF:
        raise DecodeError("no-ident", "no Ident_Number from 1 to 0xFFFF")
    if _number(file, "Station_Type") not in {None, 0}:
        raise DecodeError("no-slave", "Station_Type is not that of a slave (0)")
    values = _defaults(file)
    modules = tuple(module for block in file.blocks("module") if (module := _module(block, values)) is not None)
    modular = bool(_number(file, "Modular_Station"))
    most = _number(file, "Max_Module") if modular else 1
    return GsdSlave(
        name=_text(file, "Model_Name"),
        vendor=_text(file, "Vendor_Name"),
        ident=ident,
        modular=modular,
        most_modules=most or 1,
        modules=modules,
        user=_station_user(file, values),
        v1=bool(_number(file, "DPV1_Slave")),
        freeze=bool(_number(file, "Freeze_Mode_supp")),
        sync=bool(_number(file, "Sync_Mode_supp")),
    )


def _number(file: GsdFile, key: str) -> int | None:
    entry = file.entry(key)
    return None if entry is None else entry.number()


def _text(file: GsdFile, key: str) -> str:
    entry = file.entry(key)
    return "" if entry is None else entry.text()


def _module(block: GsdBlock, values: Mapping[int, GsdEntry]) -> SlaveModule | None:
    """None for a module whose identifiers cannot be read."""
    identifiers = block.head.octets()
    if not identifiers:
        return None
    entry = block.entry("Ext_Module_Prm_Data_Len")
    length = entry.number() if entry is not None else None
    user = _user(block.entries("Ext_User_Prm_Data_Const"), block.entries("Ext_User_Prm_Data_Ref"), values, length)
    return SlaveModule(block.head.text(), identifiers, user)


def _station_user(file: GsdFile, values: Mapping[int, GsdEntry]) -> bytes:
    """By the extended keywords, or by User_Prm_Data of older files."""
    constants, references = file.entries("Ext_User_Prm_Data_Const"), file.entries("Ext_User_Prm_Data_Ref")
    if constants or references:
        return _user(constants, references, values, None)
    plain = file.entry("User_Prm_Data")
    octets = plain.octets() if plain is not None else None
    return (octets or b"")[:MOST_USER]


def _user(
    constants: Sequence[GsdEntry], references: Sequence[GsdEntry], values: Mapping[int, GsdEntry], length: int | None
) -> bytes:
    """Constants first, then the defaults of what may be changed; ``length``: of all, where the file says it."""
    found = bytearray()
    for entry in constants:
        place, octets = gsd_number(entry.argument or "0"), entry.octets()
        if place is not None and octets is not None and 0 <= place <= MOST_USER - len(octets):
            _put(found, place, octets)
    for entry in references:
        place, number = gsd_number(entry.argument or "0"), entry.number()
        value = values.get(-1 if number is None else number)
        if place is not None and value is not None and 0 <= place < MOST_USER:
            _put_default(found, place, value)
    if length is not None and 0 <= length <= MOST_USER:
        found = found[:length].ljust(length, b"\0")
    return bytes(found[:MOST_USER])


def _put(found: bytearray, place: int, octets: bytes) -> None:
    if len(found) < place + len(octets):
        found.extend(bytes(place + len(octets) - len(found)))
    found[place : place + len(octets)] = octets


def _put_default(found: bytearray, place: int, value: GsdEntry) -> None:
    """``Unsigned8 5 0-10``, ``Bit(3) 1 0-1`` or ``BitArea(0-3) 2 0-15``."""
    first = value.value.split()[:1]
    default = gsd_number(first[0]) if first else None
    if default is None:
        return
    kind = value.key.casefold()
    if (octets := _TYPES.get(kind)) is not None:
        _put(found, place, (default & (1 << 8 * octets) - 1).to_bytes(octets, "big"))
        return
    area = _AREA.fullmatch(value.argument.replace(" ", "")) if kind == "bitarea" else None
    low = int(area[1]) if area else gsd_number(value.argument) if kind == "bit" else None
    if low is None or not 0 <= low <= 7:
        return
    width = int(area[2]) - low + 1 if area else 1
    if width < 1:
        return
    mask = (1 << width) - 1
    before = found[place] if place < len(found) else 0
    _put(found, place, bytes((before & ~(mask << low) & 0xFF | (default & mask) << low,)))


def _defaults(file: GsdFile) -> dict[int, GsdEntry]:
    """What may be changed, by its number: the statement with type and default."""
    found: dict[int, GsdEntry] = {}
    for block in file.blocks("extuserprmdata"):
        number = gsd_number(block.head.value.split('"')[0])
        value = next(
            (
                part
                for part in block.parts
                if isinstance(part, GsdEntry) and part.key.casefold() in {*_TYPES, "bit", "bitarea"}
            ),
            None,
        )
        if number is not None and value is not None:
            found.setdefault(number, value)
    return found
