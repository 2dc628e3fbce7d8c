"""A drive's network adapter, as injections see it: its MAC address."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.faults.effects.parts import DrivePart, Part

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.faults.effects.addresses import Addresses
    from pnfarm.faults.effects.supply import Supply

__all__ = ["ADAPTER", "Adapter"]


class Adapter(DrivePart):
    """``put(mac)`` gives an unpowered drive another address; it boots with it."""

    def __init__(
        self, drive: str, port: int, mac: bytes, addresses: Addresses, supply: Supply, put: Callable[[bytes], None]
    ) -> None:
        self._port = port
        self._addresses = addresses
        self._supply = supply
        self._put = put
        addresses.add(port, drive, mac, supply.power_off, self._boot)

    def _boot(self, mac: bytes, now: int) -> None:
        # a power cycle from elsewhere may have switched it on in the meantime
        self._supply.power_off(now)
        self._put(mac)
        self._supply.power_on(now)
        self._supply.power_on(now)

    def in_force(self) -> list[Any]:
        return self._addresses.in_force(self._port)

    @property
    def mac(self) -> bytes:
        """The address that the drive has now."""
        return self._addresses.of(self._port)

    @property
    def refusal(self) -> str:
        """Why its address cannot be changed, or empty."""
        return self._addresses.refusal(self._port)

    @property
    def failure(self) -> str:
        """Why the link refused the latest address, or empty."""
        return self._addresses.failure(self._port)

    def user_of(self, mac: bytes) -> str:
        """The drive of the farm that has this address, or is to have it; empty for none."""
        return self._addresses.user_of(mac)

    def change(self, mac: bytes, now: int) -> None:
        """Off, another address, on; the latest of several callers counts."""
        self._addresses.change(self._port, mac, now)

    def restore(self, mac: bytes, now: int) -> None:
        """Undo one :meth:`change`: off, the address before, on."""
        self._addresses.restore(self._port, mac, now)


ADAPTER: Part[Adapter] = Part("network adapter whose MAC address can change")
