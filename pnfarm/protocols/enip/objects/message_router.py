"""Message Router object, class 0x02 (CIP volume 1, chapter 5A-3)."""

from __future__ import annotations

from pnfarm.protocols.enip.message_router import MESSAGE_ROUTER, MessageRouter
from pnfarm.protocols.enip.object import Attribute, AttributeObject
from pnfarm.protocols.enip.objects.identity import class_attributes
from pnfarm.protocols.enip.wire.data_types import UINT
from pnfarm.wire.octets import Writer

__all__ = ["message_router_object"]


def message_router_object(router: MessageRouter, connections: int) -> AttributeObject:
    """Attribute 1 lists the classes, 2 is the number of connections that the device can have."""

    def classes() -> bytes:
        w = Writer(little=True).u16(len(router.classes))
        for class_id in router.classes:
            w.u16(class_id)
        return w.getvalue()

    instance = {1: Attribute(None, classes), 2: Attribute(UINT, lambda: connections)}
    return AttributeObject(MESSAGE_ROUTER, {0: class_attributes(), 1: instance}, {1: (1, 2)})
