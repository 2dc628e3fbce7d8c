"""Traces of a farm in real time, for Python code::

async with farm.trace("axis-*", ["velocity", "zsw1.*"], trigger="fault 702", pre="200ms", length="2s") as trace:
    await farm.drive("axis-01").fault("f702")
    recording = await trace.complete(within=10.0)
"""

from __future__ import annotations

import asyncio
import contextlib
from typing import TYPE_CHECKING, Any, Protocol, Self

from pnfarm.errors import ConfigError, RemoteError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from types import TracebackType

    from pnfarm.farm.core import FarmCore
    from pnfarm.trace import Recording, Trace

__all__ = ["FarmTrace", "trace_fields"]


def trace_fields(on: str | Sequence[str], signals: Sequence[str] | str, fields: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of a :class:`~pnfarm.trace.TraceRequest`."""
    drives = on if isinstance(on, str) else list(on)
    return {**fields, "on": drives, "signals": signals if isinstance(signals, str) else list(signals)}


class Running(Protocol):
    """What a trace needs of its farm."""

    @property
    def core(self) -> FarmCore: ...

    def now(self) -> int: ...

    def poke(self) -> None: ...


class FarmTrace:
    """An asynchronous context manager: the trace runs inside it, and is deleted at its end."""

    def __init__(self, farm: Running, fields: Mapping[str, Any]) -> None:
        self._farm = farm
        self._fields = dict(fields)
        self._trace: Trace | None = None

    @property
    def trace(self) -> Trace:
        """The trace in the engine.  Raises :class:`ConfigError` outside ``async with``."""
        if self._trace is None:
            raise ConfigError("the trace is not running: use it inside `async with`")
        return self._trace

    @property
    def state(self) -> str:
        """``waiting``, ``running`` or ``complete``."""
        return self.trace.state

    def recording(self) -> Recording:
        """The samples so far."""
        return self.trace.recording()

    def fire(self) -> None:
        """Trigger it now."""
        self._farm.core.traces.fire(self.trace.id, self._farm.now())

    async def complete(self, within: float | None = None) -> Recording:
        """Wait for the last sample; raises :class:`RemoteError` if it has not come ``within`` so many seconds."""
        trace = self.trace
        if not trace.complete:
            done = asyncio.Event()
            trace.on_end.append(done.set)
            try:
                async with asyncio.timeout(within):
                    await done.wait()
            except TimeoutError as exc:
                what = f"trace {trace.id} is {trace.state} after {within:g} s"
                raise RemoteError(f"{what} (trigger: {trace.request.trigger.text})") from exc
            finally:
                with contextlib.suppress(ValueError):
                    trace.on_end.remove(done.set)
        return trace.recording()

    async def __aenter__(self) -> Self:
        self._trace = self._farm.core.traces.start(self._fields, self._farm.now())
        self._farm.poke()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._trace is not None and not self._trace.deleted:
            self._farm.core.traces.delete(self._trace.id, self._farm.now())
