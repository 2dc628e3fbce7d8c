"""The parameters of one drive.

The model holds what is common (defaults, limits, meaning); a :class:`ParameterStore` holds only the differences: the
values written since, and those that the drive keeps over a power cycle.  A parameter's *backing* is what it reads and
writes (:class:`~pnfarm.drives.parameters.parameter.Backing`); values are raw integers as on the wire.

The store is the interface for access; it uses the values (:mod:`~pnfarm.drives.parameters.stored_values`), the telegram
(:mod:`~pnfarm.drives.telegrams.selection`) and the axis record (:mod:`~pnfarm.drives.parameters.axis_fields`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.drives.axis_commands import AXIS_COMMANDS, command_axis
from pnfarm.drives.axis_handle import AxisHandle, CommandRingFullError
from pnfarm.drives.motion_tasks import MotionTask, MotionTasks
from pnfarm.drives.parameters.axis_fields import AxisFields
from pnfarm.drives.parameters.computed import COMPUTED
from pnfarm.drives.parameters.network import NoNetwork
from pnfarm.drives.parameters.parameter import Backing, Parameter, ParameterError, ParameterErrorNumber, refusal
from pnfarm.drives.parameters.stored_values import StoredValues
from pnfarm.drives.telegrams.selection import TelegramSelection
from pnfarm.errors import ConfigError
from pnfarm.table.axis_codes import CMD_CLEAR_HISTORY

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from pnfarm.drives.description.model import Model
    from pnfarm.drives.parameters.network import Network
    from pnfarm.drives.telegrams.telegram import Signal, Telegram

__all__ = [
    "DisplayBlinkRequested",
    "FaultHistoryCleared",
    "NonVolatileSaved",
    "ParameterStore",
    "ParameterWritten",
    "RebootRequested",
    "TelegramChanged",
]


@dataclass(frozen=True, slots=True)
class ParameterWritten:
    """A parameter was changed; commands are not reported."""

    pnu: int
    subindex: int
    values: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class TelegramChanged:
    """PNU 922, 915 or 916 was written: the layout of the cyclic channel's words changes."""

    number: int


@dataclass(frozen=True, slots=True)
class NonVolatileSaved:
    """The permanent values were replaced; :meth:`ParameterStore.snapshot` gives them.

    ``written``: non-volatile memory has them already.
    """

    written: bool = False


@dataclass(frozen=True, slots=True)
class RebootRequested:
    """The drive restarts as after a power cycle."""


@dataclass(frozen=True, slots=True)
class DisplayBlinkRequested:
    """The drive flashes its display, so that it can be found."""


@dataclass(frozen=True, slots=True)
class FaultHistoryCleared:
    """The acknowledged fault situations were deleted."""


Event = (
    ParameterWritten
    | TelegramChanged
    | NonVolatileSaved
    | RebootRequested
    | DisplayBlinkRequested
    | FaultHistoryCleared
)


class ParameterStore:
    """All parameters of one drive.

    ``handle`` is the drive's rows of the table, ``network`` its name and addresses; ``watchdog_ns`` (PNU 3022) is set
    by the station on a connect.  ``overruled`` has the values of plain parameters that hardware gives, such as an
    address by switches: they are read in place of the stored ones.  ``keep`` writes a :meth:`snapshot` into
    non-volatile memory before a save is answered, and says whether that was possible.
    """

    __slots__ = (
        "_axis",
        "_events",
        "_keep",
        "_selection",
        "_tasks",
        "_values",
        "handle",
        "model",
        "network",
        "overruled",
        "watchdog_ns",
    )

    def __init__(self, model: Model, handle: AxisHandle, keep: Callable[[dict[str, Any]], bool] | None = None) -> None:
        self.model = model
        self._keep = keep
        self.handle = handle
        self.network: Network = NoNetwork()
        self.watchdog_ns = 0
        self.overruled: dict[int, int] = {}
        self._values = StoredValues(model)
        self._selection = TelegramSelection(self._values)
        self._axis = AxisFields(self._values, self._selection, handle)
        self._tasks = None
        if model.limits.motion_tasks:
            self._tasks = MotionTasks(model.motion_tasks, self._values, self._axis)
        self._events: list[Event] = []

    # access

    def read(self, pnu: int, subindex: int = 0, count: int = 1) -> list[int]:
        """``count`` values from ``subindex`` on; raises :class:`ParameterError`.  A command reads as 0."""
        parameter = self._parameter(pnu)
        if parameter.elements == 0:
            self._check_plain(parameter, subindex, count)
            return [self._value(parameter)]
        self._check_elements(parameter, subindex, count)
        if parameter.backing in {Backing.STORED, Backing.FIELD}:
            return list(self._values.array(parameter)[subindex : subindex + count])
        return list(COMPUTED[parameter.argument](self, parameter)[subindex : subindex + count])

    def write(self, pnu: int, subindex: int, values: Sequence[int]) -> None:
        """Change ``len(values)`` elements from ``subindex`` on, or none; raises :class:`ParameterError`."""
        parameter = self._parameter(pnu)
        if not parameter.writable:
            raise refusal(ParameterErrorNumber.NOT_CHANGEABLE, parameter, subindex)
        if not values:
            raise refusal(ParameterErrorNumber.NUMBER_OF_VALUES, parameter)
        if parameter.elements == 0:
            self._check_plain(parameter, subindex, len(values))
        else:
            self._check_elements(parameter, subindex, len(values))
        for offset, value in enumerate(values):
            if not parameter.allows(value):
                raise refusal(ParameterErrorNumber.LIMIT_EXCEEDED, parameter, subindex + offset)
        target = self.model.canonical(parameter)
        if target.pnu in self.model.access.disabled_only and self.handle.in_operation:
            raise refusal(ParameterErrorNumber.OPERATING_STATE, parameter, subindex)
        mapped = self._mapped_setpoint(target)
        if mapped is not None and not self._axis.falls_back(mapped.slot):
            raise refusal(ParameterErrorNumber.NO_OPERATION_PRIORITY, parameter)
        if target.backing is Backing.COMMAND:
            self._execute(target, values[0])
            return
        before = dict(self._values.current)
        if target.backing is Backing.SIGNAL:
            self._write_signal(target, values[0])
        elif target.only_reset:
            self._clear_history(target, values[0])
        elif target.backing is Backing.COMPUTED and target.argument == "station-name":
            self._write_name(target, subindex, values)
        elif target.backing is Backing.COMPUTED or target.pnu in self.model.access.mapping_elements:
            self._write_telegram(target, subindex, values)
        else:
            units = self._axis.position_units()
            self._values.write(target, subindex, values)
            if not target.after_power_on:
                self._axis.apply_written(target)
            self._apply_consequences(target.pnu, subindex, values)
            if self._axis.position_units() != units:
                self._axis.convert_positions(units)
                if self._tasks is not None:
                    self._tasks.apply_all()
        if self.model.access.saves_at_once and target.nonvolatile:
            try:
                self._save(parameter)
            except ParameterError:
                # refused: nothing has changed
                self._values.current = before
                if not target.after_power_on:
                    self._axis.apply_written(target)
                raise
        self._events.append(ParameterWritten(pnu, subindex, tuple(values)))

    def get(self, text: str | int) -> int:
        """One value by number or name (:meth:`Model.resolve`)."""
        parameter, subindex = self.model.resolve(text)
        return self.read(parameter.pnu, subindex)[0]

    def set(self, text: str | int, value: int) -> None:
        """Change one value by number or name."""
        parameter, subindex = self.model.resolve(text)
        if not self.model.writable(text):
            raise refusal(ParameterErrorNumber.NOT_CHANGEABLE, parameter, subindex)
        self.write(parameter.pnu, subindex, [value])

    def changed(self, parameter: Parameter) -> bool:
        """Whether a stored value differs from the model's default, including a station name from any source."""
        target = self.model.canonical(parameter)
        if target.pnu == self.model.access.station_name:
            return tuple(self.read(target.pnu, 0, target.elements)) != target.defaults
        return self._values.changed(target)

    def changed_numbers(self) -> list[int]:
        """The PNUs of every stored value that differs from the model's default, in ascending order."""
        parameters = self.model.parameters
        asked = {*self._values.current, self.model.access.station_name} & parameters.keys()
        return sorted(pnu for pnu in asked if self.changed(parameters[pnu]))

    def events(self) -> list[Event]:
        """What happened since the last call."""
        events, self._events = self._events, []
        return events

    # telegram

    @property
    def telegram(self) -> Telegram:
        """The telegram in force."""
        return self._selection.telegram

    @property
    def telegram_number(self) -> int:
        return self._selection.number

    @property
    def parameter_words(self) -> int:
        """Number of words at the start of the frames that no mapping changes."""
        return self._selection.frame.parameter_words

    def plug_telegram(self, number: int | None, module_ident: int | None = None, supplement: int | None = None) -> None:
        """The module in slot 1 sets telegram ``number``; None: no module is plugged, PNU 922 decides.  No event.

        ``module_ident`` selects one of the telegram's modules, default the first; ``supplement`` is the supplementary
        telegram beside it.  A module other than the
        previous one applies its settings.  Raises :class:`ConfigError` for a number that the model does not know.
        """
        self._axis.store_signal_values(ended=True)
        if number is None:
            self._selection.unplug()
        else:
            for pnu, value in self._selection.plug(number, module_ident, supplement).items():
                self._values.current[pnu] = value
                self._axis.apply_written(self.model.parameters[pnu])
        self._axis.apply_telegram()

    def channels_closed(self) -> None:
        """No controller sends a telegram any more: parameters keep the values that its signals set."""
        self._axis.store_signal_values(ended=True)

    def mapping(self, *, setpoint: bool) -> tuple[Signal | None, ...]:
        """The signals of the frames, word by word."""
        return self._selection.mapping(setpoint=setpoint)

    def mapped_numbers(self, *, setpoint: bool) -> tuple[int, ...]:
        """The signal numbers after a parameter channel, word by word, as in PNU 915 and 916."""
        return self._selection.numbers(setpoint=setpoint)

    def output_words(self) -> tuple[int, ...]:
        """Word codes from the controller to the drive, as long as the telegram in force."""
        return self._selection.codes(setpoint=True)

    def input_words(self) -> tuple[int, ...]:
        """Word codes from the drive to the controller."""
        return self._selection.codes(setpoint=False)

    # memory

    def power_on(self) -> None:
        """As after a power cycle: the permanent values are in force and on the axis record, no module is plugged."""
        self._axis.clear_written()
        self._load()
        self._selection.unplug()
        self.watchdog_ns = 0
        self._apply_all()

    @property
    def waiting_name(self) -> bytes | None:
        """A station name that was written as a parameter and waits for the next power-on, None for none."""
        return self._values.waiting_name

    def take_name(self) -> str | None:
        """The name that was written and made permanent before this power-on, once."""
        name = self._values.take_name()
        return None if name is None else name.decode("ascii")

    def address_set(self) -> None:
        """DCP set the address: set the parameter of the address's source accordingly, permanently."""
        mode = self.model.address_mode
        if mode is not None and self._values.keep_at_once(mode.parameter, mode.dcp):
            self._events.append(NonVolatileSaved())

    def address_forgotten(self) -> None:
        """The address is the factory's again, and so is that parameter."""
        mode = self.model.address_mode
        if mode is not None and self._values.keep_at_once(mode.parameter, None):
            self._events.append(NonVolatileSaved())

    def commission_address(self) -> None:
        """An address of the farm file counts as set by DCP, unless the parameter has another value."""
        mode = self.model.address_mode
        if mode is not None:
            self._values.permanent.setdefault(mode.parameter, mode.dcp)

    def snapshot(self) -> dict[str, Any]:
        """The permanent values as plain JSON: what the farm keeps for this drive."""
        return self._values.snapshot()

    def restore(self, kept: Mapping[str, Any] | None) -> list[str]:
        """Take over a :meth:`snapshot`; None keeps the factory values.  Values come into force with :meth:`power_on`.

        Returns a sentence for each entry that this model cannot take (another model or edition); they are left out.
        """
        return self._values.restore(kept)

    def in_force(self) -> dict[str, Any]:
        """As :meth:`snapshot`, the values in force."""
        return self._values.in_force()

    def check_in_force(self, kept: Mapping[str, Any]) -> None:
        """Whether this model can have these; raises :class:`ParameterError` or :class:`ConfigError`."""
        StoredValues(self.model).put_in_force(kept)

    def put_in_force(self, kept: Mapping[str, Any]) -> None:
        """Put what :meth:`in_force` gave in force, of a drive that was switched on; raises as the check does."""
        self._replace(lambda: self._values.put_in_force(kept))

    def commission(self, values: Mapping[str | int, int | Sequence[int]]) -> None:
        """Permanent values by number or name, as a farm file gives them; in force with :meth:`power_on`.

        Raises :class:`ParameterError` on the first that does not fit.
        """
        for key, value in values.items():
            self._values.keep(key, value)

    def commission_tasks(self, tasks: Iterable[MotionTask]) -> None:
        """Motion tasks that the drive has from :meth:`power_on` on; raises :class:`ConfigError` for a wrong number."""
        given = list(tasks)
        for task in given:
            if not 0 <= task.number < self.model.limits.motion_tasks:
                raise ConfigError(f"{self.model.name} keeps no motion task {task.number}")
        if self._tasks is not None:
            self._tasks.give(given)

    def keep_task(self, task: MotionTask) -> None:
        """Store a motion task that the controller brought, as MT.SET does; nothing without such parameters."""
        if self._tasks is not None and self.model.motion_tasks is not None:
            self._tasks.store(task)

    # what computed parameters use

    def raw(self, pnu: int, default: int = 0) -> int:
        """The stored value of a plain parameter, ``default`` for one that the model does not have or does not store."""
        return self._values.raw(pnu, default)

    def scaled(self, parameter: Parameter, physical: float) -> int:
        """A physical value as the parameter's raw number: positions wrap at its width, others saturate at its range."""
        return self._axis.scaled(parameter, physical)

    # inside

    def _parameter(self, pnu: int) -> Parameter:
        try:
            return self.model.parameters[pnu]
        except KeyError:
            raise ParameterError(ParameterErrorNumber.IMPERMISSIBLE_PNU, None, f"PNU {pnu}") from None

    def _check_plain(self, parameter: Parameter, subindex: int, count: int) -> None:
        if subindex != 0 or count > 1:
            raise refusal(ParameterErrorNumber.NO_ARRAY, parameter, subindex)
        if count < 1:
            raise refusal(ParameterErrorNumber.ADDRESS_IMPERMISSIBLE, parameter)

    def _check_elements(self, parameter: Parameter, subindex: int, count: int) -> None:
        if count < 1:
            raise refusal(ParameterErrorNumber.ADDRESS_IMPERMISSIBLE, parameter)
        if not 0 <= subindex < parameter.elements or subindex + count > parameter.elements:
            raise refusal(ParameterErrorNumber.FAULTY_SUBINDEX, parameter, max(subindex, parameter.elements))

    def _value(self, parameter: Parameter) -> int:
        target = self.model.canonical(parameter)
        mapped = self._mapped_setpoint(target)
        if mapped is not None:
            value = int(self.handle.image.received[mapped.slot]) or self._axis.fallback(mapped.slot)
            return target.clamp(value) if mapped.bits > 8 * target.octets else target.wrap(value)
        if target.backing is Backing.COMMAND:
            return 0
        if target.backing is Backing.COMPUTED:
            return parameter.clamp(COMPUTED[target.argument](self, target)[0])
        if target.backing is Backing.SIGNAL:
            if target.argument == "sent":
                return target.wrap(int(self.handle.image.sent[target.index]))
            return target.wrap(int(self.handle.image.received[target.index]) or self._axis.fallback(target.index))
        if target.backing is Backing.FIELD:
            shown = self._axis.changed_meanwhile(target) if target.writable else self._axis.shown(target)
            return self.raw(target.pnu) if shown is None else shown
        return self.overruled.get(target.pnu, self.raw(target.pnu))

    def _mapped_setpoint(self, parameter: Parameter) -> Signal | None:
        """The value of the set point with the same number in the active cyclic channel.

        Moog MSD manual 8.2.3, P-0915: process data are linked to parameters.
        """
        signal = self.model.profidrive.signals.get(parameter.pnu)
        if signal is None or not signal.setpoint or not self.handle.controlled:
            return None
        return signal if signal in self.mapping(setpoint=True) else None

    def _clear_history(self, parameter: Parameter, value: int) -> None:
        """PNU 952: writing zero clears the fault buffer, other values are refused."""
        if value:
            raise refusal(ParameterErrorNumber.ONLY_RESET, parameter, 0)
        try:
            self.handle.push_command(CMD_CLEAR_HISTORY)
        except CommandRingFullError as exc:
            raise refusal(ParameterErrorNumber.OPERATING_STATE, parameter) from exc
        self._events.append(FaultHistoryCleared())

    def _write_name(self, parameter: Parameter, subindex: int, values: Sequence[int]) -> None:
        """Characters of a station name (P-1289), which is stored like others and takes effect at the next power-on."""
        array = list(self.read(parameter.pnu, 0, parameter.elements))
        array[subindex : subindex + len(values)] = values
        text = bytes(array).partition(b"\0")[0]
        if tuple(text.ljust(parameter.elements, b"\0")) == parameter.defaults:
            # the default is the value of a station without a name: not a name
            text = b""
        if not text.isascii() or not self.network.allows(text.decode("ascii")):
            raise refusal(ParameterErrorNumber.VALUE_IMPERMISSIBLE, parameter, subindex)
        self._values.current[parameter.pnu] = tuple(text.ljust(parameter.elements, b"\0"))

    def _write_signal(self, parameter: Parameter, value: int) -> None:
        """A set point by its PNU: no telegram brings it now, or its word may be 0 (AKD: MDI_ACC of telegram 352)."""
        bits = 8 * parameter.octets
        value &= (1 << bits) - 1
        raw = value - (1 << 32) if value >> 31 else value
        if self._mapped_setpoint(parameter) is None:
            self.handle.image.received[parameter.index] = raw
        self._axis.set_point_written(parameter.index, raw)

    def _write_telegram(self, parameter: Parameter, subindex: int, values: Sequence[int]) -> None:
        """Change the telegram (PNU 922, 915, 916, the elements of these): not while the axis is in operation.

        A mapping only where the telegram has a free one.
        """
        if self.handle.in_operation:
            raise refusal(ParameterErrorNumber.OPERATING_STATE, parameter)
        self._values.current[parameter.pnu] = self._selection.checked(parameter, subindex, values)
        self._axis.apply_telegram()
        self._events.append(TelegramChanged(self.telegram_number))

    def _apply_consequences(self, pnu: int, subindex: int, values: Sequence[int]) -> None:
        """Change other parameters as the manual says."""
        for consequence in self.model.consequences:
            if consequence.follows(pnu, subindex, values):
                other = self.model.parameters[consequence.other]
                self._values.write(other, consequence.other_subindex, [consequence.to])
                self._axis.apply_written(other)

    def _apply_all(self) -> None:
        self._axis.apply_all()
        if self._tasks is not None:
            self._tasks.apply_all()

    # commands

    def _execute(self, parameter: Parameter, value: int) -> None:
        """Carry out a command parameter; its value is ignored, but 0 does nothing to a switch (0 or 1) and a reboot."""
        name = parameter.argument
        if value == 0 and (parameter.maximum == 1 or name == "reboot"):
            return
        if name in AXIS_COMMANDS:
            command_axis(self.handle, parameter, value)
        elif name.startswith("task-"):
            self._edit_tasks(name, value, parameter)
        elif name == "save":
            self._save(parameter)
        elif name == "load":
            self._reload(self._load, parameter)
        elif name == "factory-values":
            self._reload(self._values.reset, parameter)
        elif name == "blink":
            self._events.append(DisplayBlinkRequested())
        elif name == "reboot":
            self._events.append(RebootRequested())
        else:
            # "refuse": the model has no such function, or the control word does it
            raise refusal(ParameterErrorNumber.OPERATING_STATE, parameter)

    def _edit_tasks(self, name: str, value: int, parameter: Parameter) -> None:
        if self._tasks is None:
            raise refusal(ParameterErrorNumber.OPERATING_STATE, parameter)
        if name == "task-clear":
            self._tasks.clear(value)
        elif not (self._tasks.keep() if name == "task-set" else self._tasks.load()):
            raise refusal(ParameterErrorNumber.VALUE_IMPERMISSIBLE, parameter)

    def _save(self, parameter: Parameter) -> None:
        """Make the values in force permanent; refused where they cannot be written, and the old ones stay permanent.

        No manual gives a number for it: the profile's "operating state" says that it is no fault of the request.
        """
        self._axis.store_signal_values()
        before = self._values.permanent, self._values.permanent_tasks
        self._values.save()
        if self._keep is not None and not self._keep(self.snapshot()):
            self._values.permanent, self._values.permanent_tasks = before
            raise refusal(ParameterErrorNumber.OPERATING_STATE, parameter)
        self._events.append(NonVolatileSaved(written=self._keep is not None))

    def _load(self) -> None:
        """Load the permanent values into RAM, including motion tasks."""
        self._values.load()
        if self._tasks is not None:
            self._tasks.power_on()

    def _reload(self, replace: Callable[[], None], parameter: Parameter) -> None:
        """Replace all values in RAM; not in operation, where ramps and units would jump."""
        if self.handle.in_operation:
            raise refusal(ParameterErrorNumber.OPERATING_STATE, parameter)
        self._replace(replace)

    def _replace(self, replace: Callable[[], None]) -> None:
        before = (self.telegram_number, self.output_words(), self.input_words())
        replace()
        self._apply_all()
        if (self.telegram_number, self.output_words(), self.input_words()) != before:
            self._events.append(TelegramChanged(self.telegram_number))
