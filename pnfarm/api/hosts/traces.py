"""The traces of one farm."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import anyio.to_thread
from starlette.responses import Response

from pnfarm.api.paths.traces import KEEP_NS
from pnfarm.web.bodies import Json
from pnfarm.web.errors import named_by_path

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.api.context import ApiContext
    from pnfarm.api.paths.traces import Form
    from pnfarm.trace import Trace

__all__ = ["FarmTraces"]


class FarmTraces:
    """As :class:`~pnfarm.api.paths.traces.TracesHost`."""

    def __init__(self, context: ApiContext) -> None:
        self._context = context
        self._traces = context.core.traces

    def _found(self, trace_id: str) -> Trace:
        with named_by_path():
            return self._traces.get(trace_id, self._context.now())

    def _changed(self, trace: Trace) -> dict[str, Any]:
        self._context.poke()
        return trace.as_dict()

    async def kept(self) -> dict[str, Any]:
        return {"traces": [trace.as_dict() for trace in self._traces.kept()]}

    async def start(self, fields: Mapping[str, Any]) -> dict[str, Any]:
        return self._changed(self._traces.start(fields, self._context.now(), keep_ns=KEEP_NS))

    async def signals(self, name: str) -> dict[str, Any]:
        own = name
        if name not in self._context.core.signal_owners:
            found = self._context.station(name)
            own = found.configured_name if not found.axes else self._context.axis(name).configured_name
        return {"drive": own, "signals": [signal.as_dict() for signal in self._traces.signals(own)]}

    async def read(self, trace_id: str, form: Form) -> Response:
        trace = self._found(trace_id)
        status = trace.as_dict()
        if form == "status":
            return Json(status)
        # the samples are copied here, once; text of a million numbers takes a second, which is a thread's
        recording = trace.recording()
        if form == "csv":
            return Response(await anyio.to_thread.run_sync(recording.csv), media_type="text/csv")
        return await anyio.to_thread.run_sync(lambda: Json({**status, **recording.as_dict()}))

    async def fire(self, trace_id: str) -> dict[str, Any]:
        self._found(trace_id)
        return self._changed(self._traces.fire(trace_id, self._context.now()))

    async def delete(self, trace_id: str) -> dict[str, Any]:
        self._found(trace_id)
        return self._changed(self._traces.delete(trace_id, self._context.now()))
