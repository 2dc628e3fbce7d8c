"""What a project and a capture say of a PROFINET station, in words that are the same where they mean the same."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.imports import Said

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

__all__ = ["said_of"]


def said_of(
    name: str,
    numbers: tuple[int, int] | None = None,
    *,
    access_point: int | None = None,
    slots: Iterable[tuple[int, int, tuple[int, int]]] = (),
    order_number: str = "",
    telegrams: Mapping[int, int] | None = None,
) -> Said:
    """``numbers`` are vendor and device; of the others what the source has.

    ``slots``: of each module beside the access point its slot, its ident, and its octets of inputs and of outputs;
    ``telegrams`` by slot.
    """
    identity: dict[str, str] = {}
    if numbers is not None:
        identity["vendor and device"] = f"0x{numbers[0]:04X} and 0x{numbers[1]:04X}"
    if access_point is not None:
        identity["access point"] = f"0x{access_point:08X}"
    if order_number.strip():
        identity["order number"] = " ".join(order_number.split())
    return Said(
        name=name,
        identity=identity,
        subjects={"telegram": ", ".join(str(one) for _, one in sorted(telegrams.items()))} if telegrams else {},
        slots={slot: f"0x{ident:08X} ({inputs} in, {outputs} out)" for slot, ident, (inputs, outputs) in slots},
    )
