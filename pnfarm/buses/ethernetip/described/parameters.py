"""The parameters of a described device: their values, the Parameter object, and the objects at their paths.

A parameter that is a member of cyclic data has the value that is there.  Others have the default of the file, or what
the farm file or a controller wrote, until power-off (assumed: the file does not say whether a device stores them).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pnfarm.buses.ethernetip.device.objects.shared import Values, class_attribute
from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.message_router import object_path
from pnfarm.protocols.enip.object import SUCCESS, Answer, refused, size_status
from pnfarm.protocols.enip.status import GeneralStatus, Service
from pnfarm.protocols.enip.wire.data_types import INT, SHORT_STRING, UINT, USINT, WORD

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Mapping

    from pnfarm.protocols.enip.eds.document import Parameter
    from pnfarm.protocols.enip.object import CipObject

__all__ = ["PARAMETER_CLASS", "ParameterObject", "ParameterValues", "objects_at_paths"]

PARAMETER_CLASS: Final = 0x0F
_VALUE: Final = 1
#: Attributes of an instance in their order; those of a stub end with the data size (CIP volume 1, 5A-14.2).
_ALL = range(1, 22)
_GET_ENUM_STRING: Final = 0x4B
#: Class attributes: what is supported (instances, full attributes), the assembly of the configuration.
_CLASS_DESCRIPTOR, _CONFIGURATION = 8, 9
_INSTANCES_AND_FULL: Final = 0x0003
#: Classes that the device has anyway: what a path names there is theirs.
_STANDARD: Final = frozenset({0x01, 0x02, 0x04, 0x06, PARAMETER_CLASS, 0x48, 0xF5, 0xF6})
_LONGEST_TEXT: Final = 255


class ParameterValues:
    """``default`` gives a value as after power-on, ``cyclic`` by number those that are in cyclic data."""

    def __init__(
        self,
        rows: Mapping[int, Parameter],
        default: Callable[[Parameter], bytes],
        cyclic: Mapping[int, Callable[[], bytes]],
        *,
        strict: bool,
    ) -> None:
        self.rows = rows
        self._default = default
        self._cyclic = cyclic
        self._strict = strict
        self._written: dict[int, bytes] = {}

    def forget(self) -> None:
        """As at power-on."""
        self._written.clear()

    def read(self, parameter: Parameter) -> bytes:
        number = parameter.number
        if number in self._cyclic:
            return self._cyclic[number]()
        found = self._written.get(number)
        return self._default(parameter) if found is None else found

    def judged(self, parameter: Parameter, octets: bytes) -> GeneralStatus:
        """Whether the file allows a value; without strict limits any of the right length."""
        if status := size_status(len(octets), parameter.type.octets):
            return status
        wrong = self._strict and parameter.complaint(octets) != ""
        return GeneralStatus.INVALID_ATTRIBUTE_VALUE if wrong else GeneralStatus.SUCCESS

    def write(self, parameter: Parameter, octets: bytes) -> GeneralStatus:
        """A client's value; what is cyclic data belongs to its sender."""
        if parameter.read_only or parameter.number in self._cyclic:
            return GeneralStatus.ATTRIBUTE_NOT_SETTABLE
        status = self.judged(parameter, octets)
        if status == GeneralStatus.SUCCESS:
            self.put(parameter, octets)
        return status

    def put(self, parameter: Parameter, octets: bytes) -> None:
        """Write a value that was judged."""
        self._written[parameter.number] = octets


class ParameterObject:
    """Class 0x0F: an instance for each parameter of the file; ``configuration`` is the assembly with such values."""

    class_id = PARAMETER_CLASS

    def __init__(self, values: ParameterValues, configuration: int) -> None:
        self._values = values
        self._configuration = configuration

    @property
    def instances(self) -> Container[int]:
        return self._values.rows.keys()

    def get(self, instance: int, attribute: int) -> Answer:
        rows = self._values.rows
        if instance == 0:
            own = {_CLASS_DESCRIPTOR: _INSTANCES_AND_FULL, _CONFIGURATION: self._configuration}
            if attribute in own:
                return Answer(data=UINT.emit(own[attribute]))
            return class_attribute(attribute, max(rows), len(rows))
        found = self._attribute(rows[instance], attribute)
        return refused(GeneralStatus.ATTRIBUTE_NOT_SUPPORTED) if found is None else Answer(data=found)

    def _attribute(self, row: Parameter, attribute: int) -> bytes | None:
        number = row.type.is_number
        match attribute:
            case 1:
                return self._values.read(row)
            case 2:
                return USINT.emit(len(row.path))
            case 3:
                return row.path
            case 4:
                return WORD.emit(row.descriptor & 0xFFFF)
            case 5:
                return USINT.emit(row.code)
            case 6:
                return USINT.emit(min(row.type.octets, 0xFF))
            case 7 | 8 | 9:
                text = (row.name, row.unit, row.help)[attribute - 7]
                return SHORT_STRING.emit(text.encode("latin-1", "replace")[:_LONGEST_TEXT])
            case 10 | 11 if number:
                given = (row.minimum, row.maximum)[attribute - 10]
                limits = [limit if row.type.kind == "float" else int(limit) for limit in row.type.limits]
                return row.encode(limits[attribute - 10] if given is None else given)
            case 10 | 11:
                return bytes(row.type.octets)
            case 12:
                return row.encode(row.default)
            case 13 | 14 | 15:
                return UINT.emit(row.scaling[attribute - 13])
            case 16:
                return INT.emit(min(max(row.scaling[3], -0x8000), 0x7FFF))
            case 17 | 18 | 19 | 20:
                return UINT.emit(0)
            case 21:
                return USINT.emit(row.decimals)
        return None

    def set(self, instance: int, attribute: int, data: bytes) -> Answer:
        if instance == 0 or attribute != _VALUE:
            known = instance != 0 and attribute in _ALL
            return refused(GeneralStatus.ATTRIBUTE_NOT_SETTABLE if known else GeneralStatus.ATTRIBUTE_NOT_SUPPORTED)
        return _answer(self._values.write(self._values.rows[instance], data))

    def service(self, instance: int, service: int, data: bytes) -> Answer:
        row = self._values.rows.get(instance)
        if row is not None and service == Service.GET_ATTRIBUTES_ALL:
            return Answer(data=b"".join(self._attribute(row, number) or b"" for number in _ALL))
        if row is not None and service == _GET_ENUM_STRING:
            if status := size_status(len(data), 2):
                return refused(status)
            text = row.enums.get(int.from_bytes(data, "little"))
            if text is None:
                return refused(GeneralStatus.INVALID_PARAMETER)
            return Answer(data=SHORT_STRING.emit(text.encode("latin-1", "replace")[:_LONGEST_TEXT]))
        return refused(GeneralStatus.SERVICE_NOT_SUPPORTED)


class PathObject(Values):
    """A class of the device's own with the parameters whose paths name it, by instance and attribute."""

    def __init__(self, class_id: int, values: ParameterValues, places: Mapping[tuple[int, int], Parameter]) -> None:
        self.class_id = class_id
        self._values = values
        self._places = places
        self._instances = {instance for instance, _ in places}

    @property
    def instances(self) -> Container[int]:
        return self._instances - {0}

    def get(self, instance: int, attribute: int) -> Answer:
        found = self._places.get((instance, attribute))
        if found is not None:
            return Answer(data=self._values.read(found))
        if instance == 0:
            return class_attribute(attribute, max(self._instances), len(self._instances - {0}))
        return refused(GeneralStatus.ATTRIBUTE_NOT_SUPPORTED)

    def set(self, instance: int, attribute: int, data: bytes) -> Answer:
        found = self._places.get((instance, attribute))
        if found is None:
            return refused(GeneralStatus.ATTRIBUTE_NOT_SUPPORTED)
        return _answer(self._values.write(found, data))


def objects_at_paths(values: ParameterValues) -> list[CipObject]:
    """One for each class that a parameter's path names, but those of the standard that every device has."""
    found: dict[int, dict[tuple[int, int], Parameter]] = {}
    for row in values.rows.values():
        try:
            path = object_path(row.path) if row.path else None
        except DecodeError:
            # the Parameter object has it nevertheless
            path = None
        if path is not None and path.attribute_id is not None and path.class_id not in _STANDARD:
            found.setdefault(path.class_id, {}).setdefault((path.instance_id, path.attribute_id), row)
    return [PathObject(class_id, values, places) for class_id, places in sorted(found.items())]


def _answer(status: GeneralStatus) -> Answer:
    return SUCCESS if status == GeneralStatus.SUCCESS else refused(status)
