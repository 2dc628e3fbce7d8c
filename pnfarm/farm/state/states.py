"""The saved states of a running farm, for the API and the command line."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

from pnfarm.errors import ConfigError
from pnfarm.farm.events import StateRestored, StateSaved
from pnfarm.farm.state.content import TakenState, check_state, put_state
from pnfarm.farm.state.files import StateFiles
from pnfarm.farm.state.refused import RefusedStateError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from pnfarm.farm.core import FarmCore
    from pnfarm.farm.state.files import KeptState

__all__ = ["SavedStates"]


class SavedStates:
    """``folder``: where their files are, None for a farm without a place for them.

    ``now``: the farm's clock; ``poke``: has its runtime look at a change.
    """

    def __init__(
        self,
        core: FarmCore,
        folder: Path | None,
        now: Callable[[], int],
        poke: Callable[[], object] = lambda: None,
    ) -> None:
        self._core = core
        self._folder = folder
        self._now = now
        self._poke = poke
        #: One save or restore at a time.
        self._busy = asyncio.Lock()

    async def kept(self) -> list[KeptState]:
        """Those that there are; none without a folder."""
        return [] if self._folder is None else await asyncio.to_thread(StateFiles(self._folder).kept)

    async def save(self, name: str) -> list[str]:
        """Save the farm as it is, also over an earlier state; a sentence for whatever is not saved.

        Raises :class:`ConfigError` or :class:`EnvironmentError_`; an earlier state is still there then.
        """
        files = self._files()
        files.path(name)
        async with self._busy:
            taken = TakenState(self._core)
            await asyncio.to_thread(lambda: files.write(name, taken.plain()))
        self._core.log.record(self._now(), "", StateSaved(name))
        return taken.notes

    async def restore(self, name: str, *, only_check: bool = False) -> list[str]:
        """Put the farm into a state; a sentence for whatever is not as it was.

        Raises :class:`UnknownStateError`, :class:`ConfigError` or :class:`EnvironmentError_`; nothing is changed then.
        """
        files = self._files()
        async with self._busy:
            return self._put(name, await asyncio.to_thread(files.read, name), only_check=only_check)

    def restore_at_once(self, name: str, *, only_check: bool = False) -> list[str]:
        """As :meth:`restore`, within one turn of the event loop: for a step of a scenario, in virtual time as well."""
        return self._put(name, self._files().read(name), only_check=only_check)

    def _put(self, name: str, found: Any, *, only_check: bool) -> list[str]:
        try:
            state = check_state(self._core, found)
        except RefusedStateError as exc:
            raise RefusedStateError(f"state {name} cannot be restored: {exc}") from exc
        if only_check:
            return []
        notes = put_state(self._core, state, self._now())
        self._core.log.record(self._now(), "", StateRestored(name))
        self._poke()
        return notes

    async def delete(self, name: str) -> None:
        """Delete a state; raises :class:`UnknownStateError`, :class:`ConfigError` or :class:`EnvironmentError_`."""
        await asyncio.to_thread(self._files().delete, name)

    def _files(self) -> StateFiles:
        if self._folder is None:
            raise ConfigError(
                "the farm has no folder for states: give it `state: FOLDER`, or `pnfarm up --state DIR`; "
                "a database is none"
            )
        return StateFiles(self._folder)
