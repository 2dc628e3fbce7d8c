"""Traces at the hub: each is on drives and devices of one shard, because its samples have the time of one engine."""

from __future__ import annotations

import secrets
from http import HTTPStatus
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from pnfarm.api.paths.traces import KEEP_NS
from pnfarm.hub.hub import passed_on
from pnfarm.hub.shards import AwayError, no_steps
from pnfarm.signals.device_signal import split_name
from pnfarm.trace import TraceError, TraceRequest
from pnfarm.trace.choosing import names_of
from pnfarm.trace.trigger import SignalTrigger
from pnfarm.web.errors import NotFoundError, RequestError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from starlette.responses import Response

    from pnfarm.api.paths.traces import Form
    from pnfarm.hub.hub import Hub
    from pnfarm.hub.shards import Shard

__all__ = ["HubTraces"]

#: A whole recording may take longer than other answers.
RECORDING_SECONDS = 8.0


def _path(trace_id: str) -> str:
    return f"traces/{quote(trace_id, safe='')}"


class HubTraces:
    """As :class:`~pnfarm.api.paths.traces.TracesHost`."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub

    def _chosen(self, wanted: TraceRequest) -> tuple[Shard, list[str]]:
        """The one shard, and its drives and devices."""
        hub = self._hub
        hub.check_any()
        names = names_of(wanted, hub.shards.traced_as)
        trigger = [wanted.trigger.signal] if isinstance(wanted.trigger, SignalTrigger) else []
        devices = {split_name(name)[0] for name in (*wanted.signals, *trigger)} & set(hub.shards.with_signals)
        shards = {hub.shards.station_owner(name): None for name in (*names, *sorted(devices))}
        if len(shards) > 1:
            what = f"means stations of {len(shards)} shards ({', '.join(shard.label for shard in shards)})"
            allowed = (
                "stations of one shard: the samples of a trace have the time of one engine; start a trace for each"
            )
            raise RequestError(
                f"trace.on: {what}; allowed: {allowed}", [{"field": "on", "what": what, "allowed": allowed}]
            )
        return next(iter(shards)), names

    async def _holders(self, trace_id: str) -> tuple[list[Shard], list[str]]:
        """The shards that have a trace, and why others cannot be asked."""
        hub = self._hub
        missing = [str(shard.away()) for shard in hub.shards.unreachable]
        answers = await hub.each(
            hub.shards.reachable, lambda shard: hub.ask(shard, "GET", _path(trace_id), query={"format": "status"})
        )
        missing += map(str, answers.away.values())
        return [shard for shard, answer in answers.good.items() if answer.good], missing

    async def _holder(self, trace_id: str) -> Shard:
        self._hub.check_any()
        no_steps(trace_id)
        found, missing = await self._holders(trace_id)
        if len(found) > 1:
            sentence = f"{' and '.join(shard.label for shard in found)} have a trace {trace_id!r}: ask one of them"
            raise RequestError(sentence, status=HTTPStatus.CONFLICT)
        if not found:
            if missing:
                raise AwayError(f"no shard that answers has a trace {trace_id!r}; not known is the rest: {missing[0]}")
            raise NotFoundError(f"there is no trace {trace_id!r}")
        return found[0]

    async def kept(self) -> dict[str, Any]:
        return await self._hub.joined("traces", lambda _, one: {**one})

    async def start(self, fields: Mapping[str, Any]) -> dict[str, Any]:
        wanted = TraceRequest.parse(fields, keep_ns=KEEP_NS)
        shard, names = self._chosen(wanted)
        if wanted.name is not None and (await self._holders(wanted.name))[0]:
            # of two shards' traces with one name none could be read here
            raise TraceError([("as", f"there is a trace {wanted.name} already", "another name")])
        # a name of its own: those that shards make up are the same on each
        named = {**fields, "on": names, "as": fields.get("as") or f"trace-{secrets.token_hex(4)}"}
        found = await self._hub.asked(shard, "POST", "traces", "id", body=named)
        return {**found, "id": str(found["id"])}

    async def signals(self, name: str) -> dict[str, Any]:
        return await self._hub.asked(
            self._hub.shards.station_owner(name), "GET", f"traces/signals/{quote(name, safe='')}"
        )

    async def read(self, trace_id: str, form: Form) -> Response:
        shard = await self._holder(trace_id)
        query = {"format": form}
        return passed_on(await self._hub.ask(shard, "GET", _path(trace_id), query=query, seconds=RECORDING_SECONDS))

    async def fire(self, trace_id: str) -> dict[str, Any]:
        return await self._hub.asked(await self._holder(trace_id), "POST", f"{_path(trace_id)}/trigger")

    async def delete(self, trace_id: str) -> dict[str, Any]:
        return await self._hub.asked(await self._holder(trace_id), "DELETE", _path(trace_id))
