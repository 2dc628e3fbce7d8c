"""Paths of injected faults, which they call faults, as the command does: the catalogue, begin, list, renew, end."""

from __future__ import annotations

from http import HTTPStatus
from typing import TYPE_CHECKING, Any, Literal, Protocol
from urllib.parse import quote

from fastapi import Request  # noqa: TC002 - FastAPI reads the annotations of paths
from pydantic import Field

from pnfarm.api.changes import FaultCleared, FaultRequested, changes_nothing, who
from pnfarm.api.paths.at import At, start_ns
from pnfarm.buses.registry import fault_kinds
from pnfarm.vocabulary.quoting import shortened
from pnfarm.web.bodies import PREFIX, Json, Schema, body_of, read_object
from pnfarm.web.roles import Role

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.api.paths.host import Host
    from pnfarm.web.paths import Paths

__all__ = ["Fault", "Faults", "FaultsHost", "Outcome", "Reset", "Targets", "add_faults"]

#: Names of drives in one entry of the log.
MOST_NAMES = 16


class KindParameter(Schema):
    type: str = Field(description="number, whole number, yes or no, duration, word, fault, mac, octets or text.")
    default: Any
    required: bool
    unit: str
    minimum: float | None
    maximum: float | None
    words: list[str]
    allowed: str
    doc: str


class KindOnBus(Schema):
    """What is different of a kind on drives of one bus; empty texts are as for any bus."""

    params: list[str] = Field(description="Parameters that only drives on this bus take.")
    wire: str
    reports: str
    refused: str = Field(description="Why drives on this bus have no such fault; empty if they have.")


class FaultKind(Schema):
    """A kind of fault as it is in the catalogue."""

    kind: str
    family: str
    doc: str
    occurrence: str = Field(description="What `count` and `probability` refer to.")
    wire: str = Field(description="What a capture shows.")
    reports: str = Field(description="What controllers report.")
    buses: dict[str, KindOnBus] = Field(description="What differs on a bus, by its name.")
    params: dict[str, KindParameter]
    directions: list[str] = Field(description="The first one is the default; empty for a kind that has none.")
    takes: list[str] = Field(description="The common fields that it takes.")


class FaultKinds(Schema):
    kinds: list[FaultKind]


class FaultEvidence(Schema):
    """Seconds are those of the farm's clock."""

    checks: int = Field(description="Occurrences that were possible.")
    activations: int = Field(description="Those of them that happened.")
    first_seconds: float | None
    last_seconds: float | None
    confirmed: bool = Field(description="It was seen on the wire; of several drives, on every one.")
    confirmation: Literal["confirmed", "contradicted", "inconclusive"]
    reason: str = Field(description="Why it is not confirmed; empty when it is.")


RunState = Literal["waiting", "active", "ended"]


class FaultRun(Schema):
    """A fault on one of its drives."""

    state: RunState
    waits_for: str = Field(description="Empty once it has begun.")
    reason: str = Field(description="Why it ended; empty before.")
    starts: int = Field(description="How often it began; more than once only with `rate`.")
    held_seconds: float | None = Field(description="When its condition (`when`) held.")
    started_seconds: float | None
    ended_seconds: float | None
    evidence: FaultEvidence


class Fault(Schema):
    """A fault that was injected; seconds are those of the farm's clock."""

    id: str
    kind: str
    state: RunState = Field(description="Active while it is on any drive, ended once it is on all.")
    spec: dict[str, Any] = Field(description="As it was asked for, in the form of the request.")
    added_seconds: float
    expires_seconds: float | None = Field(description="When its time to live ends unless it is renewed.")
    evidence: FaultEvidence = Field(description="Summed over the drives.")
    drives: dict[str, FaultRun]


class Faults(Schema):
    faults: tuple[Fault, ...]


class ClearedFault(Schema):
    id: str
    kind: str
    drives: list[str]


class Reset(Schema):
    cleared: list[str] = Field(description="Ids of the faults that were cleared.")
    faults: list[ClearedFault] = Field(description="What was cleared, and on which drives.")


class Refusal(Schema):
    drive: str
    why: str = Field(description="Why this drive refuses the fault.")


class Targets(Schema):
    dry_run: bool = Field(description="Always true: nothing was changed.")
    kind: str
    spec: dict[str, Any] = Field(description="The fault as it would be, with the seed that chose the drives.")
    drives: list[str] = Field(description="Drives that it would hit.")
    cannot: list[Refusal] = Field(description="Drives that refuse it: with any of them nothing is injected.")
    left_out: list[str] = Field(description="Drives that match and that share or most leaves out.")


#: An answer, and whether all of it was done: a hub may have shards that are away.
Outcome = tuple[dict[str, Any], bool]


class FaultsHost(Protocol):
    """Who has the faults.  All raise :class:`~pnfarm.web.errors.NotFoundError` for an unknown id."""

    async def reach(self, fields: Mapping[str, Any]) -> dict[str, Any]:
        """Whom a fault would hit; changes nothing."""

    async def inject(self, fields: Mapping[str, Any], at_ns: int) -> Outcome:
        """Begin one at this moment of the host's clock, 0: at once."""

    async def listed(self) -> dict[str, Any]:
        """Those that are pending or active."""

    async def get(self, fault_id: str) -> dict[str, Any]:
        """One, also one that has ended recently."""

    async def renew(self, fault_id: str) -> Outcome:
        """Restart its time to live."""

    async def clear(self, fault_id: str) -> Outcome:
        """End it."""

    async def reset(self) -> Outcome:
        """End all."""


def _answer(outcome: Outcome, done: HTTPStatus = HTTPStatus.OK) -> Json:
    found, whole = outcome
    return Json(found, done if whole else HTTPStatus.MULTI_STATUS)


def add_faults(path: Paths, host: Host, faults: FaultsHost) -> None:
    """Declare them."""

    def note(request: Request, event: type[FaultRequested | FaultCleared], *found: Mapping[str, Any]) -> None:
        names = [shortened(list(one["drives"]), MOST_NAMES) for one in found]
        host.note(*(event(*who(request), one["id"], one["kind"], n) for one, n in zip(found, names, strict=True)))

    @path("GET fault-kinds", FaultKinds)
    async def get_kinds() -> Json:
        """Every kind of fault with its parameters."""
        return Json({"kinds": [kind.as_dict() for kind in fault_kinds().values()]})

    @path("GET faults", Faults)
    async def get_faults() -> Json:
        """Pending and active faults, with their evidence."""
        return Json(await faults.listed())

    @path(
        "POST faults",
        {201: Fault, 200: Targets},
        body=body_of(fault_kinds().schema(), f702={"kind": "f702", "on": "axis-01", "for": "2s"}),
        role=Role.INJECT,
    )
    async def post_fault(
        request: Request,
        *,
        dry_run: bool = False,
        at: At = None,
    ) -> Json:
        """Inject a fault; with dry_run only list the drives that it would hit, and why others cannot."""
        body = await read_object(request)
        if dry_run:
            changes_nothing(request)
            return Json(await faults.reach(body))
        found, whole = await faults.inject(body, start_ns(at, host))
        note(request, FaultRequested, found)
        answer = _answer((found, whole), HTTPStatus.CREATED)
        answer.headers["Location"] = f"{PREFIX}/faults/{quote(found['id'], safe='')}"
        return answer

    @path("GET faults/{fault_id}", Fault)
    async def get_fault(fault_id: str) -> Json:
        """One fault, also one that has ended recently."""
        return Json(await faults.get(fault_id))

    @path("POST faults/{fault_id}/renew", Fault, role=Role.INJECT)
    async def renew_fault(fault_id: str, request: Request) -> Json:
        """Restart a fault's time to live (ttl)."""
        # every few seconds, by a client whose fault has its entry
        changes_nothing(request)
        return _answer(await faults.renew(fault_id))

    @path("DELETE faults/{fault_id}", Fault, role=Role.INJECT)
    async def delete_fault(fault_id: str, request: Request) -> Json:
        """End a fault and return its final evidence."""
        found, whole = await faults.clear(fault_id)
        note(request, FaultCleared, found)
        return _answer((found, whole))

    @path("POST reset", Reset, role=Role.INJECT)
    async def reset(request: Request) -> Json:
        """End every injected fault."""
        found, whole = await faults.reset()
        note(request, FaultCleared, *found["faults"])
        return _answer((found, whole))
