"""What every farm offers asynchronous code, in this process or behind its API."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Generic, Protocol, Self, TypeVar

from pnfarm.vocabulary.quoting import shortened

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from types import TracebackType

__all__ = ["FarmFace", "first_drives"]


class _Drive(Protocol):
    @property
    def connected(self) -> bool: ...
    @property
    def state(self) -> str: ...


class _Device(Protocol):
    @property
    def connected(self) -> bool: ...


_D = TypeVar("_D", bound=_Drive)
_V = TypeVar("_V", bound=_Device)


class FarmFace(ABC, Generic[_D, _V]):
    """``async with`` opens and closes it; drives by name; waiting."""

    def __init__(self) -> None:
        self._drives: dict[str, _D] = {}
        self._devices: dict[str, _V] = {}

    @abstractmethod
    async def open(self) -> None:
        """Begin; on failure nothing is left behind."""

    @abstractmethod
    async def close(self) -> None:
        """End."""

    @abstractmethod
    async def wait_until(self, holds: Callable[[], object], within: float | str, *, what: str = "it") -> float:
        """Until ``holds()`` is true; how long it took, s.  Raises :class:`NotInTime`."""

    async def __aenter__(self) -> Self:
        await self.open()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    @property
    def drives(self) -> list[_D]:
        """Every drive, in the farm's order; empty while the farm does not run, or before it is connected."""
        return list(self._drives.values())

    @property
    def devices(self) -> list[_V]:
        """Every device, as :attr:`drives`."""
        return list(self._devices.values())

    async def wait_connected(self, within: float | str = 20.0) -> float:
        """Until every drive and every device exchanges data with its controller."""
        return await self.wait_until(
            lambda: all(one.connected for one in (*self.drives, *self.devices)), within, what="every connection"
        )

    async def wait_running(self, within: float | str = 20.0) -> float:
        """Until every drive is in operation (S4)."""
        return await self.wait_until(
            lambda: all(d.state == "S4" for d in self.drives), within, what="operation (S4) of every drive"
        )


def first_drives(drives: Iterable[object]) -> str:
    """The first ones in words, for messages."""
    return shortened([*map(repr, drives)], joint="; ")
