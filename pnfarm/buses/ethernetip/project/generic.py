"""An EDS file for a module of a project: its identity, and its connection as the project has it.

The project names the assemblies and the lengths of the connection, and nothing of what the data mean.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from pnfarm.buses.ethernetip.made_eds import MadeConnection, made_eds
from pnfarm.protocols.enip.connection_check import ASSEMBLY
from pnfarm.protocols.enip.wire.epath import emit_epath, logical_path

if TYPE_CHECKING:
    from pnfarm.buses.projects.l5x import L5xConnection, L5xModule

__all__ = ["configuration_instance", "configuration_octets", "generic_eds", "lengths", "points"]

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


def configuration_octets(module: L5xModule) -> int:
    """How many of its configuration's octets the connection has."""
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
    return emit_epath(logical_path(ASSEMBLY, instance, None, *ways))


def generic_eds(module: L5xModule, connection: L5xConnection) -> bytes | None:
    """The file; None where the project says too little of the connection."""
    path = points(module, connection)
    outputs, inputs = lengths(module, connection)
    if not path or not (outputs or inputs):
        return None
    owner = connection.attributes.get("Type", "") != "Input" and outputs > 0
    made = MadeConnection(
        connection.attributes.get("Name", "") or "Connection",
        path,
        outputs if owner else 0,
        inputs,
        owner=owner,
        configuration=configuration_octets(module),
    )
    numbers = [module.number(key) for key in ("Vendor", "ProductType", "ProductCode")]
    revision = module.number("Major") or 1, module.number("Minor") or 1
    catalog = module.attributes.get("CatalogNumber", "")
    return made_eds((*numbers, *revision), catalog, f"the project's module {module.name}", made)
