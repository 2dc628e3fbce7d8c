"""The saved states of one farm."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.farm.state.files import UnknownStateError
from pnfarm.web.errors import NotFoundError

if TYPE_CHECKING:
    from pnfarm.farm.state.states import SavedStates

__all__ = ["FarmStates"]


class FarmStates:
    """As :class:`~pnfarm.api.paths.states.StatesHost`."""

    def __init__(self, states: SavedStates) -> None:
        self._states = states

    async def kept(self) -> dict[str, Any]:
        found = await self._states.kept()
        return {"states": [{"state": one.name, "saved": one.saved_s, "octets": one.octets} for one in found]}

    async def save(self, name: str) -> dict[str, Any]:
        return {"state": name, "notes": await self._states.save(name)}

    async def restore(self, name: str, *, check: bool) -> dict[str, Any]:
        try:
            return {"state": name, "notes": await self._states.restore(name, only_check=check)}
        except UnknownStateError as exc:
            raise NotFoundError(str(exc)) from exc

    async def delete(self, name: str) -> dict[str, Any]:
        try:
            await self._states.delete(name)
        except UnknownStateError as exc:
            raise NotFoundError(str(exc)) from exc
        return {"state": name, "notes": []}
