"""What every farm offers plain test functions: in memory, or in a thread of its own."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Generic, Self, TypeVar

if TYPE_CHECKING:
    from types import TracebackType

__all__ = ["BlockingFace"]

_D = TypeVar("_D")


class BlockingFace(ABC, Generic[_D]):
    """A ``with`` statement opens and closes it; drives by name."""

    def open(self) -> None:
        """Begin; a line in memory has begun when it is made."""

    @abstractmethod
    def close(self) -> None:
        """End; closing twice does nothing."""

    @abstractmethod
    def drive(self, name: str) -> _D:
        """A drive by its name.  Raises :class:`ConfigError`."""

    def __getitem__(self, name: str) -> _D:
        return self.drive(name)

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
