"""The sections of a model's ``axis.toml``, ``bus.toml`` and ``model.toml``: values with their sources.

Keys outside of sections, such as the model's name, are in :attr:`Sections.data`, and so are sections that are not lists
of values with sources.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from pnfarm.drives.description.files import MODEL_FILE, ModelFiles, flat, line_of, read_toml
from pnfarm.drives.description.parts import Fact
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from pnfarm.drives.parameters.numbers import ParameterNumbers

__all__ = ["NAMING_FILES", "Section", "Sections", "joined_data"]

#: Data for every bus, data that one bus adds, names of the model: read in this order in each folder.
FILES = ("axis.toml", "bus.toml", MODEL_FILE)
#: Those that hold the model's names.
NAMING_FILES = FILES[1:]
#: Sections that every model has, and those that one with this profile or on this bus has.
REQUIRED = ("limits", "communication_loss", "motor", "firmware")
_NEEDED = {"profidrive": ("identity", "parameter_access")}
OPTIONAL = (
    "address_mode", "control_limits", "description_file", "diagnosis", "diagnosis_coding", "effects", "factor_group",
    "following_error", "lamps", "motion_tasks", "numbering", "parameter_texts", "position_units", "parameter_words",
    "realism", "sign_of_life", "identity", "parameter_access",
)  # fmt: skip
#: Keys of a section that is there.
_NEEDED_KEYS = {
    ("limits", "profidrive"): ("max_parameters", "max_elements", "max_response"),
    ("limits", "profinet"): ("io_controllers", "ports"),
    ("parameter_access", "profidrive"): ("record_indexes", "axis", "change_response_values"),
}
#: Sections whose keys are fields of the axis (:attr:`pnfarm.table.layout.Layout.fields`).
_OF_THE_AXIS = frozenset({"motor", "firmware"})
#: Other motors: sections ``motors.<kind>.<part>``.
MOTORS = "motors"
#: Key with the dotted names of what the folders above have and this model lacks.
WITHOUT = "without"
#: A fault in that list: ``faults.524``.
FAULTS = "faults"
#: Values that are a parameter, or parameters: by name, or by number on the bus.
_PARAMETERS: dict[str, frozenset[str]] = {
    "address_mode": frozenset({"parameter"}),
    "communication_loss": frozenset({"action_parameter", "stop_parameter"}),
    "diagnosis_coding": frozenset({"mode_parameter"}),
    "parameter_access": frozenset({"absent", "disabled_only", "mapping_elements", "station_name"}),
    "position_units": frozenset({"scaling", "unit", "numerator", "denominator"}),
}
#: Sections whose values are all parameters, and those whose keys are.
_ALL_PARAMETERS = frozenset({"control_limits", "factor_group", "motion_tasks"})
_KEYS_ARE_PARAMETERS = frozenset({"effects", "parameter_texts"})


def joined_data(files: ModelFiles, names: Sequence[str] = FILES) -> tuple[dict[str, Any], dict[tuple[str, ...], Path]]:
    """Content of the files, from the product's to the model's own, and the file of each value by its path of keys."""
    data: dict[str, Any] = {}
    origins: dict[tuple[str, ...], Path] = {}
    for path in [path for folder in files.folders for name in names if (path := folder / name).exists()]:
        _join(data, read_toml(path), path, (), origins)
    return data, origins


def _join(
    into: dict[str, Any],
    table: Mapping[str, Any],
    path: Path,
    above: tuple[str, ...],
    origins: dict[tuple[str, ...], Path],
) -> None:
    for key, value in table.items():
        origins[*above, key] = path
        if isinstance(value, dict) and "value" not in value:
            _join(into.setdefault(key, {}), value, path, (*above, key), origins)
        else:
            into[key] = value


class Section(dict[str, Fact]):
    """The values of one section by their keys; :meth:`where` is the place of one in its file."""

    def __init__(self, name: str, facts: Mapping[str, Fact], place: Callable[[str, str], str]) -> None:
        super().__init__(facts)
        self.name = name
        self._place = place

    def where(self, key: str = "") -> str:
        """File, line and name of a key, or of the section."""
        return self._place(self.name, key)

    def wrong(self, key: str, what: str) -> ConfigError:
        """The error of a key, or with an empty one of the section."""
        return ConfigError(f"{self.where(key)}: {what}")

    def values_by_key(self) -> dict[str, Any]:
        """The values without their sources."""
        return {key: fact.value for key, fact in self.items()}

    def with_value(self, key: str, value: Any, where: str) -> Section:
        """The section with the values of a reading of ``behaviour.toml``; errors name the place ``where``."""
        return Section(self.name, self | {key: Fact(value, "behaviour")}, lambda *_: where)

    def build(self, kind: Callable[..., Any]) -> Any:
        """A dataclass of these values; :class:`ConfigError` for a key too many or too few."""
        try:
            return kind(**self.values_by_key())
        except TypeError as exc:
            raise ConfigError(f"{self.where()}: {exc}") from exc

    def numbered(self, numbers: ParameterNumbers) -> Section:
        """The section with each parameter by its number on the bus."""
        named = self.keys() if self.name in _ALL_PARAMETERS else _PARAMETERS.get(self.name, ())
        facts: dict[str, Fact] = {}
        for key, fact in self.items():
            if self.name in _KEYS_ARE_PARAMETERS:
                facts[str(numbers.of(key, self.where))] = fact
            elif key in named:
                facts[key] = replace(fact, value=numbers.of_value(fact.value, partial(self.where, key)))
            else:
                facts[key] = fact
        return Section(self.name, facts, self._place)


class Sections:
    """All sections of a model, joined from its product's to its own."""

    def __init__(self, files: ModelFiles) -> None:
        self._file = files.folder / MODEL_FILE
        self.data, self._origins = joined_data(files)
        for name in self.data.get(WITHOUT, ()):
            self._leave_out(name)
        bus, profile = self.wanted("bus"), self.data.get("profile", "")
        self._sections = {name: self._read(name) for name in (*REQUIRED, *OPTIONAL, bus) if name in self.data}
        for name in (*REQUIRED, *_NEEDED.get(profile, ())):
            self.wanted(name)
        for (name, owner), keys in _NEEDED_KEYS.items():
            for key in keys if owner in {bus, profile} else ():
                if key not in self._sections[name]:
                    raise ConfigError(f"{self.place(name, key)}: missing")
        self.motors = {
            kind: {part: self._read(f"{MOTORS}.{kind}.{part}", facts) for part, facts in table.items()}
            for kind, table in self.data.get(MOTORS, {}).items()
        }

    @property
    def facts(self) -> dict[str, Fact]:
        """Every value by ``section.key``."""
        motors = [section for parts in self.motors.values() for section in parts.values()]
        return {
            f"{section.name}.{key}": fact
            for section in (*self._sections.values(), *motors)
            for key, fact in section.items()
        }

    @property
    def without_faults(self) -> frozenset[str]:
        """The product's faults, by their numbers as written there, that this model lacks."""
        names = [name.partition(".") for name in self.data.get(WITHOUT, ())]
        return frozenset(number for section, _, number in names if section == FAULTS)

    def wanted(self, key: str) -> Any:
        """The value of a required key outside of sections, or a required section as in the files."""
        if key not in self.data:
            raise ConfigError(f"{self._file}, {key}: missing")
        return self.data[key]

    def file(self, key: str) -> Path:
        """The file of a key outside of sections, or of a section."""
        return self._origins.get((key,), self._file)

    def place(self, section: str, key: str = "") -> str:
        """File, line and name of a section's key, or of the section; without a section, of a key outside of them."""
        names = [*filter(None, section.split(".")), *filter(None, [key])]
        apart = (*section.split("."), *key.split("."))
        path = self._origins.get(tuple(names)) or self._origins.get(apart, self._file)
        line = line_of(path, section, key)
        return f"{path}, {f'line {line}, ' if line else ''}{'.'.join(names)}"

    def section(self, name: str) -> Section:
        """A section, without values where a model does not have it."""
        return self._sections.get(name, Section(name, {}, self.place))

    def number(self, numbers: ParameterNumbers) -> None:
        """Replace the names of parameters by their numbers on the bus."""
        self._sections = {name: section.numbered(numbers) for name, section in self._sections.items()}

    def _leave_out(self, name: str) -> None:
        section, _, key = name.partition(".")
        table = self.data.get(section, {}) if key else self.data
        if section in _OF_THE_AXIS:
            *parts, key = key.split(".")
            for part in parts:
                table = table.get(part, {})
        if section != FAULTS and table.pop(key or section, None) is None:
            raise ConfigError(f"{self.place('', WITHOUT)}: the folders above have no {name}")

    def _read(self, name: str, table: Mapping[str, Any] | None = None) -> Section:
        facts: dict[str, Fact] = {}
        entries = self.data[name] if table is None else table
        if name in _OF_THE_AXIS or name.startswith(f"{MOTORS}."):
            entries = flat(entries)
        for key, entry in entries.items():
            if not isinstance(entry, dict):
                wanted = 'a value has its source: { value = ..., source = "..." }'
                raise ConfigError(f"{self.place(name, key)}: {entry!r} stands alone; {wanted}")
            if missing := [part for part in ("value", "source") if part not in entry]:
                raise ConfigError(f"{self.place(name, key)}, {missing[0]}: missing")
            value, source = entry["value"], entry["source"]
            note = entry.get("note", "")
            if source == "assumed" and not note:
                raise ConfigError(f"{self.place(name, key)}, note: an assumed value needs its reason")
            facts[key] = Fact(tuple(value) if isinstance(value, list) else value, source, note, entry.get("unit", ""))
        return Section(name, facts, self.place)
