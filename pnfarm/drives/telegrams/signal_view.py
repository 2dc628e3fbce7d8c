"""The signals of a telegram by name, for people's code: PLC programs and tests.

A name is the telegram's in lower case (``zsw1``, ``nist_b``).  A word of 16 bits is a :class:`Word`, whose bits are
attributes under the model's names (``zsw1.fault_present``) or by number (``zsw1.bit_3``); a speed is in rpm, a target
in revolutions; all others are whole numbers as on the wire.  ``view["NIST_B"]`` is any signal as on the wire.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from pnfarm.drives.telegrams.word_bits import STW1_BITS, ZSW1_BITS
from pnfarm.firmware.profidrive.real_words import DEGREES, DEGREES_A_SECOND
from pnfarm.firmware.profidrive.telegram import long_step
from pnfarm.table.signals import SLOTS
from pnfarm.vocabulary.quoting import did_you_mean, shown

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from pnfarm.drives.profiles.profidrive.part import Profidrive
    from pnfarm.drives.telegrams.telegram import Signal

__all__ = ["AxisSignals", "Inputs", "Outputs", "SignalForm", "Word", "axis_signals", "signal_units"]

#: Signals that carry the speed, the finest first.
_SPEEDS = ("nsoll_b", "ref_speed", "nsoll_a", "nist_b", "act_speed", "nist_a", "vist_f")
#: The greatest number of single precision.
_GREATEST = 3.4028234e38
#: Words with a sign of life, to the drive and from it.
_LIFE_TO, _LIFE_FROM = frozenset({"stw2", "stw2_enc", "cu_stw1"}), frozenset({"zsw2", "zsw2_enc", "cu_zsw1"})
_LIFE_SHIFT = 12


@dataclass(frozen=True, slots=True)
class SignalForm:
    """A signal of a telegram.  ``step``: size of one increment in ``unit``, 0 for a number as on the wire.

    ``bits``: 16 or 32; ``names``: names of its bits, bit 0 first, empty where none is known.  ``real``: the bits are a
    number of single precision.
    """

    name: str
    slot: int
    bits: int
    signed: bool
    step: float
    unit: str
    names: tuple[str, ...]
    real: bool = False

    @property
    def bounds(self) -> tuple[float, float]:
        """The least and the greatest number on the wire."""
        if self.real:
            return -_GREATEST, _GREATEST
        if self.signed:
            return -(1 << self.bits - 1), (1 << self.bits - 1) - 1
        return 0, (1 << self.bits) - 1

    def number(self, value: int) -> float:
        """The number on the wire from the process image's 32 bits."""
        if self.real:
            return float(struct.unpack(">f", struct.pack(">i", value))[0])
        value &= (1 << self.bits) - 1
        return value - (1 << self.bits) if self.signed and value >> (self.bits - 1) else value

    def packed(self, value: object) -> int:
        """The process image's 32 bits (a signed double word, or a word without a sign); raises :class:`ValueError`."""
        if type(value) is int and 0 <= value < 1 << self.bits - 1 and not self.real:
            # what most programs write
            return value
        least, most = self.bounds
        if self.real:
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not least <= value <= most:
                raise ValueError(f"{self.name}: {shown(value)} is not a number of single precision")
            return int(struct.unpack(">i", struct.pack(">f", value))[0])
        number = _whole(self, value)
        if not least <= number <= most and not -(1 << self.bits - 1) <= number < 1 << self.bits:
            raise ValueError(f"{self.name}: {shown(number)} does not fit into {self.bits} bits")
        number &= (1 << self.bits) - 1
        return number - (1 << 32) if self.bits == 32 and number >> 31 else number

    def bit(self, name: str) -> int:
        """The number of a bit; raises :class:`AttributeError` that says which there are."""
        if name in self.names and name:
            return self.names.index(name)
        digits = name.removeprefix("bit_")
        if name.startswith("bit_") and digits.isdecimal() and digits.isascii() and int(digits) < 16:
            return int(digits)
        known = [word for word in self.names if word]
        allowed = f"it has {', '.join(known)}" if known else "this model names none; use bit_0 to bit_15"
        raise AttributeError(f"{self.name} has no bit {name!r}{did_you_mean(name, known)}; {allowed}")


@dataclass(frozen=True, slots=True)
class AxisSignals:
    """The signals of one drive's telegram: ``setpoints`` go to the drive, ``actuals`` come from it."""

    setpoints: Mapping[str, SignalForm]
    actuals: Mapping[str, SignalForm]


def signal_units(
    *, velocity_step: float, velocity_step_b: float, target_step: float, task_velocity_step: float
) -> dict[str, tuple[float, str]]:
    """Increment and unit of each signal of speed and of a target; the steps are rpm and rev, as in the axis record."""
    return {
        **dict.fromkeys(("NSOLL_A", "NIST_A", "REF_SPEED", "ACT_SPEED"), (velocity_step, "rpm")),
        **dict.fromkeys(("NSOLL_B", "NIST_B"), (long_step(velocity_step, velocity_step_b), "rpm")),
        **dict.fromkeys(("MDI_TARPOS", "TARPOS_A"), (target_step, "rev")),
        **dict.fromkeys(("MDI_VELOCITY", "VELOCITY_A"), (task_velocity_step, "rpm")),
        "MDI_TARPOS_F": (1 / DEGREES, "rev"),
        **dict.fromkeys(("MDI_VELOCITY_F", "VIST_F"), (1 / DEGREES_A_SECOND, "rpm")),
    }


def axis_signals(
    profidrive: Profidrive,
    telegram: int,
    units: Mapping[str, tuple[float, str]],
    mapped: tuple[Sequence[Signal | None], Sequence[Signal | None]] | None = None,
) -> AxisSignals:
    """The signals of a telegram; ``units``: step and unit of those that have one, by the telegram's names.

    ``mapped``: set points and actual values of a telegram that is mapped freely.
    """
    found = profidrive.telegrams[telegram]
    output, inputs = mapped or (found.output, found.input)

    def forms(signals: Iterable[Signal | None]) -> dict[str, SignalForm]:
        return {
            signal.name.lower(): SignalForm(
                name=signal.name.lower(),
                slot=signal.slot,
                bits=signal.bits,
                signed=signal.signed or signal.name in units,
                step=units.get(signal.name, (0.0, ""))[0],
                unit=units.get(signal.name, (0.0, ""))[1],
                names=_names(profidrive, signal.name, telegram),
                real=signal.real,
            )
            for signal in signals
            if signal is not None
        }

    return AxisSignals(forms(output), forms(inputs))


def _names(profidrive: Profidrive, word: str, telegram: int) -> tuple[str, ...]:
    usual = {"STW1": STW1_BITS, "ZSW1": ZSW1_BITS}
    word = word.removesuffix("_BACK")
    return profidrive.bit_names(word, telegram) or usual.get(word, ())


class Word(int):
    """A word of 16 bits: a number, whose bits are attributes.  Those of :class:`Outputs` can be set."""

    _form: SignalForm
    _owner: Outputs | None

    def __new__(cls, value: int, form: SignalForm, owner: Outputs | None = None) -> Self:
        word = super().__new__(cls, value)
        object.__setattr__(word, "_form", form)
        object.__setattr__(word, "_owner", owner)
        return word

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        now = int(self if self._owner is None else self._owner[self._form.name])
        if name == "sign_of_life" and self._form.name in _LIFE_FROM | _LIFE_TO:
            return now >> _LIFE_SHIFT & 0xF
        return bool(now >> self._form.bit(name) & 1)

    def __setattr__(self, name: str, value: Any) -> None:
        if self._owner is None:
            raise AttributeError(f"{self._form.name} comes from the drive: {name!r} cannot be set")
        now = int(self._owner[self._form.name])
        if name == "sign_of_life" and self._form.name in _LIFE_TO:
            if value not in range(16):
                raise ValueError(f"{self._form.name}.sign_of_life: {shown(value)} is not 0 to 15")
            self._owner[self._form.name] = now & 0x0FFF | int(value) << _LIFE_SHIFT
            return
        mask = 1 << self._form.bit(name)
        self._owner[self._form.name] = now | mask if value else now & ~mask

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *(name for name in self._form.names if name)]

    @property
    def bits(self) -> list[str]:
        """The names of the bits that are set; ``bit_11`` for one without a name."""
        named = [*self._form.names, *[""] * 16]
        return [named[bit] or f"bit_{bit}" for bit in range(16) if int(self) >> bit & 1]

    def __repr__(self) -> str:
        return f"0x{int(self):04X} ({', '.join(self.bits)})"


class _View:
    """Signals by name; ``values`` is the process image, one number for each slot."""

    _forms: Mapping[str, SignalForm]
    #: The same, also by the telegram's own names.
    _named: Mapping[str, SignalForm]
    _values: Sequence[int]

    def _form(self, name: str, error: type[Exception]) -> SignalForm:
        form = self._named.get(name) or self._forms.get(name.lower())
        if form is None:
            hint = did_you_mean(name, self._forms)
            raise error(f"the telegram has no signal {name!r} in this direction{hint}; it has {', '.join(self._forms)}")
        return form

    def __getitem__(self, name: str) -> float:
        form = self._form(name, KeyError)
        return form.number(int(self._values[form.slot]))

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        form = self._form(name, AttributeError)
        number = form.number(int(self._values[form.slot]))
        if form.step:
            return number * form.step
        if form.bits == 16 and not form.signed:
            return Word(int(number), form, self._owner())
        return number

    def _owner(self) -> Outputs | None:
        return None

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name.lower() in self._forms

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._forms]

    def units(self) -> dict[str, str]:
        """The signals of the telegram with their units, "" for numbers as on the wire."""
        return {name: form.unit for name, form in self._forms.items()}

    def _speed(self) -> SignalForm:
        for name in _SPEEDS:
            if name in self._forms:
                return self._forms[name]
        raise AttributeError(f"the telegram has no speed in this direction; it has {', '.join(self._forms)}")

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={getattr(self, name)!r}' for name in self._forms)})"


class Inputs(_View):
    """What the drive sent last.  ``valid``: whether the connection is up and the drive's data are good."""

    def __init__(self, forms: Mapping[str, SignalForm], values: Sequence[int] | None = None) -> None:
        self._forms, self._named = forms, _named(forms)
        self._values = [0] * SLOTS if values is None else values
        self.valid = False

    @property
    def velocity(self) -> float:
        """The actual speed in rpm, by whichever signal the telegram has."""
        form = self._speed()
        return form.number(int(self._values[form.slot])) * form.step


class Outputs(_View):
    """What the drive gets next; values stay until they are changed."""

    _values: list[int]

    def __init__(self, forms: Mapping[str, SignalForm]) -> None:
        for name, value in (("_forms", forms), ("_named", _named(forms)), ("_values", [0] * SLOTS)):
            object.__setattr__(self, name, value)

    def _owner(self) -> Outputs | None:
        return self

    def __setitem__(self, name: str, number: float) -> None:
        form = self._form(name, KeyError)
        self._values[form.slot] = form.packed(number)

    def __setattr__(self, name: str, value: float) -> None:
        form = self._speed() if name == "velocity" else self._form(name, AttributeError)
        if not form.step:
            self._values[form.slot] = form.packed(value)
            return
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise ValueError(f"{name}: {shown(value)} is not a number in {form.unit}")
        least, most = form.bounds
        number = value / form.step
        self._values[form.slot] = form.packed(min(most, max(least, number if form.real else round(number))))

    @property
    def velocity(self) -> float:
        """The speed set point in rpm, by whichever signal the telegram has; it can be set."""
        form = self._speed()
        return form.number(self._values[form.slot]) * form.step

    def clear(self) -> None:
        """All zero."""
        self._values[:] = [0] * SLOTS


def _named(forms: Mapping[str, SignalForm]) -> dict[str, SignalForm]:
    return {**forms, **{name.upper(): form for name, form in forms.items()}}


def _whole(form: SignalForm, value: object) -> int:
    if isinstance(value, bool) or not hasattr(value, "__index__"):
        raise ValueError(f"{form.name}: {shown(value)} is not a whole number")
    return int(value.__index__())
