"""What a model has of the PROFIdrive profile, on whatever bus: its identity, telegrams and signals."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pnfarm.drives.description.parts import NO_IDENTITY, Identity
from pnfarm.drives.telegrams.word_bits import bit_names
from pnfarm.table.axis_codes import OBJECT_INFEED

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.drives.description.parts import SignOfLife
    from pnfarm.drives.profiles.profidrive.pkw import ParameterWords
    from pnfarm.drives.telegrams.telegram import Signal, Telegram
    from pnfarm.drives.telegrams.word_bits import WordBits

__all__ = ["PROFIDRIVE", "Profidrive"]

#: As a model names its profile.
PROFIDRIVE = "profidrive"


@dataclass(frozen=True, slots=True)
class Profidrive:
    """Empty of a drive that does not speak PROFIdrive: it has no telegram and no signal."""

    identity: Identity = NO_IDENTITY
    #: Used unless farm file or controller choose another one.
    default_telegram: int = 0
    telegrams: Mapping[int, Telegram] = field(default_factory=dict)
    #: Those in a submodule beside a telegram's.
    supplements: Mapping[int, Telegram] = field(default_factory=dict)
    signals: Mapping[int, Signal] = field(default_factory=dict)
    word_bits: tuple[WordBits, ...] = ()
    #: The parameter channel of telegrams that have one, None of a drive without.
    parameter_words: ParameterWords | None = None
    sign_of_life: SignOfLife | None = None

    def telegram_by_module(self, module_ident: int, idents: Mapping[int, int] | None = None) -> Telegram | None:
        """The telegram whose module has this ident number, None if none has.

        Of several in one module it is the one with its submodule among ``idents``, by subslot.
        """
        found = [(t, m) for t in self.telegrams.values() for m in t.modules if m.ident == module_ident]
        if len(found) > 1:
            found = [(t, m) for t, m in found if (idents or {}).get(m.data.subslot) == m.data.ident]
        return found[0][0] if found else None

    def bit_names(self, word: str, telegram: int) -> tuple[str, ...]:
        """The names of a control or status word's bits in a telegram, bit 0 first; empty where no manual names any.

        STW1 and ZSW1 of an infeed are E_STW1 and E_ZSW1.
        """
        known = self.telegrams.get(telegram) if word in {"STW1", "ZSW1"} else None
        if known is not None and known.object == OBJECT_INFEED:
            word = f"E_{word}"
        return bit_names(self.word_bits, word, telegram)

    @property
    def infeeds(self) -> frozenset[int]:
        """The telegrams of infeeds."""
        return frozenset(number for number, one in self.telegrams.items() if one.object == OBJECT_INFEED)
