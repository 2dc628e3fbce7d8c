"""Faults on drives of any shards.

A fault has one name, which the hub makes up unless the user gives one, and which each shard takes as its own id
(``as``).  So the shards themselves keep what belongs together: a hub that was restarted, or another one, finds it by
asking them.  A shard's own ids (``fault-3``), of faults that somebody injected there without a hub, could be the same
on two shards: the hub shows them with the shard, ``fault-3@HOST:PORT``.
"""

from __future__ import annotations

import dataclasses
import re
import secrets
from dataclasses import dataclass
from http import HTTPStatus
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import anyio

from pnfarm.buses.registry import fault_kinds
from pnfarm.drives.catalogue import model as model_by_name
from pnfarm.errors import ConfigError
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.start import seeded
from pnfarm.faults.targets import chosen
from pnfarm.hub.merging import at_hub, joined_fault
from pnfarm.hub.shards import AwayError, no_steps
from pnfarm.web.errors import NotFoundError, RequestError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from pnfarm.faults.plan import InjectionSpec
    from pnfarm.hub.client import Answer
    from pnfarm.hub.hub import Hub
    from pnfarm.hub.shards import Shard

__all__ = ["HubFaults", "RefusedError"]

#: How far ahead the start of a fault is set: beyond two of the longest round trips of late, and at the least.
LEAD_NS = 100_000_000
MOST_LEAD_NS = 4_000_000_000
#: After the start, before the shards are asked how it went.
SETTLE_SECONDS = 0.005
#: Ids that a farm makes up itself.
_OWN = re.compile(r"fault-[0-9]+")
_REFUSED = (HTTPStatus.BAD_REQUEST, HTTPStatus.INTERNAL_SERVER_ERROR)


class RefusedError(ConfigError):
    """A shard refused; its answer is passed on as it is."""

    def __init__(self, answer: Answer) -> None:
        super().__init__(f"refused with status {answer.status}")
        self.answer = answer


@dataclass(frozen=True, slots=True)
class _Known:
    """A drive as globs see it."""

    names: tuple[str, ...]
    models: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Plan:
    """Whom a fault hits: drives by shard; those of shards that are away."""

    spec: InjectionSpec
    at: dict[Shard, list[str]]
    away: dict[Shard, list[str]]
    left_out: list[str]


class HubFaults:
    """See the module's docstring."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub

    # -- which drives

    def _plan(self, fields: Mapping[str, Any]) -> _Plan:
        """Choose among the drives of all shards as one farm does."""
        hub = self._hub
        hub.check_any()
        spec = seeded(fault_kinds().parse(fields))
        known: dict[str, _Known] = {}
        for name in hub.shards.names:
            view = next(shard.drives[name] for shard in hub.shards if name in shard.drives)
            known[name] = _Known(_names(view), _models(str(view["model"])))
        try:
            names, left_out = chosen(spec, known)
        except InjectionError as exc:
            if away := [shard.label for shard in hub.shards.unreachable if not shard.drives]:
                raise AwayError(f"{exc}; not known are the drives of {', '.join(away)}") from exc
            raise
        at: dict[Shard, list[str]] = {}
        gone: dict[Shard, list[str]] = {}
        for name in names:
            shard = hub.shards.known(name)
            (at if shard.asked else gone).setdefault(shard, []).append(name)
        return _Plan(spec, at, gone, left_out)

    @staticmethod
    def _body(spec: InjectionSpec, drives: Sequence[str]) -> dict[str, Any]:
        """What one shard is sent: its drives by name; what chooses among drives is decided."""
        own = spec.without("share", "most")
        if "seed" not in own.kind.takes and own.rate is None:
            own = own.without("seed")
        return {**own.as_dict(), "on": list(drives)}

    async def reach(self, fields: Mapping[str, Any]) -> dict[str, Any]:
        """Whom it would hit; changes nothing."""
        hub = self._hub
        plan = self._plan(fields)
        answers = await self._ask(plan, dry_run=True)
        able: list[str] = []
        cannot = [
            {"drive": name, "why": f"unreachable: {shard.away()}"}
            for shard, names in plan.away.items()
            for name in names
        ]
        for shard, answer in answers.items():
            if isinstance(answer, AwayError):
                cannot += [{"drive": name, "why": f"unreachable: {answer}"} for name in plan.at[shard]]
                continue
            able += answer["drives"]
            cannot += answer["cannot"]
        order = hub.shards.names
        return {
            "dry_run": True,
            "kind": plan.spec.kind.name,
            "spec": plan.spec.as_dict(),
            "drives": [name for name in order if name in set(able)],
            "cannot": cannot,
            "left_out": plan.left_out,
            **hub.partial(answers),
        }

    async def _ask(
        self, plan: _Plan, *, dry_run: bool = False, at_ns: int = 0
    ) -> dict[Shard, dict[str, Any] | AwayError]:
        """``POST faults`` to each shard; raises :class:`RefusedError` for the first that refuses."""
        found: dict[Shard, dict[str, Any] | AwayError] = {}
        refused: list[Answer] = []

        async def one(shard: Shard, names: Sequence[str]) -> None:
            body = self._body(plan.spec, names)
            query = {"dry_run": "true"} if dry_run else {"at": repr(shard.clock.to_shard(at_ns))}
            try:
                answer = await self._hub.ask(shard, "POST", "faults", body=body, query=query)
                if _REFUSED[0] <= answer.status < _REFUSED[1] and not _is_late(answer):
                    refused.append(answer)
                    return
                if _is_late(answer):
                    raise AwayError(f"{shard.label} got the request after the moment of the start", slug="late")
                found[shard] = _fault(shard, answer)
            except AwayError as exc:
                found[shard] = exc

        async with anyio.create_task_group() as tasks:
            for shard, names in plan.at.items():
                tasks.start_soon(one, shard, names)
        if refused:
            if not dry_run:
                # a fault is on all of its drives, or on none
                begun = [shard for shard, answer in found.items() if not isinstance(answer, AwayError)]
                await self._hub.ask_all(begun, "DELETE", f"faults/{quote(str(plan.spec.name), safe='')}")
            raise RefusedError(refused[0])
        return found

    # -- begin and end

    async def inject(self, fields: Mapping[str, Any], at: float | None = None) -> dict[str, Any]:
        """Put a fault in force on all shards at one moment; ``not_hit`` has the drives of shards that are away.

        ``at`` is a moment of the hub's clock.  Raises :class:`InjectionError` or :class:`RefusedError` with nothing
        changed, :class:`AwayError` where no drive was hit.
        """
        hub = self._hub
        name = fields.get("as") or f"f-{secrets.token_hex(4)}"
        plan = whole = self._plan({**fields, "as": name})
        self._refuse_taken(str(name))
        silent: dict[Shard, AwayError] = {}
        if len(plan.at) + len(plan.away) > 1:
            reached = await self._ask(plan, dry_run=True)
            self._refuse(reached)
            # one that did not answer is not waited for a second time
            silent = {shard: answer for shard, answer in reached.items() if isinstance(answer, AwayError)}
            plan = dataclasses.replace(plan, at={one: names for one, names in plan.at.items() if one not in silent})
        hub.remember(str(name), {**plan.spec.as_dict(), **({} if "as" in fields else {"as": str(name)})})
        start = self._start(plan.at, at)
        answers = {**silent, **await self._ask(plan, at_ns=start)}
        begun = [shard for shard, answer in answers.items() if not isinstance(answer, AwayError)]
        not_hit = [
            {"drive": drive, "shard": shard.label, "why": str(shard.away())}
            for shard, drives in plan.away.items()
            for drive in drives
        ]
        for shard, answer in answers.items():
            if isinstance(answer, AwayError):
                drives = whole.at[shard]
                not_hit += [{"drive": drive, "shard": shard.label, "why": str(answer)} for drive in drives]
            else:
                shard.faults[str(name)] = answer
        if not begun:
            raise AwayError(f"no drive was hit: {not_hit[0]['why']}")
        # the answer shows it in force, as a farm's does
        await hub.sleep(max(0.0, (start - hub.now()) / 1e9) + SETTLE_SECONDS)
        await self._look(str(name), begun)
        hit = sorted((drive for shard in begun for drive in plan.at[shard]), key=hub.shards.names.index)
        return {**self._joined(str(name)), "partial": bool(not_hit), "hit": hit, "not_hit": not_hit}

    def _start(self, shards: Iterable[Shard], at: float | None) -> int:
        """The moment of the start by the hub's clock."""
        if at is not None:
            return round(at * 1e9)
        now = self._hub.now()
        trip = max((shard.clock.round_trip_ns + shard.clock.uncertainty_ns(now) for shard in shards), default=0)
        return now + min(MOST_LEAD_NS, LEAD_NS + 2 * trip)

    def _refuse_taken(self, name: str) -> None:
        """A shard that is away cannot refuse a name that it has in force."""
        for shard in self._hub.shards.unreachable:
            if shard.faults.get(name, {"state": "ended"})["state"] != "ended":
                what = f"an injection named {name!r} was in force on {shard.label}, which does not answer"
                raise InjectionError([("as", what, "another name")])

    @staticmethod
    def _refuse(reached: Mapping[Shard, dict[str, Any] | AwayError]) -> None:
        """As a farm does: with one drive that cannot, nothing is injected."""
        for answer in reached.values():
            if not isinstance(answer, AwayError) and answer["cannot"]:
                one = answer["cannot"][0]
                raise InjectionError([("on", f"{one['drive']}: {one['why']}", "")])

    async def renew(self, fault_id: str) -> tuple[dict[str, Any], bool]:
        """Begin its time to live anew on each shard; whether all of them did."""
        return await self._each(fault_id, "POST", "/renew")

    async def clear(self, fault_id: str) -> tuple[dict[str, Any], bool]:
        """End it on each shard; whether all of them did."""
        return await self._each(fault_id, "DELETE", "")

    async def _each(self, fault_id: str, method: str, suffix: str) -> tuple[dict[str, Any], bool]:
        own, shards = await self._members(fault_id)
        path = f"faults/{quote(own, safe='')}{suffix}"
        answers: dict[Shard, Answer | AwayError] = {}

        async def one(shard: Shard) -> None:
            try:
                answers[shard] = await self._hub.ask(shard, method, path)
            except AwayError as exc:
                answers[shard] = exc

        async with anyio.create_task_group() as tasks:
            for shard in shards:
                tasks.start_soon(one, shard)
        away = [answer for answer in answers.values() if isinstance(answer, AwayError)]
        refused = [a for a in answers.values() if not isinstance(a, AwayError) and not a.good]
        done = 0
        for shard, answer in answers.items():
            if not isinstance(answer, AwayError) and answer.good:
                shard.faults[own] = _fault(shard, answer)
                done += 1
        if not done:
            if refused and not away:
                raise RefusedError(refused[0])
            raise away[0] if away else AwayError(f"no shard that has {fault_id} answers")
        # of a shard where it had ended already there is nothing to end
        left = [*away, *(answer for answer in refused if answer.status != HTTPStatus.NOT_FOUND)]
        return self._joined(fault_id), not left

    async def reset(self) -> tuple[dict[str, Any], bool]:
        """End every fault on every shard; whether all shards did."""
        hub = self._hub
        hub.check_any()
        answers = await hub.ask_all(hub.shards.reachable, "POST", "reset", "cleared", "faults")
        partial = hub.partial(answers)
        found: dict[str, dict[str, Any]] = {}
        for shard, answer in answers.items():
            if isinstance(answer, AwayError):
                continue
            for fault in answer["faults"]:
                shown = found.setdefault(self._id(shard, fault["id"]), {"id": "", "kind": fault["kind"], "drives": []})
                shown["drives"] += fault["drives"]
                if fault["id"] in shard.faults:
                    shard.faults[fault["id"]]["state"] = "ended"
        faults = [{**fault, "id": fault_id} for fault_id, fault in found.items()]
        if not any(not isinstance(answer, AwayError) for answer in answers.values()):
            raise AwayError(f"nothing was reset: {partial['unreachable'][0]['reason']}")
        return {"cleared": list(found), "faults": faults, **partial}, not partial["partial"]

    # -- look

    async def listed(self) -> dict[str, Any]:
        """Those in force on any shard."""
        hub = self._hub
        answers = await hub.ask_all(hub.shards.reachable, "GET", "faults", "faults")
        partial = hub.partial(answers)
        ids: dict[str, None] = {}
        for shard in hub.shards:
            answer = answers.get(shard)
            if answer is not None and not isinstance(answer, AwayError):
                ended = {key: one for key, one in shard.faults.items() if one["state"] == "ended"}
                shard.faults = {**ended, **{str(one["id"]): one for one in answer["faults"]}}
                while len(shard.faults) > 2 * 4096:
                    del shard.faults[next(iter(shard.faults))]
            for own, one in shard.faults.items():
                if one["state"] != "ended":
                    ids.setdefault(self._id(shard, own))
        faults = sorted((self._joined(one) for one in ids), key=lambda fault: fault["added_seconds"])
        return {"faults": faults, **partial}

    async def get(self, fault_id: str) -> dict[str, Any]:
        """One, also one that has ended recently.  Raises :class:`NotFoundError`, :class:`AwayError`."""
        await self._members(fault_id)
        return self._joined(fault_id)

    async def _members(self, fault_id: str) -> tuple[str, list[Shard]]:
        """Its id on the shards, and those that have it."""
        hub = self._hub
        hub.check_any()
        no_steps(fault_id)
        own, at, label = fault_id.rpartition("@")
        if at and _OWN.fullmatch(own):
            shards = [shard for shard in hub.shards if shard.label == label]
            if shards and not shards[0].asked:
                raise shards[0].away()
        else:
            own = fault_id
            shards = list(hub.shards)
            if _OWN.fullmatch(fault_id):
                allowed = f"{fault_id}@HOST:PORT with the shard, as `pnfarm fault list` shows it"
                raise NotFoundError(f"{fault_id!r} is the name that a shard gave itself; give {allowed}")
        missing = await self._look(own, [shard for shard in shards if shard.asked])
        known = [shard for shard in shards if own in shard.faults]
        if not known:
            missing += [str(shard.away()) for shard in hub.shards.unreachable]
            if missing:
                raise AwayError(f"no shard that answers has a fault {fault_id!r}; not known is the rest: {missing[0]}")
            raise NotFoundError(f"there is no injection {fault_id!r}; `pnfarm fault list` lists them")
        return own, known

    async def _look(self, own: str, shards: Iterable[Shard]) -> list[str]:
        """Ask these shards for a fault; why any of them could not tell."""
        missing: list[str] = []

        async def one(shard: Shard) -> None:
            try:
                answer = await self._hub.ask(shard, "GET", f"faults/{quote(own, safe='')}")
                if answer.status == HTTPStatus.NOT_FOUND:
                    shard.faults.pop(own, None)
                    return
                shard.faults[own] = _fault(shard, answer)
            except AwayError as exc:
                missing.append(str(exc))

        async with anyio.create_task_group() as tasks:
            for shard in shards:
                tasks.start_soon(one, shard)
        return missing

    def _id(self, shard: Shard, own: str) -> str:
        return f"{own}@{shard.label}" if _OWN.fullmatch(own) else own

    def _joined(self, fault_id: str) -> dict[str, Any]:
        hub = self._hub
        own, at, label = fault_id.rpartition("@")
        if not (at and _OWN.fullmatch(own)):
            own, label = fault_id, ""
        parts = [
            (at_hub(shard.faults[own], shard.clock.to_hub), shard.asked)
            for shard in hub.shards
            if own in shard.faults and (not label or shard.label == label)
        ]
        order = {name: place for place, name in enumerate(hub.shards.names)}
        return {**joined_fault(parts, hub.specs.get(fault_id), order), "id": fault_id}


def _is_late(answer: Answer) -> bool:
    """Whether the request came after the moment that it names."""
    if answer.status != HTTPStatus.UNPROCESSABLE_ENTITY:
        return False
    try:
        errors = answer.object().get("errors") or []
        return any(error.get("field") == "at" and "ago" in error.get("what", "") for error in errors)
    except (ValueError, AttributeError, TypeError):
        return False


def _fault(shard: Shard, answer: Answer) -> dict[str, Any]:
    """A shard's fault, or its answer to a dry run."""
    from pnfarm.hub.hub import read  # noqa: PLC0415 - the hub knows this module

    found = read(shard, answer, "kind", "spec", "drives")
    if "dry_run" in found:
        return found
    try:
        at_hub(found, lambda seconds: seconds + 0.0)
    except (KeyError, TypeError, AttributeError) as exc:
        raise AwayError(f"{shard.label} reports a fault as no farm does", slug="garbage") from exc
    return found


def _names(view: Mapping[str, Any]) -> tuple[str, ...]:
    own, station = str(view["name"]), view.get("station_name")
    return (own, str(station)) if station and station != own else (own,)


def _models(name: str) -> tuple[str, ...]:
    try:
        found = model_by_name(name)
    except ConfigError:
        # of a shard with a newer version
        return (name,)
    return (found.name, *found.aliases)


def wrong_moment(at: float | None, now: int, most: float) -> None:
    """Raises :class:`RequestError` for a start that does not lie ahead, or too far."""
    if at is not None and not 0 <= at - now / 1e9 <= most:
        allowed = f"a moment of the hub's clock (`GET clock`) at most {most:g} s ahead"
        raise RequestError(f"at: is {at - now / 1e9:.3f} s ahead; allowed: {allowed}")
