"""The plant of a farm file, checked: its models with their ports, and where each wire begins and ends.

Every port has the number of its value; the signals of stations that wires read have theirs after the ports, and the
ends of wires at stations come last.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeAlias

from pnfarm.behaviours.catalogue import BEHAVIOURS
from pnfarm.behaviours.couplings import COUPLED
from pnfarm.behaviours.declaration import Port
from pnfarm.plant.axis_ports import TAKEN
from pnfarm.plant.coupling_kinds import COUPLINGS
from pnfarm.plant.fmi.planned import FmuModel, plan_fmu
from pnfarm.plant.parameters import read_parameters
from pnfarm.plant.python_file import PlantFileError, load_model
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quantities import in_unit
from pnfarm.vocabulary.quoting import did_you_mean, shortened, shown
from pnfarm.vocabulary.regular_file import beside

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pnfarm.behaviours.declaration import Behaviour
    from pnfarm.config.plant import PlantModel, PlantSection, WireText
    from pnfarm.plant.axis_ports import PlantAxis
    from pnfarm.plant.coupling_kinds import CouplingKind
    from pnfarm.plant.python_file import ModelClass
    from pnfarm.signals.device_signal import KnownDevices
    from pnfarm.vocabulary.issues import Report

__all__ = ["PlannedModel", "PlannedWire", "PlantPlan", "StationEnd", "plan_plant"]

#: Kinds of values that the plant computes with.
_NUMBERS = frozenset({"int", "uint", "float"})
#: Most values of a plant, and most of them that are metrics.
MOST_VALUES = 100_000
MOST_EXPORTED = 10_000


@dataclass(frozen=True, slots=True)
class PlannedModel:
    """A model: what it is, its ports by name and the numbers of their values."""

    name: str
    what: Behaviour | CouplingKind | FmuModel | ModelClass
    step_ns: int
    parameters: Mapping[str, Any]
    inputs: Mapping[str, tuple[Port, int]]
    outputs: Mapping[str, tuple[Port, int]]
    #: The number of its first value.
    first: int
    #: Ports that are metrics.
    exported: frozenset[str] = frozenset()

    @property
    def kinds(self) -> tuple[str, ...]:
        """What globs find it by beside its name."""
        return (self.what.kind_name,)


@dataclass(frozen=True, slots=True)
class StationEnd:
    """The end of a wire at a station."""

    station: str
    signal: str
    port: Port
    is_axis: bool


@dataclass(frozen=True, slots=True)
class PlannedWire:
    """``source`` and ``target``: the number of a model's value, or a signal of a station."""

    text: WireText
    source: int | StationEnd
    target: int | StationEnd
    form: str
    scale: float
    offset: float


@dataclass(frozen=True, slots=True)
class PlantPlan:
    """What a plant is made of; ``values``: how many the models' ports are."""

    step_ns: int
    models: Mapping[str, PlannedModel] = field(default_factory=dict)
    wires: tuple[PlannedWire, ...] = ()
    values: int = 0
    axes: Mapping[str, PlantAxis] = field(default_factory=dict)

    def name_of(self, number: int) -> str:
        """The port that has a value, as ``MODEL.PORT``."""
        return next(
            f"{model.name}.{name}"
            for model in self.models.values()
            for name, (_, own) in (*model.inputs.items(), *model.outputs.items())
            if own == number
        )


_End: TypeAlias = "tuple[int | StationEnd, Port]"


def plan_plant(
    section: PlantSection,
    axes: Mapping[str, PlantAxis],
    devices: KnownDevices,
    folder: Path,
    report: Report,
    *,
    runs_files: bool = True,
    has_all_stations: bool = True,
) -> PlantPlan:
    """Check a plant; what is wrong is reported at its place in the file.

    ``folder``: files of models are relative to it.  ``runs_files=False``: no file of a model
    in Python is run, and wires to it are not checked.  ``has_all_stations=False``: some of the file could not be
    read, and a name may be that of one of those.
    """
    planner = _Planner(section, axes, devices, folder, report, runs_files=runs_files, has_all_stations=has_all_stations)
    planner.models()
    planner.wires()
    return planner.plan


class _Planner:
    def __init__(
        self,
        section: PlantSection,
        axes: Mapping[str, PlantAxis],
        devices: KnownDevices,
        folder: Path,
        report: Report,
        *,
        runs_files: bool,
        has_all_stations: bool,
    ) -> None:
        self._section = section
        self._axes = axes
        self._devices = devices
        self._folder = folder
        self._runs_files = runs_files
        self._has_all_stations = has_all_stations
        self._report = report
        self._models: dict[str, PlannedModel] = {}
        #: Names of models that could not be made, or are not yet: wires to them are not checked.
        self._lost: set[str] = set()
        self._wires: list[PlannedWire] = []
        self._values = 0

    @property
    def plan(self) -> PlantPlan:
        return PlantPlan(self._section.step_ns, self._models, tuple(self._wires), self._values, self._axes)

    # -- models

    def models(self) -> None:
        """All models, in the order of the file."""
        seen: set[str] = set()
        for number, model in enumerate(self._section.models):
            at = ("plant", "models", number)
            if model.name in seen or model.name in self._axes or model.name in self._devices:
                who = "another model" if model.name in seen else "a station"
                self._report((*at, "name"), f"{shown(model.name)} is {who}, too", "a name that only this model has")
                continue
            seen.add(model.name)
            made = self._model(at, model)
            if made is None:
                self._lost.add(model.name)
            elif self._values > MOST_VALUES:
                self._report(at, f"makes {self._values} values", f"at most {MOST_VALUES} ports of all models")
                self._lost.add(model.name)
            else:
                self._models[model.name] = replace(made, exported=self._exported(at, model, made))
        if sum(len(made.exported) for made in self._models.values()) > MOST_EXPORTED:
            what = f"`metrics` exports more than {MOST_EXPORTED} ports"
            self._report(("plant", "models"), what, "the ports that somebody looks at")

    def _exported(self, at: tuple[str | int, ...], model: PlantModel, made: PlannedModel) -> frozenset[str]:
        known = {**made.inputs, **made.outputs}
        if isinstance(model.metrics, bool):
            return frozenset(known if model.metrics else ())
        for name in model.metrics:
            if name not in known:
                what = f"{model.name} has no port {shown(name)}{did_you_mean(name, known)}"
                self._report((*at, "metrics"), what, shortened(list(known)))
        return frozenset(model.metrics)

    def _model(self, at: tuple[str | int, ...], model: PlantModel) -> PlannedModel | None:
        given = [key for key in ("kind", "python", "fmu") if getattr(model, key) is not None]
        if len(given) != 1:
            self._report(at, f"model {model.name} has {' and '.join(given) or 'no kind'}", "kind, or python, or fmu")
            return None
        if model.class_name is not None and model.python is None:
            self._report((*at, "class"), "is a key of models in Python", "a file in `python`")
        step = self._section.step_ns if model.step_ns is None else model.step_ns
        if step < self._section.step_ns:
            what = "is shorter than the plant's own step"
            self._report((*at, "step"), what, f"{self._section.step_ns / 1e6:g}ms or more, or a shorter step of plant")
        if model.fmu is not None:
            return self._fmu(at, model, step)
        for key, value in (("parameters", model.fmu_parameters), ("on_failure", model.on_failure)):
            if value is not None:
                self._report((*at, key), "is a key of FMUs", "a file in `fmu`")
        if model.python is not None:
            return self._python(at, model, step)
        assert model.kind is not None
        kind = BEHAVIOURS.get(model.kind) or COUPLINGS.get(model.kind)
        if kind is None:
            known = [*BEHAVIOURS, *COUPLINGS]
            hint = did_you_mean(model.kind, known)
            self._report((*at, "kind"), f"{shown(model.kind)} is no built-in model{hint}", ", ".join(known))
            return None
        if not self._has_all_stations and model.kind in COUPLINGS:
            return None  # its axes may be among those that could not be read
        parameters = read_parameters(at, model, kind, self._axes, self._report)
        if parameters is None:
            return None
        if model.kind in COUPLINGS:
            coupling = COUPLINGS[model.kind]
            places = {port.name: (port, self._values + place) for port, place in coupling.ports}
            count, inputs = COUPLED, {port.name for port, _ in coupling.inputs}
            if model.step_ns is not None and model.step_ns != self._section.step_ns:
                self._report((*at, "step"), "is the plant's: shafts are coupled in each of its steps", "no step here")
        else:
            behaviour = BEHAVIOURS[model.kind]
            places = {port.name: (port, self._values + i) for i, port in enumerate(behaviour.ports)}
            count, inputs = len(places), {port.name for port in behaviour.inputs}
        return self._made(model.name, kind, step, parameters, places, inputs, count)

    def _made(
        self,
        name: str,
        what: Behaviour | CouplingKind | FmuModel | ModelClass,
        step: int,
        parameters: Mapping[str, Any],
        places: Mapping[str, tuple[Port, int]],
        inputs: set[str],
        count: int,
    ) -> PlannedModel:
        made = PlannedModel(
            name,
            what,
            step,
            parameters,
            {key: place for key, place in places.items() if key in inputs},
            {key: place for key, place in places.items() if key not in inputs},
            self._values,
        )
        self._values += count
        return made

    def _fmu(self, at: tuple[str | int, ...], model: PlantModel, step: int) -> PlannedModel | None:
        assert model.fmu is not None
        for key in model.parameters:
            self._report((*at, key), "is no key of an FMU", "parameters: {NAME: VALUE}")
        found = plan_fmu(at, model, beside(self._folder, model.fmu), self._report)
        if found is None:
            return None
        return self._of_ports(model.name, found, step, found.parameters)

    def _of_ports(
        self, name: str, found: FmuModel | ModelClass, step: int, parameters: Mapping[str, Any]
    ) -> PlannedModel:
        ports = {port.name: (port, self._values + i) for i, port in enumerate((*found.inputs, *found.outputs))}
        return self._made(name, found, step, parameters, ports, {port.name for port in found.inputs}, len(ports))

    def _python(self, at: tuple[str | int, ...], model: PlantModel, step: int) -> PlannedModel | None:
        if not self._runs_files:
            return None
        assert model.python is not None
        try:
            found = load_model(beside(self._folder, model.python), model.class_name)
        except PlantFileError as error:
            self._report((*at, "python"), str(error), error.allowed)
            return None
        unknown = [key for key in model.parameters if key not in found.parameters]
        for key in unknown:
            hint = did_you_mean(key, found.parameters)
            what = f"{found.name} has no such parameter{hint}"
            self._report((*at, key), what, ", ".join(found.parameters) or "no further keys")
        if not unknown and (lack := found.lack(model.parameters)):
            self._report(at, f"{found.name}: {lack}", "a key for each argument of its __init__ without a default")
        return self._of_ports(model.name, found, step, model.parameters)

    # -- wires

    def wires(self) -> None:
        """All wires, each target once."""
        targets: dict[tuple[str, str], int] = {}
        for number, wire in enumerate(self._section.wires):
            at = ("plant", "wires", number)
            source, target = self._end(at, wire.source, ends=False), self._end(at, wire.target, ends=True)
            if source is None or target is None:
                continue
            key = ("", str(target[0])) if isinstance(target[0], int) else (target[0].station, target[0].signal)
            if key in targets:
                what = f"{wire.target} has a wire already, plant.wires[{targets[key]}]"
                self._report(at, what, "one wire to each input; a model in Python joins several")
                continue
            targets[key] = number
            try:
                self._wires.append(_fitted(wire, source, target))
            except Problem as problem:
                self._report(at, problem.what, problem.allowed)

    def _end(self, at: tuple[str | int, ...], text: str, *, ends: bool) -> _End | None:
        """What a name means, as the source or the end of a wire; None: it was reported."""
        owner, port = self._split(text)
        if owner in self._lost:
            return None
        if owner in self._models:
            return self._model_end(at, self._models[owner], port, ends=ends)
        if owner in self._axes:
            return self._axis_end(at, owner, port, ends=ends)
        if owner in self._devices:
            return self._device_end(at, owner, port, ends=ends)
        if not self._has_all_stations:
            return None
        known = [*self._models, *self._axes, *self._devices]
        hint = did_you_mean(owner, known)
        self._report(at, f"{shown(text)} names no model and no station{hint}", shortened(known) or "a model first")
        return None

    def _split(self, text: str) -> tuple[str, str]:
        """Model or station, and port; a station's name and a signal may have dots."""
        places = [i for i, one in enumerate(text) if one == "."]
        for place in reversed(places):
            if any(text[:place] in known for known in (self._models, self._axes, self._devices, self._lost)):
                return text[:place], text[place + 1 :]
        owner, _, port = text.rpartition(".")
        return owner or text, port

    def _model_end(self, at: tuple[str | int, ...], model: PlannedModel, name: str, *, ends: bool) -> _End | None:
        wanted, others = (model.inputs, model.outputs) if ends else (model.outputs, model.inputs)
        if name in wanted:
            port, place = wanted[name]
            return place, port
        if not ends and name in others:
            # an input that a user sets may be seen elsewhere, too
            port, place = others[name]
            return place, port
        why = model.what.no_port(name) if isinstance(model.what, FmuModel) else ""
        if why:
            self._report(at, f"{model.name}.{name} {why}", ", ".join(wanted) or "a number or a switch")
            return None
        side = "input" if ends else "output"
        hint = did_you_mean(name, wanted)
        what = f"{model.name} has no {side} {shown(name)}{hint}"
        self._report(at, what, ", ".join(wanted) or f"it has no {side}s")
        return None

    def _axis_end(self, at: tuple[str | int, ...], axis: str, name: str, *, ends: bool) -> _End | None:
        if ends:
            taken = self._axes[axis].takes(name)
            if taken is not None:
                return StationEnd(axis, name, taken.port, is_axis=True), taken.port
            hint = did_you_mean(name, TAKEN)
            allowed = ", ".join(one for one in TAKEN if not one.startswith("input_")) + ", input_0 to input_31"
            self._report(at, f"{axis} takes no {shown(name)} from a plant{hint}", allowed)
            return None
        found = self._axes[axis].port(name)
        if found is not None:
            return StationEnd(axis, name, found, is_axis=True), found
        names = self._axes[axis].names
        what = f"{axis} gives no {shown(name)} to a plant{did_you_mean(name, names)}"
        self._report(at, what, ", ".join(names) + ", and bits such as zsw1.fault_present")
        return None

    def _device_end(self, at: tuple[str | int, ...], device: str, name: str, *, ends: bool) -> _End | None:
        signals = self._devices[device]
        signal = signals.get(name)
        if signal is None:
            what = f"{device} has no signal {shown(name)}{did_you_mean(name, signals)}"
            self._report(at, what, shortened(list(signals)) or "none of its modules has data")
            return None
        if ends and signal.direction != "input":
            inputs = [one.name for one in signals.values() if one.direction == "input"]
            what = f"{device}.{name} is an output: the controller writes it"
            self._report(at, what, shortened(inputs) or "it has no inputs")
            return None
        kind = signal.type.kind
        if kind != "bool" and kind not in _NUMBERS:
            self._report(at, f"{device}.{name} is of type {signal.type.name}", "a switch or a number")
            return None
        port = Port(name, "bit" if kind == "bool" else "number", signal.place, signal.unit)
        return StationEnd(device, name, port, is_axis=False), port


def _fitted(wire: WireText, source: _End, target: _End) -> PlannedWire:
    """A wire whose ends fit, with the factor between their units; raises :class:`Problem`."""
    (begin, given), (end, taken) = source, target
    if given.form == "bit" and taken.form == "bit":
        if not wire.is_plain and not wire.inverted:
            raise Problem(f"{wire.source} is a bit, which cannot be scaled", "not SOURCE -> TARGET")
        return PlannedWire(wire, begin, end, "inverted" if wire.inverted else "bit", 1.0, 0.0)
    if taken.form == "bit":
        what = f"{wire.source} is a number, {wire.target} is a bit"
        raise Problem(what, "a model between them, such as position-sensor")
    if wire.inverted:
        raise Problem(f"{wire.target} is a number, which cannot be inverted", "a wire between bits")
    unit = wire.unit or given.unit
    if wire.offset_unit and unit and wire.offset_unit != unit:
        raise Problem(f"adds {wire.offset_unit} to {unit}", f"an offset in {unit}")
    # beside a number without a unit the offset may have one
    factor, offset = (
        _factor(wire, given, taken, one) if one and taken.unit else 1.0 for one in (unit, unit or wire.offset_unit)
    )
    return PlannedWire(wire, begin, end, "number", wire.scale * factor, wire.offset * offset)


def _factor(wire: WireText, given: Port, taken: Port, unit: str) -> float:
    """From this unit to that of the wire's target; raises :class:`Problem`."""
    try:
        return in_unit(1.0, unit, taken.unit)
    except Problem as problem:
        how = f"({wire.source}) has the unit" if unit == given.unit and not wire.unit else "has the unit"
        what = f"{wire.target} is in {taken.unit}, what the wire gives {how} {unit}"
        raise Problem(what, f"{problem.allowed}, or a factor: {wire.source} * 1 {taken.unit}") from problem
