"""An injection as asynchronous code holds it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import anyio

from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Generator
    from types import TracebackType

    from pnfarm.faults.effects.evidence import Evidence
    from pnfarm.faults.injection import Injection

__all__ = ["Bound", "FaultHandle", "FaultReadings", "FaultView"]


@dataclass(frozen=True, slots=True)
class FaultView:
    """An injection as it was seen last."""

    id: str
    kind: str
    drives: tuple[str, ...]
    state: str
    evidence: Evidence

    @classmethod
    def of(cls, injection: Injection) -> Self:
        """One of a farm in this process."""
        kind, state = injection.spec.kind.name, injection.state.value
        return cls(injection.id, kind, injection.drives, state, injection.evidence())


class Bound(ABC):
    """An injection of a farm in this process, or of one that is reached by its API."""

    @property
    @abstractmethod
    def view(self) -> FaultView:
        """As seen last."""

    @abstractmethod
    async def clear(self) -> None:
        """End it; does nothing if it has ended."""

    async def refresh(self) -> None:  # noqa: B027 - what is in this process is always the present one
        """Look again."""


class FaultReadings(ABC):
    """What is known of an injection, however it is held."""

    @property
    @abstractmethod
    def _known(self) -> FaultView:
        """As seen last."""

    def _look(self) -> FaultView:
        """As it is now, as far as that can be asked for."""
        return self._known

    @property
    def id(self) -> str:
        return self._known.id

    @property
    def kind(self) -> str:
        """As in ``pnfarm fault kinds``."""
        return self._known.kind

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the drives that it is on."""
        return self._known.drives

    @property
    def state(self) -> str:
        """``waiting``, ``active`` or ``ended``; of a farm reached by its API as a ``refresh`` saw it last."""
        return self._look().state

    @property
    def evidence(self) -> Evidence:
        """``checks``, ``activations``, ``first_ns`` and ``last_ns`` (the farm's clock), ``confirmed`` on the wire."""
        return self._look().evidence

    def __repr__(self) -> str:
        known = self._look()
        on = ", ".join(known.drives)
        return f"<{type(self).__name__} {known.id} {known.kind} on {on}: {known.state}, {known.evidence}>"


class FaultHandle(FaultReadings):
    """``await`` it to put the injection in force until it ends by itself or by :meth:`clear`; ``async with`` clears it
    at its end, also after an exception or a cancellation.  Nothing happens before one of the two.
    """

    def __init__(self, begin: Callable[[], Awaitable[Bound]]) -> None:
        self._begin = begin
        self._bound: Bound | None = None

    async def _start(self) -> Self:
        if self._bound is None:
            self._bound = await self._begin()
        return self

    def __await__(self) -> Generator[object, None, Self]:
        return self._start().__await__()

    async def __aenter__(self) -> Self:
        return await self._start()

    async def __aexit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> None:
        with anyio.CancelScope(shield=True):
            await self.clear()

    @property
    def _held(self) -> Bound:
        if self._bound is None:
            raise ConfigError("the fault was not injected: `await` it, or use it with `async with`")
        return self._bound

    @property
    def view(self) -> FaultView:
        """All of it, as seen last."""
        return self._held.view

    @property
    def _known(self) -> FaultView:
        return self.view

    async def refresh(self) -> Self:
        """Look again; needed only where the farm is reached by its API."""
        await self._held.refresh()
        return self

    async def clear(self) -> None:
        """End it; does nothing if it has ended."""
        await self._held.clear()

    def __repr__(self) -> str:
        return "<FaultHandle, not injected>" if self._bound is None else super().__repr__()
