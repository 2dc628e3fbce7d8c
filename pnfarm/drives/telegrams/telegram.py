"""Signals, telegrams, and the words that the engine moves.

A telegram has a list of words for each direction; a double word takes two consecutive ones, its upper half first.
``output`` goes from the controller to the drive (set points), ``input`` back (actual values).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.table.axis_codes import OBJECT_AXIS, OBJECT_CONTROL_UNIT, OBJECT_ENCODER, OBJECT_INFEED, TASKS_NONE
from pnfarm.table.signals import ACTUAL_SLOTS, PART_HIGH, PART_LOW, PART_WORD, SETPOINT_SLOTS, WORD_NONE, word_code

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

__all__ = [
    "NO_MODULE",
    "NO_TELEGRAM",
    "PARAMETER_WORDS",
    "TASK_FORMS",
    "MappingError",
    "Module",
    "Signal",
    "Submodule",
    "Telegram",
    "object_of",
    "parameter_signals",
    "signal_codes",
    "signal_numbers",
    "whole_signals",
    "with_choices",
]

#: Number of words of a parameter channel, before all others.
PARAMETER_WORDS = 4


class MappingError(ConfigError):
    """A list of signals is not a valid telegram; ``index`` is the wrong entry."""

    def __init__(self, index: int, sentence: str) -> None:
        super().__init__(f"word {index + 1}: {sentence}")
        self.index = index


@dataclass(frozen=True, slots=True)
class Signal:
    """A signal by its number: ``bits`` is 16 or 32; ``setpoint`` distinguishes set points from actual values.

    A set point that is ``readable`` can be echoed as received.  ``stored``: it is not an actual value but a stored
    parameter of this number, of an array its ``element``.  ``shown_as``: lists use the number of its parameter instead
    of its own number, which only the profile defines; 0 for its own.  ``signed``: it is a signed number; this may be
    left out if a parameter of the same name gives it.  ``real``: its 32 bits are a number of single precision.
    """

    number: int
    name: str
    bits: int
    setpoint: bool
    drive_signal: str
    source: str
    note: str = ""
    readable: bool = False
    stored: bool = False
    element: int = 0
    shown_as: int = 0
    signed: bool = False
    real: bool = False

    @property
    def back(self) -> Signal:
        """This set point as the drive sends it back."""
        return replace(self, name=f"{self.name}_BACK", setpoint=False)

    @property
    def slot(self) -> int:
        """Its slot in the process image."""
        return (SETPOINT_SLOTS if self.setpoint else ACTUAL_SLOTS)[self.name]


@dataclass(frozen=True, slots=True)
class Submodule:
    """A submodule; data lengths in octets without IOPS and IOCS."""

    slot: int
    subslot: int
    ident: int
    api: int
    input_bytes: int
    output_bytes: int
    name: str = ""
    source: str = ""
    note: str = ""

    @property
    def has_data(self) -> bool:
        return bool(self.input_bytes or self.output_bytes)


@dataclass(frozen=True, slots=True)
class Module:
    """A module of the drive; ``slot`` is that of its submodules.

    ``choices`` are other submodules that it takes, in their subslots: those of other telegrams, supplementary ones,
    those without data that a maker's file has.
    """

    ident: int
    submodules: tuple[Submodule, ...]
    source: str = ""
    note: str = ""
    #: Its name among other modules of the same telegram.
    name: str = ""
    #: Parameters that plugging it sets, if different from its telegram: PNU -> raw number.
    settings: Mapping[int, int] = field(default_factory=dict, hash=False)
    choices: tuple[Submodule, ...] = ()

    @property
    def slot(self) -> int:
        return self.submodules[0].slot

    @property
    def data(self) -> Submodule:
        """The submodule with the telegram's data."""
        return next((one for one in self.submodules if one.has_data), self.submodules[-1])


#: For a drive without modules.
NO_MODULE = Module(0, ())

#: Control words of objects that are no axis.
_OBJECTS = {"STW2_ENC": OBJECT_ENCODER, "CU_STW1": OBJECT_CONTROL_UNIT, "E_STW1": OBJECT_INFEED}

#: How a telegram selects traversing tasks: names of ``TASKS_*``, by number.
TASK_FORMS = ("none", "mdi", "pos-stw", "target-position", "driving-set")


@dataclass(frozen=True, slots=True)
class Telegram:
    """A telegram: its module in slot 1 and its words.

    ``module`` is the one to use; ``others`` carry the same telegram.  The first ``parameter_words`` of both directions
    are a parameter channel, which a free mapping leaves alone.  ``settings`` (PNU -> raw number) are what plugging a
    module of this telegram sets.

    ``output`` and ``input`` name the signals, None for a word without one; ``output_words`` and ``input_words`` are the
    same as word codes (:func:`pnfarm.table.signals.word_code`).  With ``free_mapping`` the words are only the default.
    ``opmode`` is the axis's operation mode that comes with the telegram, None where a parameter sets it.
    ``tasks`` is how it selects traversing tasks (``TASKS_*`` of the axis).
    ``pulses_enabled`` is the bit of ZSW2 for enabled pulses in this telegram, None without one.
    ``falls_back`` names set points whose parameter applies while the telegram's word is 0.
    ``own_words``: a farm file may give the words (:mod:`pnfarm.drives.telegrams.own_words`).
    ``identifiers`` are the octets by which a master configures it, empty on a bus without.
    ``supplementary``: it is a submodule beside a telegram's, whose words follow on that telegram's; its ``module`` has
    that submodule alone.
    """

    number: int
    name: str
    free_mapping: bool
    output: tuple[Signal | None, ...]
    input: tuple[Signal | None, ...]
    output_words: tuple[int, ...]
    input_words: tuple[int, ...]
    module: Module
    source: str
    note: str
    opmode: int | None = None
    tasks: int = TASKS_NONE
    pulses_enabled: int | None = None
    others: tuple[Module, ...] = ()
    parameter_words: int = 0
    settings: Mapping[int, int] = field(default_factory=dict)
    falls_back: tuple[str, ...] = ()
    identifiers: bytes = b""
    own_words: bool = False
    supplementary: bool = False

    @property
    def object(self) -> int:
        """What its control word is of (``OBJECT_*``)."""
        return object_of(self.output)

    @property
    def modules(self) -> tuple[Module, ...]:
        """Every module that carries it, the one to use first."""
        return self.module, *self.others


def object_of(set_points: Iterable[Signal | None]) -> int:
    """What the control word among these set points is of (``OBJECT_*``)."""
    return next((_OBJECTS[one.name] for one in set_points if one is not None and one.name in _OBJECTS), OBJECT_AXIS)


#: For a drive whose profile has no telegrams.
NO_TELEGRAM = Telegram(0, "", False, (), (), (), (), NO_MODULE, "", "")


def with_choices(telegrams: Mapping[int, Telegram], supplements: Iterable[Telegram]) -> dict[int, Telegram]:
    """The telegrams with modules that take each other's submodules, where they have the same ident, and supplements."""
    beside = [one.module.data for one in supplements]
    shared: dict[tuple[int, int], dict[Submodule, None]] = {}
    for module in (module for telegram in telegrams.values() for module in telegram.modules):
        own = [one for one in (*module.submodules, *module.choices) if one not in beside]
        shared.setdefault((module.slot, module.ident), {}).update(dict.fromkeys(own))

    def joined(module: Module) -> Module:
        every = (*shared[module.slot, module.ident], *(replace(one, slot=module.slot) for one in beside))
        return replace(module, choices=tuple(one for one in every if one not in module.submodules))

    return {
        number: replace(each, module=joined(each.module), others=tuple(map(joined, each.others)))
        for number, each in telegrams.items()
    }


def signal_codes(signals: Sequence[Signal | None], *, setpoint: bool, repeats: bool = False) -> tuple[int, ...]:
    """Word codes of a list of signals; :class:`MappingError` on a torn double word or a wrong direction.

    And on a repetition, unless it ``repeats``.
    """
    codes: list[int] = []
    seen: set[str] = set()
    while len(codes) < len(signals):
        index = len(codes)
        signal = signals[index]
        if signal is None:
            codes.append(WORD_NONE)
            continue
        if signal.setpoint != setpoint:
            wanted, given = ("set point", "an actual value") if setpoint else ("actual value", "a set point")
            raise MappingError(index, f"{signal.name} is {given}; this direction takes {wanted}s")
        if signal.name in seen and not repeats:
            raise MappingError(index, f"{signal.name} is given twice")
        seen.add(signal.name)
        if signal.bits == 16:
            codes.append(word_code(signal.slot, PART_WORD))
            continue
        if index + 1 >= len(signals) or signals[index + 1] != signal:
            raise MappingError(index, f"{signal.name} is a double word and takes two consecutive words")
        codes += [word_code(signal.slot, PART_HIGH), word_code(signal.slot, PART_LOW)]
    return tuple(codes)


def parameter_signals(*, setpoint: bool) -> tuple[Signal, ...]:
    """The words of a parameter channel, in one direction; they have no number, so that no mapping names them."""
    head, value = (
        Signal(0, name, 32, setpoint, "", "profile; Moog MSD manual 8.2.4, table 8.11")
        for name in ("PKW_HEAD", "PKW_VALUE")
    )
    return head, head, value, value


def signal_numbers(signals: Iterable[Signal | None]) -> tuple[int, ...]:
    """The signal numbers word by word, 0 for none, as in PNU 915 and 916."""
    return tuple(signal.shown_as or signal.number if signal else 0 for signal in signals)


def whole_signals(signals: Sequence[Signal | None], *, setpoint: bool) -> tuple[Signal | None, ...]:
    """``signals`` without half double words and without repeated set points."""
    found: list[Signal | None] = []
    seen: set[str] = set()
    while len(found) < len(signals):
        signal = signals[len(found)]
        width = signal.bits // 16 if signal else 1
        whole = len(found) + width <= len(signals) and signals[len(found) + width - 1] == signal
        if signal is None or not whole or (setpoint and signal.name in seen):
            found.append(None)
            continue
        seen.add(signal.name)
        found += [signal] * width
    return tuple(found)
