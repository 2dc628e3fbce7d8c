"""Paths of saved states of the whole farm."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Protocol

from fastapi import Query
from pydantic import Field

from pnfarm.web.bodies import Json, Schema
from pnfarm.web.roles import Role

if TYPE_CHECKING:
    from pnfarm.web.paths import Paths

__all__ = ["SavedState", "SavedStates", "StatesHost", "add_states"]


class SavedState(Schema):
    state: str
    saved: float = Field(description="Seconds since 1970.")
    octets: int


class SavedStates(Schema):
    states: list[SavedState]


class StateAnswer(Schema):
    state: str
    notes: list[str] = Field(description="A sentence for each part that is not saved, or not as it was.")


class StatesHost(Protocol):
    """Who has the states.  All raise :class:`~pnfarm.web.errors.NotFoundError` for an unknown name."""

    async def kept(self) -> dict[str, Any]: ...

    async def save(self, name: str) -> dict[str, Any]: ...

    async def restore(self, name: str, *, check: bool) -> dict[str, Any]:
        """``check``: only find out whether it can be restored."""

    async def delete(self, name: str) -> dict[str, Any]: ...


def add_states(path: Paths, states: StatesHost) -> None:
    """Declare them."""

    @path("GET states", SavedStates)
    async def get_states() -> Json:
        """Every saved state of the farm."""
        return Json(await states.kept())

    @path("PUT states/{name}", StateAnswer, role=Role.ADMIN)
    async def put_state(name: str) -> Json:
        """Save the state of the whole farm under this name; an earlier one is replaced."""
        return Json(await states.save(name))

    @path("POST states/{name}/restore", StateAnswer, role=Role.ADMIN)
    async def post_restore(
        name: str, check: Annotated[bool, Query(description="Only find out whether it can be restored.")] = False
    ) -> Json:
        """Put the whole farm into a saved state; connections are set up again by their controllers."""
        return Json(await states.restore(name, check=check))

    @path("DELETE states/{name}", StateAnswer, role=Role.ADMIN)
    async def delete_state(name: str) -> Json:
        """Delete a saved state."""
        return Json(await states.delete(name))
