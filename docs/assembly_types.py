"""Commands and responses in the assemblies of a position controller, for the page of a drive that has them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.drives.profiles.cip.words import CONTROL_BITS, STATUS_1_BITS, STATUS_2_BITS
from pnfarm.firmware.causes import NUMBER_MASK
from pnfarm.firmware.ethernetip.message_types import (
    COMMAND_OCTETS,
    COMMAND_TYPES,
    ERRORS,
    RESPONSE_OCTETS,
    RESPONSE_TYPES,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pnfarm.drives.description.model import Model
    from pnfarm.firmware.ethernetip.message_types import MessageType, Octets

__all__ = ["lines"]

MODES = 3


def _places(octets: Octets) -> str:
    return str(octets.first) if octets.first == octets.last else f"{octets.first} to {octets.last}"


def _cells(octets: Octets | None) -> tuple[str, str, str, str]:
    if octets is None:
        return ("-", "-", "-", "-")
    return (_places(octets), octets.kind, octets.unit or "-", octets.meaning)


def _row(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _octets(rows: Iterable[Octets]) -> list[str]:
    return ["| octets | type | unit | meaning |", "|---|---|---|---|", *(_row(*_cells(one)) for one in rows)]


def _modes(kind: MessageType) -> str:
    return "any" if len(kind.modes) == MODES else ", ".join(kind.modes)


def _types(kinds: Iterable[MessageType], *, modes: bool) -> list[str]:
    """One row for each datum, after that of its type."""
    heads = ["number", "name", "what it does", *(["modes"] if modes else []), "octets", "type", "unit", "meaning"]
    found = [_row(*heads, "source"), "|" + "---|" * (len(heads) + 1)]
    for kind in kinds:
        source = f"{kind.source} ({kind.note})" if kind.note else kind.source
        head = (f"`0x{kind.number:02X}`", kind.name, kind.does, *([_modes(kind)] if modes else []))
        for place, octets in enumerate(kind.data or (None,)):
            first = place == 0
            found.append(_row(*(head if first else [""] * len(head)), *_cells(octets), source if first else ""))
    return found


def _bits(word: str, names: Iterable[str]) -> str:
    found = (f"{bit} {name.replace('_', ' ')}" for bit, name in enumerate(names) if name)
    return f"Bits of {word}: {', '.join(found)}."


def lines(described: Model) -> list[str]:
    """The section of the page."""
    facts = {key: fact.value for key, fact in described.bus_facts.items()}
    unhomed = int(described.firmware["ethernetip.unhomed_fault"]) & NUMBER_MASK
    return [
        "## Commands and responses",
        "",
        "The drive has every type that the manual numbers; one that the manual only names, or does not name, is marked",
        "`assumed`. Any other type is refused. A test compares these tables with what the drive takes and refuses. The",
        "least significant octet of a number is the first.",
        "",
        f"### To the drive: assembly {facts['output_assembly']}",
        "",
        *_octets(COMMAND_OCTETS),
        "",
        _bits("the control word", CONTROL_BITS),
        "",
        "A command is taken when *load start* rises, in one of its modes (DRV.OPMODE). One that begins a motion or a",
        "torque needs the drive enabled, without a fault and without a stop bit. In position mode the axis must be",
        f"homed, or fault {unhomed} is raised (its number is assumed). The octets of each type:",
        "",
        *_types(COMMAND_TYPES, modes=True),
        "",
        f"### From the drive: assembly {facts['input_assembly']}",
        "",
        *_octets(RESPONSE_OCTETS),
        "",
        _bits("status word 1", STATUS_1_BITS),
        _bits("status word 2", STATUS_2_BITS),
        "",
        "Octets 4 to 7 belong to the response:",
        "",
        *_types(RESPONSE_TYPES, modes=False),
        "",
        "Errors in response `0x14`; when each comes is assumed where the manual has only the list (6.2.3.5):",
        "",
        "| error code | additional code | what is wrong | when it comes |",
        "|---|---|---|---|",
        *(_row(f"`0x{code & 0xFF:02X}`", f"`0x{code >> 8:02X}`", what, when) for code, (what, when) in ERRORS.items()),
        "",
        "An attribute or a parameter that is refused has the general status of its explicit message, and `0xFF` as the",
        "additional code.",
        "",
    ]
