"""From the data that a maker's file names to signals; names follow :mod:`pnfarm.signals.naming`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.signals.naming import Datum, signal_names
from pnfarm.signals.signal import Signal

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.wire.value_types import ByteOrder, ValueType

__all__ = ["FileDatum", "named_signals"]


@dataclass(frozen=True, slots=True)
class FileDatum:
    """One datum or bit, its type, and what one step of it is worth."""

    datum: Datum
    type: ValueType
    scale: float = 1.0
    unit: str = ""


def named_signals(found: Sequence[FileDatum], order: ByteOrder) -> tuple[Signal, ...]:
    """In the same order; ``order`` is that of the octets on the bus."""
    return tuple(
        Signal(
            name=name,
            direction=one.datum.direction,
            slot=one.datum.slot,
            subslot=one.datum.subslot,
            octet=one.datum.octet,
            type=one.type,
            bit=one.datum.bit,
            unit=one.unit,
            scale=one.scale,
            order=order,
        )
        for name, one in zip(signal_names([one.datum for one in found]), found, strict=True)
    )
