"""The identity of a drive on EtherNet/IP, changed as if another product were there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from pnfarm.faults.effects.parts import DrivePart, Part
from pnfarm.protocols.enip.objects.identity import identity_key

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.buses.ethernetip.device.device import EthernetIpDevice
    from pnfarm.protocols.enip.connection import ManagerEvent

__all__ = ["IDENTITY", "Identity", "OtherIdentity"]


@dataclass(frozen=True, slots=True, eq=False)
class OtherIdentity:
    """What is different; None: as it is."""

    vendor_id: int | None = None
    device_type: int | None = None
    product_code: int | None = None
    major: int | None = None
    minor: int | None = None
    serial: int | None = None

    @property
    def is_own(self) -> bool:
        """Whether nothing differs."""
        return all(getattr(self, name) is None for name in self.__slots__)


class Identity(DrivePart):
    """The changes in force, on top of the identity with which the drive booted; the latest of a field counts."""

    def __init__(self, device: EthernetIpDevice) -> None:
        self._device = device
        self._changes: list[OtherIdentity] = []
        self._own = self._present()

    def _present(self) -> OtherIdentity:
        data = self._device.identity
        return OtherIdentity(data.vendor_id, data.device_type, data.product_code, *data.revision, data.serial)

    def rebooted(self, now: int) -> None:
        del now
        self._own = self._present()
        self._put()

    def in_force(self) -> list[Any]:
        return list(self._changes)

    @property
    def own(self) -> OtherIdentity:
        """As the drive booted."""
        return self._own if self._changes else self._present()

    def change(self, change: OtherIdentity) -> None:
        """Have another identity: Identity object, ListIdentity, and what electronic keys are compared with."""
        if not self._changes:
            self._own = self._present()
        self._changes.append(change)
        self._put()

    def restore(self, change: OtherIdentity) -> None:
        """Undo it."""
        self._changes.remove(change)
        self._put()

    def _put(self) -> None:
        found = {name: getattr(self._own, name) for name in OtherIdentity.__slots__}
        for change in self._changes:
            found |= {name: value for name in found if (value := getattr(change, name)) is not None}
        data, manager = self._device.identity, self._device.adapter.manager
        data.vendor_id, data.device_type = found["vendor_id"], found["device_type"]
        data.product_code, data.serial = found["product_code"], found["serial"]
        data.revision = (found["major"], found["minor"])
        manager.settings = replace(manager.settings, key=identity_key(data))

    def listen(self, hook: Callable[[ManagerEvent, int], None]) -> None:
        """Call ``hook`` for what happens to connections."""
        self._device.connections.listeners.append(hook)

    def unlisten(self, hook: Callable[[ManagerEvent, int], None]) -> None:
        """Remove it."""
        self._device.connections.listeners.remove(hook)


IDENTITY: Part[Identity] = Part("identity of EtherNet/IP")
