"""An EDS file for a module of a project: its identity, and its connection as the project has it.

The project names the assemblies and the lengths of the connection, and nothing of what the data mean.  That outputs
have the 32-bit header for run and idle, and inputs have none, is assumed: it is what generic modules use.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from pnfarm.protocols.enip.eds.text import Eds, EdsEntry, EdsSection, EdsString, emit_eds
from pnfarm.protocols.enip.wire.epath import Logical, LogicalSegment, emit_epath, logical_path

if TYPE_CHECKING:
    from pnfarm.buses.projects.l5x import L5xConnection, L5xModule
    from pnfarm.protocols.enip.eds.text import EdsField

__all__ = ["configuration_instance", "generic_eds", "lengths", "points"]

_ASSEMBLY: Final = 0x04
#: Class 1, cyclic, and an exclusive owner or a listener to inputs.
_OWNER, _INPUTS = 0x0401_0002, 0x0201_0002
#: Fixed lengths, priorities low, high and scheduled, point-to-point outputs, inputs either way.
_PARAMETERS: Final = 1 << 0 | 1 << 2 | 7 << 24 | 7 << 28 | 1 << 18 | 1 << 21 | 1 << 22
_OUTPUT_FORMAT: Final = 8
_HEARTBEAT, _HEADER = 3, 4
_CONFIGURATION = re.compile(r"\[\s*([0-9]{1,9})\s*,\s*([0-9]{1,9})\s*[,\]]")
#: Octets in front of a configuration: its length and its instance are among them.
_CONFIGURATION_HEAD: Final = 4


def _number(text: str) -> int:
    return int(text) if text.isascii() and text.isdigit() and len(text) < 10 else 0


def lengths(module: L5xModule, connection: L5xConnection) -> tuple[int, int]:
    """Octets of outputs and of inputs; those of the module count where the connection has none."""
    first = connection is module.connections[0]
    found = []
    for way in ("Output", "Input"):
        usual = module.communications.get(f"PrimCxn{way}Size", "") if first else ""
        found.append(_number(connection.attributes.get(f"{way}Size", usual)))
    return found[0], found[1]


def configuration_instance(module: L5xModule) -> int:
    """The instance of its configuration, 0 for none: the second number of the configuration."""
    found = _CONFIGURATION.match(module.configuration)
    return 0 if found is None else int(found[2])


def _configuration_octets(module: L5xModule) -> int:
    found = _CONFIGURATION.match(module.configuration)
    return 0 if found is None else max(0, int(found[1]) - _CONFIGURATION_HEAD)


def points(module: L5xModule, connection: L5xConnection) -> bytes:
    """The application path; empty where the project does not name the assemblies."""
    written = connection.attributes.get("ConnectionPath", "")
    if written:
        digits = written.replace(" ", "")
        return bytes.fromhex(digits) if re.fullmatch(r"(?:[0-9A-Fa-f]{2}){1,64}", digits) else b""
    ways = [_number(connection.attributes.get(f"{way}CxnPoint", "")) for way in ("Output", "Input")]
    if not all(0 < point <= 0xFFFF for point in ways):
        return b""
    instance = configuration_instance(module)
    if not 0 < instance <= 0xFFFF:
        return b""
    segments = (*logical_path(_ASSEMBLY, instance), *(LogicalSegment(Logical.CONNECTION_POINT, one) for one in ways))
    return emit_epath(segments)


def generic_eds(module: L5xModule, connection: L5xConnection) -> bytes | None:
    """The file; None where the project says too little of the connection."""
    path = points(module, connection)
    outputs, inputs = lengths(module, connection)
    if not path or not (outputs or inputs):
        return None
    owner = connection.attributes.get("Type", "") != "Input" and outputs > 0
    parameters = _PARAMETERS | (_HEADER if owner else _HEARTBEAT) << _OUTPUT_FORMAT
    octets = _configuration_octets(module)
    fields: list[EdsField] = [
        f"0x{_OWNER if owner else _INPUTS:08X}", f"0x{parameters:08X}", "", str(outputs if owner else 0), "", "",
        str(inputs), "", "", "", str(octets) if octets else "", "",
        _text(connection.attributes.get("Name", "") or "Connection"), EdsString(""), EdsString(path.hex(" ").upper()),
    ]  # fmt: skip
    device = {
        "VendCode": module.number("Vendor"), "ProdType": module.number("ProductType"),
        "ProdCode": module.number("ProductCode"), "MajRev": module.number("Major") or 1,
        "MinRev": module.number("Minor") or 1,
    }  # fmt: skip
    catalog = module.attributes.get("CatalogNumber", "")
    named = [("VendName", "Unknown"), ("ProdTypeStr", "Unknown"), ("ProdName", catalog), ("Catalog", catalog)]
    sections = (
        EdsSection("File", (EdsEntry("DescText", (_text(f"Made of the project's module {module.name}"),)),)),
        EdsSection(
            "Device",
            (
                *(EdsEntry(key, (str(value),)) for key, value in device.items()),
                *(EdsEntry(key, (_text(value),)) for key, value in named),
            ),
        ),
        EdsSection("Device Classification", (EdsEntry("Class1", ("EtherNetIP",)),)),
        EdsSection("Connection Manager", (EdsEntry("Connection1", tuple(fields)),)),
    )
    return emit_eds(Eds(sections), ["Made of a project: the maker's own file in its place gives the data names."])


def _text(value: str) -> EdsString:
    return EdsString("".join(one for one in value if one.isascii() and one.isprintable() and one not in '"\\')[:60])
