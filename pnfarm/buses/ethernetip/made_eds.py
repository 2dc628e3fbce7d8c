"""An EDS file for a device of which only its identity and one connection are known.

That outputs have the 32-bit header for run and idle, and inputs have none, is assumed: it is what generic modules use.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from pnfarm.protocols.enip.connection import ConnectionKind
from pnfarm.protocols.enip.eds import bits
from pnfarm.protocols.enip.eds.text import Eds, EdsEntry, EdsSection, EdsString, emit_eds

if TYPE_CHECKING:
    from pnfarm.protocols.enip.eds.text import EdsField

__all__ = ["MadeConnection", "made_eds"]

#: Point-to-point outputs, inputs either way.
_PARAMETERS: Final = bits.PRIORITIES | bits.OUTPUT_POINT_TO_POINT | bits.INPUT_MULTICAST | bits.INPUT_POINT_TO_POINT


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
    kind = bits.KINDS[ConnectionKind.EXCLUSIVE_OWNER if owner else ConnectionKind.INPUT_ONLY]
    transport = bits.CLASS_1 | 1 << bits.FIRST_TRIGGER + connection.trigger | kind
    parameters = (
        _PARAMETERS
        | bits.FIXED_OUTPUTS << connection.variable_outputs
        | bits.FIXED_INPUTS << connection.variable_inputs
        | (bits.HEADER if owner else bits.HEARTBEAT) << bits.OUTPUT_FORMAT
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
