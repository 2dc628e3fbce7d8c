"""What the drive's objects share: the status of a refused parameter, data of the right length, the class itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.drives.parameters.parameter import ParameterErrorNumber
from pnfarm.protocols.enip.object import Answer, refused, size_status
from pnfarm.protocols.enip.status import GeneralStatus

if TYPE_CHECKING:
    from pnfarm.drives.parameters.parameter import ParameterError

__all__ = ["Values", "class_attribute", "integer_of", "octets_of", "status_of"]

#: 6.1.4 has five of these codes; the others are CIP's for the same case.
_STATUS = {
    ParameterErrorNumber.IMPERMISSIBLE_PNU: GeneralStatus.OBJECT_DOES_NOT_EXIST,
    ParameterErrorNumber.NOT_CHANGEABLE: GeneralStatus.ATTRIBUTE_NOT_SETTABLE,
    ParameterErrorNumber.LIMIT_EXCEEDED: GeneralStatus.INVALID_ATTRIBUTE_VALUE,
    ParameterErrorNumber.VALUE_IMPERMISSIBLE: GeneralStatus.INVALID_ATTRIBUTE_VALUE,
    ParameterErrorNumber.ONLY_RESET: GeneralStatus.INVALID_ATTRIBUTE_VALUE,
    ParameterErrorNumber.OPERATING_STATE: GeneralStatus.DEVICE_STATE_CONFLICT,
    ParameterErrorNumber.NO_OPERATION_PRIORITY: GeneralStatus.PRIVILEGE_VIOLATION,
}
REVISION, MAX_INSTANCE, NUMBER_OF_INSTANCES = 1, 2, 3


class Values:
    """An object whose values are read and written (6.1.1); it has no other service."""

    def service(self, instance: int, service: int, data: bytes) -> Answer:  # noqa: ARG002 - the protocol's shape
        return refused(GeneralStatus.SERVICE_NOT_SUPPORTED)


def status_of(error: ParameterError) -> GeneralStatus:
    """The general status of a refused parameter."""
    try:
        return _STATUS[ParameterErrorNumber(error.number)]
    except (KeyError, ValueError):
        return GeneralStatus.INVALID_PARAMETER


def octets_of(value: int, size: int) -> bytes:
    """An integer in so many octets; its sign is in its bits."""
    return (value & ((1 << 8 * size) - 1)).to_bytes(size, "little")


def integer_of(data: bytes, size: int, *, signed: bool) -> int | Answer:
    """The integer of data with exactly ``size`` octets, or the answer to another length."""
    if wrong := size_status(len(data), size):
        return refused(wrong)
    return int.from_bytes(data, "little", signed=signed)


def class_attribute(attribute: int, highest: int, count: int) -> Answer:
    """Attributes of a class (CIP volume 1, 4-4.1): revision 1, highest instance of 16 bits, number of instances."""
    values = {REVISION: 1, MAX_INSTANCE: min(highest, 0xFFFF), NUMBER_OF_INSTANCES: count}
    if attribute not in values:
        return refused(GeneralStatus.ATTRIBUTE_NOT_SUPPORTED)
    return Answer(data=values[attribute].to_bytes(2, "little"))
