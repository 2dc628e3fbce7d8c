"""Reset to factory settings: which keys of a drive's non-volatile memory it clears, in one table."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.protocols.profinet.dcp.rules import Stored

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["MEMORY_AFTER_RESET", "clear_memory"]

#: Each key of the memory (:mod:`pnfarm.farm.memory.sqlite`) by its kind of data, with its value after a reset.  None
#: removes the key.  Name and address become "", because without the key those of the farm file would apply.
MEMORY_AFTER_RESET: dict[Stored, dict[str, Any]] = {
    Stored.APPLICATION: {"drive": None},
    Stored.IDENTIFICATION: {"im": None},
    Stored.COMMUNICATION: {"name": "", "ip": "", "gateway": "", "dns": None},
    Stored.INTERFACE: {"pdev": None, "hello": None},
    Stored.MANAGEMENT: {"snmp": None},
}


def clear_memory(kept: dict[str, Any], clears: Iterable[Stored]) -> None:
    """Clear the kinds of data in ``kept``, in place."""
    for kind in clears:
        for key, value in MEMORY_AFTER_RESET[kind].items():
            if value is not None:
                kept[key] = value
                continue
            # with those of further axes
            for own in [own for own in kept if own.partition(".")[0] == key]:
                del kept[own]
