"""The scenario file (``*.scenario.yml``): read and checked as a whole before anything starts.

All errors are reported at once, each with line, key and what is allowed (:class:`FarmFileError`).  Repetitions are
written out when the file is read, with the variables' values in place, so that each step that will run was checked.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import re
from dataclasses import astuple, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pnfarm.scenario.definition.steps import MEASURES, STEPS, WHOLE, Step
from pnfarm.scenario.find import FIND, number_of, read_range
from pnfarm.signals.device_signal import stations_in
from pnfarm.vocabulary.conditions import ConditionError, parse_condition
from pnfarm.vocabulary.issues import FarmFileError, FileIssue, Location, field_path
from pnfarm.vocabulary.names import is_name
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import did_you_mean, few_hints, shown
from pnfarm.vocabulary.regular_file import beside, read_regular
from pnfarm.vocabulary.samples import with_files
from pnfarm.vocabulary.yaml_lines import MAX_OCTETS, Document, YamlError, parse_yaml

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    from pnfarm.scenario.definition.steps import StepKind

__all__ = ["KEYS", "MAX_RUNS", "MAX_STEPS", "Scenario", "load_scenario", "parse_scenario", "walk"]

#: Most steps once repetitions are written out; most errors that are reported.
MAX_STEPS = 10_000
#: Most steps and lists of them that are looked at, wrong ones and `repeat` included.
MAX_LOOKED = 5 * MAX_STEPS
MAX_ISSUES = 100
#: Most runs of a matrix.
MAX_RUNS = 100
#: Keys of the file.
KEYS: Mapping[str, str] = {
    "scenario": "Name of the scenario.",
    "farm": "Farm file, relative to this file, or the URL of a running farm's API.",
    "with": "Keys of the farm file that this scenario sets, such as {controller.cycle: 2ms}.",
    "description": "What it shows.",
    "matrix": "Lists of values: the whole scenario runs once for each combination, $name in `with` and in steps.",
    "variables": "Values for $name in `with` and in steps.",
    "budget": "How late the farm itself may be before a failure is inconclusive; left out, the farm's own budget.",
    "steps": "The steps, in order.",
}
_GROUPS = ("parallel", "repeat", "find")
_VARIABLE = re.compile(r"\$(?:\{([A-Za-z_]\w*)\}|([A-Za-z_]\w*))")
_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,63}")


@dataclass(slots=True)
class Scenario:
    """A file without errors of its own; ``farm`` as written, ``steps`` with repetitions written out."""

    name: str
    farm: str | None
    description: str
    overrides: Mapping[str, Any]
    budget_ns: int | None
    steps: tuple[Step, ...]
    path: Path | None = None
    #: Values of variables that were given beside the file.
    given: Mapping[str, Any] = field(default_factory=dict)
    issues: list[FileIssue] = field(default_factory=list)
    #: The combination of a matrix that this run is for.
    combination: Mapping[str, Any] = field(default_factory=dict)
    #: With a matrix: the runs, in order; the steps here are those of the first one.
    runs: tuple[Scenario, ...] = ()

    @property
    def title(self) -> str:
        """Its name, with the combination of a matrix that it is."""
        inside = ", ".join(f"{key}={value}" for key, value in self.combination.items())
        return f"{self.name} [{inside}]" if inside else self.name

    @property
    def is_remote(self) -> bool:
        """Whether the farm is a running one, by its URL."""
        return self.farm is not None and "://" in self.farm

    @property
    def farm_path(self) -> Path | None:
        """The farm file, None where the scenario names none or a running farm."""
        if self.farm is None or self.is_remote:
            return None
        base = self.path.parent if self.path is not None else Path()
        return beside(base, self.farm)

    def every_step(self) -> Iterator[Step]:
        """All steps, those of branches too."""
        return walk(self.steps)

    def expectations(self) -> Iterator[tuple[int, Step]]:
        """The steps that are test cases even if they are not reached, each with its number among all."""
        for number, step in enumerate(self.every_step()):
            if step.kind in {"expect", "find"} and not step.part:
                yield number, step

    def issue(self, step: Step, key: str, what: str, allowed: str) -> FileIssue:
        """An error in a step."""
        name = str(self.path) if self.path is not None else "<scenario>"
        place = field_path(step.location) + (f".{key}" if key else "")
        return FileIssue(name, step.line, 0, place, what, allowed)


def walk(steps: Sequence[Step]) -> Iterator[Step]:
    """Steps, and those inside of them."""
    for step in steps:
        yield step
        for branch in step.branches:
            yield from walk(branch)


def load_scenario(path: str | Path, variables: Mapping[str, Any] | None = None) -> Scenario:
    """Read and check a file; ``variables`` replace the file's.

    Raises :class:`FarmFileError` with everything that is wrong.
    """
    path = Path(path)
    try:
        data = read_regular(path, MAX_OCTETS + 1)
    except OSError as error:
        what = f"cannot be read: {(error.strerror or str(error)).lower()}"
        raise FarmFileError([FileIssue(str(path), 0, 0, "", what, "a scenario file, *.scenario.yml")]) from error
    return parse_scenario(data, path, variables)


@few_hints()
def parse_scenario(text: str | bytes, path: Path | None = None, variables: Mapping[str, Any] | None = None) -> Scenario:
    """Check a scenario's text; ``variables`` replace its own.  Raises :class:`FarmFileError`."""
    name = str(path) if path is not None else "<scenario>"
    try:
        document = parse_yaml(text)
    except YamlError as error:
        raise FarmFileError([FileIssue(name, *astuple(error.problem))]) from error
    return _Reader(document, name, path, variables or {}).read()


class _TooManyError(Exception):
    """Enough errors were found."""


class _Reader:
    def __init__(self, document: Document, name: str, path: Path | None, given: Mapping[str, Any]) -> None:
        self._document = document
        self._name = name
        self._path = path
        self._given = given
        self._issues: dict[FileIssue, None] = {FileIssue(name, *astuple(found)): None for found in document.problems}
        #: Where a variable is named that there is not.
        self._without_value: set[Location] = set()
        self._count = self._looked = 0
        #: Where in a `find` the steps that are read are; empty outside.
        self._part = ""

    def report(self, location: Location, what: str, allowed: str) -> None:
        if location in self._without_value:
            # what follows from that is no error of its own
            return
        line, column = self._document.locate(location)
        self._issues[FileIssue(self._name, line, column, field_path(location), what, allowed)] = None
        if len(self._issues) >= MAX_ISSUES:
            raise _TooManyError

    def read(self) -> Scenario:
        values = self._document.root.plain()
        scenario = None
        with contextlib.suppress(_TooManyError):
            scenario = self._whole(values)
        if self._issues or scenario is None:
            raise FarmFileError(self._issues)
        return scenario

    def _whole(self, values: Any) -> Scenario | None:
        if not isinstance(values, dict):
            self.report((), f"is {shown(values)}", "a mapping such as `scenario: f702-recovery` ...")
            return None
        if "steps" not in values and (of_farm := next((key for key in ("drives", "devices") if key in values), None)):
            self.report((of_farm,), "is of a farm file: `pnfarm up` runs it", "a scenario, with `steps`")
            return None
        self._check_keys(values, (), KEYS)
        name = values.get("scenario")
        if not is_name(name):
            what = "is missing" if name is None else f"is {shown(name)}"
            self.report(("scenario",), what, "a name: a-z, 0-9, -, _ and ., at most 64 characters")
        farm = values.get("farm")
        if farm is not None and (not isinstance(farm, str) or not farm):
            self.report(("farm",), f"is {shown(farm)}", KEYS["farm"])
        variables = self._mapping(values, "variables", "a mapping of names and values")
        for key in variables:
            self._check_identifier(("variables", key), key)
        matrix = self._matrix(values, variables)
        settable = [*variables, *matrix]
        for key, value in self._given.items():
            if key in matrix:
                # one value instead of all
                matrix[key] = self._list([value], ("matrix", key)) or [""]
            elif key in variables:
                variables[key] = value
            else:
                known = ", ".join(settable) or "none"
                self.report(("variables",), f"has no {key!r} to set{did_you_mean(key, settable)}", known)
        overrides = self._mapping(values, "with", "a mapping such as {controller.cycle: 2ms}")
        budget = None
        if values.get("budget") is not None:
            budget = self._value(("budget",), STEPS["wait"].keys["for"].read, values["budget"])
        steps = values.get("steps")
        if not isinstance(steps, list) or not steps:
            self.report(("steps",), "is missing" if steps is None else f"is {shown(steps)}", "a list of steps")
            return None
        whole = Scenario(str(name), farm, str(values.get("description") or ""), {}, budget, (), self._path, self._given)
        runs = []
        # without a matrix there is one combination, of nothing
        for chosen in itertools.product(*matrix.values()):
            combination = dict(zip(matrix, chosen, strict=True))
            values = {**variables, **combination}
            read = tuple(self._steps(steps, ("steps",), values, {}))
            filled = self._filled(overrides, ("with",), values)
            runs.append(replace(whole, overrides=filled, steps=read, combination=combination))
        return replace(runs[0], combination={}, runs=tuple(runs)) if matrix else runs[0]

    def _matrix(self, values: Mapping[str, Any], variables: Mapping[str, Any]) -> dict[str, list[Any]]:
        """The lists of values by name; empty where there is no matrix, or a wrong one."""
        if values.get("matrix") == {}:
            self.report(("matrix",), "is empty", "names and lists, such as {cycle: [1ms, 4ms]}")
        found: dict[str, list[Any]] = {}
        total = 1
        for name, given in self._mapping(values, "matrix", "names and lists, such as {cycle: [1ms, 4ms]}").items():
            place = ("matrix", name)
            self._check_identifier(place, name)
            if name in variables:
                self.report(place, "is also in `variables`", "a name of its own")
            chosen = self._list(given, place)
            if len({str(value) for value in chosen}) < len(chosen):
                self.report(place, "has a value twice", "each value once")
            # a wrong list still gives its name a value, for the steps
            found[name] = chosen or [""]
            total *= len(found[name])
        if total > MAX_RUNS:
            self.report(("matrix",), f"makes {total} runs", f"at most {MAX_RUNS}")
            return {name: chosen[:1] for name, chosen in found.items()}
        return found

    def _mapping(self, values: Mapping[str, Any], key: str, allowed: str) -> dict[str, Any]:
        value = values.get(key)
        if value is None:
            return {}
        if not isinstance(value, dict):
            self.report((key,), f"is {shown(value)}", allowed)
            return {}
        return value

    def _check_keys(self, content: Iterable[str], at: Location, keys: Collection[str], allowed: str = "") -> None:
        for key in content:
            if key not in keys:
                self.report((*at, key), f"is not a key here{did_you_mean(key, keys)}", allowed or ", ".join(keys))

    def _check_required(self, content: Mapping[str, Any], at: Location, kind: StepKind) -> None:
        for key in kind.required:
            if key not in content:
                self.report((*at, key), "is missing", kind.keys[key].doc)

    def _check_identifier(self, location: Location, name: str) -> None:
        if not _IDENTIFIER.fullmatch(name):
            self.report(location, f"{shown(name)} is not a name of a variable", "letters, digits and _")

    def _value(self, location: Location, read: Any, value: Any) -> Any:
        try:
            return read(value)
        except Problem as problem:
            self.report(location, problem.what, problem.allowed)
            return None

    # -- steps

    def _count_step(self, at: Location, *, valid: bool) -> None:
        """What is wrong, and what repeats, takes time too: a file may make it very often."""
        self._looked += 1
        self._count += valid
        if self._count > MAX_STEPS or self._looked > MAX_LOOKED:
            self.report(at, "makes too many steps", f"at most {MAX_STEPS}, with repetitions written out")
            raise _TooManyError

    def _steps(self, steps: Any, at: Location, known: Mapping[str, Any], loop: Mapping[str, Any]) -> list[Step]:
        self._count_step(at, valid=False)
        if not isinstance(steps, list) or not steps:
            self.report(at, f"is {shown(steps)}", "a list of steps")
            return []
        found: list[Step] = []
        for number, step in enumerate(steps):
            found += self._step(step, (*at, number), known, loop)
        return found

    def _step(self, value: Any, at: Location, known: Mapping[str, Any], loop: Mapping[str, Any]) -> list[Step]:
        words = (*STEPS, *_GROUPS)
        self._count_step(at, valid=isinstance(value, dict) and len(value) == 1 and "repeat" not in value)
        if not isinstance(value, dict) or len(value) != 1:
            what = f"has {len(value)} keys" if isinstance(value, dict) else f"is {shown(value)}"
            self.report(at, what, "a step with one key: " + ", ".join(words))
            return []
        ((kind, content),) = value.items()
        at = (*at, kind)
        if kind == "repeat":
            return self._repeat(content, at, known, loop)
        if kind == "parallel":
            return self._parallel(content, at, known, loop)
        if kind == "find":
            return self._find(content, at, known, loop)
        if kind not in STEPS:
            self.report(at, f"is not a step{did_you_mean(kind, words)}", ", ".join(words))
            return []
        content = self._filled(content, at, known)
        read = self._content(kind, content, at)
        line = self._document.locate(at)[0]
        return [Step(kind, read, at, line, loop, part=self._part)] if read is not None else []

    def _content(self, kind: str, content: Any, at: Location) -> dict[str, Any] | None:
        known = STEPS[kind]
        before = len(self._issues)
        if kind in WHOLE:
            content = {WHOLE[kind]: content}
        elif known.short and not isinstance(content, dict):
            content = {known.short: content}
        if not isinstance(content, dict):
            self.report(at, f"is {shown(content)}", f"a mapping such as `{known.example}`")
            return None
        self._check_keys(content, at, known.keys)
        read: dict[str, Any] = {}
        for key, value in content.items():
            if key in known.keys and (found := self._value((*at, key), known.keys[key].read, value)) is not None:
                read[key] = found
        if kind == "fault" and "spec" in read and self._path is not None:
            folder, spec = self._path.parent, read["spec"]
            params = self._value((*at, "params", "values"), lambda given: with_files(given, folder), spec.get("params"))
            read["spec"] = {**spec, "params": params} if params is not None else spec
        self._check_required(content, at, known)
        if known.one_of and (given := sum(key in content for key in known.one_of)) != 1:
            what = "has none of these" if not given else "has more than one of these"
            self.report(at, what, " or ".join(known.one_of))
        elif kind == "expect":
            self._expectation(content, at)
        elif kind == "wait" and "for" in content and (extra := [key for key in ("within", "drive") if key in content]):
            self.report((*at, extra[0]), "belongs to until", "for alone")
        return read if len(self._issues) == before else None

    def _expectation(self, content: Mapping[str, Any], at: Location) -> None:
        given = [key for key in MEASURES if key in content]
        if "metric" in content:
            if len(given) != 1:
                self.report(at, f"has {len(given)} of these", ", ".join(MEASURES))
            elif given != ["value"] and "for" not in content:
                # in no time nothing is counted: `increases: 0` would hold whatever happens
                self.report((*at, "for"), "is missing", f"the time over which {given[0]} is measured, such as 10s")
            for key in ("drive", "within"):
                if key in content:
                    self.report((*at, key), "is for conditions on drives", 'labels: metric: name{drive="axis-01"}')
        else:
            for key in given:
                self.report((*at, key), "is for metrics", "drive, that, within, for, name")
            if "drive" not in content and not _of_devices(content.get("that")):
                self.report((*at, "drive"), "is missing", STEPS["expect"].keys["drive"].doc)

    def _parallel(self, content: Any, at: Location, known: Mapping[str, Any], loop: Mapping[str, Any]) -> list[Step]:
        if not isinstance(content, list) or not content:
            self.report(at, f"is {shown(content)}", "a list whose entries, steps or lists of steps, run at once")
            return []
        branches = [
            self._steps(entry, (*at, number), known, loop)
            if isinstance(entry, list)
            else self._step(entry, (*at, number), known, loop)
            for number, entry in enumerate(content)
        ]
        step = Step("parallel", {}, at, self._document.locate(at)[0], loop, tuple(map(tuple, branches)), self._part)
        return [step]

    def _find(self, content: Any, at: Location, known: Mapping[str, Any], loop: Mapping[str, Any]) -> list[Step]:
        """Branches of the step: each value's trial, and what follows it."""
        if self._part:
            self.report(at, "is inside of another find", "find outside of find")
            return []
        if not isinstance(content, dict):
            self.report(at, f"is {shown(content)}", f"a mapping such as `{FIND.example}`")
            return []
        self._check_keys(content, at, FIND.keys)
        self._check_required(content, at, FIND)
        own = {key: content[key] for key in ("by", "measure", "is", "name") if content.get(key) is not None}
        filled = self._filled(own, at, known)
        read = {key: self._value((*at, key), FIND.keys[key].read, value) for key, value in filled.items()}
        matrix = content.get("for")
        if not isinstance(matrix, dict) or len(matrix) != 1:
            if "for" in content:
                self.report((*at, "for"), f"is {shown(matrix)}", FIND.keys["for"].doc)
            return []
        ((name, values),) = matrix.items()
        place = (*at, "for", name)
        self._check_identifier(place, name)
        chosen = self._list(self._filled(values, place, known), place)
        if any(self._value(place, number_of, value) is None for value in chosen):
            return []
        branches: list[tuple[Step, ...]] = []
        for value in chosen:
            inside = ({**known, name: value}, {**loop, name: value})
            for part, key in (("trial", "steps"), ("then", "then")):
                self._part = part
                given = content.get(key)
                wanted = given is not None or key == "steps"
                branches.append(tuple(self._steps(given, (*at, key), *inside)) if wanted else ())
        self._part = ""
        trials = [step for trial in branches[::2] for step in walk(trial)]
        if trials and not any(step.kind == "expect" for step in trials):
            self.report((*at, "steps"), "has no expectation", "at least one `expect`, which decides whether it holds")
        read |= {"variable": name, "values": chosen}
        return [Step("find", read, at, self._document.locate(at)[0], loop, tuple(branches))]

    def _repeat(self, content: Any, at: Location, known: Mapping[str, Any], loop: Mapping[str, Any]) -> list[Step]:
        allowed = "`for: {n: [1, 2, 3]}` or `times: 3`, and steps"
        if not isinstance(content, dict):
            self.report(at, f"is {shown(content)}", allowed)
            return []
        self._check_keys(content, at, ("for", "times", "steps"), allowed)
        rounds = self._rounds(content, at, known)
        found: list[Step] = []
        for values in rounds:
            found += self._steps(content.get("steps"), (*at, "steps"), {**known, **values}, {**loop, **values})
        return found

    def _rounds(self, content: Mapping[str, Any], at: Location, known: Mapping[str, Any]) -> list[dict[str, Any]]:
        if ("for" in content) == ("times" in content):
            self.report(at, "needs one of these", "for, times")
            return []
        if "times" in content:
            times = self._filled(content["times"], (*at, "times"), known)
            if isinstance(times, bool) or not isinstance(times, int) or not 1 <= times <= MAX_STEPS:
                self.report((*at, "times"), f"is {shown(times)}", f"a whole number from 1 to {MAX_STEPS}")
                return []
            return [{"round": number + 1} for number in range(times)]
        matrix = content["for"]
        if not isinstance(matrix, dict) or not matrix:
            self.report((*at, "for"), f"is {shown(matrix)}", "a mapping of names and lists, such as {n: [1, 2, 3]}")
            return []
        lists: dict[str, list[Any]] = {}
        total = 1
        for name, values in matrix.items():
            place = (*at, "for", name)
            self._check_identifier(place, name)
            lists[name] = self._list(self._filled(values, place, known), place)
            total *= len(lists[name])
        if total > MAX_STEPS:
            self.report((*at, "for"), f"makes {total} rounds", f"at most {MAX_STEPS}")
            return []
        return [dict(zip(lists, values, strict=True)) for values in itertools.product(*lists.values())]

    def _list(self, values: Any, place: Location) -> list[Any]:
        allowed = "a list such as [1ms, 4ms], or {from: 1, to: 6}"
        if isinstance(values, dict):
            if (found := read_range(values, MAX_STEPS)) is not None:
                return found
        elif isinstance(values, list) and values and not any(isinstance(item, (dict, list)) for item in values):
            # a record is JSON, which has no other numbers
            odd = next((item for item in values if isinstance(item, float) and not math.isfinite(item)), None)
            if odd is None:
                return values
            self.report(place, f"has {odd}", "finite numbers")
            return []
        self.report(place, f"is {shown(values)}", allowed)
        return []

    def _filled(self, value: Any, at: Location, known: Mapping[str, Any]) -> Any:
        """``value`` with ``$name`` replaced; a text that is only ``$name`` takes the variable's own type."""
        if isinstance(value, dict):
            return {key: self._filled(item, (*at, key), known) for key, item in value.items()}
        if isinstance(value, list):
            return [self._filled(item, (*at, number), known) for number, item in enumerate(value)]
        if not isinstance(value, str) or "$" not in value:
            return value

        def replaced(found: re.Match[str]) -> str:
            return str(self._variable(found[1] or found[2], at, known))

        whole = _VARIABLE.fullmatch(value)
        if whole is not None:
            return self._variable(whole[1] or whole[2], at, known)
        return _VARIABLE.sub(replaced, value)

    def _variable(self, name: str, at: Location, known: Mapping[str, Any]) -> Any:
        if name not in known:
            hint = did_you_mean(name, known)
            self.report(at, f"${name} has no value{hint}", ", ".join(f"${other}" for other in known) or "`variables:`")
            self._without_value.add(at)
            return ""
        return known[name]


def _of_devices(condition: Any) -> bool:
    """Whether a condition may be about signals of devices alone, or is one that is wrong anyway."""
    try:
        return bool(stations_in(parse_condition(str(condition)), None))
    except ConditionError:
        return True
