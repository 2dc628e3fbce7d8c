"""Models in Python: each stepped at its own time, between the values of its ports.

No clock and no task of its own: :meth:`PythonModels.service` makes the steps that are due in virtual time, with the
farm's deadlines; in real time a thread of their own makes the calls of :meth:`PythonModels.work`.
A model that raises, or does not return, is not called again; its outputs stay.
"""

from __future__ import annotations

import math
import threading
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from pnfarm.errors import ConfigError
from pnfarm.plant.events import PlantModelFailed, PlantModelLate
from pnfarm.plant.python_file import ModelClass
from pnfarm.plant.python_state import check_state, put_state, state_of
from pnfarm.user_code.caller import Caller
from pnfarm.user_code.calling_thread import Call
from pnfarm.user_code.file import error_text, place_of, placed
from pnfarm.vocabulary.quoting import shortened

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from pnfarm.behaviours.declaration import Port
    from pnfarm.plant.plan import PlannedModel
    from pnfarm.station.event import Event
    from pnfarm.user_code.thread import Work

__all__ = ["PythonModels", "is_reported"]

_T = TypeVar("_T")

#: Longest call.
LIMIT_NS = 1_000_000_000
#: The first step that is too slow is reported, and then each that multiplies their number by this.
REPORTED_AGAIN = 10


class _Model:
    def __init__(self, planned: PlannedModel, values: Any) -> None:
        what = planned.what
        assert isinstance(what, ModelClass)
        self.name = planned.name
        self.file = what.path
        self.step_ns = planned.step_ns
        try:
            self.model = what.kind(**planned.parameters)
        except Exception as exc:
            raise ConfigError(f"plant model {planned.name} cannot be made: {placed(exc, what.module)}") from exc
        # gives and takes numbers of Python's own, in half of the time that an array needs
        self._values: Any = memoryview(values)
        self._numbers = [(port.name, at) for port, at in planned.inputs.values() if port.form != "bit"]
        self._bits = [(port.name, at) for port, at in planned.inputs.values() if port.form == "bit"]
        self._outputs = [(port, at) for port, at in planned.outputs.values()]
        try:
            for port, at in planned.outputs.values():
                if not hasattr(self.model, port.name):
                    setattr(self.model, port.name, False if port.form == "bit" else 0.0)
                self._values[at] = _number(port, getattr(self.model, port.name))
        except Exception as exc:
            raise ConfigError(f"plant model {planned.name} cannot be made: {self.file}: {error_text(exc)}") from exc
        self.due_ns = 0
        self.last_ns = 0
        self.missed = 0
        self.reported = 0
        self.steps = 0
        self.longest_ns = 0
        self.failure = ""

    def step(self, seconds: float) -> None:
        """Inputs to attributes, the user's step, attributes to outputs: all of them, or none."""
        values, model = self._values, self.model
        for name, at in self._numbers:
            setattr(model, name, values[at])
        for name, at in self._bits:
            setattr(model, name, values[at] != 0.0)
        model.step(seconds)
        found = [(at, _number(port, getattr(model, port.name))) for port, at in self._outputs]
        for at, value in found:
            values[at] = value


def _number(port: Port, value: Any) -> float:
    """What a model made of an output, as a finite number, of a bit as 0 or 1; raises ValueError."""
    if isinstance(value, (int, float, np.number, np.bool_)) and math.isfinite(value):
        return float(value) if port.form != "bit" else 1.0 if value else 0.0
    raise ValueError(f"{port.name} is {value!r}, not a finite number")


class PythonModels:
    """``note`` records an event, ``now`` first.

    ``late(now, ns)``: in real time, takes how late a step was; None in virtual time.
    """

    limit_ns = LIMIT_NS

    def __init__(
        self,
        models: Iterable[PlannedModel],
        values: Any,
        note: Callable[[int, Event], object],
        *,
        late: Callable[[int, int], object] | None = None,
    ) -> None:
        self._models = [_Model(one, values) for one in models]
        self._note = note
        self._late = late
        self._caller = Caller()
        #: Who calls models: their thread, or who saves or restores them.
        self._calling = threading.Lock()

    def __len__(self) -> int:
        return len(self._models)

    def start(self, now: int) -> None:
        """The first step of each is a step from now.

        In real time its grid is that of its step, as the engine's is: the thread wakes when the engine does, which
        costs less than a wake-up of its own.
        """
        for model in self._models:
            model.last_ns = now
            model.due_ns = now + model.step_ns - (0 if self._late is None else now % model.step_ns)

    def next_deadline(self) -> int | None:
        return min((model.due_ns for model in self._models if not model.failure), default=None)

    def service(self, now: int) -> None:
        """Make the steps that are due."""
        for call in self.work(now):
            self._caller.run(call, self.limit_ns)

    def work(self, now: int) -> Work:
        with self._calling:
            for model in self._models:
                if model.due_ns <= now and not model.failure:
                    yield (call := Call(partial(model.step, (now - model.last_ns) / 1e9)))
                    self._done(model, call, now)

    def states(self) -> tuple[dict[str, Any], list[str]]:
        """The state of each by name, and a sentence for whatever is not in it.  Raises :class:`ConfigError`."""
        found: dict[str, Any] = {}
        sentences: list[str] = []
        for model in self._models:
            state, left_out = self._called(model, "saved", partial(state_of, model.model))
            found[model.name] = state
            if left_out:
                sentences.append(f"{model.name}: {shortened(left_out)} of {model.file.name} cannot be saved")
        return found, sentences

    def check_states(self, states: Any) -> None:
        """Whether :meth:`put_states` takes these; raises :class:`ConfigError`."""
        if not isinstance(states, dict) or states.keys() != {model.name for model in self._models}:
            raise ConfigError("the models in Python are others")
        for model in self._models:
            try:
                check_state(model.model, states[model.name])
            except ConfigError as exc:
                raise ConfigError(f"plant model {model.name}: {exc}") from exc

    def put_states(self, states: Mapping[str, Any], now: int) -> None:
        """Put back what :meth:`states` gave, of all or of none.  Raises :class:`ConfigError`."""
        before, _ = self.states()
        for number, model in enumerate(self._models):
            try:
                self._called(model, "restored", partial(put_state, model.model, states[model.name]))
            except ConfigError:
                for earlier in self._models[:number]:
                    self._called(earlier, "restored", partial(put_state, earlier.model, before[earlier.name]))
                raise
        for model in self._models:
            model.failure = ""
        self.start(now)

    def _called(self, model: _Model, what: str, action: Callable[[], _T]) -> _T:
        """The result of a model's own code; raises :class:`ConfigError`."""
        found: list[_T] = []
        call = Call(lambda: found.append(action()))
        if not self._calling.acquire(timeout=LIMIT_NS / 1e9):
            raise ConfigError(f"plant model {model.name} cannot be {what}: it is busy")
        try:
            self._caller.run(call, LIMIT_NS)
        finally:
            self._calling.release()
        if call.duration_ns is None or call.error is not None:
            why = error_text(call.error) if call.error is not None else f"no return within {LIMIT_NS / 1e9:g} s"
            raise ConfigError(f"plant model {model.name} cannot be {what}: {why}")
        return found[0]

    def close(self) -> None:
        """End the threads of the models."""
        self._caller.close()

    def snapshot(self) -> dict[str, dict[str, Any]]:
        """How far each is, by name."""
        return {
            model.name: {
                "steps": model.steps,
                "missed_steps": model.missed,
                "longest_seconds": model.longest_ns / 1e9,
                "failure": model.failure,
            }
            for model in self._models
        }

    def _done(self, model: _Model, call: Call, now: int) -> None:
        model.steps += 1
        model.last_ns = now
        model.due_ns += model.step_ns
        if call.duration_ns is None:
            self._fail(model, f"no return within {LIMIT_NS / 1e9:g} s", str(model.file), 0, now)
        elif call.error is not None:
            file, line = place_of(call.error, str(model.file))
            self._fail(model, error_text(call.error), file, line, now)
        elif self._late is not None:
            self._late(now, now + call.duration_ns - (model.due_ns - model.step_ns))
            model.longest_ns = max(model.longest_ns, call.duration_ns)
            if model.due_ns <= now:
                # it was late by whole steps, its own or the machine's: they are left out
                missed = (now - model.due_ns) // model.step_ns + 1
                model.due_ns += missed * model.step_ns
                model.missed += missed
            if call.duration_ns > model.step_ns:
                model.reported += 1
                if is_reported(model.reported):
                    self._note(
                        now,
                        PlantModelLate(model.name, call.duration_ns / 1e9, model.step_ns / 1e9, model.missed),
                    )

    def _fail(self, model: _Model, error: str, file: str, line: int, now: int) -> None:
        model.failure = error
        self._note(now, PlantModelFailed(model.name, error, file, line))


def is_reported(count: int) -> bool:
    """Whether this late step is: the first, the tenth, the hundredth ..."""
    while count % REPORTED_AGAIN == 0:
        count //= REPORTED_AGAIN
    return count == 1
