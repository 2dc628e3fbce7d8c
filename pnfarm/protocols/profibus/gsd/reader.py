"""From the statements of a GSD file to what they say (GSD specification 5.1; EN 50170).

What cannot be read is left out with a warning; a file is refused where it is none of a slave, or has no end.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.gsd.document import Gsd, ModuleItem, SlotItem
from pnfarm.protocols.profibus.gsd.statements import (
    INTERVAL_NS,
    RATES,
    GsdBlock,
    GsdEntry,
    GsdFile,
    Warnings,
    gsd_number,
    parse_gsd,
)
from pnfarm.protocols.profibus.gsd.values import MOST_USER, UserParameters, UserValue

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

__all__ = ["parse_gsd_file"]

#: Blocks, and statements of one kind; real files have up to a thousand.
MOST: Final = 8192
#: Texts of a file; its modules may share a list of them.
MOST_TEXTS: Final = 1 << 16
#: Octets of identifiers of one module.
MOST_IDENTIFIERS: Final = 244
#: Longest record, and slots of Max_Module.
_RECORD, _SLOTS = 240, 244
_TYPES: Final = {"unsigned8": 1, "unsigned16": 2, "unsigned32": 4, "signed8": 1, "signed16": 2, "signed32": 4}
_BITS: Final = ("bit", "bitarea")
_AREA: Final = re.compile(r"([0-7])\s*-\s*([0-7])")
_ANY: Final = r"[+-]?(?:0[xX][0-9A-Fa-f]{1,16}|[0-9]{1,20})"
_RANGE: Final = re.compile(rf"({_ANY})(?:\s*-\s*({_ANY}))?")


class _Reader:
    """One file; ``top`` are its statements outside of blocks, the first of each keyword."""

    def __init__(self, file: GsdFile) -> None:
        self.file = file
        self.warnings = Warnings(file.warnings)
        self.top: dict[str, GsdEntry] = {}
        for part in file.parts:
            if isinstance(part, GsdEntry):
                self.top.setdefault(part.key.casefold(), part)
        self._texts_left = MOST_TEXTS

    # -- single statements -------------------------------------------------------------------------------------------

    def text(self, key: str) -> str:
        entry = self.top.get(key.casefold())
        return "" if entry is None else entry.text()

    def number(self, key: str, highest: int, lowest: int = 0) -> int | None:
        """None without the statement, or where its number is not in these limits."""
        return self.number_of(self.top.get(key.casefold()), highest, lowest)

    def number_of(self, entry: GsdEntry | None, highest: int, lowest: int = 0) -> int | None:
        if entry is None:
            return None
        value = entry.number()
        if value is not None and lowest <= value <= highest:
            return value
        self.warnings.add(entry.line, f"{entry.key} is no number from {lowest} to {highest}")
        return None

    def flag(self, key: str) -> bool:
        return bool(self.number(key, 0xFFFF))

    def required(self, key: str) -> int:
        value = self.number(key, 0xFFFF, 1)
        if value is None:
            entry = self.top.get(key.casefold())
            where = "" if entry is None else f"line {entry.line}: "
            raise DecodeError("no-ident", f"{where}no {key} from 1 to 0xFFFF")
        return value

    def only(self, key: str, wanted: int, what: str) -> None:
        """Refuse a file with another number."""
        entry = self.top.get(key.casefold())
        if entry is not None and entry.number() != wanted:
            raise DecodeError("no-slave", f"line {entry.line}: {key} is not that of {what} ({wanted})")

    def blocks(self, kind: str) -> list[GsdBlock]:
        found = self.file.blocks(kind)
        if len(found) > MOST:
            raise DecodeError("long", f"line {found[MOST].head.line}: more than {MOST} blocks {found[0].head.key}")
        return found

    def index(self, entry: GsdEntry, highest: int) -> int | None:
        """The number in parentheses."""
        found = gsd_number(entry.argument)
        if found is not None and 0 <= found <= highest:
            return found
        self.warnings.add(entry.line, f"{entry.key}({entry.argument}) has no number up to {highest}")
        return None

    def texts(self, entries: Iterable[GsdEntry], highest: int) -> dict[int, str]:
        """``Text(0) = "off"``: number -> text, the first of each."""
        found: dict[int, str] = {}
        for entry in entries:
            self._texts_left -= 1
            if self._texts_left < 0:
                raise DecodeError("long", f"line {entry.line}: more than {MOST_TEXTS} texts")
            if (number := self.index(entry, highest)) is not None:
                found.setdefault(number, entry.text())
        return found

    # -- parameters --------------------------------------------------------------------------------------------------

    def values(self) -> dict[int, UserValue]:
        """The ``ExtUserPrmData`` blocks by their numbers."""
        texts = {
            number: self.texts(block.entries("Text"), 0xFFFF_FFFF)
            for block in self.blocks("prmtext")
            if (number := block.head.number()) is not None
        }
        found: dict[int, UserValue] = {}
        for block in self.blocks("extuserprmdata"):
            number = gsd_number(block.head.value.split('"')[0])
            value = None if number is None else self._value(block, texts)
            if number is None or value is None:
                self.warnings.add(block.head.line, f"{block.head.key} {block.head.value[:40]} cannot be read")
            else:
                found.setdefault(number, value)
        return found

    def _value(self, block: GsdBlock, texts: Mapping[int, Mapping[int, str]]) -> UserValue | None:
        typed = (one for one in block.parts if isinstance(one, GsdEntry) and one.key.casefold() in {*_TYPES, *_BITS})
        entry = next(typed, None)
        if entry is None or not entry.value:
            return None
        first, *rest = entry.value.split(None, 1)
        default, kind = gsd_number(first), entry.key.casefold()
        allowed = _ranges("".join(rest))
        if default is None or allowed is None:
            return None
        low: int | None = None
        width = 0
        if kind == "bit":
            low, width = gsd_number(entry.argument), 1
        elif (area := _AREA.fullmatch(entry.argument)) is not None:
            low, width = int(area[1]), int(area[2]) - int(area[1]) + 1
        if kind in _BITS and (low is None or not 0 <= low <= 7 or width < 1):
            return None
        ref = block.entry("Prm_Text_Ref")
        number = None if ref is None else ref.number()
        named = {} if number is None else texts.get(number, {})
        octets = _TYPES.get(kind, 1)
        return UserValue(block.head.text(), octets, default, kind.startswith("signed"), low, width, allowed, named)

    def parameters(
        self, entries: Sequence[GsdEntry], values: Mapping[int, UserValue], length: int | None = None
    ) -> UserParameters:
        """Of the ``Ext_User_Prm_Data_*`` among these statements."""
        constants: list[tuple[int, bytes]] = []
        named: list[tuple[int, UserValue]] = []
        for entry in entries[:MOST]:
            key = entry.key.casefold()
            if key not in {"ext_user_prm_data_const", "ext_user_prm_data_ref"}:
                continue
            place = self.index(entry, MOST_USER) if entry.argument else 0
            if place is None:
                continue
            if key.endswith("const"):
                octets = entry.octets()
                if octets is None or place + len(octets) > MOST_USER:
                    self.warnings.add(entry.line, f"{entry.key} has no octets that fit")
                else:
                    constants.append((place, octets))
                continue
            number = entry.number()
            value = None if number is None else values.get(number)
            if value is None or place + value.octets > MOST_USER:
                self.warnings.add(entry.line, f"{entry.key} names no ExtUserPrmData that fits")
            else:
                named.append((place, value))
        return UserParameters(tuple(constants), tuple(named), length)

    def station_parameters(self, values: Mapping[int, UserValue]) -> UserParameters:
        """By the extended keywords, or by User_Prm_Data of older files."""
        entries = [part for part in self.file.parts if isinstance(part, GsdEntry)]
        extended = [entry for entry in entries if entry.key.casefold().startswith("ext_user_prm_data_")]
        if extended:
            return self.parameters(extended, values)
        plain = self.top.get("user_prm_data")
        octets = plain.octets() if plain is not None else b""
        if plain is not None and (octets is None or len(octets) > MOST_USER):
            self.warnings.add(plain.line, f"{plain.key} has no octets that fit")
            octets = None
        return UserParameters(((0, octets),) if octets else (), (), self.number("User_Prm_Data_Len", MOST_USER))

    # -- modules and slots -------------------------------------------------------------------------------------------

    def modules(self, values: Mapping[int, UserValue]) -> Iterator[ModuleItem]:
        for block in self.blocks("module"):
            identifiers = block.head.octets()
            if not identifiers or len(identifiers) > MOST_IDENTIFIERS:
                self.warnings.add(block.head.line, f"the module {block.head.text()[:40]!r} has no identifiers")
                continue
            entries = [part for part in block.parts if isinstance(part, GsdEntry)]
            first = {entry.key.casefold(): entry for entry in reversed(entries)}
            # a statement that is a number alone: its keyword
            numbers = (gsd_number(entry.key) for entry in entries if not entry.value and not entry.argument)
            yield ModuleItem(
                block.head.text(),
                identifiers,
                next((number for number in numbers if number is not None), None),
                self.parameters(entries, values, self.number_of(first.get("ext_module_prm_data_len"), MOST_USER)),
                preset=bool(self.number_of(first.get("preset"), 0xFFFF)),
                safety="f_ext_module_prm_data_len" in first,
            )

    def slots(self) -> dict[int, SlotItem]:
        found: dict[int, SlotItem] = {}
        for block in self.blocks("slotdefinition"):
            for entry in block.entries("Slot")[:MOST]:
                number = self.index(entry, _SLOTS)
                words = entry.value.rpartition('"')[2].strip()
                head, *rest = words.split(None, 1) or [""]
                default, allowed = gsd_number(head), _ranges("".join(rest))
                if number is None or default is None or allowed is None:
                    self.warnings.add(entry.line, f"Slot({entry.argument}) has no modules that can be read")
                    continue
                found.setdefault(number, SlotItem(entry.text(), allowed, default or None))
        return found


def _ranges(text: str) -> tuple[tuple[int, int], ...] | None:
    """``0-3,8``; empty for nothing, None for other text."""
    found = []
    for word in filter(None, (one.strip() for one in text.split(","))):
        part = _RANGE.fullmatch(word)
        first = None if part is None else gsd_number(part[1])
        last = first if part is None or part[2] is None else gsd_number(part[2])
        if first is None or last is None:
            return None
        found.append((min(first, last), max(first, last)))
    return tuple(found[:MOST])


def parse_gsd_file(data: bytes) -> Gsd:
    """A whole file.  Raises :class:`DecodeError` where it is none, or of no slave of DP; its detail has the line."""
    reader = _Reader(parse_gsd(data))
    reader.only("Station_Type", 0, "a slave")
    reader.only("Protocol_Ident", 0, "PROFIBUS DP")
    ident = reader.required("Ident_Number")
    modular, v1 = reader.flag("Modular_Station"), reader.flag("DPV1_Slave")
    values = reader.values()
    # the keyword counts to 255, and no Chk_Cfg has room for so many
    most = min(reader.number("Max_Module", 0xFF) or 1, _SLOTS) if modular else 1
    class_one = v1 and (reader.flag("C1_Read_Write_supp") or "c1_read_write_supp" not in reader.top)
    class_two = v1 and reader.flag("C2_Read_Write_supp")
    entries = [part for part in reader.file.parts if isinstance(part, GsdEntry)]
    return Gsd(
        vendor=reader.text("Vendor_Name"),
        model=reader.text("Model_Name"),
        revision=reader.text("Revision"),
        ident=ident,
        hardware=reader.text("Hardware_Release"),
        software=reader.text("Software_Release"),
        order_number=reader.text("OrderNumber"),
        family=_family(reader.text("Slave_Family")),
        rates={
            rate: reader.number(f"MaxTsdr_{word}", 0xFFFF)
            for rate, word in RATES.items()
            if reader.flag(f"{word}_supp")
        },
        freeze=reader.flag("Freeze_Mode_supp"),
        sync=reader.flag("Sync_Mode_supp"),
        fail_safe=reader.flag("Fail_Safe"),
        address_changes=reader.flag("Set_Slave_Add_supp"),
        modular=modular,
        most_modules=most,
        most_inputs=reader.number("Max_Input_Len", 0xFFFF) if modular else None,
        most_outputs=reader.number("Max_Output_Len", 0xFFFF) if modular else None,
        most_data=reader.number("Max_Data_Len", 0xFFFF) if modular else None,
        most_parameters=reader.number("Max_User_Prm_Data_Len", MOST_USER),
        most_diagnosis=reader.number("Max_Diag_Data_Len", 244, 6) or 244,
        v1=v1,
        class_one=(reader.number("C1_Max_Data_Len", _RECORD) or _RECORD) if class_one else 0,
        class_two=(reader.number("C2_Max_Data_Len", _RECORD) or _RECORD) if class_two else 0,
        connections=(reader.number("C2_Max_Count_Channels", 49) or 1) if class_two else 0,
        interval_ns=(reader.number("Min_Slave_Intervall", 0xFFFF) or 0) * INTERVAL_NS,
        parameters=reader.station_parameters(values),
        modules=tuple(reader.modules(values)),
        slots=reader.slots(),
        unit_diagnoses=reader.texts((one for one in entries if one.key.casefold() == "unit_diag_bit"), 8 * 62 - 1),
        channel_errors=reader.texts((one for one in entries if one.key.casefold() == "channel_diag"), 31),
        warnings=reader.warnings.all(),
    )


def _family(text: str) -> int:
    """``3@Digital@24V``: the number of the main family, 0 (general) without one."""
    number = gsd_number(text.partition("@")[0])
    return number if number is not None and 0 <= number <= 0xFF else 0
