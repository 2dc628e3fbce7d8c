"""Position Controller object, class 0x25, and its Supervisor, class 0x24 (AKD EtherNet/IP manual 7.1, 7.2, 11.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.ethernetip.device.objects.shared import Values, class_attribute, integer_of, octets_of, status_of
from pnfarm.buses.ethernetip.device.objects.values import POSITION_UNITS, PROFILE_UNITS
from pnfarm.drives.parameters.parameter import ParameterError
from pnfarm.firmware.ethernetip.attributes import ATTRIBUTES, attribute_value
from pnfarm.protocols.enip.object import SUCCESS, Answer, refused
from pnfarm.protocols.enip.status import GeneralStatus

if TYPE_CHECKING:
    from collections.abc import Container

    from pnfarm.buses.ethernetip.device.objects.values import CipValues
    from pnfarm.drives.parameters.store import ParameterStore
    from pnfarm.drives.profiles.cip.part import CipAttribute

__all__ = ["CONTROLLER_CLASS", "SUPERVISOR_CLASS", "PositionController", "Supervisor"]

CONTROLLER_CLASS = 0x25
SUPERVISOR_CLASS = 0x24
ONLY = 1

ATTRIBUTE_LIST = 2
MODE = 3
POSITION_UNIT = 4
PROFILE_UNIT = 5
TARGET_POSITION = 6
TARGET_VELOCITY = 7
ACCELERATION = 8
DECELERATION = 9
MOVE_TYPE = 10
TRAJECTORY_START = 11
ENABLE = 17
TORQUE = 25
HOME_MODE = 100
START_HOME = 101
GENERAL_FAULT = 5

#: Another mode than DRV.OPMODE has: only read.
OTHER_MODE = 3
POSITION_MODE = 2
#: Attributes of a ramp, and their parameters in position mode and in the other modes.
RAMPS = {ACCELERATION: ("HOME.ACC", "DRV.ACC"), DECELERATION: ("HOME.DEC", "DRV.DEC")}


class PositionController(Values):
    """Motion goes to the firmware by settings of the axis record; parameters go to the store."""

    class_id = CONTROLLER_CLASS

    def __init__(self, store: ParameterStore, values: CipValues) -> None:
        self._store = store
        self._values = values
        self._rows = store.model.cip.attributes
        # the drive boots: what attributes set before is gone
        self._settings.incremental = self._settings.torque = 0

    @property
    def instances(self) -> Container[int]:
        return (ONLY,)

    @property
    def _axis(self) -> Any:
        return self._store.handle.axis

    @property
    def _settings(self) -> Any:
        return self._axis.ethernetip.settings

    def get(self, instance: int, attribute: int) -> Answer:
        if instance == 0:
            return class_attribute(attribute, ONLY, ONLY)
        row = self._row(instance, attribute)
        if isinstance(row, Answer):
            return row
        if not row.readable:
            return refused(GeneralStatus.ATTRIBUTE_NOT_SUPPORTED)
        if attribute == ATTRIBUTE_LIST:
            return Answer(data=bytes(ATTRIBUTES))
        return Answer(data=octets_of(self._value(attribute), row.size))

    def set(self, instance: int, attribute: int, data: bytes) -> Answer:
        row = self._row(instance, attribute)
        if isinstance(row, Answer):
            return row
        if not row.writable:
            return refused(GeneralStatus.ATTRIBUTE_NOT_SETTABLE)
        value = integer_of(data, row.size, signed=row.signed)
        if isinstance(value, Answer):
            return value
        if (row.minimum is not None and value < row.minimum) or (row.maximum is not None and value > row.maximum):
            return refused(GeneralStatus.INVALID_ATTRIBUTE_VALUE)
        try:
            return self._write(attribute, value)
        except ParameterError as exc:
            return refused(status_of(exc))

    def enable(self, on: bool) -> Answer:
        """Attribute 0x11, and DRV.EN; while a controller sends assemblies, their Enable bit decides."""
        self._settings.enable = int(on)
        self._settings.enables = (int(self._settings.enables) + 1) & 0xFFFFFFFF
        return SUCCESS

    def size(self, attribute: int) -> int:
        """Octets of an attribute, 0 where there is none or it has no width of its own."""
        row = self._rows.get((CONTROLLER_CLASS, attribute))
        return 0 if row is None else row.size

    def _row(self, instance: int, attribute: int) -> CipAttribute | Answer:
        row = self._rows.get((CONTROLLER_CLASS, attribute))
        if instance == 0 or row is None:
            return refused(GeneralStatus.ATTRIBUTE_NOT_SUPPORTED)
        return row

    def _value(self, attribute: int) -> int:
        """The value now; a target that the firmware has yet to take over is that of the settings."""
        if self._settings.targets_set != self._axis.ethernetip.targets_seen:
            if attribute == TARGET_POSITION:
                return int(self._settings.target)
            if attribute == TARGET_VELOCITY and int(self._settings.velocity):
                return int(self._settings.velocity)
        if attribute == TORQUE and float(self._axis.ethernetip.torque_command) == 0.0:
            # what the next start takes
            return int(self._settings.torque)
        if attribute in RAMPS:
            return self._values.read(self._ramp(attribute))
        return int(attribute_value(self._axis, attribute))

    def _ramp(self, attribute: int) -> int:
        return self._values.named(RAMPS[attribute][0 if int(self._axis.drive.settings.opmode) == POSITION_MODE else 1])

    def _write(self, attribute: int, value: int) -> Answer:
        if attribute == MODE:
            if value == OTHER_MODE:
                return refused(GeneralStatus.INVALID_ATTRIBUTE_VALUE)
            self._store.set("DRV.OPMODE", POSITION_MODE - value)
        elif attribute == POSITION_UNIT:
            self._store.set(POSITION_UNITS, value)
        elif attribute == PROFILE_UNIT:
            self._store.set(PROFILE_UNITS, value)
        elif attribute in {TARGET_POSITION, TARGET_VELOCITY}:
            self._aim(attribute, value)
        elif attribute in RAMPS:
            self._values.write(self._ramp(attribute), value)
        elif attribute == MOVE_TYPE:
            self._settings.incremental = value
        elif attribute == TRAJECTORY_START:
            return self._start() if value else SUCCESS
        elif attribute == ENABLE:
            return self.enable(bool(value))
        elif attribute == TORQUE:
            self._settings.torque = value
        elif attribute == HOME_MODE:
            self._store.set("HOME.MODE", value)
        elif attribute == START_HOME and value:
            self._store.set("HOME.MOVE", 1)
        return SUCCESS

    def _aim(self, attribute: int, value: int) -> None:
        """A target: the other one stays what it is, whether an attribute or an assembly brought it."""
        own, settings = self._axis.ethernetip, self._settings
        if settings.targets_set == own.targets_seen:
            settings.target, settings.velocity = own.target_units, own.velocity_units
        if attribute == TARGET_POSITION:
            settings.target = value
        else:
            settings.velocity = value
        settings.targets_set = (int(settings.targets_set) + 1) & 0xFFFFFFFF

    def _start(self) -> Answer:
        if not self._store.handle.in_operation:
            return refused(GeneralStatus.DEVICE_STATE_CONFLICT)
        self._settings.starts = (int(self._settings.starts) + 1) & 0xFFFFFFFF
        return SUCCESS


class Supervisor(Values):
    """Class 0x24: whether the drive has a fault."""

    class_id = SUPERVISOR_CLASS

    def __init__(self, store: ParameterStore) -> None:
        self._store = store

    @property
    def instances(self) -> Container[int]:
        return (ONLY,)

    def get(self, instance: int, attribute: int) -> Answer:
        if instance == 0:
            return class_attribute(attribute, ONLY, ONLY)
        if attribute != GENERAL_FAULT:
            return refused(GeneralStatus.ATTRIBUTE_NOT_SUPPORTED)
        return Answer(data=bytes([int(self._store.handle.axis.faults.code[0] != 0)]))

    def set(self, instance: int, attribute: int, data: bytes) -> Answer:  # noqa: ARG002 - the protocol's shape
        """Nothing of it can be written."""
        found = self.get(instance, attribute)
        return refused(GeneralStatus.ATTRIBUTE_NOT_SETTABLE) if found.ok else found
