"""Named signals of one drive, for conditions: ``velocity``, ``state``, ``zsw1.fault_present``, ``param("DRV.OPMODE")``.

Every drive has the signals of :data:`SIGNALS`, and the words of its model's profile: ``stw1``, ``zsw1``, digital inputs
and outputs of PROFIdrive, ``control``, ``status_1`` and ``status_2`` of CIP's position controller.  Their bits have the
names of the model's manual (of any telegram of the model), else the profile's; ``zsw1.3`` and ``zsw1.bit_3`` is a bit
by its number.
What a model's manual does not define, its drives do not have.
"""

from __future__ import annotations

import dataclasses
import re
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from pnfarm.drives.parameters.parameter import ParameterError
from pnfarm.drives.profiles.cip.part import CIP
from pnfarm.drives.profiles.cip.words import CONTROL_BITS, STATUS_1_BITS, STATUS_2_BITS
from pnfarm.drives.telegrams.word_bits import STW1_BITS, ZSW1_BITS
from pnfarm.firmware.axis import AXIS
from pnfarm.firmware.profidrive.control_word import FAULT_ACKNOWLEDGE
from pnfarm.table.access.places import place_of
from pnfarm.table.axis_codes import FIRMWARE_ETHERNETIP, NUMBER_MASK, POWER_ENABLE, POWER_ON

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from pnfarm.drives.description.model import Model
    from pnfarm.station.axis import Axis
    from pnfarm.table.access.places import Place
    from pnfarm.vocabulary.conditions import Value

__all__ = [
    "EVENT_SIGNALS",
    "SIGNALS",
    "STATES",
    "STATUS_BITS",
    "WORDS",
    "DriveSignal",
    "find_parameter",
    "find_signal",
    "profile_words",
    "signal_names",
]

#: Signals that say what an axis does and what it waits for, whatever its bus.
STATUS_BITS = ("ready", "enabled", "acknowledging", "in_operation", "at_rest", "homed", "task_active", "target_reached")
#: Words of the signal ``state``.
STATES = ("off", "boot", "S1", "S2", "S3", "S4", "S5")
#: Signals whose every change is an event, so that none is missed between two readings.
EVENT_SIGNALS = frozenset({"state", "fault", "faulted", "warning", "connected", "powered"})
#: A request by a parameter is over at once: it shows for this long.
_ASKED_NS = 10_000_000
_BIT = re.compile(r"(?:bit_)?([0-9]{1,2})")


def _nowhere(station: Axis) -> Place | None:
    del station
    return None


@dataclass(frozen=True, slots=True)
class ProfileWord:
    """A word of a drive's profile, of 16 bits or fewer: its field, and its lowest bit there; names of its bits."""

    doc: str
    path: tuple[str, str]
    names: tuple[str, ...]
    shift: int = 0
    bits: int = 16

    def read(self, station: Axis) -> int:
        subject, field = self.path
        whole = int(getattr(getattr(station.handle.axis, subject), field))
        return whole >> self.shift & (1 << self.bits) - 1

    def place(self, bit: int | None = None) -> Place:
        """Where the word is, or one bit of it."""
        whole = place_of(AXIS, ".".join(self.path))
        shift, bits = (self.shift, self.bits) if bit is None else (self.shift + bit, 1)
        return dataclasses.replace(whole, shift=whole.shift + shift, mask=(1 << bits) - 1, sign=0)


_PROFIDRIVE_WORDS = {
    "stw1": ProfileWord("control word 1 in force", ("profidrive", "stw1"), STW1_BITS),
    "zsw1": ProfileWord("status word 1", ("profidrive", "zsw1"), ZSW1_BITS),
}
#: Of drives with such a telegram.
_DIGITAL_WORDS = {
    "e_digital": ProfileWord("digital inputs", ("machine", "inputs"), ()),
    "a_digital": ProfileWord("digital outputs, of a control unit", ("machine", "outputs"), ()),
}
_CIP_WORDS = {
    "control": ProfileWord("control word in force", ("ethernetip", "word"), CONTROL_BITS, bits=8),
    "status_1": ProfileWord("status word 1", ("ethernetip", "status"), STATUS_1_BITS, bits=8),
    "status_2": ProfileWord("status word 2", ("ethernetip", "status"), STATUS_2_BITS, shift=8, bits=8),
}
#: The words of any profile.
WORDS = frozenset({*_PROFIDRIVE_WORDS, *_DIGITAL_WORDS, *_CIP_WORDS})


@lru_cache(maxsize=64)
def profile_words(model: Model) -> Mapping[str, ProfileWord]:
    if model.profile == CIP:
        return _CIP_WORDS
    known = {(signal.name, signal.setpoint) for signal in model.profidrive.signals.values()}
    digital = [name for name, setpoint in (("E_DIGITAL", False), ("A_DIGITAL", True)) if (name, setpoint) in known]
    return _PROFIDRIVE_WORDS | {name.lower(): _DIGITAL_WORDS[name.lower()] for name in digital}


@dataclass(frozen=True, slots=True)
class DriveSignal:
    """``form``: ``number``, ``bit``, ``state``, ``fault`` (a number of the manual), ``word``, ``text``.

    ``place`` gives the field of the axis table that holds it now, for the engine; None: only the event loop knows it.
    ``is_said``: it is the drive that says it, which says nothing without its supply: no, or 0.
    """

    name: str
    form: str
    unit: str
    doc: str
    read: Callable[[Axis], Value]
    place: Callable[[Axis], Place | None] = _nowhere
    is_said: bool = False

    def now(self, station: Axis) -> Value:
        if self.is_said and (not station.powered or station.handle.is_to_boot):
            return False if self.form == "bit" else 0
        return self.read(station)

    @property
    def has_place(self) -> bool:
        """Whether the engine can find it."""
        return self.place is not _nowhere


def _state(station: Axis) -> str:
    if not station.powered:
        return "off"
    number = int(station.handle.axis.drive.state)
    return f"S{number}" if number and not station.handle.is_to_boot else "boot"


def _fault(station: Axis) -> int:
    return next((int(code) & NUMBER_MASK for code in station.handle.axis.faults.code if code), 0)


def _ready(station: Axis) -> bool:
    drive = station.handle.axis.drive
    return int(drive.state) > 0 and not int(drive.lacks) and _fault(station) == 0


def _enabled(station: Axis) -> bool:
    axis = station.handle.axis
    if int(axis.front) == FIRMWARE_ETHERNETIP:
        # it is asked for while a fault keeps it from being ordered
        return bool(axis.ethernetip.wanted)
    both = POWER_ON | POWER_ENABLE
    return int(axis.orders.power) & both == both


def _acknowledging(station: Axis) -> bool:
    axis = station.handle.axis
    if int(axis.front) != FIRMWARE_ETHERNETIP and int(axis.profidrive.stw1) & FAULT_ACKNOWLEDGE:
        return True
    asked = int(axis.faults.asked_ns)
    return asked != 0 and 0 <= int(axis.last_ns) - asked < _ASKED_NS


def _acknowledging_place(station: Axis) -> Place | None:
    if int(station.handle.axis.front) == FIRMWARE_ETHERNETIP:
        return None
    return _PROFIDRIVE_WORDS["stw1"].place(FAULT_ACKNOWLEDGE.bit_length() - 1)


def _at_rest(station: Axis) -> bool:
    axis = station.handle.axis
    return abs(float(axis.motor.velocity)) <= float(axis.ramp.settings.standstill)


def _cycle(station: Axis) -> float:
    connection = station.device.connection()
    return connection.cycle_ns / 1e9 if connection is not None else 0.0


def _axis(*path: str) -> Callable[[Axis], Value]:
    def read(station: Axis) -> Value:
        value: Any = station.handle.axis
        for step in path:
            value = getattr(value, step)
        return float(value)

    return read


def _position(station: Axis) -> float:
    axis = station.handle.axis
    return float(axis.motor.position) - float(axis.homing.origin)


def _signal(
    name: str, form: str, unit: str, doc: str, read: Callable[[Axis], Value], place: Place | None = None
) -> DriveSignal:
    return DriveSignal(name, form, unit, doc, read, _nowhere if place is None else lambda _: place)


def _number(name: str, unit: str, doc: str, *path: str) -> DriveSignal:
    return _signal(name, "number", unit, doc, _axis(*path), place_of(AXIS, ".".join(path)))


_FAULT_PLACE = place_of(AXIS, "faults.code", mask=NUMBER_MASK)
#: S4 and S5 are the states that have this bit.
_RUNNING_PLACE = dataclasses.replace(
    place_of(AXIS, "drive.state"), shift=place_of(AXIS, "drive.state").shift + 2, mask=1
)


def _motion_bit(bit: int) -> Place:
    """A bit of DRV.MOTIONSTAT."""
    whole = place_of(AXIS, "profidrive.motion_status")
    return dataclasses.replace(whole, shift=whole.shift + bit, mask=1)


def _motion(bit: int) -> Callable[[Axis], Value]:
    return lambda station: bool(int(station.handle.axis.profidrive.motion_status) >> bit & 1)


_TASK_ACTIVE, _AT_TARGET = 0, 11

#: What is so whether or not a drive says it: its supply, its motor, and what is counted.
_NOT_SAID = frozenset({
    "state", "powered", "at_rest", "velocity", "position", "current", "torque", "thermal_load", "connects",
    "watchdog_expirations", "telegram",
})  # fmt: skip


#: By name.
SIGNALS: Mapping[str, DriveSignal] = {
    signal.name: dataclasses.replace(signal, is_said=signal.name not in _NOT_SAID)
    for signal in (
        _signal("state", "state", "", "state of the drive: off, boot, S1 to S5", _state),
        _signal("connected", "bit", "", "a connection exchanges cyclic data", lambda station: station.device.connected),
        _signal("powered", "bit", "", "the control supply is on", lambda station: station.powered),
        _signal("faulted", "bit", "", "a fault is active", lambda station: _fault(station) != 0, _FAULT_PLACE),
        _signal("fault", "fault", "", "oldest active fault by the manual's number, 0 for none", _fault, _FAULT_PLACE),
        _signal(
            "warning",
            "fault",
            "",
            "active warning by the manual's number, 0 for none",
            lambda station: int(station.handle.axis.warnings.code) & NUMBER_MASK,
            place_of(AXIS, "warnings.code", mask=NUMBER_MASK),
        ),
        _signal("ready", "bit", "", "nothing but the controller keeps the power stage off", _ready),
        _signal("enabled", "bit", "", "the controller asks for operation", _enabled),
        DriveSignal(
            "acknowledging",
            "bit",
            "",
            "the controller asks to acknowledge faults",
            _acknowledging,
            _acknowledging_place,
        ),
        _signal(
            "in_operation",
            "bit",
            "",
            "the power stage is on: S4 and S5",
            lambda station: station.handle.in_operation,
            _RUNNING_PLACE,
        ),
        _signal("at_rest", "bit", "", "the shaft does not turn", _at_rest),
        _signal(
            "homed",
            "bit",
            "",
            "the home position is known",
            lambda station: bool(station.handle.axis.homing.homed),
            place_of(AXIS, "homing.homed"),
        ),
        _signal("task_active", "bit", "", "a motion task runs", _motion(_TASK_ACTIVE), _motion_bit(_TASK_ACTIVE)),
        _signal(
            "target_reached",
            "bit",
            "",
            "the last motion task ended in its target, and the shaft is there",
            _motion(_AT_TARGET),
            _motion_bit(_AT_TARGET),
        ),
        _number("setpoint", "rpm", "velocity that the controller requests", "ramp", "setpoint"),
        _number("velocity", "rpm", "actual velocity of the shaft", "motor", "velocity"),
        _signal(
            "position",
            "number",
            "revolutions",
            "actual position, from the home position on",
            _position,
            place_of(AXIS, "motor.position", less="homing.origin"),
        ),
        _number("following_error", "revolutions", "commanded minus actual position", "positioning", "following_error"),
        _number("current", "A", "torque-building current", "motor", "current"),
        _number("torque", "Nm", "torque of the motor", "motor", "torque"),
        _number("bus_voltage", "V", "voltage of the DC link", "supply", "voltage"),
        _number("thermal_load", "1", "thermal load, 1 is the limit", "motor", "thermal_load"),
        _signal("cycle", "number", "s", "agreed cycle of the connection, 0 without one", _cycle),
        _signal("connects", "number", "", "connections that reached data exchange", lambda s: s.device.connects),
        _signal("watchdog_expirations", "number", "", "expired watchdogs", lambda s: s.device.watchdog_expirations),
        _signal("telegram", "number", "", "number of the telegram in force", lambda s: s.store.telegram_number),
    )
}


@lru_cache(maxsize=64)
def _bits(model: Model, word: str) -> Mapping[str, tuple[tuple[frozenset[int], int], ...]]:
    """Name of a bit -> where it is: (telegrams, bit); no telegrams: in all others."""
    found: dict[str, list[tuple[frozenset[int], int]]] = {}
    tables: list[tuple[frozenset[int], Sequence[str]]] = [
        (frozenset(bits.telegrams), bits.names) for bits in model.profidrive.word_bits if bits.word == word.upper()
    ]
    if infeeds := model.profidrive.infeeds:
        tables += [(infeeds, bits.names) for bits in model.profidrive.word_bits if bits.word == f"E_{word.upper()}"]
    if not any(not telegrams for telegrams, _ in tables):
        tables.append((frozenset(), profile_words(model)[word].names))
    for telegrams, names in tables:
        for bit, name in enumerate(names):
            if name:
                found.setdefault(name, []).append((telegrams, bit))
    return {name: tuple(places) for name, places in found.items()}


def _bit_signal(model: Model, word: str, name: str, places: Sequence[tuple[frozenset[int], int]]) -> DriveSignal:
    """A bit where the telegram in force has it; false where that telegram has no such bit."""
    own = {telegram for telegrams, _ in places for telegram in telegrams}
    whole = profile_words(model)[word]

    def bit_now(station: Axis) -> int | None:
        telegram = station.store.telegram_number
        for telegrams, bit in places:
            if telegram in telegrams or (not telegrams and telegram not in own):
                return bit
        return None

    def read(station: Axis) -> Value:
        bit = bit_now(station)
        return bit is not None and bool(whole.read(station) >> bit & 1)

    def place(station: Axis) -> Place | None:
        bit = bit_now(station)
        return None if bit is None else whole.place(bit)

    return DriveSignal(name, "bit", "", f"bit of {word.upper()}", read, place, is_said=True)


def signal_names(model: Model) -> list[str]:
    """Every name that a condition on a drive of this model may use, but for parameters."""
    words = profile_words(model)
    return [*SIGNALS, *words, *(f"{word}.{name}" for word in words for name in _bits(model, word))]


def find_signal(model: Model, name: str) -> DriveSignal | None:
    """The signal of this name (in any case); ``p930`` is a parameter by number.  None if a drive has none."""
    lower = name.lower()
    if (known := SIGNALS.get(lower)) is not None:
        return known
    word, dot, bit = lower.partition(".")
    if (whole := profile_words(model).get(word)) is not None:
        if not dot:
            return dataclasses.replace(_signal(word, "word", "", whole.doc, whole.read, whole.place()), is_said=True)
        if (places := _bits(model, word).get(bit)) is not None:
            return _bit_signal(model, word, lower, places)
        number = _BIT.fullmatch(bit)
        if number is not None and int(number[1]) < whole.bits:
            everywhere = ((frozenset[int](), int(number[1])),)
            return _bit_signal(model, word, lower, everywhere)
        return None
    if re.fullmatch(r"p[0-9]+(\.[0-9]+)?", lower):
        return find_parameter(model, lower[1:])
    return None


def find_parameter(model: Model, name: str) -> DriveSignal | None:
    """A parameter, or an element of one, by number or by the maker's name, as a signal; None if the model has none."""
    try:
        parameter, element = model.resolve(name)
    except ParameterError:
        return None
    if element >= max(1, parameter.elements):
        return None

    def read(station: Axis) -> Value:
        return int(station.store.get(name))

    # its value is the raw number, as `pnfarm param get` shows it: a unit beside it would be read wrongly
    return DriveSignal(f'param("{name}")', "number", "", parameter.name, read, is_said=True)
