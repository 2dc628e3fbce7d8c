"""An injection as asynchronous code holds it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, Self

import anyio

from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Generator
    from types import TracebackType

    from pnfarm.faults.effects.evidence import Evidence

__all__ = ["Bound", "FaultHandle"]


class Bound(Protocol):
    """An injection of a farm in this process, or of one that is reached by its API."""

    @property
    def id(self) -> str: ...

    @property
    def kind(self) -> str: ...

    @property
    def drives(self) -> tuple[str, ...]: ...

    @property
    def state(self) -> str: ...

    @property
    def evidence(self) -> Evidence: ...

    async def clear(self) -> None: ...

    async def refresh(self) -> None: ...


class FaultHandle:
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
    def _known(self) -> Bound:
        if self._bound is None:
            raise ConfigError("the fault was not injected: `await` it, or use it with `async with`")
        return self._bound

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
        """``waiting``, ``active`` or ``ended``; of a farm reached by its API as :meth:`refresh` saw it last."""
        return self._known.state

    @property
    def evidence(self) -> Evidence:
        """``checks``, ``activations``, ``first_ns`` and ``last_ns`` (the farm's clock), ``confirmed`` on the wire."""
        return self._known.evidence

    async def refresh(self) -> Self:
        """Look again; needed only where the farm is reached by its API."""
        await self._known.refresh()
        return self

    async def clear(self) -> None:
        """End it; does nothing if it has ended."""
        await self._known.clear()

    def __repr__(self) -> str:
        if self._bound is None:
            return "<FaultHandle, not injected>"
        return f"<FaultHandle {self.id} {self.kind} on {', '.join(self.drives)}: {self.state}, {self.evidence}>"
