"""A plant without stations: its models, stepped by hand."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from from_python import called

from pnfarm.config.plant import PlantSection
from pnfarm.engine.columns import allocate
from pnfarm.engine.plant.pace import plant_moment
from pnfarm.engine.plant.step import take_step
from pnfarm.plant.plan import plan_plant
from pnfarm.plant.plant import Plant

if TYPE_CHECKING:
    from pnfarm.station.event import Event

BEGIN_NS = 1_000_000_000


class PlantBench:
    """``models`` and ``wires`` as in a farm file; ``bench["gripper.extended"]`` is a port."""

    def __init__(
        self, *models: dict[str, Any], wires: tuple[str, ...] = (), step: str = "1ms", in_real_time: bool = False
    ) -> None:
        section = PlantSection.model_validate({"step": step, "models": [*models], "wires": [*wires]})
        self.issues: list[str] = []
        plan = plan_plant(section, {}, {}, Path(), lambda at, what, allowed: self.issues.append(f"{at[-1]}: {what}"))
        self.events: list[Event] = []
        self._columns = allocate(images=1)
        #: In real time: when a model was late, and by how much.
        self.late: list[tuple[int, int]] = []
        late = (lambda now, ns: self.late.append((now, ns))) if in_real_time else None
        self._plant = Plant(plan, {}, {}, self._columns, lambda _, event: self.events.append(event), late=late)
        self._step_ns = plan.step_ns
        self._columns.engine[0].plant_step_ns = plan.step_ns
        self.now = BEGIN_NS
        self._plant.python.start(self.now)
        self.fmus = self._plant.fmus
        self.fmus.start(self.now)

    def __getitem__(self, port: str) -> Any:
        model, _, name = port.rpartition(".")
        return self._plant.parts[model].signals.get(name)

    def __setitem__(self, port: str, value: Any) -> None:
        model, _, name = port.rpartition(".")
        self._plant.parts[model].signals.set({name: value})

    def ports(self, model: str) -> tuple[str, ...]:
        """The names of a model's ports."""
        return self._plant.parts[model].signals.names

    def step(self, steps: int = 1) -> None:
        """Steps of the plant, and of models in Python that are due."""
        for _ in range(steps):
            take_step(self._plant.row, self.now)
            self._plant.service(self.now)
            self.now += self._step_ns

    def stand(self, seconds: float) -> None:
        """The machine stands, and the engine's next tick makes up for what it can."""
        self._columns.engine[0].plant_due_ns = self.now
        self.now += round(seconds * 1e9)
        called(plant_moment)(self._columns.engine[0], self.now)

    def start(self, now: int) -> None:
        """As a farm does."""
        self._plant.start(now)

    @property
    def due_ns(self) -> int:
        """When the next step is due."""
        return int(self._columns.engine[0].plant_due_ns)

    def service(self) -> None:
        """What the event loop does when the plant's deadline is due."""
        due = self._plant.next_deadline()
        if due is not None and due <= self.now:
            self._plant.service(self.now)

    def run(self, seconds: float) -> None:
        """As many steps as fit."""
        self.step(round(seconds * 1e9) // self._step_ns)

    def steps_until(self, port: str, value: Any = True, most: int = 100_000) -> int:
        """How many steps it takes until a port has a value."""
        for count in range(1, most):
            self.step()
            if self[port] == value:
                return count
        raise AssertionError(f"{port} did not become {value!r}")
