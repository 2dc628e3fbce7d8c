"""An injection as a test holds it."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Self

from pnfarm.library.fault import FaultReadings, FaultView

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType

    from pnfarm.faults.manager import Injection

__all__ = ["BlockingFault", "Fault"]


class BlockingFault(FaultReadings):
    """An injection in force: a context manager that ends it, with its evidence."""

    @abstractmethod
    def clear(self) -> None:
        """End it; does nothing if it has ended."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.clear()


class Fault(BlockingFault):
    """An injection in force: a context manager that ends it, with its evidence."""

    def __init__(self, injection: Injection, clear: Callable[[str], object]) -> None:
        self._injection = injection
        self._clear = clear

    @property
    def _known(self) -> FaultView:
        return FaultView.of(self._injection)

    def clear(self) -> None:
        if self.state != "ended":
            self._clear(self.id)
