"""The hub itself: asks the shards, all at once and each for a bounded time, and keeps what it knows of them.

Its tasks are in :mod:`pnfarm.hub.tasks`, its answers in :mod:`pnfarm.hub.hosts`.
"""

from __future__ import annotations

import asyncio
import re
import time
from collections import deque
from dataclasses import dataclass
from functools import cache
from http import HTTPStatus
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import anyio
import structlog
from starlette.responses import Response

from pnfarm.api.context import Context
from pnfarm.errors import ConfigError
from pnfarm.farm.events import StateRestored
from pnfarm.hub.client import REQUEST_SECONDS, Answer, ShardClient
from pnfarm.hub.log import MergedLog
from pnfarm.hub.shards import AwayError, Shard, Shards, understood
from pnfarm.hub.states import ShardEvent
from pnfarm.station.event import texts_of
from pnfarm.station.events import PowerReturned, StationRenamed
from pnfarm.version import __version__
from pnfarm.vocabulary.trust import client_context
from pnfarm.web.bodies import PREFIX

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Iterable, Mapping
    from pathlib import Path

    import httpx

    from pnfarm.station.event import Event

__all__ = ["Answers", "Hub", "RefusedError", "passed_on", "read"]

#: A shard's clock is asked with this patience.
PROBE_SECONDS = 1.0
#: Requests of users whose words the hub remembers: faults by id.
MOST_SPECS = 4096
#: What the end of the hub waits for scenarios that undo what they changed.
UNDO_SECONDS = 3.0
#: Beyond it the number of an entry has no place in a position (:mod:`pnfarm.api.events`).
MOST_NUMBER = 10**15
#: Probes at the first meeting, for a good offset at once.
FIRST_PROBES = 4

#: Headers of a shard's answer: whatever type it says, a browser opens it without scripts, and as no other type.
_NO_PAGE = {"Content-Security-Policy": "sandbox", "X-Content-Type-Options": "nosniff"}

_INSTANCE = re.compile(r"[0-9a-f]{8}")

_T = TypeVar("_T")

logger = structlog.get_logger("pnfarm.hub")


def refusal(answer: Answer) -> str:
    """Why a shard refuses, in its words."""
    try:
        return str(answer.object()["detail"])
    except (ValueError, KeyError):
        return f"status {answer.status}"


def read(shard: Shard, answer: Answer, *keys: str) -> dict[str, Any]:
    """A good answer's object, which has these members; raises :class:`AwayError` for anything else."""
    with understood(shard):
        found = answer.object()
    if not answer.good:
        raise AwayError(f"{shard.label} refuses: {refusal(answer)[:300]}", slug="refusal")
    with understood(shard):
        return {**found, **{key: found[key] for key in keys}}


def passed_on(answer: Answer) -> Response:
    """A shard's answer as it is; a browser shows none of it as a page of the hub's own."""
    headers = _NO_PAGE | ({} if answer.tag is None else {"ETag": answer.tag})
    media_type = answer.media_type or "application/octet-stream"
    return Response(answer.body, answer.status, headers=headers, media_type=media_type)


@cache
def _renaming() -> frozenset[str]:
    """Events after which stations may have other names; those of buses are known once their paths were declared."""
    return texts_of((StationRenamed, StateRestored))


class RefusedError(ConfigError):
    """A shard refused; its answer is passed on as it is."""

    def __init__(self, answer: Answer) -> None:
        super().__init__(refusal(answer))
        self.answer = answer


@dataclass(frozen=True, slots=True)
class Answers(Generic[_T]):
    """What shards answered, and why others did not."""

    good: dict[Shard, _T]
    away: dict[Shard, AwayError]


class Hub(Context):
    """``ca``: the authority of the shards' certificates.  ``now`` is the hub's clock, ns.

    For tests: what a shard is reached by, and how long an answer may take.  Raises :class:`ConfigError` for a file
    that is no authority's.
    """

    def __init__(
        self,
        *,
        token: str | None = None,
        ca: Path | None = None,
        now: Callable[[], int] = time.monotonic_ns,
        wall: Callable[[], float] = time.time,
        sleep: Callable[[float], Awaitable[None]] = anyio.sleep,
        transport: Callable[[str], httpx.AsyncBaseTransport] | None = None,
        request_seconds: float = REQUEST_SECONDS,
    ) -> None:
        super().__init__(kind="hub")
        self.now = now
        self.wall = wall
        self.sleep = sleep
        self.shards = Shards()
        self.log = MergedLog()
        #: Fault -> as it was asked for.
        self.specs: dict[str, dict[str, Any]] = {}
        #: Scenarios that end, with what they changed.
        self.undoing: set[asyncio.Task[None]] = set()
        #: What is wrong with names that are asked for, by name.
        self.discovery: dict[str, str] = {}
        #: By URL, the name that a shard was discovered by.
        self.server_names: dict[str, str] = {}
        self._token = token
        self._trust = client_context(ca) if ca is not None else None
        self._transport = transport
        self._request_seconds = request_seconds
        self._clients: dict[str, ShardClient] = {}
        self._own = 0
        self._known: deque[str] = deque()

    def client(self, shard: Shard) -> ShardClient:
        if shard.url not in self._clients:
            transport = self._transport(shard.url) if self._transport is not None else None
            name = self.server_names.get(shard.url)
            self._clients[shard.url] = ShardClient(
                shard.url, self._token, transport, trust=self._trust, server_name=name
            )
        return self._clients[shard.url]

    @property
    def is_secure(self) -> bool:
        """Whether it asks shards without a given scheme by TLS."""
        return self._trust is not None

    async def drop(self, shard: Shard) -> None:
        """A shard that is no longer known."""
        self.server_names.pop(shard.url, None)
        if (found := self._clients.pop(shard.url, None)) is not None:
            await found.close()

    async def aclose(self) -> None:
        """Close every connection."""
        self.close()
        if self.undoing:
            await asyncio.wait(self.undoing, timeout=UNDO_SECONDS)
        for found in list(self._clients.values()):
            await found.close()
        self._clients.clear()

    def remember(self, fault_id: str, spec: Mapping[str, Any]) -> None:
        """What a user asked for."""
        self.specs[fault_id] = dict(spec)
        while len(self.specs) > MOST_SPECS:
            del self.specs[next(iter(self.specs))]

    def record(self, event: Event) -> None:
        """The hub's own entry of the log."""
        getattr(logger, event.level)(event.text, **event.logged())
        self._own += 1
        now = self.now()
        head = {"time": self.wall(), "farm_seconds": now / 1e9, "drive": "", "event": event.text}
        self.log.take(self.instance, self._own, now, {**event.details(), **head})

    def note(self, *events: Event) -> None:
        """A client changed something."""
        for event in events:
            self.record(event)

    # -- asking

    async def ask(
        self, shard: Shard, method: str, path: str, *, seconds: float | None = None, **options: Any
    ) -> Answer:
        """As :meth:`ShardClient.ask`; ``path`` below ``/api/v1``.  Raises :class:`AwayError`, of one away at once."""
        if not shard.asked:
            raise shard.away()
        patience = self._request_seconds if seconds is None else seconds
        try:
            return await self.client(shard).ask(method, f"{PREFIX}/{path}", seconds=patience, **options)
        except AwayError as exc:
            shard.errors[exc.slug] += 1
            raise

    async def asked(self, shard: Shard, method: str, path: str, *keys: str, **options: Any) -> dict[str, Any]:
        """An object with these ``keys``, as of :meth:`ask`; raises :class:`RefusedError` for a refusal."""
        answer = await self.ask(shard, method, path, **options)
        if not answer.good:
            raise RefusedError(answer)
        return read(shard, answer, *keys)

    async def each(self, shards: Iterable[Shard], work: Callable[[Shard], Awaitable[_T]]) -> Answers[_T]:
        """``work`` with all of them at once, which may raise :class:`AwayError`; in their order."""
        good: dict[Shard, _T] = {}
        away: dict[Shard, AwayError] = {}

        async def one(shard: Shard) -> None:
            try:
                good[shard] = await work(shard)
            except AwayError as exc:
                away[shard] = exc

        wanted = list(shards)
        async with anyio.create_task_group() as tasks:
            for shard in wanted:
                tasks.start_soon(one, shard)
        return Answers(
            {one: good[one] for one in wanted if one in good}, {one: away[one] for one in wanted if one in away}
        )

    async def ask_all(self, method: str, path: str, use: Callable[[Shard, dict[str, Any]], _T]) -> Answers[_T]:
        """What ``use`` makes of the answer of every shard; one whose answer it cannot use is away."""

        async def one(shard: Shard) -> _T:
            found = read(shard, await self.ask(shard, method, path))
            with understood(shard):
                return use(shard, found)

        return await self.each(self.shards, one)

    async def joined(
        self, what: str, use: Callable[[Shard, dict[str, Any]], dict[str, Any]], *, path: str = ""
    ) -> dict[str, Any]:
        """The lists of all shards as one: the member ``what`` of the answers to a ``path``, usually of the same name.

        ``use`` makes the hub's entry of a shard's.
        """
        answers = await self.ask_all(
            "GET", path or what, lambda shard, answer: [use(shard, one) for one in answer[what]]
        )
        return {what: [one for entries in answers.good.values() for one in entries], **self.partial(answers)}

    def partial(self, answers: Answers[Any]) -> dict[str, Any]:
        """The members of an answer that say whose part is missing; raises AwayError if no shard's is there."""
        self.check_any()
        missing = [*self.missing(answers).values()]
        return {"partial": bool(missing), "unreachable": missing}

    def missing(self, answers: Answers[Any]) -> dict[Shard, dict[str, Any]]:
        """An entry of ``unreachable`` for each shard that is away, or that did not answer just now."""
        gone = {shard: shard.told() for shard in self.shards.unreachable}
        return gone | {
            shard: {"shard": shard.label, "reason": str(why), "since": self.wall()}
            for shard, why in answers.away.items()
            if shard.asked
        }

    def check_any(self) -> None:
        """Raises :class:`AwayError` while there is no shard to ask."""
        if not len(self.shards):
            why = "; ".join(f"{name}: {what}" for name, what in self.discovery.items() if what)
            raise AwayError("no shard is known yet" + (f" ({why})" if why else ""))

    # -- what is known of a shard

    async def probe(self, shard: Shard) -> bool:
        """Ask its clock, and what else a new run has; whether it came or went."""
        try:
            await self._probe(shard)
        except AwayError as exc:
            shard.errors[exc.slug] += 1
            return self.shards.note(shard, exc.event, str(exc), self.now(), self.wall())
        return self.shards.note(shard, ShardEvent.ANSWERED, "", self.now(), self.wall())

    async def _probe(self, shard: Shard) -> None:
        about = await self._clock(shard)
        if about["kind"] != "farm":
            raise AwayError(f"{shard.label} is itself a hub: give the shards behind it", slug="hub")
        is_new = about["instance"] != shard.instance or not (shard.drives or shard.devices)
        if is_new:
            shard.clock.forget()
            for _ in range(FIRST_PROBES):
                about = await self._clock(shard)
        if is_new or shard.may_be_renamed:
            await self._read_stations(shard)
        if is_new:
            shard.faults.clear()
        shard.about = about
        same = about["pnfarm"] == __version__
        shard.notes = [] if same else [f"runs pnfarm {about['pnfarm']}, and this hub {__version__}"]

    async def _read_stations(self, shard: Shard) -> None:
        client = self.client(shard)
        # a name that is set meanwhile may be missed
        shard.may_be_renamed = False
        try:
            view = read(shard, await client.ask("GET", f"{PREFIX}/drives"))
            devices = read(shard, await client.ask("GET", f"{PREFIX}/devices"), "devices")
            plant = await client.ask("GET", f"{PREFIX}/plant")
            # a farm of an older version has none
            models = [] if plant.status == HTTPStatus.NOT_FOUND else read(shard, plant, "models")["models"]
            self.shards.take(shard, view, devices["devices"], models)
        except AwayError:
            shard.may_be_renamed = True
            raise

    async def _clock(self, shard: Shard) -> dict[str, Any]:
        asked = self.now()
        answer = await self.client(shard).ask("GET", f"{PREFIX}/clock", seconds=PROBE_SECONDS)
        answered = self.now()
        if answer.status == 404 and b"no such path" in answer.body:
            raise AwayError(f"{shard.label} runs a pnfarm without GET clock: update it", slug="version")
        about = read(shard, answer, "kind", "farm", "instance", "farm_seconds", "pnfarm")
        seconds, instance = about["farm_seconds"], about["instance"]
        sane = isinstance(seconds, (int, float)) and abs(seconds) < 1e10
        if not (
            sane and isinstance(instance, str) and _INSTANCE.fullmatch(instance) and isinstance(about["farm"], str)
        ):
            raise AwayError(f"{shard.label} does not answer as a farm does: its clock is not valid", slug="garbage")
        shard.clock.note(asked, round(seconds * 1e9), answered)
        return about

    # -- times

    def wall_of(self, at_ns: int) -> float:
        """A moment of the hub's clock in seconds since the epoch."""
        return self.wall() - (self.now() - at_ns) / 1e9

    def entry(self, shard: Shard, entry: Mapping[str, Any]) -> dict[str, Any]:
        """A shard's entry of the log, with its times by the hub's clock."""
        seconds = shard.clock.to_hub(float(entry["farm_seconds"]))
        return {**entry, "farm_seconds": seconds, "time": self.wall_of(round(seconds * 1e9)), "shard": shard.label}

    def take_entry(self, shard: Shard, entry: Mapping[str, Any]) -> None:
        """A message of a shard's event stream.  Raises :class:`AwayError` for one that no farm sends."""
        if "lost" in entry and "sequence" not in entry:
            return
        with understood(shard, "sends no entries"):
            number, moved = int(entry["sequence"]), self.entry(shard, entry)
            "".join((entry["drive"], entry["event"]))
            if not 0 < number < MOST_NUMBER:
                raise ValueError(f"the sequence number {number}")
        if moved["event"] in _renaming() or (
            # without its supply it forgets a name that was set until then
            moved["event"] == PowerReturned.TEXT and not shard.has_own_name(moved["drive"])
        ):
            shard.may_be_renamed = True
        # one of a time to come would hold up all behind it
        at_ns = min(round(moved["farm_seconds"] * 1e9), self.now())
        self.log.take(shard.instance, number, at_ns, moved)
