"""The parameters of one drive.

The model holds what is common (defaults, limits, meaning); a :class:`ParameterStore` holds only what differs: the
values written since, and those that the drive keeps over a power cycle.  A parameter's *behaviour* says what stands
behind it (:class:`~pnfarm.drives.parameter.Behaviour`); values are raw integers as on the wire.

Written values live in RAM until DRV.NVSAVE makes them permanent (AKD EtherNet/IP manual 6.7, "Saving to
Non-volatile Memory"); :meth:`ParameterStore.power_on` goes back to the permanent ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, pi
from typing import TYPE_CHECKING, Any

from pnfarm.drives.axis_handle import AxisHandle, CommandRingFullError
from pnfarm.drives.computed import COMPUTED
from pnfarm.drives.parameter import Behaviour, Parameter, ParameterError, ParameterErrorNumber
from pnfarm.drives.telegram import MappingError, Signal, Telegram, signal_codes, signal_numbers
from pnfarm.errors import ConfigError
from pnfarm.table.axis import (
    CMD_ACKNOWLEDGE,
    CMD_CLEAR_HISTORY,
    CMD_SET_POSITION,
    VELOCITY_NSOLL_A,
    VELOCITY_NSOLL_B,
    VELOCITY_REF_SPEED,
)
from pnfarm.table.signals import NSOLL_B, REF_SPEED

if TYPE_CHECKING:
    from pnfarm.drives.model import Model

__all__ = [
    "DisplayBlinkRequested",
    "NonVolatileSaved",
    "ParameterStore",
    "ParameterWritten",
    "RebootRequested",
    "TelegramChanged",
]

TELEGRAM_SELECTION = 922
FREE_TELEGRAM = 0
SETPOINT_MAPPING = 915
ACTUAL_MAPPING = 916
POSITION_SCALING = 3014
HOME_POSITION = 2205
UNIT_ROTARY = 2393
UNIT_IN = 2390
UNIT_OUT = 2392
#: A ramp whose time is zero, rpm/s.
AT_ONCE = 1e12
#: Fields of the axis that are zero in models that do not speak of them.
OPTIONAL_FIELDS = (
    "velocity_step_b",
    "ramp_generator",
    "loss_delay_ns",
    "fault_places",
    "velocity_limit",
    "sensor_step",
    "sensor_step_2",
    "coast_method",
    "life",
    "life_tolerance",
    "life_fault",
)


@dataclass(frozen=True, slots=True)
class ParameterWritten:
    """A parameter was changed; commands are not reported."""

    pnu: int
    subindex: int
    values: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class TelegramChanged:
    """PNU 922, 915 or 916 was written: the words of the cyclic channel must be laid out anew."""

    number: int


@dataclass(frozen=True, slots=True)
class NonVolatileSaved:
    """The permanent values were replaced; :meth:`ParameterStore.snapshot` gives them."""


@dataclass(frozen=True, slots=True)
class RebootRequested:
    """The drive shall restart as after a power cycle."""


@dataclass(frozen=True, slots=True)
class DisplayBlinkRequested:
    """The drive shall make itself noticed."""


Event = ParameterWritten | TelegramChanged | NonVolatileSaved | RebootRequested | DisplayBlinkRequested
Value = int | tuple[int, ...]


class ParameterStore:
    """All parameters of one drive.

    ``handle`` is the drive's rows of the table; ``watchdog_ns`` (PNU 3022) is set by the station on a connect.
    """

    __slots__ = ("_events", "_module", "_plugged", "_saved", "_values", "handle", "model", "watchdog_ns")

    def __init__(self, model: Model, handle: AxisHandle) -> None:
        self.model = model
        self.handle = handle
        self.watchdog_ns = 0
        self._values: dict[int, Value] = {}
        self._saved: dict[int, Value] = {}
        self._events: list[Event] = []
        self._plugged: int | None = None
        self._module: int | None = None

    # access

    def read(self, pnu: int, subindex: int = 0, count: int = 1) -> list[int]:
        """``count`` values from ``subindex`` on; raises :class:`ParameterError`.  A command reads as 0."""
        parameter = self._parameter(pnu)
        if parameter.elements == 0:
            self._check_plain(parameter, subindex, count)
            return [self._value(parameter)]
        self._check_elements(parameter, subindex, count)
        if parameter.behaviour is Behaviour.STORED:
            return list(self._array(parameter)[subindex : subindex + count])
        return list(COMPUTED[parameter.argument](self, parameter)[subindex : subindex + count])

    def write(self, pnu: int, subindex: int, values: Sequence[int]) -> None:
        """Change ``len(values)`` elements from ``subindex`` on, or none; raises :class:`ParameterError`."""
        parameter = self._parameter(pnu)
        if not parameter.writable:
            raise self._refusal(ParameterErrorNumber.NOT_CHANGEABLE, parameter, subindex)
        if not values:
            raise self._refusal(ParameterErrorNumber.NUMBER_OF_VALUES, parameter)
        if parameter.elements == 0:
            self._check_plain(parameter, subindex, len(values))
        else:
            self._check_elements(parameter, subindex, len(values))
        for offset, value in enumerate(values):
            if not parameter.minimum <= value <= parameter.maximum:
                raise self._refusal(ParameterErrorNumber.LIMIT_EXCEEDED, parameter, subindex + offset)
        target = self.model.canonical(parameter)
        if target.behaviour is Behaviour.COMMAND:
            self._execute(target, values[0])
            return
        if target.behaviour is Behaviour.SIGNAL:
            self._write_signal(target, values[0])
        elif target.behaviour is Behaviour.COMPUTED and target.argument == "fault-situations":
            self._clear_history(target, values[0])
        elif target.behaviour is Behaviour.COMPUTED:
            self._write_telegram(target, subindex, values)
        elif target.elements:
            array = list(self._array(target))
            array[subindex : subindex + len(values)] = values
            self._values[target.pnu] = tuple(array)
        else:
            self._values[target.pnu] = values[0]
            if not target.after_power_on:
                self._apply_written(target)
        if self.model.access.saves_at_once and target.nonvolatile:
            self._save()
        self._events.append(ParameterWritten(pnu, subindex, tuple(values)))

    def get(self, text: str | int) -> int:
        """One value by number or name (:meth:`Model.resolve`)."""
        parameter, subindex = self.model.resolve(text)
        return self.read(parameter.pnu, subindex)[0]

    def set(self, text: str | int, value: int) -> None:
        """Change one value by number or name."""
        parameter, subindex = self.model.resolve(text)
        self.write(parameter.pnu, subindex, [value])

    def changed(self, parameter: Parameter) -> bool:
        """Whether a stored value differs from the model's default."""
        return self.model.canonical(parameter).pnu in self._values

    def changed_numbers(self) -> list[int]:
        """The PNUs of every stored value that differs from the model's default, rising."""
        return sorted(self._values)

    def events(self) -> list[Event]:
        """What happened since the last call."""
        events, self._events = self._events, []
        return events

    # telegram

    @property
    def telegram(self) -> Telegram:
        """The telegram in force."""
        return self.model.telegrams[self.telegram_number]

    @property
    def parameter_words(self) -> int:
        """Words in front of the frames that no mapping touches."""
        return self._frame.parameter_words

    @property
    def telegram_number(self) -> int:
        """The number of the plugged module's telegram, or that of PNU 922 while none is plugged.

        PNU 922 = 0 is a free mapping over the frames of whatever module is plugged (AKD PROFINET manual 5.11.1).
        """
        selected = self.raw(TELEGRAM_SELECTION, self.model.default_telegram)
        return selected if self._plugged is None or selected == FREE_TELEGRAM else self._plugged

    def plug_telegram(self, number: int | None, module_ident: int | None = None) -> None:
        """The module in slot 1 brings telegram ``number``; None: no module is plugged, PNU 922 rules.  No event.

        ``module_ident`` says which of the telegram's modules it is, its first if not given.  Another module than the
        one before brings its settings with it.  Raises :class:`ConfigError` for a number that the model does not know.
        """
        if number is not None and number not in self.model.telegrams:
            raise ConfigError(
                f"{self.model.name} has no telegram {number}; it has {', '.join(map(str, self.model.telegrams))}"
            )
        telegram = None if number is None else self.model.telegrams[number]
        module = None
        if telegram is not None:
            module = next((m for m in telegram.modules if m.ident == module_ident), telegram.module)
        another = module is not None and (number, module.ident) != (self._plugged, self._module)
        self._plugged = number
        self._module = None if module is None else module.ident
        if telegram is not None and module is not None and another:
            for pnu, value in {**telegram.settings, **module.settings}.items():
                self._values[pnu] = value
                self._apply_written(self.model.parameters[pnu])
        self._apply_telegram()

    def mapping(self, *, setpoint: bool) -> tuple[Signal | None, ...]:
        """The signals of the frames, word by word: those of the telegram, or PNU 915 or 916 where the mapping is free.

        The length is that of the plugged module; a free mapping that is longer is cut, a double word not torn.
        """
        frame = self._frame
        words = frame.output if setpoint else frame.input
        head, words = words[: frame.parameter_words], words[frame.parameter_words :]
        return head + self._mapped(words, setpoint=setpoint)

    def _mapped(self, words: tuple[Signal | None, ...], *, setpoint: bool) -> tuple[Signal | None, ...]:
        """What a free mapping makes of ``words``."""
        stored = self._values.get(SETPOINT_MAPPING if setpoint else ACTUAL_MAPPING)
        if not self.telegram.free_mapping or not isinstance(stored, tuple):
            return words
        signals = list(self.model.signals_of(stored[: len(words)]))
        if (
            len(stored) > len(words)
            and signals
            and signals[-1] is not None
            and signals[-1].number == stored[len(words)]
        ):
            signals[-1] = None
        return tuple(signals) + (None,) * (len(words) - len(signals))

    def output_words(self) -> tuple[int, ...]:
        """Word codes from the controller to the drive, as long as the telegram in force."""
        return signal_codes(self.mapping(setpoint=True), setpoint=True)

    def input_words(self) -> tuple[int, ...]:
        """Word codes from the drive to the controller."""
        return signal_codes(self.mapping(setpoint=False), setpoint=False)

    # memory

    def power_on(self) -> None:
        """As after a power cycle: the permanent values are in force and on the axis record, no module is plugged."""
        self._values = dict(self._saved)
        self._plugged = self._module = None
        self.watchdog_ns = 0
        self.apply_defaults()

    def apply_defaults(self) -> None:
        """Write every field of writer ``parameter`` of the axis record from the values in force."""
        axis = self.handle.axis
        for field in OPTIONAL_FIELDS:
            setattr(axis, field, 0)
        for field, value in self.model.firmware.items():
            setattr(axis, field, value)
        for parameter in self.model.axis_parameters:
            self._apply(parameter)
        self._apply_communication_loss()
        if self.model.sign_of_life is not None:
            axis.life = 1
            axis.life_fault = self.model.faults[self.model.sign_of_life.fault].code
        self._apply_telegram()

    def snapshot(self) -> dict[str, Any]:
        """The permanent values as plain JSON: what the farm keeps for this drive."""
        return {
            "model": self.model.name,
            "parameters": {
                str(pnu): list(value) if isinstance(value, tuple) else value for pnu, value in self._saved.items()
            },
        }

    def restore(self, kept: Mapping[str, Any] | None) -> list[str]:
        """Take over a :meth:`snapshot`; None keeps the factory values.  Values come into force with :meth:`power_on`.

        Returns a sentence for each entry that this model cannot take (another model or edition); they are left out.
        """
        self._saved = {}
        refused: list[str] = []
        if kept is None:
            return refused
        parameters = kept.get("parameters")
        if not isinstance(parameters, Mapping):
            return ["the kept values have no parameters; the drive starts with its defaults"]
        for key, value in parameters.items():
            try:
                self._keep(str(key), value)
            except ParameterError as exc:
                refused.append(f"kept parameter {key}: {exc}")
        return refused

    def commission(self, values: Mapping[str | int, int | Sequence[int]]) -> None:
        """Permanent values by number or name, as a farm file gives them; in force with :meth:`power_on`.

        Raises :class:`ParameterError` on the first that does not fit.
        """
        for key, value in values.items():
            self._keep(key, value)

    # what computed parameters use

    def raw(self, pnu: int, default: int = 0) -> int:
        """The stored value of a plain parameter, ``default`` for one that the model does not have or does not store."""
        value = self._values.get(pnu)
        if isinstance(value, int):
            return value
        parameter = self.model.parameters.get(pnu)
        return (
            parameter.default
            if parameter is not None and parameter.behaviour in {Behaviour.STORED, Behaviour.FIELD}
            else default
        )

    def scaled(self, parameter: Parameter, physical: float) -> int:
        """A physical value as the parameter's raw number: positions wrap at its bits, all else stops at its range."""
        if not isfinite(physical):
            return parameter.default
        if parameter.scale == "position":
            return parameter.wrap(round(physical * self._position_units()))
        return parameter.clamp(round(physical / self._factor(parameter)))

    # inside

    def _array(self, parameter: Parameter) -> tuple[int, ...]:
        """A stored array's elements."""
        stored = self._values.get(parameter.pnu)
        return stored if isinstance(stored, tuple) else parameter.defaults

    @property
    def _frame(self) -> Telegram:
        """The telegram whose module fixes the length of the frames."""
        return self.telegram if self._plugged is None else self.model.telegrams[self._plugged]

    def _refusal(self, number: ParameterErrorNumber, parameter: Parameter, value: int | None = None) -> ParameterError:
        return ParameterError(number, value, f"{parameter.pnu} {parameter.name}")

    def _parameter(self, pnu: int) -> Parameter:
        try:
            return self.model.parameters[pnu]
        except KeyError:
            raise ParameterError(ParameterErrorNumber.IMPERMISSIBLE_PNU, None, f"PNU {pnu}") from None

    def _check_plain(self, parameter: Parameter, subindex: int, count: int) -> None:
        if subindex != 0 or count > 1:
            raise self._refusal(ParameterErrorNumber.NO_ARRAY, parameter, subindex)
        if count < 1:
            raise self._refusal(ParameterErrorNumber.ADDRESS_IMPERMISSIBLE, parameter)

    def _check_elements(self, parameter: Parameter, subindex: int, count: int) -> None:
        if count < 1:
            raise self._refusal(ParameterErrorNumber.ADDRESS_IMPERMISSIBLE, parameter)
        if not 0 <= subindex < parameter.elements or subindex + count > parameter.elements:
            raise self._refusal(ParameterErrorNumber.FAULTY_SUBINDEX, parameter, max(subindex, parameter.elements))

    def _value(self, parameter: Parameter) -> int:
        target = self.model.canonical(parameter)
        if target.behaviour is Behaviour.COMMAND:
            return 0
        if target.behaviour is Behaviour.COMPUTED:
            return parameter.clamp(COMPUTED[target.argument](self, target)[0])
        if target.behaviour is Behaviour.SIGNAL:
            image = self.handle.image
            return target.wrap(int((image.received if target.argument == "received" else image.sent)[target.index]))
        if target.behaviour is Behaviour.FIELD and not target.writable:
            field = getattr(self.handle.axis, target.argument)
            return self.scaled(target, float(field[target.index] if target.index >= 0 else field))
        return self.raw(target.pnu)

    def _factor(self, parameter: Parameter) -> float:
        return float(self.handle.axis.acceleration_step) if parameter.scale == "acceleration" else parameter.factor

    def _position_units(self) -> float:
        """Raw numbers of a position parameter to one revolution (UNIT.PROTARY, PN.POSSCALE)."""
        units = {1: 2.0 * pi, 2: 360.0, 3: self.raw(UNIT_IN, 1) / max(self.raw(UNIT_OUT, 1), 1), 4: 65536.0}
        return units.get(self.raw(UNIT_ROTARY), 4294967296.0) / max(self.raw(POSITION_SCALING, 1), 1)

    def _apply(self, parameter: Parameter) -> None:
        raw = self.raw(parameter.pnu)
        if parameter.choices:
            value = parameter.choices[raw]
        elif parameter.scale == "2^-n":
            value = 2.0**-raw
        elif parameter.scale.endswith("/n"):
            value = parameter.factor / raw if raw else AT_ONCE
        else:
            value = raw * self._factor(parameter)
        if parameter.index >= 0:
            getattr(self.handle.axis, parameter.argument)[parameter.index] = value
        else:
            setattr(self.handle.axis, parameter.argument, value)

    def _apply_written(self, parameter: Parameter) -> None:
        if parameter.behaviour is Behaviour.FIELD:
            self._apply(parameter)
            if parameter.argument == "acceleration_step":
                for other in self.model.axis_parameters:
                    if other.scale == "acceleration":
                        self._apply(other)
        loss = self.model.communication_loss
        if parameter.pnu in {loss.action_parameter, loss.stop_parameter}:
            self._apply_communication_loss()

    def _apply_communication_loss(self) -> None:
        loss = self.model.communication_loss
        raised = not loss.action_parameter or self.raw(loss.action_parameter)
        code = self.model.faults[loss.fault].code if raised else 0
        on_stop = self.raw(loss.stop_parameter) >> loss.stop_bit & 1 if loss.stop_parameter else loss.on_stop
        self.handle.axis.loss_fault = code
        self.handle.axis.stop_fault = code if on_stop else 0

    def _apply_telegram(self) -> None:
        """Tell the firmware what comes with the telegram in force: operation mode, velocity set point, bit of ZSW2."""
        axis, telegram = self.handle.axis, self.telegram
        if telegram.opmode is not None:
            axis.opmode = telegram.opmode
        axis.pulses_enabled = 0 if telegram.pulses_enabled is None else 1 << telegram.pulses_enabled
        slots = {signal.slot for signal in self.mapping(setpoint=True) if signal is not None}
        axis.velocity_signal = (
            VELOCITY_NSOLL_B if NSOLL_B in slots else VELOCITY_REF_SPEED if REF_SPEED in slots else VELOCITY_NSOLL_A
        )

    def _clear_history(self, parameter: Parameter, value: int) -> None:
        """PNU 952: zero forgets the fault buffer, nothing else may be written."""
        if value:
            raise self._refusal(ParameterErrorNumber.ONLY_RESET, parameter, 0)
        try:
            self.handle.push_command(CMD_CLEAR_HISTORY)
        except CommandRingFullError as exc:
            raise self._refusal(ParameterErrorNumber.OPERATING_STATE, parameter) from exc

    def _write_signal(self, parameter: Parameter, value: int) -> None:
        """A set point by its PNU, unless the running cyclic channel brings it (MDI_ACC with telegram 352: allowed)."""
        carried = {signal.slot for signal in self.mapping(setpoint=True) if signal is not None}
        if self.handle.controlled and parameter.index in carried:
            raise self._refusal(ParameterErrorNumber.NO_OPERATION_PRIORITY, parameter)
        bits = 8 * parameter.octets
        value &= (1 << bits) - 1
        self.handle.image.received[parameter.index] = value - (1 << 32) if value >> 31 else value

    def _write_telegram(self, parameter: Parameter, subindex: int, values: Sequence[int]) -> None:
        """PNU 922, 915, 916: not while the axis is in operation; a mapping only where the telegram has a free one."""
        if self.handle.in_operation:
            raise self._refusal(ParameterErrorNumber.OPERATING_STATE, parameter)
        if parameter.argument == "telegram":
            self._check_telegram(values[0], parameter)
            if self._plugged is not None and values[0] not in {self._plugged, FREE_TELEGRAM}:
                # the module in slot 1 fixes the frames
                raise self._refusal(ParameterErrorNumber.OPERATING_STATE, parameter)
            self._values[parameter.pnu] = values[0]
        else:
            if not self.telegram.free_mapping:
                raise self._refusal(ParameterErrorNumber.OPERATING_STATE, parameter)
            self._values[parameter.pnu] = self._checked_mapping(parameter, subindex, values)
        self._apply_telegram()
        self._events.append(TelegramChanged(self.telegram_number))

    def _check_telegram(self, number: int, parameter: Parameter) -> None:
        if number not in self.model.telegrams:
            raise self._refusal(ParameterErrorNumber.VALUE_IMPERMISSIBLE, parameter, 0)

    def _checked_mapping(self, parameter: Parameter, subindex: int, values: Sequence[int]) -> tuple[int, ...]:
        setpoint = parameter.argument == "setpoint-mapping"
        numbers = list(signal_numbers(self.mapping(setpoint=setpoint)))[self._frame.parameter_words :]
        length = len(numbers)
        numbers += [0] * (parameter.elements - length)
        numbers[subindex : subindex + len(values)] = values
        for index in range(length, parameter.elements):
            if numbers[index]:
                raise self._refusal(ParameterErrorNumber.VALUE_IMPERMISSIBLE, parameter, index)
        return self._mapping_numbers(parameter, numbers[:length], setpoint=setpoint)

    def _mapping_numbers(self, parameter: Parameter, numbers: Sequence[int], *, setpoint: bool) -> tuple[int, ...]:
        try:
            signal_codes(self.model.signals_of(numbers), setpoint=setpoint)
        except MappingError as exc:
            raise ParameterError(
                ParameterErrorNumber.VALUE_IMPERMISSIBLE, exc.index, f"{parameter.pnu} {parameter.name}, {exc}"
            ) from exc
        return tuple(numbers)

    def _keep(self, key: str | int, value: Any) -> None:
        """Check one permanent value and take it over."""
        parameter, subindex = self.model.resolve(key)
        target = self.model.canonical(parameter)
        if subindex:
            raise self._refusal(ParameterErrorNumber.ADDRESS_IMPERMISSIBLE, parameter)
        if not target.nonvolatile:
            raise self._refusal(ParameterErrorNumber.NOT_CHANGEABLE, parameter, 0)
        values = (
            [value]
            if isinstance(value, int)
            else list(value)
            if isinstance(value, Sequence) and not isinstance(value, str)
            else []
        )
        if not values or any(not isinstance(v, int) or isinstance(v, bool) for v in values):
            raise self._refusal(ParameterErrorNumber.INCORRECT_DATA_TYPE, parameter)
        if len(values) > max(parameter.elements, 1):
            raise self._refusal(ParameterErrorNumber.NUMBER_OF_VALUES, parameter)
        for index, number in enumerate(values):
            if not parameter.minimum <= number <= parameter.maximum:
                raise self._refusal(ParameterErrorNumber.LIMIT_EXCEEDED, parameter, index)
        if target.elements and target.behaviour is Behaviour.STORED:
            self._saved[target.pnu] = tuple(values) + target.defaults[len(values) :]
            return
        if target.elements:
            self._saved[target.pnu] = self._mapping_numbers(
                target, values, setpoint=target.argument == "setpoint-mapping"
            )
            return
        if target.argument == "telegram":
            self._check_telegram(values[0], target)
        self._saved[target.pnu] = values[0]

    # commands

    def _execute(self, parameter: Parameter, value: int) -> None:
        """Carry out a command parameter; its value does not matter, except that a reboot asks for one that is not 0."""
        name = parameter.argument
        try:
            if name == "acknowledge":
                self.handle.push_command(CMD_ACKNOWLEDGE)
            elif name == "set-position":
                if self.handle.in_operation and abs(float(self.handle.axis.velocity)) > float(
                    self.handle.axis.standstill
                ):
                    raise self._refusal(ParameterErrorNumber.OPERATING_STATE, parameter)
                revolutions = self.raw(HOME_POSITION) / self._position_units()
                self.handle.push_command(CMD_SET_POSITION, round(revolutions * 1e6))
            elif name == "save":
                self._save()
            elif name == "load":
                self._reload(dict(self._saved), parameter)
            elif name == "factory-values":
                self._reload({}, parameter)
            elif name == "blink":
                self._events.append(DisplayBlinkRequested())
            elif name == "reboot":
                if value:
                    self._events.append(RebootRequested())
            else:
                # "refuse": the model has no such function, or the control word does it
                raise self._refusal(ParameterErrorNumber.OPERATING_STATE, parameter)
        except CommandRingFullError as exc:
            raise self._refusal(ParameterErrorNumber.OPERATING_STATE, parameter) from exc

    def _save(self) -> None:
        parameters = self.model.parameters
        self._saved = {pnu: value for pnu, value in self._values.items() if parameters[pnu].nonvolatile}
        self._events.append(NonVolatileSaved())

    def _reload(self, values: dict[int, Value], parameter: Parameter) -> None:
        """Replace all values in RAM; not in operation, where ramps and units would jump."""
        if self.handle.in_operation:
            raise self._refusal(ParameterErrorNumber.OPERATING_STATE, parameter)
        before = (self.telegram_number, self.output_words(), self.input_words())
        self._values = values
        self.apply_defaults()
        if (self.telegram_number, self.output_words(), self.input_words()) != before:
            self._events.append(TelegramChanged(self.telegram_number))
