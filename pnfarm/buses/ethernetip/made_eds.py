"""An EDS file for a device of which only its identity and one connection are known.

That outputs have the 32-bit header for run and idle, and inputs have none, is assumed: it is what generic modules use.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from pnfarm.protocols.enip.eds.text import Eds, EdsEntry, EdsSection, EdsString, emit_eds

if TYPE_CHECKING:
    from pnfarm.protocols.enip.eds.text import EdsField

__all__ = ["MadeConnection", "made_eds"]

#: Class 1, the first of the triggers, and an exclusive owner or a listener to inputs.
_CLASS_1, _TRIGGER, _OWNER, _INPUTS = 1 << 1, 16, 1 << 26, 1 << 25
#: Priorities low, high and scheduled, point-to-point outputs, inputs either way.
_PARAMETERS: Final = 7 << 24 | 7 << 28 | 1 << 18 | 1 << 21 | 1 << 22
#: Fixed lengths of both directions; variable ones are the next bits.
_FIXED_OUTPUT, _FIXED_INPUT = 1 << 0, 1 << 2
_OUTPUT_FORMAT: Final = 8
_HEARTBEAT, _HEADER = 3, 4


@dataclass(frozen=True, slots=True)
class MadeConnection:
    """``path`` is the application path without key and data; octets of each direction and of a ``configuration``."""

    name: str
    path: bytes
    outputs: int
    inputs: int
    owner: bool
    configuration: int = 0
    trigger: int = 0
    variable_outputs: bool = False
    variable_inputs: bool = False


def made_eds(identity: tuple[int, ...], product: str, source: str, connection: MadeConnection) -> bytes:
    """``identity``: vendor, type, code, major and minor revision; ``source``: what the file is made of."""
    owner = connection.owner
    transport = _CLASS_1 | 1 << _TRIGGER + connection.trigger | (_OWNER if owner else _INPUTS)
    parameters = (
        _PARAMETERS
        | _FIXED_OUTPUT << connection.variable_outputs
        | _FIXED_INPUT << connection.variable_inputs
        | (_HEADER if owner else _HEARTBEAT) << _OUTPUT_FORMAT
    )
    fields: list[EdsField] = [
        f"0x{transport:08X}", f"0x{parameters:08X}", "", str(connection.outputs), "", "",
        str(connection.inputs), "", "", "", str(connection.configuration or ""), "",
        _text(connection.name), EdsString(""), EdsString(connection.path.hex(" ").upper()),
    ]  # fmt: skip
    numbers = zip(("VendCode", "ProdType", "ProdCode", "MajRev", "MinRev"), identity, strict=True)
    named = [("VendName", "Unknown"), ("ProdTypeStr", "Unknown"), ("ProdName", product), ("Catalog", product)]
    sections = (
        EdsSection("File", (EdsEntry("DescText", (_text(f"Made of {source}"),)),)),
        EdsSection(
            "Device",
            (
                *(EdsEntry(key, (str(value),)) for key, value in numbers),
                *(EdsEntry(key, (_text(value),)) for key, value in named),
            ),
        ),
        EdsSection("Device Classification", (EdsEntry("Class1", ("EtherNetIP",)),)),
        EdsSection("Connection Manager", (EdsEntry("Connection1", tuple(fields)),)),
    )
    return emit_eds(Eds(sections), ["Made without the maker's file, which in its place gives the data names."])


def _text(value: str) -> EdsString:
    return EdsString("".join(one for one in value if one.isascii() and one.isprintable() and one not in '"\\')[:60])
