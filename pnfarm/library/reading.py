"""Readings of drives that are asked for elsewhere: of what the API gave, or in another thread."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from pnfarm.farm.views.readings import DriveReadings

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["Reading"]

_T = TypeVar("_T")


class _Read(Protocol):
    """What has readings: ``read`` passes its source to a function."""

    def read(self, reading: Callable[[Any], _T]) -> _T: ...


class Reading(Generic[_T]):
    """A property of a drive: ``reading`` of its source; documented as in :class:`DriveReadings`."""

    def __init__(self, reading: Callable[[Any], _T]) -> None:
        self._reading = reading

    def __set_name__(self, owner: type, name: str) -> None:
        self.__doc__ = getattr(DriveReadings, name, DriveReadings.active_fault).__doc__

    def __get__(self, drive: _Read | None, owner: type) -> _T:
        # on the class, which only documentation asks for, it is itself
        return self if drive is None else drive.read(self._reading)  # type: ignore[return-value]
