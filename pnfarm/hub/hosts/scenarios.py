"""The scenarios that a hub carries out."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

from pnfarm.drives.catalogue import model as model_by_name
from pnfarm.hub.scenario import HubRun
from pnfarm.scenario.running import KeptScenarios, RunningScenario

if TYPE_CHECKING:
    from collections.abc import Collection, Coroutine, Mapping, Sequence

    from pnfarm.drives.description.model import Model
    from pnfarm.hub.hosts.faults import HubFaults
    from pnfarm.hub.hub import Hub
    from pnfarm.scenario.definition.binding import Binding
    from pnfarm.scenario.flow import Flow

__all__ = ["HubScenarios"]

#: Longest pause between two checks, s.
PAUSE_SECONDS = 0.2


class HubScenarios(KeptScenarios):
    """Over the drives of all shards."""

    WHO = "hub"
    RUNNING = "these farms run"

    def __init__(self, hub: Hub, faults: HubFaults) -> None:
        super().__init__(hub.now)
        self._hub = hub
        self._faults = faults

    def start(
        self,
        text: str,
        variables: Mapping[str, Any] | None = None,
        *,
        part: bool = False,
        barred: Collection[str] = (),
        at_ns: int = 0,
    ) -> RunningScenario:
        self._hub.check_any()
        return super().start(text, variables, part=part, barred=barred, at_ns=at_ns)

    def _drives(self) -> Mapping[str, Model]:
        return {name: model_by_name(str(view["model"])) for name, view in self._hub.shards.views.items()}

    def _models(self) -> Mapping[str, Sequence[str]]:
        return self._hub.shards.devices

    def _begin(self, binding: Binding, at_ns: int, *, part: bool) -> tuple[Flow, Coroutine[Any, Any, None]]:
        del part
        run = HubRun(binding, self._hub, self._faults, at_ns)
        return run, self._carry_out(run)

    async def _carry_out(self, run: HubRun) -> None:
        """Until it has ended, with its faults cleared."""
        hub = self._hub
        while not run.finished:
            run.wake.clear()
            due = run.advance(hub.now())
            pause = min((due - hub.now()) / 1e9, PAUSE_SECONDS)
            if pause > 0 and not run.finished:
                try:
                    await asyncio.wait_for(run.wake.wait(), pause)
                except TimeoutError:
                    continue
            else:
                await asyncio.sleep(0)
