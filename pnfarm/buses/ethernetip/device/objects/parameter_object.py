"""Parameter object, class 0x0F: one instance for each row of Appendix B (AKD EtherNet/IP manual 7.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.ethernetip.device.objects.shared import Values, class_attribute, integer_of, octets_of, status_of
from pnfarm.drives.parameters.parameter import Backing, ParameterError
from pnfarm.drives.profiles.cip.part import Scaling
from pnfarm.protocols.enip.object import SUCCESS, Answer, refused
from pnfarm.protocols.enip.status import GeneralStatus

if TYPE_CHECKING:
    from collections.abc import Callable, Container

    from pnfarm.buses.ethernetip.device.objects.values import CipValues
    from pnfarm.drives.parameters.store import ParameterStore

__all__ = ["PARAMETER_CLASS", "ParameterObject"]

PARAMETER_CLASS = 0x0F
VALUE, DATA_TYPE, DATA_LENGTH = 1, 5, 6
#: Widths of data that execute a command: 7.3 says 1 octet, and the examples of 6.6 and 6.7 have 4.
COMMAND_SIZES = frozenset({1, 2, 4})
LONG, SHORT = 8, 4


class ParameterObject(Values):
    """``enable`` switches the drive on or off as attribute 0x11 of the position controller does: DRV.EN."""

    class_id = PARAMETER_CLASS

    def __init__(self, store: ParameterStore, values: CipValues, enable: Callable[[bool], Answer]) -> None:
        self._store = store
        self._values = values
        self._rows = store.model.cip.instances
        self._attributes = store.model.cip.attributes
        self._enable = enable

    @property
    def instances(self) -> Container[int]:
        return self._rows.keys()

    def get(self, instance: int, attribute: int) -> Answer:
        if instance == 0:
            return class_attribute(attribute, max(self._rows), len(self._rows))
        row = self._rows.get(instance)
        if row is None:
            return refused(GeneralStatus.OBJECT_DOES_NOT_EXIST)
        if (PARAMETER_CLASS, attribute) not in self._attributes:
            return refused(GeneralStatus.ATTRIBUTE_NOT_SUPPORTED)
        if attribute == DATA_TYPE:
            return Answer(data=bytes([row.type_code]))
        if attribute == DATA_LENGTH:
            return Answer(data=bytes([row.size]))
        try:
            return Answer(data=octets_of(self._values.read(instance), row.size))
        except ParameterError as exc:
            return refused(status_of(exc))

    def set(self, instance: int, attribute: int, data: bytes) -> Answer:
        """Write a value, or execute a command; a value of 64 bits may come in 32 (7.3.3)."""
        row = self._rows.get(instance)
        if instance != 0 and row is None:
            return refused(GeneralStatus.OBJECT_DOES_NOT_EXIST)
        if row is None or (PARAMETER_CLASS, attribute) not in self._attributes:
            return refused(GeneralStatus.ATTRIBUTE_NOT_SUPPORTED)
        if attribute != VALUE or not self._store.model.parameters[instance].writable:
            return refused(GeneralStatus.ATTRIBUTE_NOT_SETTABLE)
        if row.scaling is Scaling.COMMAND:
            return self._execute(instance, data)
        size = SHORT if row.size == LONG and len(data) == SHORT else row.size
        value = integer_of(data, size, signed=row.signed)
        return value if isinstance(value, Answer) else self._write(instance, value)

    def _execute(self, instance: int, data: bytes) -> Answer:
        if not data:
            return refused(GeneralStatus.NOT_ENOUGH_DATA)
        if len(data) not in COMMAND_SIZES:
            return refused(GeneralStatus.TOO_MUCH_DATA)
        parameter = self._store.model.parameters[instance]
        if parameter.backing is Backing.COMMAND and parameter.argument == "enable":
            return self._enable(True)
        return self._write(instance, 1)

    def _write(self, instance: int, value: int) -> Answer:
        try:
            self._values.write(instance, value)
        except ParameterError as exc:
            return refused(status_of(exc))
        return SUCCESS
