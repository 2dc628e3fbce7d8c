"""Selects a drive's telegram and its words: by the module in slot 1, PNU 922, 915 and 916."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.drives.parameters.parameter import ParameterErrorNumber, refusal
from pnfarm.drives.parameters.stored_values import check_telegram, mapping_numbers
from pnfarm.drives.telegrams.mapping import mapped_signals
from pnfarm.drives.telegrams.telegram import NO_TELEGRAM, signal_codes, signal_numbers, whole_signals
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.drives.parameters.parameter import Parameter
    from pnfarm.drives.parameters.stored_values import StoredValues, Value
    from pnfarm.drives.telegrams.telegram import Signal, Telegram

__all__ = ["TelegramSelection"]

TELEGRAM_SELECTION = 922
FREE_TELEGRAM = 0
SETPOINT_MAPPING = 915
ACTUAL_MAPPING = 916


class TelegramSelection:
    """The telegram in force; it reads the drive's stored values and writes none."""

    __slots__ = ("_module", "_plugged", "_supplement", "_values")

    def __init__(self, values: StoredValues) -> None:
        self._values = values
        self._plugged: int | None = None
        self._module: int | None = None
        self._supplement = NO_TELEGRAM

    # telegram

    @property
    def key(self) -> tuple[int | None, ...]:
        """What the telegram and its words depend on besides the drive's values."""
        return self._plugged, self._module, self._supplement.number

    @property
    def words_key(self) -> tuple[object, ...]:
        """What the telegram and its words depend on, for drives of one model."""
        stored = self._values.current
        elements = self._elements(setpoint=True), self._elements(setpoint=False)
        return *self.key, self.number, stored.get(SETPOINT_MAPPING), stored.get(ACTUAL_MAPPING), *elements

    @property
    def number(self) -> int:
        """The number of the plugged module's telegram, or that of PNU 922 while none is plugged.

        PNU 922 = 0 is a free mapping over the frames of whatever module is plugged (AKD PROFINET manual 5.11.1).
        """
        selected = self._values.raw(TELEGRAM_SELECTION, self._values.model.profidrive.default_telegram)
        return selected if self._plugged is None or selected == FREE_TELEGRAM else self._plugged

    @property
    def telegram(self) -> Telegram:
        """The telegram in force."""
        return self._telegram(self.number)

    @property
    def frame(self) -> Telegram:
        """The telegram whose module determines the length of the frames."""
        return self.telegram if self._plugged is None else self._telegram(self._plugged)

    def _telegram(self, number: int) -> Telegram:
        telegrams = self._values.model.profidrive.telegrams
        return telegrams[number] if telegrams else NO_TELEGRAM

    def plug(self, number: int, module_ident: int | None = None, supplement: int | None = None) -> dict[int, int]:
        """A module of telegram ``number`` is in slot 1, its first if ``module_ident`` is not one of its modules.

        ``supplement`` is the supplementary telegram beside it.
        Returns the settings that it applies, PNU -> raw number: none if it is the previous module.
        Raises :class:`ConfigError` for a number that the model does not know.
        """
        model = self._values.model
        if number not in model.profidrive.telegrams:
            raise ConfigError(
                f"{model.name} has no telegram {number}; it has {', '.join(map(str, model.profidrive.telegrams))}"
            )
        telegram = model.profidrive.telegrams[number]
        module = next((m for m in telegram.modules if m.ident == module_ident), telegram.module)
        before = (self._plugged, self._module)
        self._plugged, self._module = number, module.ident
        self._supplement = NO_TELEGRAM if supplement is None else model.profidrive.supplements[supplement]
        return {} if before == (number, module.ident) else {**telegram.settings, **module.settings}

    def unplug(self) -> None:
        """No module is plugged: PNU 922 decides."""
        self._plugged = self._module = None
        self._supplement = NO_TELEGRAM

    # words

    def mapping(self, *, setpoint: bool) -> tuple[Signal | None, ...]:
        """The signals of the frames, word by word: those of the telegram, and after them the supplementary one's."""
        more = self._supplement.output if setpoint else self._supplement.input
        return self._own(setpoint=setpoint) + more

    def _own(self, *, setpoint: bool) -> tuple[Signal | None, ...]:
        """Those of the telegram, or PNU 915 or 916 where the mapping is free.

        The length is that of the plugged module; a longer free mapping is cut, but never within a double word.
        """
        frame = self.frame
        words = frame.output if setpoint else frame.input
        head, words = words[: frame.parameter_words], words[frame.parameter_words :]
        return head + self._mapped(words, setpoint=setpoint)

    def _mapped(self, words: tuple[Signal | None, ...], *, setpoint: bool) -> tuple[Signal | None, ...]:
        """The signals of a free mapping ``words``."""
        stored = self._values.current.get(SETPOINT_MAPPING if setpoint else ACTUAL_MAPPING)
        if not self.telegram.free_mapping or not isinstance(stored, tuple):
            return words
        model = self._values.model
        # an element was checked with what was mapped when it was written, which may have been fewer words
        elements = [
            element if number in model.parameters and element < model.parameters[number].elements else 0
            for number, element in zip(stored, self._elements(setpoint=setpoint), strict=False)
        ]
        every = mapped_signals(model, stored, setpoint=setpoint, elements=elements)
        signals = whole_signals(every[: len(words)], setpoint=setpoint)
        return signals + (None,) * (len(words) - len(signals))

    def numbers(self, *, setpoint: bool) -> tuple[int, ...]:
        """The signal numbers after a parameter channel, without those of a supplementary telegram.

        If a mapping is written entry by entry, they are as written, including half double words.
        """
        signals = self._own(setpoint=setpoint)[self.frame.parameter_words :]
        stored = self._values.current.get(SETPOINT_MAPPING if setpoint else ACTUAL_MAPPING)
        model = self._values.model
        if not model.access.mapping_by_entry or not self.telegram.free_mapping or not isinstance(stored, tuple):
            return signal_numbers(signals)
        return (stored + (0,) * len(signals))[: len(signals)]

    def _elements(self, *, setpoint: bool) -> tuple[int, ...]:
        """The elements of stored arrays, word by word (Moog MSD manual 8.2.3, P-1253 and P-1254)."""
        numbers = self._values.model.access.mapping_elements
        return self._values.array(self._values.model.parameters[numbers[not setpoint]]) if numbers else ()

    def codes(self, *, setpoint: bool) -> tuple[int, ...]:
        """Word codes of one direction."""
        # a free mapping without repetitions, where the drive takes none, was checked when it was written
        return signal_codes(self.mapping(setpoint=setpoint), setpoint=setpoint, repeats=not setpoint)

    # checks before writing

    def checked(self, parameter: Parameter, subindex: int, values: Sequence[int]) -> Value:
        """The new value of PNU 922, 915 or 916 with ``values`` from ``subindex`` on; raises :class:`ParameterError`.

        A mapping only where the telegram has a free one.
        """
        if parameter.argument == "telegram":
            return self._checked_number(parameter, values[0])
        if parameter.pnu in self._values.model.access.mapping_elements:
            return self._checked_elements(parameter, subindex, values)
        if not self.telegram.free_mapping:
            raise refusal(ParameterErrorNumber.OPERATING_STATE, parameter)
        return self._checked_mapping(parameter, subindex, values)

    def _checked_number(self, parameter: Parameter, number: int) -> int:
        check_telegram(self._values.model, parameter, number)
        if self._plugged is not None and number not in {self._plugged, FREE_TELEGRAM}:
            # the module in slot 1 determines the frames
            raise refusal(ParameterErrorNumber.OPERATING_STATE, parameter)
        return number

    def _checked_mapping(self, parameter: Parameter, subindex: int, values: Sequence[int]) -> tuple[int, ...]:
        setpoint = parameter.argument == "setpoint-mapping"
        numbers = list(self.numbers(setpoint=setpoint))
        length = len(numbers)
        numbers += [0] * (parameter.elements - length)
        numbers[subindex : subindex + len(values)] = values
        for index in range(length, parameter.elements):
            if numbers[index]:
                raise refusal(ParameterErrorNumber.VALUE_IMPERMISSIBLE, parameter, index)
        elements = self._elements(setpoint=setpoint)
        return mapping_numbers(self._values.model, parameter, numbers[:length], elements)

    def _checked_elements(self, parameter: Parameter, subindex: int, values: Sequence[int]) -> tuple[int, ...]:
        """The elements with ``values`` among them, if what is mapped now has them."""
        setpoint = parameter.pnu == self._values.model.access.mapping_elements[0]
        elements = list(self._elements(setpoint=setpoint))
        elements[subindex : subindex + len(values)] = values
        numbers = self.numbers(setpoint=setpoint)
        mapped_signals(self._values.model, numbers, setpoint=setpoint, elements=elements)
        return tuple(elements)
