"""The scenarios that a hub carries out: a bounded number at work, the last ones kept with their records."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

from pnfarm.buses.registry import fault_kinds
from pnfarm.drives.catalogue import model as model_by_name
from pnfarm.errors import ConfigError
from pnfarm.hub.scenario import HubRun
from pnfarm.scenario.definition.binding import bind_scenario
from pnfarm.scenario.definition.file import parse_scenario
from pnfarm.scenario.running import MOST_AT_WORK, MOST_KEPT, RunningScenario
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.hub.faults import HubFaults
    from pnfarm.hub.hub import Hub

__all__ = ["HubScenarios"]

#: Longest pause between two looks, s.
PAUSE_SECONDS = 0.2


class HubScenarios:
    """As :class:`pnfarm.scenario.running.RunningScenarios`."""

    def __init__(self, hub: Hub, faults: HubFaults) -> None:
        self._hub = hub
        self._faults = faults
        self._kept: dict[str, RunningScenario] = {}
        self._numbers = 0
        hub.on_close.append(self.close)

    def start(self, text: str, variables: Mapping[str, Any] | None = None, *, part: bool = False) -> RunningScenario:
        """Check a scenario against the drives of all shards and begin it.  Raises :class:`ConfigError`."""
        hub = self._hub
        if part:
            raise ConfigError("part: is what a hub asks of a farm, and this is a hub; leave it out")
        hub.check_any()
        scenario = parse_scenario(text, variables=variables)
        if scenario.overrides:
            raise ConfigError("with: sets keys of a farm file, and these farms run already; leave it out")
        drives = {}
        for name in hub.shards.names:
            view = next(shard.drives[name] for shard in hub.shards if name in shard.drives)
            drives[name] = model_by_name(str(view["model"]))
        binding = bind_scenario(scenario, drives, fault_kinds())
        at_work = [found.id for found in self._kept.values() if not found.run.finished]
        if len(at_work) >= MOST_AT_WORK:
            raise ConfigError(f"{len(at_work)} scenarios are at work ({', '.join(at_work)}); end one of them first")
        run = HubRun(binding, hub, self._faults, hub.now())
        self._numbers += 1
        task = asyncio.get_running_loop().create_task(self._carry_out(run))
        found = RunningScenario(f"scenario-{self._numbers}", run, task)
        self._kept[found.id] = found
        for old in [one.id for one in self._kept.values() if one.run.finished][: max(0, len(self._kept) - MOST_KEPT)]:
            del self._kept[old]
        return found

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

    def list(self) -> list[RunningScenario]:
        """Those at work and those kept, oldest first."""
        return list(self._kept.values())

    def get(self, wanted: str) -> RunningScenario:
        """Raises :class:`ConfigError` for an unknown id."""
        if wanted not in self._kept:
            known = ", ".join(self._kept) or "none"
            raise ConfigError(f"there is no scenario {shown(wanted)}; there are {known}")
        return self._kept[wanted]

    def cancel(self, wanted: str) -> RunningScenario:
        """End one; its faults are cleared within seconds.  Raises :class:`ConfigError` for an unknown id."""
        found = self.get(wanted)
        found.run.cancel(self._hub.now())
        return found

    def close(self) -> None:
        """End all of them: the hub stops."""
        for found in self._kept.values():
            found.run.cancel(self._hub.now(), "the hub stopped", broken=True)
