"""From a drive's parameters to its axis record: every field of writer ``parameter``, in physical units."""

from __future__ import annotations

from functools import lru_cache
from math import isfinite
from typing import TYPE_CHECKING, Any, NamedTuple

from pnfarm.drives.parameters.control_limits import apply_control_limits
from pnfarm.drives.parameters.factor_group import apply_factor_group, float_bits, float_of
from pnfarm.drives.parameters.measured import deviation
from pnfarm.drives.parameters.parameter import Backing, Parameter
from pnfarm.drives.telegrams.telegram import object_of
from pnfarm.firmware.axis import AXIS
from pnfarm.table.access.fresh_rows import FreshRows, Same
from pnfarm.table.access.patch import Patch
from pnfarm.table.axis_codes import (
    FAULT_ACTIONS,
    RAMP_GENERATED,
    TASKS_TABLE,
    TASKS_TARPOS,
    VELOCITY_NSOLL_A,
    VELOCITY_NSOLL_B,
    VELOCITY_REF_SPEED,
)
from pnfarm.table.signals import (
    AIST_GLATT,
    DRV_ACC,
    DRV_DEC,
    FIRST_SHOWN,
    HOME_DIST,
    HOME_MODE,
    IAIST_GLATT,
    JOG_SPEED_1,
    JOG_SPEED_2,
    KPC,
    M_ACT,
    M_ADD1,
    M_LIMIT_POS,
    MDI_ACC,
    MELD_NAMUR,
    MIST_GLATT,
    MOMRED,
    MT_FEEDRATE,
    NIST_A_GLATT,
    NSOLL_B,
    OVERRIDE,
    PIST_GLATT,
    POS_STW2,
    REF_SPEED,
    SATZANW,
    SETPOINT_SLOTS,
    TARPOS_A,
    TORQUE_LIMIT_NEGATIVE,
    TORQUE_LIMIT_POSITIVE,
    XERR,
)

if TYPE_CHECKING:
    from collections.abc import Hashable

    from pnfarm.drives.axis_handle import AxisHandle
    from pnfarm.drives.parameters.stored_values import StoredValues
    from pnfarm.drives.telegrams.selection import TelegramSelection
    from pnfarm.drives.telegrams.telegram import Signal

__all__ = ["AxisFields"]

#: Fields that other parameters' scales follow.
_SCALED_BY = {
    "profidrive.acceleration_step": "acceleration",
    "jog.velocity": "jog/n",
    "profidrive.velocity_step": "reference/n",
}
#: Velocity steps to the velocity reference value (HIWIN E1 manual 6.1: 0x4000 is 100 %).
_REFERENCE = 0x4000
#: A field that no parameter and no section of the model sets has its default.
_PARAMETER_FIELDS = tuple((key, field.default) for key, field in AXIS.fields.items() if field.writer == "parameter")
#: Fields that are positions of the shaft; their parameters count from the home position.
SHAFT_POSITIONS = frozenset({"motor.position", "profile.position"})
#: Fields that hold the fault number of a cause that the firmware itself detects.
_FAULT_OF_CAUSE = {
    "encoder-error": "sensor.fault",
    "overvoltage": "supply.overvoltage_fault",
    "undervoltage": "supply.undervoltage_fault",
    "overload": "motor.overload_fault",
    "drive-overload": "foldback.drive_fault",
    "overspeed": "motor.overspeed_fault",
}
#: Fields whose parameters a signal changes (AKD PROFINET manual 5.8), and that signal.
_CHANGED_BY = {
    "homing.method": HOME_MODE,
    "homing.distance": HOME_DIST,
    "ramp.acceleration": DRV_ACC,
    "ramp.deceleration": DRV_DEC,
}
#: ``opmode`` of a telegram whose operation mode a parameter sets and that brings XERR and KPC.
POSITION_MODE = 2
#: Set points by their bits of ``torque_signals``.
_TORQUE_SIGNALS = (TORQUE_LIMIT_POSITIVE, TORQUE_LIMIT_NEGATIVE, MOMRED, M_LIMIT_POS, M_ADD1)
#: As ``profidrive.position_bits`` has them.
_POSITION_WORDS = ("POS_STW1", "POS_STW2", "POS_ZSW1", "POS_ZSW2")
#: Actual values that the firmware computes for telegrams that have one of them.
_SMOOTHED = frozenset({NIST_A_GLATT, IAIST_GLATT, MIST_GLATT, PIST_GLATT, AIST_GLATT, MELD_NAMUR, M_ACT})
#: Bits of ``home_signals``.
_HOME_SIGNALS = {HOME_MODE: 0x1, HOME_DIST: 0x2}
#: A ramp whose time is zero, rpm/s.
IMMEDIATE = 1e12


#: Drives with the same model, parameters and telegram, as they are before the farm starts.
_NEW_DRIVES: FreshRows[int] = FreshRows()


class _OfTelegram(NamedTuple):
    """Fields by their keys, the same to compare with, and the words of stored parameters, whose values may differ."""

    fields: tuple[tuple[str, Any], ...]
    patch: Patch
    stored: list[Signal]


#: What a telegram writes, by what it depends on.
_TELEGRAMS: dict[Hashable, _OfTelegram] = {}
MOST_TELEGRAMS = 256


@lru_cache(maxsize=64)
def _factory_values(firmware: tuple[tuple[str, float], ...]) -> Patch:
    """The defaults of all fields of parameters, and a model's own values."""
    return Patch(AXIS, (*_PARAMETER_FIELDS, *firmware))


class AxisFields:
    """Writes the axis record of ``handle`` from the drive's stored values and its telegram."""

    __slots__ = ("_generator_set", "_handle", "_positions", "_records", "_selection", "_values", "_written")

    def __init__(self, values: StoredValues, selection: TelegramSelection, handle: AxisHandle) -> None:
        self._values = values
        self._selection = selection
        self._handle = handle
        #: Raw numbers that were rounded when the unit changed: PNU -> the rounded number, and the exact position, rev.
        self._positions: dict[int, tuple[int, float]] = {}
        #: Set points that were written by their PNU: slot -> raw number.
        self._written: dict[int, int] = {}
        #: Records inside the axis while all fields are written: names that lead there -> record.
        self._records: dict[tuple[str, ...], Any] = {}
        #: How often a parameter wrote ``ramp_generator``.
        self._generator_set = 0

    @property
    def axis(self) -> Any:
        """The record that this writes."""
        return self._handle.axis

    # from parameters

    def clear_written(self) -> None:
        """Set points that were written as parameters are forgotten."""
        self._written.clear()

    def apply_all(self) -> None:
        """Write every field from the values in force."""
        self._positions.clear()
        self._records.clear()
        axis, values = self._handle.axis, self._values
        _factory_values(tuple(values.model.firmware.items())).apply(axis)
        self._convert_defaults()
        if int(axis.last_ns):
            # the engine may be writing to it
            self._write_all()
            return
        key = (
            Same(values.model), tuple(values.current.items()), self._selection.key, tuple(self._written.items()),
            tuple(self._positions.items()), self._generator_set,
        )  # fmt: skip
        self._generator_set = _NEW_DRIVES.write(axis, key, self._write_all)

    def _write_all(self) -> int:
        """Returns how often a parameter wrote ``ramp_generator``."""
        axis, model = self._handle.axis, self._values.model
        if model.factor_group is not None:
            apply_factor_group(model.factor_group, self._values, axis)
        if model.control_limits is not None:
            apply_control_limits(model.control_limits, self._values, axis)
        for parameter in model.axis_parameters:
            self._apply(parameter)
        self._records.clear()
        self._apply_communication_loss()
        self._apply_fault_actions()
        if model.profidrive.sign_of_life is not None:
            axis.life.settings.watched = 1
            axis.life.settings.fault = model.faults[model.profidrive.sign_of_life.fault].code
        if model.following_error is not None:
            axis.positioning.settings.following_fault = model.faults[model.following_error.fault].code
        for fault in model.faults.values():
            if fault.cause in _FAULT_OF_CAUSE:
                AXIS.write(axis, _FAULT_OF_CAUSE[fault.cause], fault.code)
        self.apply_telegram()
        return self._generator_set

    def apply_written(self, parameter: Parameter) -> None:
        """One parameter was changed: write the fields that depend on it."""
        model = self._values.model
        if parameter.backing is Backing.FIELD and parameter.is_for(linear=model.pitch > 0.0):
            self._apply(parameter)
            self._apply_scaled(_SCALED_BY.get(parameter.argument, ""))
            self._override_signal(parameter)
        if model.factor_group is not None and parameter.pnu in model.factor_group.numbers:
            apply_factor_group(model.factor_group, self._values, self._handle.axis)
            self._apply_scaled("velocity")
            self._apply_scaled("acceleration")
        if model.control_limits is not None and parameter.pnu in model.control_limits.numbers:
            apply_control_limits(model.control_limits, self._values, self._handle.axis)
        if parameter.pnu in model.fault_actions:
            self._apply_fault_actions()
        if parameter.pnu in {model.communication_loss.action_parameter, model.communication_loss.stop_parameter}:
            self._apply_communication_loss()
        if int(self._handle.axis.profidrive.settings.shows):
            self._apply_shown()

    def _apply_scaled(self, scale: str) -> None:
        for parameter in self._values.model.axis_parameters if scale else ():
            if parameter.scale == scale:
                self._apply(parameter)

    def apply_telegram(self) -> None:
        """Write what comes with the telegram in force: operation mode, tasks, velocity set point, bit of ZSW2."""
        key = Same(self._values.model), self._selection.words_key, self.fallback(MDI_ACC)
        known = _TELEGRAMS.get(key)
        if known is None:
            known = _TELEGRAMS[key] = self._of_telegram()
            if len(_TELEGRAMS) > MOST_TELEGRAMS:
                del _TELEGRAMS[next(iter(_TELEGRAMS))]
        # mostly it is there: with each connection the telegram is plugged again, and is the one from before
        if not known.patch.stands_in(self._handle.axis):
            for name, value in known.fields:
                AXIS.write(self._handle.axis, name, value)
        if known.stored:
            self._apply_shown()

    def _of_telegram(self) -> _OfTelegram:
        """What :meth:`apply_telegram` writes."""
        telegram, setpoints = self._selection.telegram, self._selection.mapping(setpoint=True)
        slots = self._mapped_slots()
        bit_names = self._values.model.profidrive.bit_names
        task_form = telegram.tasks
        if task_form == TASKS_TARPOS and telegram.free_mapping and SATZANW in slots and TARPOS_A not in slots:
            task_form = TASKS_TABLE
        shows, stored = self._shows()
        fields: dict[str, Any] = {
            "profidrive.task_form": task_form,
            "profidrive.real_tasks": any(one is not None and one.real for one in setpoints),
            "profidrive.torque_signals": sum((slot in slots) << bit for bit, slot in enumerate(_TORQUE_SIGNALS)),
            "profidrive.object": object_of(setpoints),
            "profidrive.position_words": {OVERRIDE, POS_STW2} <= slots,
            "profidrive.inverts": "invert_setpoint" in bit_names("STW1", telegram.number),
            "profidrive.position_bits": [
                sum((name != "") << bit for bit, name in enumerate(bit_names(word, telegram.number)))
                for word in _POSITION_WORDS
            ],
            "profidrive.jog_signals": (JOG_SPEED_1 in slots) | (JOG_SPEED_2 in slots) << 1,
            "interpolation.servo_control": (telegram.opmode or POSITION_MODE) if {XERR, KPC} <= slots else 0,
            "profidrive.home_signals": (HOME_MODE in slots) | (HOME_DIST in slots) << 1,
            "profidrive.feedrate_signal": MT_FEEDRATE in slots,
            "profidrive.spare_acceleration": self.fallback(MDI_ACC),
            "profidrive.pulses_enabled": 0 if telegram.pulses_enabled is None else 1 << telegram.pulses_enabled,
            "profidrive.parameter_channel": self._selection.frame.parameter_words > 0,
            "profidrive.shows": shows,
            "profidrive.velocity_signal": VELOCITY_NSOLL_B
            if NSOLL_B in slots
            else VELOCITY_REF_SPEED
            if REF_SPEED in slots
            else VELOCITY_NSOLL_A,
        }
        if telegram.opmode is not None:
            fields["drive.opmode"] = telegram.opmode
        return _OfTelegram(tuple(fields.items()), Patch(AXIS, fields.items()), stored)

    def _shows(self) -> tuple[int, list[Signal]]:
        """The field ``shows``, and the mapped words that are stored parameters."""
        shown = {signal for signal in self._selection.mapping(setpoint=False) if signal is not None}
        stored = [signal for signal in shown if signal.stored]
        smoothed = any(signal.slot in _SMOOTHED for signal in shown)
        return any(signal.readable for signal in shown) | bool(stored) << 1 | smoothed << 2, stored

    def _apply_shown(self) -> None:
        """Mapped words that are not actual values: set points echoed as received, and stored parameters."""
        values, settings = self._values, self._handle.axis.profidrive.settings
        settings.shows, stored = self._shows()
        for signal in stored:
            parameter = values.model.parameters[signal.number]
            raw = values.array(parameter)[signal.element] if parameter.elements else values.raw(signal.number)
            settings.shown[signal.slot - FIRST_SHOWN] = raw - (1 << 32) if raw >= 1 << 31 else raw

    def fallback(self, slot: int) -> int:
        """The set point that was written as a parameter and applies while the telegram's word is 0; 0 for none."""
        return self._written.get(slot, 0) if self.falls_back(slot) else 0

    def falls_back(self, slot: int) -> bool:
        """Whether, in the telegram in force, this set point's parameter applies while the telegram's word is 0."""
        return any(SETPOINT_SLOTS[name] == slot for name in self._selection.telegram.falls_back)

    def set_point_written(self, slot: int, raw: int) -> None:
        """A set point was written by its PNU: if the telegram does not have it, it applies from now on."""
        axis = self._handle.axis
        self._written[slot] = raw
        axis.profidrive.settings.spare_acceleration = self.fallback(MDI_ACC)
        axis.profidrive.settings.home_signals |= _HOME_SIGNALS.get(slot, 0)
        if slot == MT_FEEDRATE:
            axis.profidrive.settings.feedrate_signal = 1

    def store_signal_values(self, *, ended: bool = False) -> None:
        """Store what signals of the telegram changed in the parameters that they change (AKD PROFINET manual 5.8).

        With ``ended`` the telegram is no longer received, and the parameters apply again.
        """
        mapped = self._mapped_slots()
        if mapped.isdisjoint(_HOME_SIGNALS):
            return
        for parameter in self._values.model.axis_parameters:
            slot = _CHANGED_BY.get(parameter.argument)
            if slot not in _HOME_SIGNALS or slot not in mapped:
                continue
            value = self.changed_meanwhile(parameter)
            if ended:
                self._handle.axis.profidrive.settings.home_signals = (
                    int(self._handle.axis.profidrive.settings.home_signals) & ~_HOME_SIGNALS[slot]
                )
            if value is not None and parameter.allows(value):
                self._values.current[parameter.pnu] = value
                self._apply(parameter)

    def _override_signal(self, parameter: Parameter) -> None:
        """A parameter was written whose signal was also written as a parameter: the last one written applies."""
        slot = _CHANGED_BY.get(parameter.argument)
        if slot is None or slot in self._mapped_slots():
            return
        axis = self._handle.axis
        axis.profidrive.settings.home_signals = int(axis.profidrive.settings.home_signals) & ~_HOME_SIGNALS.get(slot, 0)
        self._handle.image.received[slot] = 0

    def _mapped_slots(self) -> set[int]:
        """The slots of the set points that the telegram in force contains."""
        return {signal.slot for signal in self._selection.mapping(setpoint=True) if signal is not None}

    def physical(self, parameter: Parameter, raw: int) -> float:
        """A raw number of a parameter in the unit of its field."""
        if parameter.choices:
            return parameter.choices[raw]
        if parameter.scale.startswith("float32"):
            return float_of(raw) * parameter.factor
        if parameter.scale == "2^-n":
            return 2.0**-raw
        if parameter.scale == "position":
            number, position = self._positions.get(parameter.pnu, (None, 0.0))
            return position if number == raw else raw / self.position_units()
        if parameter.scale == "jog/n":
            return 1000.0 * abs(float(self._handle.axis.jog.settings.velocity[0])) / raw if raw else IMMEDIATE
        if parameter.scale == "reference/n":
            return (
                1000.0 * _REFERENCE * float(self._handle.axis.profidrive.settings.velocity_step) / raw
                if raw
                else IMMEDIATE
            )
        if parameter.scale.endswith("/n"):
            return parameter.factor / raw if raw else IMMEDIATE
        if parameter.scale.endswith("torque-constant") and raw == parameter.default:
            return AXIS.fields[parameter.argument].default
        return raw * self._factor(parameter)

    def _place(self, key: str) -> tuple[Any, str]:
        """The record that a field is in, and its name there: each record on the way to it takes a microsecond."""
        *parts, name = AXIS.path(key)
        way = tuple(parts)
        record = self._records.get(way)
        if record is None:
            record = self._handle.axis
            for part in parts:
                record = record[part]
            self._records[way] = record
        return record, name

    def _apply(self, parameter: Parameter) -> None:
        record, name = self._place(parameter.argument)
        if parameter.elements:
            field = record[name]
            for index, raw in enumerate(self._values.array(parameter)):
                field[index] = self.physical(parameter, raw)
            return
        if parameter.argument == "ramp.generator":
            self._generator_set += 1
            self._handle.axis.ramp.settings.generator_set = self._generator_set
        value = self.physical(parameter, self._values.raw(parameter.pnu))
        if parameter.index >= 0:
            record[name][parameter.index] = value
        else:
            record[name] = value

    def _apply_communication_loss(self) -> None:
        loss = self._values.model.communication_loss
        raised = not loss.action_parameter or self._values.raw(loss.action_parameter)
        code = self._values.model.faults[loss.fault].code if raised else 0
        on_stop = self._values.raw(loss.stop_parameter) >> loss.stop_bit & 1 if loss.stop_parameter else loss.on_stop
        self._handle.axis.faults.settings.loss_fault = code
        self._handle.axis.faults.settings.stop_fault = code if on_stop else 0

    def _apply_fault_actions(self) -> None:
        """Which faults are ignored: those whose parameter is not 0."""
        raw = self._values.raw
        found = [number for pnu, number in self._values.model.fault_actions.items() if raw(pnu)]
        self._handle.axis.faults.settings.ignored[:] = found + [0] * (FAULT_ACTIONS - len(found))

    # from field to parameter

    def shown(self, parameter: Parameter) -> int:
        """A field as the raw number of the parameter that reads it."""
        field = AXIS.read(self._handle.axis, parameter.argument)
        physical = float(field[parameter.index] if parameter.index >= 0 else field)
        physical += deviation(self._handle.axis, parameter.argument)
        if parameter.argument in SHAFT_POSITIONS:
            physical -= float(self._handle.axis.homing.origin)
        return self.scaled(parameter, physical)

    def changed_meanwhile(self, parameter: Parameter) -> int | None:
        """The value of a writable parameter that a signal or homing changed, None where neither did.

        A ramp of zero does not count (:func:`pnfarm.firmware.profidrive.telegram.from_setpoints`).
        """
        if parameter.argument == "ramp.generator":
            left = int(self._handle.axis.ramp.generator_left)
            return self.scaled(parameter, RAMP_GENERATED) if left == self._generator_set + 1 else None
        slot = _CHANGED_BY.get(parameter.argument)
        if slot is None:
            return None
        axis, value = self._handle.axis, int(self._handle.image.received[slot])
        if slot in _HOME_SIGNALS:
            return self._homing_signal(parameter, slot, value)
        return (
            self.scaled(parameter, (value & 0xFFFF) * float(axis.profidrive.settings.acceleration_step))
            if value & 0xFFFF
            else None
        )

    def _homing_signal(self, parameter: Parameter, slot: int, value: int) -> int | None:
        """HOME_MODE or HOME_DIST in its parameter's number, None where it does not count.

        While the data of a telegram are not valid, the last valid value stays.
        """
        axis, bit = self._handle.axis, _HOME_SIGNALS[slot]
        if not int(axis.profidrive.settings.home_signals) & bit:
            return None
        distance = value * float(axis.travel.settings.position_step)
        if slot in self._mapped_slots() and not self._handle.controlled:
            if not int(axis.homing.brought) & bit:
                return None
            value, distance = int(axis.homing.method_in_force), float(axis.homing.distance_in_force)
        return value & 0xFFFF if slot == HOME_MODE else self.scaled(parameter, distance)

    def scaled(self, parameter: Parameter, physical: float) -> int:
        """A physical value as the parameter's raw number: positions wrap at its width, others saturate at its range."""
        if parameter.scale.startswith("float32"):
            return float_bits(physical / parameter.factor)
        if not isfinite(physical):
            return parameter.default
        if parameter.scale == "position":
            return parameter.wrap(round(physical * self.position_units()))
        return parameter.clamp(round(physical / self._factor(parameter)))

    def _convert_defaults(self) -> None:
        """Defaults are given in the model's units of positions; convert them to the units in force."""
        units = self._values.model.position_units
        if units is not None and self.position_units() != units.default:
            self.convert_positions(units.default, written=False)

    def convert_positions(self, units: float, *, written: bool = True) -> None:
        """The unit of positions changed from ``units`` to the revolution: positions stay, raw numbers are converted.

        With ``written`` false, written values and tasks stay unchanged: they already have the unit.
        AKD PROFINET manual 6.2: a PNU's value is the parameter's value divided by PN.POSSCALE.
        """
        now = self.position_units()
        current = self._values.current
        for parameter in self._values.model.parameters.values():
            if parameter.scale != "position" or not parameter.writable or parameter.backing is Backing.SIGNAL:
                continue
            if not written and parameter.pnu in current:
                continue
            raw = self._values.raw(parameter.pnu)
            number, position = self._positions.get(parameter.pnu, (None, 0.0))
            position = position if number == raw else raw / units
            raw = self._numbered(parameter, position * now)
            current[parameter.pnu] = raw
            self._positions[parameter.pnu] = (raw, position)
            for task in self._values.tasks.values() if written else ():
                if parameter.pnu in task:
                    task[parameter.pnu] = self._numbered(parameter, task[parameter.pnu] / units * now)
        if written:
            self._apply_scaled("position")

    @staticmethod
    def _numbered(parameter: Parameter, value: float) -> int:
        return min(max(parameter.wrap(round(value)), parameter.minimum), parameter.maximum)

    def position_units(self) -> float:
        """Raw numbers of a position parameter to one revolution; 1 for a model that has no such parameters."""
        raw, units = self._values.raw, self._values.model.position_units
        if units is None:
            return 1.0
        chosen = units.revolution[raw(units.unit)] or raw(units.numerator) / raw(units.denominator)
        return chosen * units.multiple / raw(units.scaling, 1)

    def _factor(self, parameter: Parameter) -> float:
        if parameter.scale == "velocity":
            return float(self._handle.axis.profidrive.settings.velocity_step)
        if parameter.scale == "acceleration":
            return float(self._handle.axis.profidrive.settings.acceleration_step)
        if parameter.scale.endswith("torque-constant"):
            return float(self._handle.axis.motor.settings.torque_constant) / (
                -1000.0 if parameter.scale[0] == "-" else 1000.0
            )
        if parameter.scale == "rated-torque":
            return float(self._handle.axis.torque.settings.rated) / 100.0
        return parameter.factor
