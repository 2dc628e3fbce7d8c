"""The drive's name and addresses on the network, for parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

__all__ = ["Network", "NoNetwork"]


class Network(Protocol):
    """Name and addresses in force; an address is a number of 32 bits, 0 for none."""

    @property
    def name(self) -> str: ...

    @property
    def ip(self) -> int: ...

    @property
    def mask(self) -> int: ...

    @property
    def gateway(self) -> int: ...

    @property
    def macs(self) -> tuple[bytes, ...]:
        """MAC address of the station, then of each port."""

    @property
    def line_rate(self) -> int:
        """Code of a serial line's rate in the drive's parameter, 0 without one."""

    def allows(self, name: str) -> bool:
        """Whether a station may have this name."""


@dataclass(frozen=True, slots=True)
class NoNetwork:
    """A drive without a network."""

    name: str = ""
    ip: int = 0
    mask: int = 0
    gateway: int = 0
    macs: tuple[bytes, ...] = ()
    line_rate: int = 0

    def allows(self, name: str) -> bool:
        """Any."""
        del name
        return True
