"""The scenarios of a running farm, or of a hub: a bounded number at work, the last ones kept with their records."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from pnfarm.buses.registry import fault_kinds
from pnfarm.errors import ConfigError
from pnfarm.scenario.definition.binding import bind_scenario
from pnfarm.scenario.definition.file import parse_scenario
from pnfarm.scenario.lateness import FarmLateness
from pnfarm.scenario.realtime import carry_out
from pnfarm.scenario.run import ScenarioRun
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Coroutine, Mapping, Sequence

    from pnfarm.drives.description.model import Model
    from pnfarm.farm.core import FarmCore
    from pnfarm.metrics import FarmCollector
    from pnfarm.scenario.definition.binding import Binding
    from pnfarm.scenario.flow import Flow
    from pnfarm.signals.signal import Signal

__all__ = ["BarredStepError", "KeptScenarios", "RunningScenario", "RunningScenarios"]

#: Scenarios at work at once, and those kept altogether.
MOST_AT_WORK = 4
MOST_KEPT = 32
#: The same of those that are parts of a scenario that a hub carries out: one for each of its waits and expectations.
MOST_PARTS_AT_WORK = 32
MOST_PARTS_KEPT = 64


@dataclass(slots=True)
class RunningScenario:
    """One scenario; ``task`` carries it out."""

    id: str
    run: Flow
    task: asyncio.Task[None]
    part: bool = False

    @property
    def failure(self) -> BaseException | None:
        """What broke the run itself, if anything did."""
        return self.task.exception() if self.task.done() and not self.task.cancelled() else None

    def as_dict(self) -> dict[str, Any]:
        """For JSON: the record so far."""
        return {"id": self.id, **self.run.record.as_dict()}

    def progress(self, first: int, now: int) -> dict[str, Any]:
        """How far it is, with the cases that ended, from the ``first`` on in the order in which they ended."""
        run, record = self.run, self.run.record
        return {
            **self.summary(),
            "step": run.step,
            "steps_begun": run.steps_begun,
            "steps": run.steps,
            "left_seconds": max(0, run.due_ns - now) / 1e9,
            "cases": [case.as_dict(record.origin_ns) for case in record.cases[first:]],
        }

    def summary(self) -> dict[str, Any]:
        """The same without cases and timeline."""
        return {"id": self.id, **self.run.record.summary()}


class BarredStepError(ConfigError):
    """A scenario has a step that the one who starts it may not take."""


class KeptScenarios(ABC):
    """What is carried out, by a farm or by a hub: ``now`` is its clock."""

    #: Who carries them out, and whose keys cannot be set any more.
    WHO: ClassVar[str]
    RUNNING: ClassVar[str]

    def __init__(self, now: Callable[[], int]) -> None:
        self._now = now
        self._kept: dict[str, RunningScenario] = {}
        self._numbers = 0

    @abstractmethod
    def _drives(self) -> Mapping[str, Model]:
        """The models of all drives by name."""

    def _devices(self) -> Mapping[str, Mapping[str, Signal]] | None:
        """The signals of all devices by name; None where they are not known."""
        return None

    @abstractmethod
    def _models(self) -> Mapping[str, Sequence[str]]:
        """What the models of all devices are called, by the devices' names."""

    @abstractmethod
    def _begin(self, binding: Binding, at_ns: int, *, part: bool) -> tuple[Flow, Coroutine[Any, Any, None]]:
        """A run that begins at this moment, and what carries it out."""

    def start(
        self,
        text: str,
        variables: Mapping[str, Any] | None = None,
        *,
        part: bool = False,
        barred: Collection[str] = (),
        at_ns: int = 0,
    ) -> RunningScenario:
        """Check a scenario against the drives and begin it, at this moment or at once.  Raises :class:`ConfigError`.

        ``part``: of one that a hub carries out on several farms: it makes no traces, and is not listed.  ``barred``:
        kinds of steps that it must not have (:class:`BarredStepError`).
        """
        scenario = parse_scenario(text, variables=variables)
        for step in scenario.every_step():
            if step.kind in barred:
                raise BarredStepError(f"line {step.line}: who starts this scenario may not `{step.kind}`")
        if scenario.overrides:
            raise ConfigError(f"with: sets keys of a farm file, and {self.RUNNING} already; leave it out")
        binding = bind_scenario(scenario, self._drives(), fault_kinds(), self._devices(), self._models())
        at_work = [found.id for found in self._kept.values() if not found.run.finished and found.part is part]
        if len(at_work) >= (MOST_PARTS_AT_WORK if part else MOST_AT_WORK):
            raise ConfigError(f"{len(at_work)} scenarios are at work ({', '.join(at_work)}); end one of them first")
        run, work = self._begin(binding, at_ns or self._now(), part=part)
        self._numbers += 1
        task = asyncio.get_running_loop().create_task(work)
        found = RunningScenario(f"{'part' if part else 'scenario'}-{self._numbers}", run, task, part)
        self._kept[found.id] = found
        alike = [old for old in self._kept.values() if old.part is part]
        more = max(0, len(alike) - (MOST_PARTS_KEPT if part else MOST_KEPT))
        for old in [old.id for old in alike if old.run.finished][:more]:
            del self._kept[old]
        return found

    def list(self) -> list[RunningScenario]:
        """Those at work and those kept, oldest first."""
        return [found for found in self._kept.values() if not found.part]

    def get(self, wanted: str) -> RunningScenario:
        """Raises :class:`ConfigError` for an unknown id."""
        if wanted not in self._kept:
            known = ", ".join(self._kept) or "none"
            raise ConfigError(f"there is no scenario {shown(wanted)}; there are {known}")
        return self._kept[wanted]

    def cancel(self, wanted: str) -> RunningScenario:
        """End one; its faults are cleared.  Raises :class:`ConfigError` for an unknown id."""
        found = self.get(wanted)
        found.run.cancel(self._now())
        return found

    def close(self) -> None:
        """End all of them: who carries them out stops."""
        for found in self._kept.values():
            found.run.cancel(self._now(), f"the {self.WHO} stopped", broken=True)


class RunningScenarios(KeptScenarios):
    """Those of a farm; ``poke`` makes its runtime send what a step put in force."""

    WHO = "farm"
    RUNNING = "this farm runs"

    def __init__(
        self, core: FarmCore, collector: FarmCollector, now: Callable[[], int], poke: Callable[[], None]
    ) -> None:
        super().__init__(now)
        self._core = core
        self._collector = collector
        self._poke = poke

    def _drives(self) -> Mapping[str, Model]:
        return {station.configured_name: station.model for station in self._core.axes}

    def _devices(self) -> Mapping[str, Mapping[str, Signal]] | None:
        return self._core.signals()

    def _models(self) -> Mapping[str, Sequence[str]]:
        return {name: device.kinds for name, device in self._core.signal_owners.items()}

    def _begin(self, binding: Binding, at_ns: int, *, part: bool) -> tuple[Flow, Coroutine[Any, Any, None]]:
        lateness = FarmLateness(self._core, binding.scenario.budget_ns, self._now())
        run = ScenarioRun(binding, self._core, self._collector, at_ns, lateness=lateness, traced=not part)
        return run, carry_out(run, self._core, self._poke, self._now)

    def cancel(self, wanted: str) -> RunningScenario:
        found = super().cancel(wanted)
        found.task.cancel()
        self._poke()
        return found

    def close(self) -> None:
        super().close()
        for found in self._kept.values():
            found.task.cancel()
