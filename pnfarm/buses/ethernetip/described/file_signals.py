"""The signals of a described device: the members of its assemblies as named values.

The *slot* of a signal is the instance of its assembly, the *subslot* always 1.  A bit string whose bits the file names
gives one signal for each of these; a member that is not whole octets gives one for each of its bits.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.signals.file_signals import FileDatum, named_signals
from pnfarm.signals.naming import Datum
from pnfarm.wire.value_types import BOOL, ValueType

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from pnfarm.protocols.enip.eds.document import Member
    from pnfarm.signals.signal import Direction, Signal

__all__ = ["SUBSLOT", "assembly_signals"]

SUBSLOT = 1


def _member_signals(direction: Direction, instance: int, member: Member) -> Iterator[FileDatum]:
    parameter = member.parameter
    if parameter is None:
        return
    octet, bit = divmod(member.place, 8)

    def datum(text: str, octet: int, bit: int | None = None) -> Datum:
        return Datum(text, direction, instance, SUBSLOT, octet, bit)

    whole = not bit and not member.bits % 8
    if parameter.bit_names:
        for number, name in parameter.bit_names.items():
            if 0 <= number < member.bits:
                yield FileDatum(datum(name, *divmod(member.place + number, 8)), BOOL)
    elif member.bits == 1 or (whole and parameter.is_bool):
        # CIP has 0 and 1 in the octet of a BOOL
        yield FileDatum(datum(parameter.name, octet, bit), BOOL)
    elif whole:
        size = member.bits // 8
        kind = parameter.type
        if size != kind.octets:
            kind = ValueType(kind.kind if kind.kind in {"int", "uint"} and size <= 8 else "octets", size)
        scale = parameter.scale if kind.is_number else 1.0
        yield FileDatum(datum(parameter.name, octet), kind, scale, parameter.unit)
    else:
        for number in range(member.bits):
            yield FileDatum(datum(f"{parameter.name} {number}", *divmod(member.place + number, 8)), BOOL)


def assembly_signals(assemblies: Iterable[tuple[Direction, int, int, Sequence[Member]]]) -> tuple[Signal, ...]:
    """Of assemblies (direction, instance, octets, members); one that the file does not divide is one signal."""
    found: list[FileDatum] = []
    for direction, instance, octets, members in assemblies:
        if octets and not any(member.parameter for member in members):
            text = "inputs" if direction == "input" else "outputs"
            found.append(FileDatum(Datum(text, direction, instance, SUBSLOT, 0), ValueType("octets", octets)))
        for member in members:
            found += _member_signals(direction, instance, member)
    return named_signals(found, "little")
