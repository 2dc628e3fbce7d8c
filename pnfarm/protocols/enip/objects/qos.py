"""QoS object, class 0x48 (CIP volume 2, chapter 5-7): the DSCP of each kind of message."""

from __future__ import annotations

from collections.abc import Callable  # noqa: TC003 - a field of a dataclass
from dataclasses import dataclass, field
from typing import Final

from pnfarm.protocols.enip.object import Attribute, AttributeObject
from pnfarm.protocols.enip.objects.identity import class_attributes
from pnfarm.protocols.enip.status import GeneralStatus
from pnfarm.protocols.enip.wire.data_types import USINT, Value

__all__ = ["QOS", "QosData", "qos_object"]

QOS: Final = 0x48
_HIGHEST_DSCP: Final = 63


@dataclass(slots=True)
class QosData:
    """DSCP by attribute: 4 urgent, 5 scheduled, 6 high, 7 low, 8 explicit; the standard's defaults."""

    dscp: dict[int, int] = field(default_factory=lambda: {4: 55, 5: 47, 6: 43, 7: 31, 8: 27})
    #: Hears of every write, and says whether it could be stored.
    changed: Callable[[], bool] = field(default=lambda: True, repr=False)


def qos_object(data: QosData) -> AttributeObject:
    def written(number: int) -> Callable[[Value], int]:
        def write(value: Value) -> int:
            assert isinstance(value, int)
            if value > _HIGHEST_DSCP:
                return GeneralStatus.INVALID_ATTRIBUTE_VALUE
            before, data.dscp[number] = data.dscp[number], value
            if not data.changed():
                data.dscp[number] = before
                return GeneralStatus.STORE_OPERATION_FAILURE
            return GeneralStatus.SUCCESS

        return write

    def current(number: int) -> Callable[[], Value]:
        return lambda: data.dscp[number]

    attributes = {number: Attribute(USINT, current(number), written(number)) for number in data.dscp}
    return AttributeObject(QOS, {0: class_attributes(), 1: attributes})
