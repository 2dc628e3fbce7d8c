"""The injections of one farm."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.web.errors import NotFoundError, named_by_path

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.api.context import ApiContext
    from pnfarm.api.paths.faults import Outcome

__all__ = ["FarmFaults"]


class FarmFaults:
    """As :class:`~pnfarm.api.paths.faults.FaultsHost`; the farm always does all of it."""

    def __init__(self, context: ApiContext) -> None:
        self._context = context
        self._manager = context.core.injections

    async def reach(self, fields: Mapping[str, Any]) -> dict[str, Any]:
        return self._manager.reach(fields).as_dict()

    async def inject(self, fields: Mapping[str, Any], at_ns: int) -> Outcome:
        return self._manager.inject(fields, self._context.now(), at_ns=at_ns).as_dict(), True

    async def listed(self) -> dict[str, Any]:
        return {"faults": [injection.as_dict() for injection in self._manager.list()]}

    async def get(self, fault_id: str) -> dict[str, Any]:
        with named_by_path():
            return self._manager.get(fault_id).as_dict()

    async def renew(self, fault_id: str) -> Outcome:
        if all(injection.id != fault_id for injection in self._manager.list()):
            # as for an unknown one: its client is to begin it again
            raise NotFoundError(f"the fault {fault_id!r} is not in force, so that nothing can be renewed")
        injection = self._manager.renew(fault_id, self._context.now())
        self._context.poke()
        return injection.as_dict(), True

    async def clear(self, fault_id: str) -> Outcome:
        with named_by_path():
            (injection,) = self._manager.clear(fault_id, self._context.now())
        return injection.as_dict(), True

    async def reset(self) -> Outcome:
        cleared = self._manager.clear(None, self._context.now())
        faults = [{"id": one.id, "kind": one.spec.kind.name, "drives": list(one.drives)} for one in cleared]
        return {"cleared": [one.id for one in cleared], "faults": faults}, True
