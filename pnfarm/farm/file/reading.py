"""The farm file (``*.pnfarm.yml``): read, checked as a whole, expanded to drives.

A file is read as a whole and **all** its errors are reported at once (:class:`FarmFileError`), each with
its line, its key, and what is allowed.  There are four stages:

1. text to values with places (:mod:`pnfarm.vocabulary.yaml_lines`);
2. values to typed sections (:mod:`pnfarm.farm.file.sections`), groups and controllers by the keys of their bus
   (:mod:`pnfarm.farm.file.choice`), errors to sentences (:mod:`pnfarm.farm.file.errors`);
3. where a section is wrong, its wrong keys are set aside, so that the rest can still be checked;
4. checks between sections (:mod:`pnfarm.farm.file.checks`), with the facts of the drive models
   (:mod:`pnfarm.config.known`).
"""

from __future__ import annotations

import copy
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import Field, PrivateAttr, ValidationError

from pnfarm.buses.registry import BUSES
from pnfarm.config.database import is_database
from pnfarm.config.device import DeviceConfig
from pnfarm.config.drive import DriveConfig
from pnfarm.config.impairment import FAULT_KINDS, FOLDER
from pnfarm.config.known import Known, catalogue
from pnfarm.farm.file.checks import check
from pnfarm.farm.file.choice import Choice
from pnfarm.farm.file.described import with_descriptions
from pnfarm.farm.file.errors import Explainer
from pnfarm.farm.file.expand import controller_mac, expand_device_sections, expand_sections
from pnfarm.farm.file.identities import with_identities
from pnfarm.farm.file.lists import with_lists
from pnfarm.farm.file.sections import CHOICE, AnyDevices, AnyGroup, FarmSections
from pnfarm.vocabulary.issues import FarmFileError, FileIssue, Location, field_path, parse_path
from pnfarm.vocabulary.quoting import few_hints, shown
from pnfarm.vocabulary.regular_file import beside, read_regular
from pnfarm.vocabulary.yaml_lines import MAX_OCTETS, Document, YamlError, parse_yaml

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from pnfarm.buses.bus import Bus
    from pnfarm.buses.farm_file import FarmFilePart

__all__ = [
    "DeviceConfig",
    "DriveConfig",
    "FarmConfig",
    "FarmFileError",
    "FileIssue",
    "Known",
    "controller_mac",
    "expand",
    "expand_all",
    "expand_devices",
    "load_farm",
    "parse_farm",
]


class FarmConfig(FarmSections):
    """A farm file without errors.  Made by :func:`load_farm` and :func:`parse_farm`."""

    _path: Path | None = PrivateAttr(default=None)
    _values: dict[str, Any] = PrivateAttr(default_factory=dict)
    _document: Document | None = PrivateAttr(default=None)
    _known: Known | None = PrivateAttr(default=None)
    _notes: tuple[str, ...] = PrivateAttr(default=())

    def adopted(
        self,
        path: Path | None,
        values: dict[str, Any],
        document: Document | None,
        known: Known,
        notes: Sequence[str] = (),
    ) -> FarmConfig:
        """Remember where the sections come from; the last stage of reading."""
        self._path, self._values, self._document, self._known = path, values, document, known
        self._notes = tuple(notes)
        return self

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user should know though nothing is wrong."""
        return self._notes

    @property
    def path(self) -> Path | None:
        """The file, or None for text that is not from a file."""
        return self._path

    def place(self, location: Location) -> tuple[str, int, int]:
        """File, line and column of a value, as messages name them; 0 where it is not in the file."""
        return _place(self._path, self._document, location)

    @property
    def known(self) -> Known:
        """The models and fault kinds against which the file was checked."""
        return self._known or catalogue()

    @property
    def state_directory(self) -> Path | None:
        """``state`` relative to the file's folder; None: it is a database, or the drives keep nothing after the run."""
        if self.state is None or self.state_database is not None:
            return None
        return self.beside(self.state)

    def beside(self, path: str) -> Path:
        """A path of the file, relative to the file's folder."""
        return beside(self._path.parent if self._path is not None else Path(), path)

    @property
    def state_database(self) -> str | None:
        """The URL of ``state``, which may hold a password; None: it is a folder, or there is none."""
        return self.state if is_database(self.state) else None

    @property
    def token_path(self) -> Path | None:
        """The file of the API's token, relative to the farm file's folder; None: the token is not in a file."""
        section = self.api
        if section is None:
            return None
        if section.token_file is not None:
            return self.beside(section.token_file)
        if section.token is not None or section.tokens is not None or not section.needs_token:
            return None
        if (state := self.state_directory) is None:
            return None
        return state / "api-token"

    def with_overrides(self, overrides: Mapping[str, Any], origin: str = "override") -> FarmConfig:
        """The same file with some keys set from outside, checked again as a whole.

        Keys are paths as messages write them (``api``, ``link.parent``, ``realtime.cpu``, ``drives[0].count``).
        Values are those that a file has once it is read: a text is that text, whatever YAML would make of it.
        ``origin`` names where they come from (``PNFARM_UP_API``, ``--api``) in messages.  Raises
        :class:`FarmFileError`.
        """
        if not overrides:
            return self
        values = copy.deepcopy(self._values)
        issues: list[FileIssue] = []
        set_here: set[Location] = set()
        for key, value in overrides.items():
            location = parse_path(key)
            try:
                _set(values, location, value)
            except LookupError:
                issues.append(FileIssue(origin, 0, 0, key, "is not a key of a farm file", "a path such as link.parent"))
            else:
                set_here.add(location)

        def place(location: Location) -> tuple[str, int, int]:
            if any(location[: len(path)] == path for path in set_here):
                return origin, 0, 0
            return _place(self._path, self._document, location)

        return _build(values, place, issues, self._path, self._document, self.known)


def load_farm(path: str | Path, known: Known | None = None) -> FarmConfig:
    """Read and check a farm file.

    ``known`` is what the drive models and the fault catalogue allow; by default the installed models.
    Raises :class:`FarmFileError` with everything that is wrong, also when the file cannot be read.
    """
    path = Path(path)
    try:
        data = read_regular(path, MAX_OCTETS + 1)
    except OSError as error:
        what = f"cannot be read: {(error.strerror or str(error)).lower()}"
        raise FarmFileError([FileIssue(str(path), 0, 0, "", what, "a farm file, *.pnfarm.yml")]) from error
    return parse_farm(data, path, known)


def parse_farm(text: str | bytes, path: str | Path | None = None, known: Known | None = None) -> FarmConfig:
    """Check a farm file's text; ``path`` names it in messages and is what ``state`` is relative to."""
    file = Path(path) if path is not None else None
    try:
        document = parse_yaml(text)
    except YamlError as error:
        found = error.problem
        issue = FileIssue(_file_name(file), found.line, found.column, found.field, found.what, found.allowed)
        raise FarmFileError([issue]) from error
    issues = [
        FileIssue(_file_name(file), found.line, found.column, found.field, found.what, found.allowed)
        for found in document.problems
    ]
    return _build(
        document.root.plain(),
        lambda location: _place(file, document, location),
        issues,
        file,
        document,
        known if known is not None else catalogue(),
    )


def expand(config: FarmConfig) -> list[DriveConfig]:
    """One entry per drive, in the file's order; names, addresses and MACs are counted up and unique."""
    return list(expand_sections(config, config.known))


def expand_devices(config: FarmConfig) -> list[DeviceConfig]:
    """The same of the devices that are no drives."""
    return list(expand_device_sections(config))


def expand_all(config: FarmConfig) -> list[DriveConfig | DeviceConfig]:
    """The drives, and then the devices."""
    return [*expand(config), *expand_devices(config)]


# --- stages -----------------------------------------------------------------------------------------------------


@few_hints()
def _build(
    values: Any,
    place: Callable[[Location], tuple[str, int, int]],
    issues: list[FileIssue],
    path: Path | None,
    document: Document | None,
    known: Known,
) -> FarmConfig:
    reported = set(issues)

    def report(location: Location, what: str, allowed: str) -> None:
        file, line, column = place(location)
        issue = FileIssue(file, line, column, field_path(location), what, allowed)
        if issue not in reported:
            reported.add(issue)
            issues.append(issue)

    if not isinstance(values, dict):
        report((), f"is {shown(values)}", "a mapping such as `farm: line-1` ...")
        raise FarmFileError(issues)
    named = "drives" in values or "devices" in values
    if "steps" in values and not named:
        report(("steps",), "is of a scenario: `pnfarm run` carries it out", "a farm file, with `drives` or `devices`")
        raise FarmFileError(issues)
    if not named and (values.get("farm") is not None or not _names_devices(values)):
        report(("drives",), "is missing", "a list of groups, each with name and model")
    config = None
    choice = Choice(values, known)
    folder = path.parent if path is not None else Path()
    context = {FAULT_KINDS: known.fault_kinds, CHOICE: choice, FOLDER: folder}
    in_lists: list[FileIssue] = []
    notes: list[str] = []
    try:
        config = FarmConfig.model_validate(values, context=context)
    except ValidationError as error:
        errors = error.errors(include_url=False)
        explainer = Explainer(FarmConfig, values, choice)
        for found in errors:
            report(*explainer.explain(found))
        wrong = [found["loc"] for found in errors]
        rest, moved = _set_aside(values, wrong, known, choice)
        partial = _Partial.model_validate(rest, context=context)
        known, in_lists = with_lists(partial.parameter_lists, folder, known, report)

        def report_moved(location: Location, what: str, allowed: str) -> None:
            report(_moved(location, moved), what, allowed)

        groups, _ = with_identities(partial.drives, folder, known, report_moved)
        devices = with_descriptions(partial.devices, folder, report, moved["devices"])
        check(
            partial.model_copy(update={"drives": groups, "devices": devices}),
            known,
            folder,
            report_moved,
            is_complete=not _says_nothing_of_links(wrong),
            has_all_stations=not any(location[0] in {"drives", "devices"} for location in wrong),
            places=moved["drives"],
            device_places=moved["devices"],
        )
    else:
        known, in_lists = with_lists(config.parameter_lists, folder, known, report)
        groups, notes = with_identities(config.drives, folder, known, report)
        devices = with_descriptions(config.devices, folder, report)
        config = config.model_copy(update={"drives": groups, "devices": devices})
        check(config, known, folder, report)
    issues += in_lists
    if issues or config is None:
        raise FarmFileError(issues)
    return config.adopted(path, values, document, known, notes)


def _names_devices(values: dict[str, Any]) -> bool:
    """Whether the controller has its own devices, so that the file needs no drives."""
    controller = values.get("controller")
    if not isinstance(controller, dict):
        return False
    maps = [controller, *(each for name, each in controller.items() if name in BUSES and isinstance(each, dict))]
    return any(each.get("devices") for each in maps)


class _Partial(FarmSections):
    """What is left of a file whose wrong keys were set aside."""

    drives: list[AnyGroup] = Field(default_factory=list)
    devices: list[AnyDevices] = Field(default_factory=list)


#: Where one of these is wrong, a group's drives cannot be checked.
_ESSENTIAL = frozenset(("name", "model", "start"))


#: Keys of a group that only its model can judge; its bus has others.
_JUDGED_BY_MODEL = frozenset({"params", "identity", "realism", "behaviour", "words"})


def _without_model(group: dict[str, Any], known: Known, bus: Bus) -> bool:
    """A group of an unknown model still has names and addresses: keep those, and skip the checks of the model.

    It gets any model of the bus whose keys it has; False where there is none.
    """
    on_bus = (name for name in known.models if (model := known.model(name)) is not None and model.bus == bus.name)
    if (any_one := next(on_bus, None)) is None:
        return False
    group["model"] = any_one
    group["limits"] = "lax"
    for key in _JUDGED_BY_MODEL | bus.farm_file.judged_by_model:
        group.pop(key, None)
    return True


def _set_aside(
    values: dict[str, Any], wrong: list[Location], known: Known, choice: Choice
) -> tuple[dict[str, Any], dict[str, list[int]]]:
    """``values`` without what is wrong, and for each remaining group of drives and devices its place in the file.

    A wrong key of a group or of the controller goes alone, so that the others are still checked against each
    other; where an essential key is wrong, its whole group goes.
    """
    rest = copy.deepcopy(values)
    lost_groups: set[int] = set()
    lost_devices: set[int] = set()
    for number in {location[1] for location in wrong if location[:1] == ("drives",) and location[2:3] == ("model",)}:
        group = rest["drives"][number]
        if not _without_model(group, known, choice.group(group)):
            lost_groups.add(int(number))
    for location in wrong:
        match location:
            case ("drives", int(number), "params" | "load" | "motor" | "behaviour" as section, str(key), *_):
                # a group without a model has lost the keys that only a model can check
                rest["drives"][number].get(section, {}).pop(key, None)
            case ("drives", int(number), str(key), *_) if key not in _ESSENTIAL:
                group = rest["drives"][number]
                _drop(group, key, choice.group(group).farm_file)
                if key == "limits":
                    # a wrong word here must not bring a second complaint about the cycle
                    rest["drives"][number]["limits"] = "lax"
            case ("drives", int(), "model"):
                pass
            case ("drives", int(number), *_):
                lost_groups.add(number)
            case ("devices", int(number), *_):
                lost_devices.add(number)
            case ("controller", str(name)) if name in BUSES:
                # without its map, a bus's controller would seem to be where another one is
                rest.pop("controller", None)
            case ("controller", str(), *_) if "controller" not in rest:
                pass
            case ("controller", str(name), str(key), *_) if name in BUSES:
                _drop(rest["controller"][name], key, BUSES[name].farm_file)
                _drop(rest["controller"], key, BUSES[name].farm_file)
            case ("controller", str(key), *_):
                for one in choice.controllers(rest["controller"]):
                    _drop(rest["controller"], key, one.bus.farm_file)
            case ("parameter_lists", str(key), *_):
                rest["parameter_lists"].pop(key, None)
            case (key, *_):
                rest.pop(str(key), None)
            case _:
                pass
    moved: dict[str, list[int]] = {}
    for key, lost in (("drives", lost_groups), ("devices", lost_devices)):
        groups = rest.get(key, [])
        moved[key] = [number for number in range(len(groups)) if number not in lost]
        rest[key] = [groups[number] for number in moved[key]]
    return rest, moved


def _drop(section: dict[str, Any], key: str, part: FarmFilePart[Any, Any]) -> None:
    for each in part.together.get(key, (key,)):
        section.pop(each, None)


def _says_nothing_of_links(wrong: list[Location]) -> bool:
    """Whether an error hides how the sections belong together."""
    return any(
        location[0] in {"farm", "link"}
        or location[:2] in _LINKING
        or (location[0] == "controller" and location[1] in BUSES and location[2:] in _LINKING_IN_MAP)
        for location in wrong
    )


_LINKING = frozenset((("controller",), ("controller", "interface"), ("controller", "link")))
#: In the map for one bus; what is beside it is another controller's address.
_LINKING_IN_MAP = frozenset(((), ("interface",), ("link",), ("ip",)))


def _moved(location: Location, moved: dict[str, list[int]]) -> Location:
    match location:
        case ("drives", int(number), *inside):
            return ("drives", moved["drives"][number], *inside)
        case _:
            return location


def _file_name(path: Path | None) -> str:
    return str(path) if path is not None else "<text>"


def _place(path: Path | None, document: Document | None, location: Location) -> tuple[str, int, int]:
    line, column = document.locate(location) if document is not None else (0, 0)
    return _file_name(path), line, column


# --- overrides --------------------------------------------------------------------------------------------------


def _set(values: dict[str, Any], location: Location, value: Any) -> None:
    """Set one key, creating the sections on the way; LookupError where another value is in the way."""
    target: Any = values
    for step, following in zip(location, (*location[1:], None), strict=True):
        if isinstance(target, list):
            if not isinstance(step, int) or step >= len(target):
                raise LookupError(step)
        elif not isinstance(target, dict) or not isinstance(step, str) or not step:
            raise LookupError(step)
        if following is None:
            target[step] = value
        else:
            if isinstance(target, dict) and target.get(step) is None:
                target[step] = {}
            target = target[step]
