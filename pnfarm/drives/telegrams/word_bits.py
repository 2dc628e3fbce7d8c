"""Names of the bits of control and status words, as a model's ``telegrams.toml`` gives them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Container, Iterable, Mapping, Sequence

__all__ = ["STW1_BITS", "ZSW1_BITS", "WordBits", "bit_names", "read_bits"]

#: Control word 1 by bit, in velocity mode, for a model that names none (profile 4.1, 6.3.2; AKD PROFINET manual 5.4).
STW1_BITS = (
    "on",
    "no_coast_stop",
    "no_quick_stop",
    "enable_operation",
    "enable_ramp_generator",
    "unfreeze_ramp_generator",
    "enable_setpoint",
    "fault_acknowledge",
    "jog_1",
    "jog_2",
    "control_by_plc",
)
#: Status word 1 by bit, likewise (AKD PROFINET manual 5.5).
ZSW1_BITS = (
    "ready_to_switch_on",
    "ready_to_operate",
    "operation_enabled",
    "fault_present",
    "coast_stop_not_activated",
    "quick_stop_not_activated",
    "switching_on_inhibited",
    "warning_present",
    "velocity_error_within_range",
    "control_requested",
    "target_velocity_reached",
)


@dataclass(frozen=True, slots=True)
class WordBits:
    """Names of a word's bits, bit 0 first, empty where a bit has no meaning.

    ``telegrams`` are those in which they apply; empty for all others.
    """

    word: str
    telegrams: tuple[int, ...]
    names: tuple[str, ...]
    source: str
    note: str = ""


def bit_names(known: Sequence[WordBits], word: str, telegram: int) -> tuple[str, ...]:
    """The names that apply in this telegram, empty if there are none."""
    own = next((bits.names for bits in known if bits.word == word and telegram in bits.telegrams), None)
    if own is not None:
        return own
    return next((bits.names for bits in known if bits.word == word and not bits.telegrams), ())


def read_bits(
    tables: Iterable[tuple[str, Mapping[str, Any]]], words: Container[str], telegrams: Container[int]
) -> tuple[WordBits, ...]:
    """The entries ``[[bits]]``, each with its place; raises :class:`ConfigError` that names the entry and the field."""
    found: list[WordBits] = []
    for here, table in tables:
        for key in ("word", "names", "source"):
            if key not in table:
                raise ConfigError(f"{here}, {key}: missing")
        if table["word"] not in words:
            raise ConfigError(f"{here}, word: there is no signal {table['word']!r}")
        names = tuple(table["names"])
        if len(names) > 16 or not all(isinstance(name, str) for name in names):
            raise ConfigError(f"{here}, names: at most 16, one for each bit, empty for an unused one")
        wanted = tuple(table.get("telegrams", ()))
        if unknown := [number for number in wanted if number not in telegrams]:
            raise ConfigError(f"{here}, telegrams: there is no telegram {unknown[0]}")
        found.append(WordBits(table["word"], wanted, names, table["source"], table.get("note", "")))
    return tuple(found)
