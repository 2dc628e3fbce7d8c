"""Faults on drives and devices of any shards.

A fault has one name, which the hub makes up unless the user gives one, and which each shard takes as its own id
(``as``).  So the shards themselves keep what belongs together: a hub that was restarted, or another one, finds it by
asking them.  A shard's own ids (``fault-3``), of faults that were injected there without the hub, could be the same
on two shards: the hub shows them with the shard, ``fault-3@HOST:PORT``.
"""

from __future__ import annotations

import dataclasses
import secrets
from dataclasses import dataclass
from http import HTTPStatus
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from pnfarm.buses.registry import fault_kinds
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.start import seeded
from pnfarm.faults.targets import chosen
from pnfarm.hub.hub import RefusedError, read
from pnfarm.hub.merging import at_hub, joined_fault
from pnfarm.hub.shards import OWN_FAULT, AwayError, no_steps, understood
from pnfarm.web.errors import NotFoundError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from pnfarm.api.paths.faults import Outcome
    from pnfarm.faults.plan import InjectionSpec
    from pnfarm.hub.client import Answer
    from pnfarm.hub.hub import Answers, Hub
    from pnfarm.hub.shards import Shard

__all__ = ["HubFaults"]

#: How far ahead the start of a fault is set: beyond two of the longest round trips of late, and at the least.
LEAD_NS = 100_000_000
MOST_LEAD_NS = 4_000_000_000
#: After the start, before the shards are asked how it went.
SETTLE_SECONDS = 0.005
#: After these a request may have been carried out; of so many faults that is remembered.
_UNSURE = frozenset({"timeout", "broken", "garbage"})
MOST_UNSURE = 4096
_REFUSED = (HTTPStatus.BAD_REQUEST, HTTPStatus.INTERNAL_SERVER_ERROR)


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
        #: Shards that may have carried a request out whose answer was lost, by the fault.
        self._unsure: dict[str, set[Shard]] = {}

    # -- which drives

    def _plan(self, fields: Mapping[str, Any]) -> _Plan:
        """Choose among the drives of all shards as one farm does."""
        hub = self._hub
        hub.check_any()
        spec = seeded(fault_kinds().parse(fields))
        try:
            names, left_out = chosen(spec, hub.shards.known_as)
        except InjectionError as exc:
            if away := [shard.label for shard in hub.shards.unreachable if not shard.drives]:
                raise AwayError(f"{exc}; not known are the drives of {', '.join(away)}") from exc
            raise
        at: dict[Shard, list[str]] = {}
        gone: dict[Shard, list[str]] = {}
        for name in names:
            shard = hub.shards.known_station(name)
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
        missing = [(names, shard.away()) for shard, names in plan.away.items()]
        missing += [(plan.at[shard], why) for shard, why in answers.away.items()]
        cannot = [{"drive": name, "why": f"unreachable: {why}"} for names, why in missing for name in names]
        able = {name for answer in answers.good.values() for name in answer["drives"]}
        return {
            "dry_run": True,
            "kind": plan.spec.kind.name,
            "spec": plan.spec.as_dict(),
            "drives": [name for name in hub.shards.stations if name in able],
            "cannot": cannot + [one for answer in answers.good.values() for one in answer["cannot"]],
            "left_out": plan.left_out,
            **hub.partial(answers),
        }

    async def _ask(self, plan: _Plan, *, dry_run: bool = False, at_ns: int = 0) -> Answers[dict[str, Any]]:
        """``POST faults`` to each shard; raises :class:`RefusedError` for the first that refuses."""
        refused: list[Answer] = []

        async def one(shard: Shard) -> dict[str, Any]:
            body = self._body(plan.spec, plan.at[shard])
            query = {"dry_run": "true"} if dry_run else {"at": repr(shard.clock.to_shard(at_ns))}
            answer = await self._hub.ask(shard, "POST", "faults", body=body, query=query)
            if _is_late(answer):
                raise AwayError(f"{shard.label} got the request after the moment of the start", slug="late")
            if _REFUSED[0] <= answer.status < _REFUSED[1]:
                refused.append(answer)
                raise AwayError(f"{shard.label} refuses", slug="refusal")
            return _fault(shard, answer)

        answers = await self._hub.each(plan.at, one)
        if refused:
            if not dry_run:
                # a fault is on all of its drives, or on none
                path = f"faults/{quote(str(plan.spec.name), safe='')}"
                hit = [*answers.good, *(shard for shard, why in answers.away.items() if why.slug in _UNSURE)]
                await self._hub.each(hit, lambda shard: self._hub.ask(shard, "DELETE", path))
            raise RefusedError(refused[0])
        return answers

    # -- begin and end

    async def inject(
        self, fields: Mapping[str, Any], at_ns: int = 0, *, begins: Callable[[int], None] | None = None
    ) -> Outcome:
        """Put a fault in force on all shards at one moment; ``not_hit`` has the drives of shards that are away.

        ``at_ns`` is a moment of the hub's clock, 0: as soon as all can; ``begins`` is called with it when the requests
        are about to be sent.  Raises :class:`InjectionError` or
        :class:`RefusedError` with nothing changed, :class:`AwayError` where no drive was hit.
        """
        hub = self._hub
        name = str(fields.get("as") or f"f-{secrets.token_hex(4)}")
        plan = whole = self._plan({**fields, "as": name})
        if "as" in fields:
            await self._look(name, hub.shards.reachable)
            self._refuse_taken(name)
        silent: dict[Shard, AwayError] = {}
        if len(plan.at) + len(plan.away) > 1:
            reached = await self._ask(plan, dry_run=True)
            self._refuse(reached.good.values())
            # one that did not answer is not waited for a second time
            silent = reached.away
            plan = dataclasses.replace(plan, at={one: names for one, names in plan.at.items() if one not in silent})
        start = at_ns or self._start(plan.at)
        if begins is not None:
            begins(start)
        answers = await self._ask(plan, at_ns=start)
        hub.remember(name, {**plan.spec.as_dict(), **({} if "as" in fields else {"as": name})})
        missing = [(shard, drives, shard.away()) for shard, drives in plan.away.items()]
        missing += [(shard, whole.at[shard], why) for shard, why in {**silent, **answers.away}.items()]
        not_hit = [
            {"drive": drive, "shard": shard.label, "why": str(why)}
            for shard, drives, why in missing
            for drive in drives
        ]
        for shard, answer in answers.good.items():
            shard.faults[name] = answer
        if unsure := {shard for shard, why in answers.away.items() if why.slug in _UNSURE}:
            self._unsure[name] = unsure
            if len(self._unsure) > MOST_UNSURE:
                del self._unsure[next(iter(self._unsure))]
        if not answers.good:
            raise AwayError(f"no drive was hit: {not_hit[0]['why']}")
        # the answer shows it in force, as a farm's does
        await hub.sleep(max(0.0, (start - hub.now()) / 1e9) + SETTLE_SECONDS)
        await self._look(name, answers.good)
        reached_drives = {drive for shard in answers.good for drive in plan.at[shard]}
        hit = [name for name in hub.shards.stations if name in reached_drives]
        return {**self._joined(name), "partial": bool(not_hit), "hit": hit, "not_hit": not_hit}, not not_hit

    def _start(self, shards: Iterable[Shard]) -> int:
        """The moment of the start by the hub's clock."""
        now = self._hub.now()
        trip = max((shard.clock.round_trip_ns + shard.clock.uncertainty_ns(now) for shard in shards), default=0)
        return now + min(MOST_LEAD_NS, LEAD_NS + 2 * trip)

    def _refuse_taken(self, name: str) -> None:
        """As one farm does: a shard that is away, or that the fault is not for, cannot refuse it itself."""
        for shard in self._hub.shards:
            if shard.faults.get(name, {"state": "ended"})["state"] != "ended":
                what = f"an injection named {name!r} is in force on {shard.label}"
                if not shard.asked:
                    raise InjectionError([("as", f"{what}, which does not answer", "another name")])
                raise InjectionError([("as", what, "another name, or clear it first")])

    @staticmethod
    def _refuse(reached: Iterable[dict[str, Any]]) -> None:
        """As a farm does: with one drive that cannot, nothing is injected."""
        for answer in reached:
            if answer["cannot"]:
                one = answer["cannot"][0]
                raise InjectionError([("on", f"{one['drive']}: {one['why']}", "")])

    async def renew(self, fault_id: str) -> Outcome:
        """Restart its time to live on each shard."""
        return await self._each(fault_id, "POST", "/renew")

    async def clear(self, fault_id: str) -> Outcome:
        """End it on each shard."""
        return await self._each(fault_id, "DELETE", "")

    async def _each(self, fault_id: str, method: str, suffix: str) -> Outcome:
        own, known, unheard = await self._members(fault_id)
        # with what has ended on a shard that is away nothing is to be done
        shards = [one for one in known if one.asked or one.faults[own]["state"] != "ended"]
        path = f"faults/{quote(own, safe='')}{suffix}"
        answers = await self._hub.each(shards, lambda shard: self._hub.ask(shard, method, path))
        refused = [answer for answer in answers.good.values() if not answer.good]
        done = {shard: _fault(shard, answer) for shard, answer in answers.good.items() if answer.good}
        for shard, fault in done.items():
            shard.faults[own] = fault
        if not done:
            if refused and not answers.away:
                raise RefusedError(refused[0])
            raise next(iter(answers.away.values()), AwayError(f"no shard that has {fault_id} answers"))
        # of a shard where it had ended already there is nothing to end
        left = unheard or answers.away or any(answer.status != HTTPStatus.NOT_FOUND for answer in refused)
        return self._joined(fault_id), not left

    async def reset(self) -> Outcome:
        """End every fault on every shard."""
        hub = self._hub
        hub.check_any()
        answers = await hub.ask_all("POST", "reset", lambda _, answer: [_cleared(one) for one in answer["faults"]])
        partial = hub.partial(answers)
        found: dict[str, dict[str, Any]] = {}
        for shard, cleared in answers.good.items():
            for own, kind, drives in cleared:
                name = shard.fault_id(own)
                found.setdefault(name, {"id": name, "kind": kind, "drives": []})["drives"] += drives
                if own in shard.faults:
                    shard.faults[own]["state"] = "ended"
        if not answers.good:
            raise AwayError(f"nothing was reset: {partial['unreachable'][0]['reason']}")
        return {"cleared": list(found), "faults": list(found.values()), **partial}, not partial["partial"]

    # -- look

    async def listed(self) -> dict[str, Any]:
        """Those in force on any shard."""
        hub = self._hub
        answers = await hub.ask_all(
            "GET", "faults", lambda _, answer: {str(one["id"]): _sound(one) for one in answer["faults"]}
        )
        partial = hub.partial(answers)
        ids: dict[str, None] = {}
        for shard in hub.shards:
            if (answer := answers.good.get(shard)) is not None:
                ended = {key: one for key, one in shard.faults.items() if one["state"] == "ended"}
                shard.faults = {**ended, **answer}
                while len(shard.faults) > 2 * 4096:
                    del shard.faults[next(iter(shard.faults))]
            for own, one in shard.faults.items():
                if one["state"] != "ended":
                    ids.setdefault(shard.fault_id(own))
        faults = sorted((self._joined(one) for one in ids), key=lambda fault: fault["added_seconds"])
        return {"faults": faults, **partial}

    async def get(self, fault_id: str) -> dict[str, Any]:
        """One, also one that has ended recently.  Raises :class:`NotFoundError`, :class:`AwayError`."""
        await self._members(fault_id)
        return self._joined(fault_id)

    async def _members(self, fault_id: str) -> tuple[str, list[Shard], list[Shard]]:
        """Its id on the shards, those that have it, and those that may have it and do not answer."""
        hub = self._hub
        hub.check_any()
        no_steps(fault_id)
        own, label = _parted(fault_id)
        if label:
            shards = [shard for shard in hub.shards if shard.label == label]
            if shards and not shards[0].asked:
                raise shards[0].away()
        else:
            shards = list(hub.shards)
            if OWN_FAULT.fullmatch(fault_id):
                allowed = f"{fault_id}@HOST:PORT with the shard, as `pnfarm fault list` shows it"
                raise NotFoundError(f"{fault_id!r} is the name that a shard gave itself; give {allowed}")
        silent = await self._look(own, [shard for shard in shards if shard.asked])
        known = [shard for shard in shards if own in shard.faults]
        silent |= {shard: shard.away() for shard in hub.shards.unreachable}
        if not known:
            if silent:
                why = next(iter(silent.values()))
                raise AwayError(f"no shard that answers has a fault {fault_id!r}; not known is the rest: {why}")
            raise NotFoundError(f"there is no fault {fault_id!r}; `pnfarm fault list` lists them")
        # of one that has not answered since this hub began nothing is known
        unsure = self._unsure.get(own, set()) | {shard for shard in shards if not shard.instance}
        return own, known, [shard for shard in silent if shard in unsure and shard not in known]

    async def _look(self, own: str, shards: Iterable[Shard]) -> dict[Shard, AwayError]:
        """Ask these shards for a fault; why any of them gave no answer."""

        async def one(shard: Shard) -> None:
            answer = await self._hub.ask(shard, "GET", f"faults/{quote(own, safe='')}")
            if answer.status == HTTPStatus.NOT_FOUND:
                shard.faults.pop(own, None)
                return
            shard.faults[own] = _fault(shard, answer)

        return dict((await self._hub.each(shards, one)).away)

    def _joined(self, fault_id: str) -> dict[str, Any]:
        hub = self._hub
        own, label = _parted(fault_id)
        parts = [
            (at_hub(shard.faults[own], shard.clock.to_hub), shard.asked)
            for shard in hub.shards
            if own in shard.faults and (not label or shard.label == label)
        ]
        if not parts:
            raise AwayError(f"no shard that answers has a fault {fault_id!r} any more")
        order = {name: place for place, name in enumerate(hub.shards.stations)}
        return {**joined_fault(parts, hub.specs.get(fault_id), order), "id": fault_id}


def _parted(fault_id: str) -> tuple[str, str]:
    """A fault's id on the shards, and the shard's label, if it has one."""
    own, _, label = fault_id.rpartition("@")
    return (own, label) if OWN_FAULT.fullmatch(own) else (fault_id, "")


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
    found = read(shard, answer)
    with understood(shard):
        if "dry_run" not in found:
            return _sound(found)
        cannot = [{key: one[key] for key in ("drive", "why")} for one in found["cannot"]]
        return {**found, "drives": [str(one) for one in found["drives"]], "cannot": cannot}


def _sound(fault: dict[str, Any]) -> dict[str, Any]:
    """A fault that can be put together with those of other shards."""
    joined_fault([(at_hub(fault, lambda seconds: seconds + 0.0), True)], None, {})
    return fault


def _cleared(fault: Mapping[str, Any]) -> tuple[str, str, list[str]]:
    """Of a reset: id, kind, drives."""
    return str(fault["id"]), str(fault["kind"]), [str(one) for one in fault["drives"]]
