"""A scenario checked against the drives of a farm: names, kinds of faults, parameters, signals of each model."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pnfarm.drives.parameters.parameter import ParameterError
from pnfarm.errors import ConfigError
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.plan import matching
from pnfarm.faults.signals import SIGNALS
from pnfarm.scenario.definition.steps import ALL_CONNECTED
from pnfarm.signals.conditions import bind
from pnfarm.signals.device_signal import device_of, releases, stations_in
from pnfarm.signals.layers import EVERY
from pnfarm.vocabulary.conditions import ConditionError, names_in, parse_condition
from pnfarm.vocabulary.globs import read_globs
from pnfarm.vocabulary.issues import FarmFileError
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import did_you_mean, few_hints, shortened, shown

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from pnfarm.drives.description.model import Model
    from pnfarm.faults.catalogue import Catalogue
    from pnfarm.faults.plan import InjectionSpec
    from pnfarm.scenario.definition.file import Scenario
    from pnfarm.scenario.definition.steps import Step
    from pnfarm.signals.conditions import Condition
    from pnfarm.signals.device_signal import KnownDevices
    from pnfarm.signals.signal import Signal
    from pnfarm.vocabulary.issues import FileIssue

__all__ = ["Binding", "bind_scenario", "own_fault_errors"]

#: Most errors that are reported.
MAX_ISSUES = 100


@dataclass(frozen=True, slots=True)
class Binding:
    """A scenario and its farm's drives (name and model, in the farm's order).

    ``devices``: the signals of each; None where they are not known before the scenario runs.  ``models``: what the
    models of devices are called, also then.
    """

    scenario: Scenario
    drives: Mapping[str, Model]
    devices: KnownDevices | None = None
    models: Mapping[str, Sequence[str]] = field(default_factory=dict)

    def chosen(self, step: Step, key: str = "drive") -> list[str]:
        """Names of the drives that a key of a step means; all without the key."""
        return self.matching(step.get(key) or ["all"])

    def matching(self, globs: Sequence[str]) -> list[str]:
        """Names of the drives that globs mean.  Raises :class:`InjectionError`."""
        known = {name: ((name,), (model.name, *model.aliases)) for name, model in self.drives.items()}
        return matching(globs, known)

    def hit(self, globs: Sequence[str]) -> list[str]:
        """Names of the drives and devices that a fault hits.  Raises :class:`InjectionError`."""
        known = {name: ((name,), (model.name, *model.aliases)) for name, model in self.drives.items()}
        known |= {name: ((name,), tuple(self.models.get(name, ()))) for name in (self.devices or self.models)}
        return matching(globs, known)

    def hit_or_none(self, globs: Any) -> list[str]:
        """As :meth:`hit` for a fault's `on`; none if it is not valid."""
        try:
            return self.hit(read_globs(globs))
        except (InjectionError, Problem):
            return []

    def condition_of(self, step: Step) -> tuple[str, list[str]]:
        """The condition of a step, and the devices that it is about; no devices where it is about drives."""
        text = step.get("that") or step.get("until")
        if text == ALL_CONNECTED:
            text = "connected"
        found = [] if step.get("drive") else stations_in(parse_condition(text), self.devices)
        return text, found

    def knows(self, condition: str) -> bool:
        """Whether it can be checked: not if it names signals of devices that are not known."""
        names = names_in(parse_condition(condition))
        return self.devices is not None or not any(device_of(name, None) for name in names)

    def conditions(self, step: Step) -> dict[str, Condition]:
        """The condition of a step, for each of its drives, or for each of the devices that it is about."""
        text, stations = self.condition_of(step)
        if stations or (step.kind == "expect" and not step.get("drive")):
            return dict.fromkeys(stations, bind(text, None, self.devices))
        by_model: dict[str, Condition] = {}
        found: dict[str, Condition] = {}
        if step.get("until") == ALL_CONNECTED and not step.get("drive"):
            found = {name: bind(text, None, self.devices, name) for name in self.devices or ()}
        for name in self.chosen(step) if self.drives or not found else ():
            model = self.drives[name]
            if model.name not in by_model:
                by_model[model.name] = bind(text, model, self.devices)
            found[name] = by_model[model.name]
        return found


@few_hints()
def bind_scenario(
    scenario: Scenario,
    drives: Mapping[str, Model],
    kinds: Catalogue,
    devices: KnownDevices | None = None,
    models: Mapping[str, Sequence[str]] | None = None,
    states: Sequence[str] | None = None,
) -> Binding:
    """Check every step against the farm; of a matrix, one run at a time.

    ``states``: the names of those that are saved; None where they are not known before the scenario runs.
    Raises :class:`FarmFileError` with all that is wrong.
    """
    if scenario.runs:
        raise ConfigError(
            "matrix: repeats the whole scenario, with a farm for each run, and this farm runs already; "
            "use `repeat: {for: ...}` in the steps, or `pnfarm run` with a farm file"
        )
    binding = Binding(scenario, drives, devices, models or {})
    issues: dict[FileIssue, None] = {}
    names: set[str] = set()
    for step in scenario.every_step():
        for key, what, allowed in _errors(binding, step, kinds, names, states):
            issues[scenario.issue(step, key, what, allowed)] = None
        if len(issues) >= MAX_ISSUES:
            break
    if issues:
        raise FarmFileError(issues)
    return binding


def _errors(
    binding: Binding, step: Step, kinds: Catalogue, names: set[str], states: Sequence[str] | None
) -> Iterator[tuple[str, str, str]]:
    missing = False
    for key in ("drive", "on", "off", "cycle"):
        if step.get(key) is not None:
            try:
                binding.matching(step.values[key])
            except InjectionError as error:
                missing = True
                yield from ((key, what, allowed) for _, what, allowed in error.issues)
    match step.kind:
        case "fault":
            yield from _fault_errors(binding, step.values["spec"], kinds)
            name = step.values["spec"].get("as")
            if isinstance(name, str):
                names.add(name)
        case "clear":
            wanted = step.values["fault"]
            if wanted != "all" and wanted not in names:
                what = f"no fault above is called {wanted!r}{did_you_mean(wanted, names)}"
                yield "", what, ", ".join(("all", *sorted(names)))
        case "restore" if states is not None and (wanted := step.values["state"]) not in states:
            allowed = shortened(states) or "`state: FOLDER` in the farm file, with states of `pnfarm state save`"
            yield "", f"there is no state {wanted}{did_you_mean(wanted, states)}", allowed
        case "wait" | "expect" if not missing and (step.get("that") or step.get("until")):
            try:
                if binding.knows(binding.condition_of(step)[0]):
                    binding.conditions(step)
            except ConditionError as error:
                key = "that" if step.get("that") else "until"
                yield key, f"column {error.column}: {error.what}", error.allowed
        case "param" if not missing:
            yield from _parameter_errors(binding, step)
        case "set" | "force" if binding.devices is not None:
            yield from _signal_errors(binding.devices, step.values["signals"])
        case "release" if binding.devices is not None:
            yield from _signal_errors(binding.devices, releases(step.values["signals"], binding.devices))
        case "load":
            wanted = step.values["total"] if "total" in step.values else step.values["drives"]
            key = "total" if "total" in step.values else "drives"
            count, most = abs(wanted), len(binding.chosen(step, "on")) if not missing else 0
            if not missing and count > most:
                yield key, f"is {count}, and there are {most}", f"at most {most}"
        case _:
            pass


def _fault_errors(binding: Binding, given: Mapping[str, Any], kinds: Catalogue) -> Iterator[tuple[str, str, str]]:
    try:
        spec = kinds.parse(given)
        names = binding.hit(spec.on)
    except InjectionError as error:
        yield from error.issues
        return
    models = {binding.drives[name].name: binding.drives[name] for name in names if name in binding.drives}
    devices = [name for name in names if name not in binding.drives]
    if spec.when is not None and binding.knows(spec.when):
        subjects: list[tuple[Model | None, str]] = [(model, "") for model in models.values()]
        for model, own in subjects + [(None, name) for name in devices if binding.devices is not None]:
            try:
                bind(spec.when, model, binding.devices, own)
            except ConditionError as error:
                yield "when", f"column {error.column}: {error.what}", error.allowed
    if SIGNALS in spec.kind.effect.needs and binding.devices is not None:
        for name in devices:
            known = binding.devices.get(name, {})
            if (wanted := spec.values()["signal"]) not in known:
                yield "params.signal", *_no_signal(name, wanted, known)
    for model in models.values():
        yield from own_fault_errors(spec, model)


def own_fault_errors(spec: InjectionSpec, model: Model) -> Iterator[tuple[str, str, str]]:
    """A drive's own fault or warning that an injection asks for and the model does not have."""
    if spec.kind.name in {"drive-fault", "drive-warning"}:
        wanted = next((value for key, value in spec.params.items() if key in {"fault", "warning"}), None)
        if wanted is not None:
            try:
                model.fault(wanted)
            except ConfigError as error:
                yield "params", str(error), f"a fault of `pnfarm models {model.name}`"


def _signal_errors(devices: KnownDevices, signals: Mapping[str, Mapping[str, Any]]) -> Iterator[tuple[str, str, str]]:
    """What is wrong with values of signals; None: a force that is released."""
    for station, values in signals.items():
        known = devices.get(station)
        if known is None:
            hint = did_you_mean(station, devices)
            yield station, f"there is no device {shown(station)}{hint}", shortened(list(devices)) or "none"
            continue
        for name, value in values.items():
            key, signal = f"{station}.{name}", known.get(name)
            if name == EVERY:
                continue
            if signal is None:
                yield key, *_no_signal(station, name, known)
            elif value is not None and (problem := signal.refusal(value)) is not None:
                yield key, problem.what, problem.allowed


def _no_signal(station: str, name: str, known: Mapping[str, Signal]) -> tuple[str, str]:
    return f"{station} has no signal {shown(name)}{did_you_mean(name, known)}", f"a name of `pnfarm io {station}`"


def _parameter_errors(binding: Binding, step: Step) -> Iterator[tuple[str, str, str]]:
    for model in {binding.drives[name].name: binding.drives[name] for name in binding.chosen(step)}.values():
        for key in step.values["set"]:
            try:
                parameter, _ = model.resolve(key)
            except ParameterError:
                hint = did_you_mean(key, model.parameter_names)
                allowed = f"a name or number of `pnfarm models {model.name}`"
                yield f"set.{key}", f"{model.name} has no such parameter{hint}", allowed
                continue
            if not model.writable(key):
                yield f"set.{key}", f"{parameter.name} can only be read", "a parameter that can be written"
