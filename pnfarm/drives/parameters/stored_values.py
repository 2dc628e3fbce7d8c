"""The values of one drive that differ from its model's: those in force, and the permanent ones.

Written values are in RAM until DRV.NVSAVE makes them permanent (AKD EtherNet/IP manual 6.7, "Saving to
Non-volatile Memory"); a power cycle goes back to the permanent ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from pnfarm.drives.parameters.parameter import Backing, Parameter, ParameterError, ParameterErrorNumber, refusal
from pnfarm.drives.telegrams.mapping import mapped_signals
from pnfarm.drives.telegrams.telegram import MappingError, signal_codes
from pnfarm.errors import ConfigError
from pnfarm.table.axis_codes import MOTION_TASKS

if TYPE_CHECKING:
    from pnfarm.drives.description.model import Model

__all__ = ["StoredValues", "Value", "check_telegram", "mapping_numbers"]

Value = int | tuple[int, ...]


def check_telegram(model: Model, parameter: Parameter, number: int) -> None:
    """Raise :class:`ParameterError` for a telegram that the model does not have."""
    if number not in model.profidrive.telegrams:
        raise refusal(ParameterErrorNumber.VALUE_IMPERMISSIBLE, parameter, 0)


def mapping_numbers(
    model: Model, parameter: Parameter, numbers: Sequence[int], elements: Sequence[int] = ()
) -> tuple[int, ...]:
    """The signals for PNU 915 or 916 to map, checked; raises :class:`ParameterError`.

    ``elements`` are those of stored arrays, word by word.
    """
    setpoint = parameter.argument == "setpoint-mapping"
    try:
        signals = mapped_signals(model, numbers, setpoint=setpoint, elements=elements)
        if not model.access.mapping_by_entry:
            signal_codes(signals, setpoint=setpoint)
    except MappingError as exc:
        raise ParameterError(
            ParameterErrorNumber.VALUE_IMPERMISSIBLE, exc.index, f"{parameter.pnu} {parameter.name}, {exc}"
        ) from exc
    return tuple(numbers)


def _as_list(value: Any, parameter: Parameter) -> list[int]:
    """A number, or a list of them, from a file."""
    values = [value] if isinstance(value, int) else value
    if not isinstance(values, Sequence) or isinstance(values, str) or not values:
        raise refusal(ParameterErrorNumber.INCORRECT_DATA_TYPE, parameter)
    if any(not isinstance(number, int) or isinstance(number, bool) for number in values):
        raise refusal(ParameterErrorNumber.INCORRECT_DATA_TYPE, parameter)
    return list(values)


class StoredValues:
    """``current`` and ``permanent`` values by PNU; a parameter that is in neither has its model's default."""

    __slots__ = ("current", "model", "permanent", "permanent_tasks", "tasks")

    def __init__(self, model: Model) -> None:
        self.model = model
        self.current: dict[int, Value] = {}
        self.permanent: dict[int, Value] = {}
        #: Motion tasks by number, each its parameters' raw numbers by PNU.
        self.tasks: dict[int, dict[int, int]] = {}
        self.permanent_tasks: dict[int, dict[int, int]] = {}

    def raw(self, pnu: int, default: int = 0) -> int:
        """The value of a plain parameter, ``default`` for one that the model does not have or does not store."""
        value = self.current.get(pnu)
        if isinstance(value, int):
            return value
        parameter = self.model.parameters.get(pnu)
        return (
            parameter.default
            if parameter is not None and parameter.backing in {Backing.STORED, Backing.FIELD}
            else default
        )

    def array(self, parameter: Parameter) -> tuple[int, ...]:
        """The elements of an array that is stored or in the axis record."""
        stored = self.current.get(parameter.pnu)
        return stored if isinstance(stored, tuple) else parameter.defaults

    def changed(self, parameter: Parameter) -> bool:
        """Whether the value in force differs from the model's default."""
        factory = parameter.defaults or parameter.default
        if parameter.backing not in {Backing.STORED, Backing.FIELD}:
            # a telegram or a mapping, whose default is the module's
            return parameter.pnu in self.current
        return self.current.get(parameter.pnu, factory) != factory

    def write(self, parameter: Parameter, subindex: int, values: Sequence[int]) -> None:
        """Change a plain value, or elements of an array from ``subindex`` on."""
        if parameter.elements:
            array = list(self.array(parameter))
            array[subindex : subindex + len(values)] = values
            self.current[parameter.pnu] = tuple(array)
        else:
            self.current[parameter.pnu] = values[0]

    # the name of the station, which is a parameter of some models

    @property
    def _name(self) -> Parameter | None:
        pnu = self.model.access.station_name
        return self.model.parameters[pnu] if pnu else None

    @property
    def waiting_name(self) -> bytes | None:
        """The written name, None for none."""
        written = self.current.get(self._name.pnu) if self._name is not None else None
        return bytes(written).partition(b"\0")[0] if isinstance(written, tuple) else None

    def take_name(self) -> bytes | None:
        """Take the permanent name out of the store: it is the station's from now on."""
        name = self.waiting_name
        if self._name is not None:
            self.current.pop(self._name.pnu, None)
            self.permanent.pop(self._name.pnu, None)
        return name

    # non-volatile memory

    def keep_at_once(self, pnu: int, value: int | None) -> bool:
        """One value, None for the default, in force and permanent; false if nothing changed."""
        before = (self.current.get(pnu), self.permanent.get(pnu))
        for values in (self.current, self.permanent):
            if value is None:
                values.pop(pnu, None)
            else:
                values[pnu] = value
        return before != (value, value)

    def save(self) -> None:
        """Make the values in force permanent, as far as the drive stores them."""
        parameters = self.model.parameters
        self.permanent = {pnu: value for pnu, value in self.current.items() if parameters[pnu].nonvolatile}
        self.permanent_tasks = {number: dict(task) for number, task in self.tasks.items()}

    def load(self) -> None:
        """Put the permanent values in force."""
        self.current = dict(self.permanent)
        self.tasks = {number: dict(task) for number, task in self.permanent_tasks.items()}

    def reset(self) -> None:
        """Put the model's defaults in force, without motion tasks; the permanent values stay."""
        self.current = {}
        self.tasks = {}

    def snapshot(self) -> dict[str, Any]:
        """The permanent values as plain JSON: what the farm keeps for this drive."""
        return self._as_plain(self.permanent, self.permanent_tasks)

    def in_force(self) -> dict[str, Any]:
        """The same of the values in force."""
        return self._as_plain(self.current, self.tasks)

    def _as_plain(self, values: Mapping[int, Value], tasks: Mapping[int, Mapping[int, int]]) -> dict[str, Any]:
        kept: dict[str, Any] = {
            "model": self.model.name,
            "parameters": {
                str(pnu): list(value) if isinstance(value, tuple) else value for pnu, value in values.items()
            },
        }
        if tasks:
            kept["motion_tasks"] = {
                str(number): {str(pnu): raw for pnu, raw in task.items()} for number, task in tasks.items()
            }
        return kept

    def put_in_force(self, kept: Mapping[str, Any]) -> None:
        """Put what :meth:`in_force` gave in force, all of it or nothing.

        Raises :class:`ParameterError` or :class:`ConfigError` for what this model cannot have.
        """
        parameters, tasks = kept.get("parameters"), kept.get("motion_tasks", {})
        if not isinstance(parameters, Mapping) or not isinstance(tasks, Mapping):
            raise ConfigError("`parameters` and `motion_tasks` are no mappings")
        values = dict(self._fitting(str(key), value, permanent=False) for key, value in parameters.items())
        found = dict(self._fitting_task(str(number), task) for number, task in tasks.items())
        self.current, self.tasks = values, found

    def restore(self, kept: Mapping[str, Any] | None) -> list[str]:
        """Take over a :meth:`snapshot`; None keeps the factory values.

        Returns a sentence for each entry that this model cannot take (another model or edition); they are left out.
        """
        self.permanent = {}
        self.permanent_tasks = {}
        refused: list[str] = []
        if kept is None:
            return refused
        parameters = kept.get("parameters")
        if not isinstance(parameters, Mapping):
            return ["the kept values have no parameters; the drive starts with its defaults"]
        for key, value in parameters.items():
            try:
                self.keep(str(key), value)
            except ParameterError as exc:
                refused.append(f"kept parameter {key}: {exc}")
        tasks = kept.get("motion_tasks")
        for number, task in tasks.items() if isinstance(tasks, Mapping) else ():
            try:
                place, found = self._fitting_task(str(number), task)
                self.permanent_tasks[place] = found
            except (ParameterError, ConfigError, ValueError) as exc:
                refused.append(f"kept motion task {number}: {exc}")
        return refused

    def _fitting_task(self, number: str, task: Any) -> tuple[int, dict[int, int]]:
        wanted = self.model.motion_tasks
        if wanted is None or not isinstance(task, Mapping):
            raise ConfigError("this model keeps no such task")
        if not (number.isascii() and number.isdigit() and len(number) < 4 and int(number) < MOTION_TASKS):
            raise ConfigError(f"its number is not within 0..{MOTION_TASKS - 1}")
        found: dict[int, int] = {}
        for pnu in wanted.contents:
            parameter = self.model.parameters[pnu]
            (value,) = _as_list(task.get(str(pnu), parameter.default), parameter)
            if not parameter.minimum <= value <= parameter.maximum:
                raise refusal(ParameterErrorNumber.LIMIT_EXCEEDED, parameter, 0)
            found[pnu] = value
        return int(number), found

    def keep(self, key: str | int, value: Any) -> None:
        """Check one permanent value, by number or name, and take it over; raises :class:`ParameterError`."""
        pnu, fitting = self._fitting(key, value, permanent=True)
        self.permanent[pnu] = fitting

    def _fitting(self, key: str | int, value: Any, *, permanent: bool) -> tuple[int, Value]:
        """A value of a file as the store has it; raises :class:`ParameterError`."""
        parameter, subindex = self.model.resolve(key)
        target = self.model.canonical(parameter)
        if subindex:
            raise refusal(ParameterErrorNumber.ADDRESS_IMPERMISSIBLE, parameter)
        if permanent and not (target.nonvolatile and self.model.writable(key)):
            raise refusal(ParameterErrorNumber.NOT_CHANGEABLE, parameter, 0)
        values = _as_list(value, parameter)
        if len(values) > max(parameter.elements, 1):
            raise refusal(ParameterErrorNumber.NUMBER_OF_VALUES, parameter)
        for index, number in enumerate(values):
            if not parameter.allows(number):
                raise refusal(ParameterErrorNumber.LIMIT_EXCEEDED, parameter, index)
        if target.elements and target.backing in {Backing.STORED, Backing.FIELD}:
            return target.pnu, tuple(values) + target.defaults[len(values) :]
        if target.text:
            if not bytes(values).isascii():
                raise refusal(ParameterErrorNumber.VALUE_IMPERMISSIBLE, parameter)
            return target.pnu, tuple(values) + (0,) * (target.elements - len(values))
        if target.elements:
            return target.pnu, mapping_numbers(self.model, target, values)
        if target.argument == "telegram":
            check_telegram(self.model, target, values[0])
        return target.pnu, values[0]
