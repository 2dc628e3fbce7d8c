"""Attributes of the Connection Manager object, class 0x06 (CIP volume 1, table 3-5.2); its services open and close."""

from __future__ import annotations

from pnfarm.protocols.enip.connection_manager import CONNECTION_MANAGER, ConnectionManager
from pnfarm.protocols.enip.object import Attribute, AttributeObject
from pnfarm.protocols.enip.objects.identity import class_attributes
from pnfarm.protocols.enip.wire.data_types import UINT

__all__ = ["connection_manager_object"]

#: Attributes 1 to 8: what the manager has counted, modulo 65,536.
_COUNTS = (
    "open_requests",
    "open_format_rejects",
    "open_resource_rejects",
    "open_other_rejects",
    "close_requests",
    "close_format_rejects",
    "close_other_rejects",
    "timeouts",
)


def connection_manager_object(manager: ConnectionManager) -> AttributeObject:
    instance = {
        number: Attribute(UINT, lambda name=name: manager.counts[name] & 0xFFFF)  # type: ignore[misc]  # name is bound here
        for number, name in enumerate(_COUNTS, 1)
    }
    return AttributeObject(CONNECTION_MANAGER, {0: class_attributes(), 1: instance}, {1: tuple(instance)})
