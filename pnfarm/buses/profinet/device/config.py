"""A device's settings from the farm file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Mapping
    from ipaddress import IPv4Address, IPv4Interface

    from pnfarm.drives.motion_tasks import MotionTask

__all__ = ["DeviceConfig"]


class DeviceConfig(Protocol):
    """One drive's settings; the farm's own record of a drive includes them.

    ``ip`` and ``name`` apply while the memory has none, ``telegram`` None is the model's default, ``hello``: the drive
    announces itself with DCP Hello, ``strict``: it keeps to its model's limits.
    """

    @property
    def name(self) -> str: ...
    @property
    def ip(self) -> IPv4Interface | None: ...
    @property
    def gateway(self) -> IPv4Address | None: ...
    @property
    def strict(self) -> bool: ...
    @property
    def params(self) -> Mapping[str, int | float | str | bool]: ...
    @property
    def telegram(self) -> int | None: ...
    @property
    def hello(self) -> bool: ...
    @property
    def motion_tasks(self) -> tuple[MotionTask, ...]: ...
