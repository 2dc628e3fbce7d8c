"""A device's settings from the farm file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from ipaddress import IPv4Address, IPv4Interface

__all__ = ["DeviceConfig"]


class DeviceConfig(Protocol):
    """One device's settings; the farm's own record of it includes them.

    ``ip`` and ``name`` apply while the memory has none, ``hello``: the device announces itself with DCP Hello.
    """

    @property
    def name(self) -> str: ...
    @property
    def ip(self) -> IPv4Interface | None: ...
    @property
    def gateway(self) -> IPv4Address | None: ...
    @property
    def hello(self) -> bool: ...
