"""The FMUs of a plant, each stepped at its own time by its own process, between the values of its ports.

At each of its times an FMU gets its inputs and begins a step to the next one, where its outputs are taken.  In virtual
time the farm waits there for the step's end; in real time it never waits: outputs that are late stay as they are.
No clock and no task of its own, as :class:`pnfarm.plant.python_models.PythonModels`.
"""

from __future__ import annotations

import base64
import contextlib
import threading
import time
from typing import TYPE_CHECKING, Any

import numpy as np

from pnfarm.errors import ConfigError
from pnfarm.plant.events import PlantModelFailed, PlantModelLate
from pnfarm.plant.fmi.memory import MAX_STATE, RESTORE, SAVE
from pnfarm.plant.fmi.planned import FmuModel
from pnfarm.plant.fmi.process import PATIENCE_SECONDS, FmuFailure, FmuProcess, FmuRefusal
from pnfarm.plant.python_models import is_reported

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from pnfarm.plant.plan import PlannedModel
    from pnfarm.station.event import Event
    from pnfarm.user_code.thread import Work

__all__ = ["FmuModels"]

#: Longest start, longest step, longest saving and restoring of an FMU.
START_NS, STEP_NS, STATE_NS = 60_000_000_000, 10_000_000_000, 10_000_000_000
#: Who saves or restores in real time waits so long for the end of a step.
BUSY_NS = 1_000_000_000
#: Longest time of an FMU in a state.
LONGEST_NS = 10**18
#: Most steps in one that makes up for those that were left out.
MADE_UP = 10


class _Fmu:
    """``values`` are those of all ports; the inputs there get the start values of the description."""

    def __init__(self, planned: PlannedModel, values: Any) -> None:
        assert isinstance(planned.what, FmuModel)
        self.name, self.what, self.step_ns = planned.name, planned.what, planned.step_ns
        self._values = values
        self._inputs = np.array([number for _, number in planned.inputs.values()], dtype=np.intp)
        self._outputs = np.array([number for _, number in planned.outputs.values()], dtype=np.intp)
        self._on_failure = {planned.outputs[name][1]: value for name, value in planned.what.on_failure.items()}
        starts = [one.start_value for one in planned.what.description.of("input")]
        values[self._inputs] = starts
        self.process = FmuProcess(planned.name, planned.what, starts)
        self.due_ns = 0
        #: When the step that it is in was to end.
        self.wanted_ns = 0
        #: Its own time, and how far that is behind the farm's.
        self.time_ns = 0
        self.behind_ns = 0
        self.steps = self.missed = self.reported = self.longest_ns = 0
        self.failure = ""

    def take(self) -> None:
        """Outputs to the values, all or none; raises :class:`FmuFailure`."""
        found = self.process.outputs
        wrong = np.flatnonzero(~np.isfinite(found))
        if wrong.size:
            port = self.what.outputs[int(wrong[0])].name
            raise FmuFailure(f"{port} is {float(found[wrong[0]])}, not a finite number")
        self._values[self._outputs] = found

    def begin(self) -> None:
        """Begin the step to the next time, longer where steps were left out and the FMU can vary them."""
        made_up = min(self.behind_ns, (MADE_UP - 1) * self.step_ns) if self.what.description.varies_steps else 0
        # what is not made up for is left out for good
        self.behind_ns = 0
        self.process.inputs[:] = self._values[self._inputs]
        self.process.ask_step(self.time_ns, self.step_ns + made_up)
        self.time_ns += self.step_ns + made_up
        self.due_ns += self.step_ns
        self.wanted_ns = self.due_ns

    def leave_out(self, now: int) -> None:
        """The steps that are over at ``now``, none of which began."""
        count = max(0, (now - self.due_ns) // self.step_ns + 1)
        self.due_ns += count * self.step_ns
        self.behind_ns += count * self.step_ns
        self.missed += count

    def fail(self, text: str) -> None:
        """End its process; the outputs hold, or get the values of the farm file."""
        self.failure = text
        self.process.kill()
        for number, value in self._on_failure.items():
            self._values[number] = value


class FmuModels:
    """``note`` records an event, ``now`` first.  Raises :class:`ConfigError` where an FMU cannot be made.

    ``late(now, ns)``: in real time, takes how late a step was; None in virtual time.
    """

    limit_ns = STEP_NS

    def __init__(
        self,
        models: Iterable[PlannedModel],
        values: Any,
        note: Callable[[int, Event], object],
        *,
        late: Callable[[int, int], object] | None = None,
    ) -> None:
        self._note = note
        self._late = late
        self._fmus: list[_Fmu] = []
        #: Who asks the FMUs: their thread, or who saves or restores them.
        self._turning = threading.Lock()
        try:
            # all of them start at the same time
            for one in models:
                self._fmus.append(_Fmu(one, values))
            for fmu in self._fmus:
                _make(fmu)
        except BaseException:
            self.close()
            raise

    def __len__(self) -> int:
        return len(self._fmus)

    def start(self, now: int) -> None:
        """The first step of each is from now on."""
        for fmu in self._fmus:
            fmu.due_ns = now
            fmu.begin()

    def next_deadline(self) -> int | None:
        return min((fmu.due_ns for fmu in self._fmus if not fmu.failure), default=None)

    def service(self, now: int) -> None:
        """Take the outputs that are due, and begin the next steps."""
        with self._turning:
            for fmu in self._fmus:
                if not fmu.failure and fmu.due_ns <= now:
                    try:
                        self._turn(fmu, now)
                    except FmuFailure as failure:
                        self._failed(fmu, failure, now)

    def work(self, now: int) -> Work:
        """In a thread of their own: the same, without a call in this process."""
        self.service(now)
        return iter(())

    def _failed(self, fmu: _Fmu, failure: FmuFailure, now: int) -> None:
        fmu.fail(str(failure))
        self._note(now, PlantModelFailed(fmu.name, fmu.failure, str(fmu.what.path), 0))

    def _turn(self, fmu: _Fmu, now: int) -> None:
        began = fmu.process.asked_ns
        last = fmu.process.answer(STEP_NS if self._late is None else 0)
        if last is None:
            if self._late is None or time.perf_counter_ns() - began >= STEP_NS:
                raise FmuFailure(f"a step did not end within {STEP_NS / 1e9:g} s")
            fmu.leave_out(now)
            return
        fmu.take()
        fmu.steps += 1
        if last:
            raise FmuFailure(last.decode())
        if self._late is not None:
            self._late(now, now - fmu.wanted_ns)
            took = fmu.process.took_ns
            fmu.longest_ns = max(fmu.longest_ns, took)
            if took > fmu.step_ns:
                fmu.reported += 1
                if is_reported(fmu.reported):
                    self._note(now, PlantModelLate(fmu.name, took / 1e9, fmu.step_ns / 1e9, fmu.missed))
            # the machine's own lateness, by whole steps
            fmu.leave_out(now - fmu.step_ns)
        fmu.begin()

    def close(self) -> None:
        """End their processes, each after the step that it is in."""
        until = time.monotonic() + PATIENCE_SECONDS
        for fmu in self._fmus:
            fmu.process.ask_to_end(round(max(0.0, until - time.monotonic()) * 1e9))
        for fmu in self._fmus:
            fmu.process.close(max(0.0, until - time.monotonic()))

    def snapshot(self) -> dict[str, dict[str, Any]]:
        """How far each is, by name."""
        return {
            fmu.name: {
                "steps": fmu.steps,
                "missed_steps": fmu.missed,
                "longest_seconds": fmu.longest_ns / 1e9,
                "failure": fmu.failure,
            }
            for fmu in self._fmus
        }

    # -- state

    def states(self, now: int) -> tuple[dict[str, Any], list[str]]:
        """By name, at the ends of the steps that they are in, for which it waits; and what is not saved, in sentences.

        None: of an FMU that has failed, or that cannot save its state.
        """
        found: dict[str, Any] = {}
        sentences = []
        with self._turning:
            for fmu in self._fmus:
                found[fmu.name] = None
                try:
                    octets = self._asked(fmu, SAVE, now)
                except FmuRefusal as refusal:
                    sentences.append(f"{fmu.name}: the inner state of its FMU is not saved: {refusal}")
                    continue
                found[fmu.name] = {
                    "token": fmu.what.description.token,
                    "state": base64.b64encode(octets).decode(),
                    "time_ns": fmu.time_ns,
                    "remaining_ns": min(max(fmu.due_ns - now, 0), fmu.step_ns),
                }
        return found, sentences

    def check_states(self, states: Any) -> None:
        """Whether these are what :meth:`states` gave of such FMUs; raises :class:`ConfigError`."""
        if not isinstance(states, dict) or states.keys() != {fmu.name for fmu in self._fmus}:
            raise ConfigError("the FMUs are others")
        for fmu in self._fmus:
            one = states[fmu.name]
            if one is None:
                continue
            if not isinstance(one, dict) or one.keys() != {"token", "state", "time_ns", "remaining_ns"}:
                raise ConfigError(f"plant model {fmu.name} has no state of an FMU")
            if one["token"] != fmu.what.description.token:
                raise ConfigError(f"plant model {fmu.name} has the state of another FMU")
            times = (("time_ns", LONGEST_NS), ("remaining_ns", fmu.step_ns))
            if any(type(one[key]) is not int or not 0 <= one[key] <= most for key, most in times):
                raise ConfigError(f"plant model {fmu.name} has a time that it cannot have")
            if not isinstance(one["state"], str) or _octets_of(one["state"]) is None:
                raise ConfigError(f"plant model {fmu.name} has a state that is not in base64")

    def put_states(self, states: Mapping[str, Any], now: int) -> list[str]:
        """Put back what :meth:`check_states` accepted; a sentence for each FMU that goes on as it is."""
        sentences = []
        with self._turning:
            for fmu in self._fmus:
                one = states[fmu.name]
                try:
                    if one is None:
                        raise FmuRefusal("it was not saved")
                    self._asked(fmu, RESTORE + (_octets_of(one["state"]) or b""), now)
                except FmuRefusal as refusal:
                    sentences.append(f"{fmu.name}: the inner state of its FMU continues: {refusal}")
                    continue
                fmu.time_ns, fmu.behind_ns = one["time_ns"], 0
                fmu.due_ns = fmu.wanted_ns = now + one["remaining_ns"]
        return sentences

    def _asked(self, fmu: _Fmu, order: bytes, now: int) -> bytes:
        """Between two steps, whose outputs are taken when they are due; raises :class:`FmuRefusal`."""
        if fmu.failure:
            raise FmuRefusal("it has failed")
        if not fmu.what.description.saves_state:
            raise FmuRefusal("it cannot save its state")
        if len(order) > MAX_STATE:
            raise FmuRefusal(f"its state has more than {MAX_STATE} octets")
        limit_ns = STEP_NS if self._late is None else BUSY_NS
        try:
            last = fmu.process.answer(limit_ns)
            if last is None:
                raise FmuRefusal(f"it is in a step of more than {limit_ns / 1e9:g} s")
            if last:
                raise FmuFailure(last.decode())
            fmu.process.ask(order)
            found = fmu.process.answer(STATE_NS)
            if found is None:
                raise FmuFailure(f"no answer about its state within {STATE_NS / 1e9:g} s")
        except FmuFailure as failure:
            self._failed(fmu, failure, now)
            raise FmuRefusal(f"it has failed: {failure}") from failure
        return found


def _octets_of(text: str) -> bytes | None:
    with contextlib.suppress(ValueError):
        return base64.b64decode(text, validate=True)
    return None


def _make(fmu: _Fmu) -> None:
    try:
        if fmu.process.answer(START_NS) is None:
            raise FmuFailure(f"it did not start within {START_NS / 1e9:g} s")
        fmu.take()
    except FmuFailure as failure:
        raise ConfigError(f"plant model {fmu.name} cannot be made: {fmu.what.path}: {failure}") from failure
