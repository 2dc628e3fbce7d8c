"""An FMU of the farm file, checked: ports, parameters, the library for this machine.  None of its code is run."""

from __future__ import annotations

import platform
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.behaviours.declaration import Port
from pnfarm.plant.fmi.description import MAX_OCTETS, FmuFileError, read_description
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import did_you_mean, shortened, shown
from pnfarm.vocabulary.zip_files import DamagedZipError, zip_member, zip_names

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pnfarm.config.plant import PlantModel
    from pnfarm.plant.fmi.description import FmuDescription, FmuVariable
    from pnfarm.vocabulary.issues import Location, Report

__all__ = ["MOST_MEMBERS", "FmuModel", "plan_fmu"]

#: Largest file, octets, and most files in it.
MAX_FILE, MOST_MEMBERS = 1 << 30, 50_000
#: Most ports of an FMU.
MOST_PORTS = 1000
#: Longest text of a parameter.
MAX_TEXT = 4096
_DESCRIPTION = "modelDescription.xml"


@dataclass(frozen=True, slots=True)
class FmuModel:
    """An FMU as a model of the plant; ``library``: its member for this machine."""

    name: str
    path: Path
    description: FmuDescription
    library: str
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    #: Start values that the farm file gives.
    parameters: Mapping[str, bool | int | float | str]
    #: Outputs that have these values when it has failed; the others hold.
    on_failure: Mapping[str, float]

    @property
    def kind_name(self) -> str:
        return "fmu"

    def no_port(self, name: str) -> str:
        """Why a variable is no port, empty if it is unknown."""
        one = self.description.variables.get(name)
        if one is None or one.causality in {"input", "output"}:
            return "" if one is None else one.no_port
        return "is a parameter" if one.causality == "parameter" else "is neither input nor output"


def plan_fmu(at: Location, model: PlantModel, path: Path, report: Report) -> FmuModel | None:
    """Read the description, and check the keys of the farm file; None: the FMU cannot be used, as reported."""
    try:
        description, library = _read(path)
    except FmuFileError as error:
        report((*at, "fmu"), f"{path}: {error}", error.allowed)
        return None
    inputs, outputs = (tuple(map(_port, description.of(side))) for side in ("input", "output"))
    if not 1 <= len(inputs) + len(outputs) <= MOST_PORTS:
        what = f"{path}: it has {len(inputs) + len(outputs)} inputs and outputs that are numbers or switches"
        report((*at, "fmu"), what, f"1 to {MOST_PORTS}")
        return None
    settable = {one.name: one for one in description.variables.values() if one.is_settable}
    parameters: dict[str, bool | int | float | str] = {}
    for name, value in (model.fmu_parameters or {}).items():
        key = (*at, "parameters", name)
        if name not in settable:
            what = f"{description.name} has no such parameter{did_you_mean(name, settable)}"
            report(key, what, shortened(list(settable)) or "it has none")
            continue
        try:
            parameters[name] = _value(settable[name], value)
        except Problem as problem:
            report(key, problem.what, problem.allowed)
    on_failure: dict[str, float] = {}
    known = {one.name: one for one in description.of("output")}
    for name, value in (model.on_failure or {}).items():
        key = (*at, "on_failure", name)
        if name not in known:
            report(key, f"{description.name} has no such output{did_you_mean(name, known)}", shortened(list(known)))
            continue
        try:
            on_failure[name] = float(_value(known[name], value))
        except Problem as problem:
            report(key, problem.what, problem.allowed)
    return FmuModel(description.name, path, description, library, inputs, outputs, parameters, on_failure)


def _read(path: Path) -> tuple[FmuDescription, str]:
    """The description, and the member with the library for this machine; raises :class:`FmuFileError`."""
    if not path.is_file():
        raise FmuFileError("it is no file" if path.exists() else "there is no such file", "the path of an FMU")
    if path.stat().st_size > MAX_FILE:
        raise FmuFileError(f"it has more than {MAX_FILE} octets")
    try:
        names = zip_names(path, MOST_MEMBERS + 1)
        if len(names) > MOST_MEMBERS:
            raise FmuFileError(f"it has more than {MOST_MEMBERS} files")
        if _DESCRIPTION not in names:
            raise FmuFileError(f"it has no {_DESCRIPTION}")
        description = read_description(zip_member(path, _DESCRIPTION, MAX_OCTETS + 1))
    except DamagedZipError as error:
        raise FmuFileError(f"it cannot be read as a zip file: {error}") from error
    return description, _library(description, names)


def _library(description: FmuDescription, names: list[str]) -> str:
    """FMI 2.0.5, clause 2.3; FMI 3.0.2, clause 2.5.1.4.1."""
    machine = platform.machine().lower()
    folders = [f"{machine}-linux"]
    if description.version == 2 and machine == "x86_64":
        folders.insert(0, "linux64")
    wanted = [f"binaries/{folder}/{description.identifier}.so" for folder in folders]
    found = next((name for name in wanted if name in names), None)
    if found is None:
        there = sorted({name.split("/")[1] for name in names if name.startswith("binaries/") and name.count("/") > 1})
        have = f"binaries for {shortened(there)} alone" if there else "no binaries"
        raise FmuFileError(f"it has {have}, and this machine is {folders[0]}", f"{wanted[0]} in it")
    return found


def _port(variable: FmuVariable) -> Port:
    return Port(variable.name, "bit" if variable.is_bit else "number", variable.doc, variable.unit)


def _value(variable: FmuVariable, value: bool | float | str) -> bool | int | float | str:
    """A start value as its variable's type has it; raises :class:`Problem`."""
    if variable.type == "String":
        if isinstance(value, str) and len(value) <= MAX_TEXT and "\0" not in value:
            return value
        raise Problem(f"is {shown(value)}", f"a text of at most {MAX_TEXT} characters")
    if variable.is_bit:
        if isinstance(value, bool):
            return value
        raise Problem(f"is {shown(value)}", "true or false")
    what = "a whole number" if variable.is_whole else "a number"
    if variable.has_limits:
        what += f" from {variable.low:g} to {variable.high:g}"
    if (
        isinstance(value, bool | str)
        or not variable.low <= value <= variable.high
        or (variable.is_whole and value != int(value))
    ):
        raise Problem(f"is {shown(value)}", f"{what} {variable.unit}".rstrip())
    return int(value) if variable.is_whole else float(value)
