"""A farm file as commands read it: against the installed models and the fault catalogue, and in one line."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from functools import cached_property
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    import typer

    from pnfarm.config.device import DeviceConfig
    from pnfarm.config.drive import DriveConfig
    from pnfarm.config.impairment import Impairment
    from pnfarm.drives.description.model import Model
    from pnfarm.farm.file.reading import FarmConfig, Known
    from pnfarm.farm.shard import Shard
    from pnfarm.signals.device_signal import KnownDevices

__all__ = [
    "check_impairments",
    "check_program",
    "counted",
    "described",
    "known_names",
    "link_text",
    "read",
    "shard_option",
    "summary",
]


def shard_option(context: typer.Context, text: str | None) -> Shard | None:
    """The shard of ``--shard`` or PNFARM_UP_SHARD; raises :class:`~pnfarm.errors.ConfigError` naming its source."""
    if text is None:
        return None
    from pnfarm.farm.shard import parse_shard

    source = context.get_parameter_source("shard")
    return parse_shard(text, "PNFARM_UP_SHARD" if source is not None and source.name == "ENVIRONMENT" else "--shard")


class _FaultKinds(Collection[str]):
    """The names of the fault catalogue, which is loaded when one is asked for: most farm files name none."""

    @cached_property
    def _names(self) -> frozenset[str]:
        from pnfarm.buses.registry import fault_kinds

        return frozenset(fault_kinds())

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


_FAULT_KINDS = _FaultKinds()


def known_names() -> Known:
    """The installed models and the fault catalogue, which a farm file refers to."""
    from pnfarm.config.known import catalogue

    return catalogue(_FAULT_KINDS)


def read(path: Path) -> FarmConfig:
    """A farm file, checked against the models and the fault catalogue.  Raises :class:`FarmFileError`."""
    from pnfarm.farm.file.reading import load_farm

    return load_farm(path, known_names())


def check_impairments(config: FarmConfig) -> None:
    """Check the parameters, drives and conditions of the file's impairments; raises :class:`FarmFileError`.

    The farm file's own checks only know the kinds; the fault catalogue knows the parameters of each, and the model its
    signals.
    """
    from pnfarm.config.drive import DriveConfig
    from pnfarm.drives import catalogue
    from pnfarm.farm.file.reading import FarmFileError, FileIssue, expand, expand_devices

    issues: list[FileIssue] = []
    named: set[str] = set()
    drives, devices = expand(config), expand_devices(config)
    known = _known_signals(config, devices)
    members: list[tuple[str, int, Sequence[Impairment], list[DriveConfig | DeviceConfig], Model | None]] = []
    for group, section in enumerate(config.drives):
        own = [drive for drive in drives if drive.group == group]
        members.append(("drives", group, section.impair, [*own], catalogue.model(section.model)))
    for group, described_section in enumerate(config.devices):
        own_devices = [device for device in devices if device.group == group]
        members.append(("devices", group, described_section.impair, [*own_devices], None))
    for key, group, impairments, stations, model in members:
        names = [name for one in stations for name in one.names]
        kinds = _kinds(stations[0], model)
        for number, impairment in enumerate(impairments):
            found = list(_misfits(impairment, key[:-1], model, kinds, names, known))
            if isinstance(stations[0], DriveConfig) and not found:
                found += _unknown_faults(impairment, stations[0])
            if impairment.name is not None and impairment.name in named:
                found.append(("as", f"{impairment.name!r} is the name of another fault", "a name of its own"))
            if impairment.name is not None:
                named.add(impairment.name)
            for field, what, allowed in found:
                location: tuple[str | int, ...] = (key, group, "impair", number, *field.split("."))
                place = f"{key}[{group}].impair[{number}].{field}"
                issues.append(FileIssue(*config.place(location), place, what, allowed))
    if issues:
        raise FarmFileError(issues)


def _kinds(one: DriveConfig | DeviceConfig, model: Model | None) -> tuple[str, ...]:
    """The names of a drive's model, or those of a device's file."""
    from pnfarm.config.device import DeviceConfig

    if isinstance(one, DeviceConfig):
        return one.kinds
    return () if model is None else (model.name, *model.aliases)


def _misfits(
    impairment: Impairment,
    what: str,
    model: Model | None,
    models: tuple[str, ...],
    names: Sequence[str],
    devices: KnownDevices,
) -> Iterator[tuple[str, str, str]]:
    """What is wrong with an impairment of drives of one model, or of devices: (field, what is wrong, allowed).

    ``what`` is one of them: ``drive``, ``device``; ``devices`` are all of the farm.
    """
    from pnfarm.buses.registry import fault_kinds
    from pnfarm.faults.errors import InjectionError
    from pnfarm.faults.targets import check_bus
    from pnfarm.signals.conditions import bind
    from pnfarm.vocabulary.conditions import ConditionError
    from pnfarm.vocabulary.globs import GLOBS, means

    try:
        spec = fault_kinds().parse(impairment.as_dict() | {"on": "all"})
        if model is not None:
            check_bus(names[0], model.bus, spec)
    except InjectionError as exc:
        yield from exc.issues
    if impairment.on is not None and not any(means(glob, (name,), models) for glob in impairment.on for name in names):
        yield "on", f"means no {what} of this group: {names[0]} to {names[-1]}", GLOBS
    if impairment.when is not None:
        try:
            bind(impairment.when, model, devices, "" if model is not None else names[0])
        except ConditionError as exc:
            yield "when", f"column {exc.column}: {exc.what}", exc.allowed


def _unknown_faults(impairment: Impairment, drive: DriveConfig) -> Iterator[tuple[str, str, str]]:
    """A fault of its own that no drive of the group has, also none that the file adds."""
    if impairment.kind not in {"drive-fault", "drive-warning"}:
        # what makes the model of the file takes the compiler with it
        return
    from pnfarm.buses.registry import fault_kinds
    from pnfarm.farm.farm import model_of
    from pnfarm.scenario.definition.binding import own_fault_errors

    yield from own_fault_errors(fault_kinds().parse(impairment.as_dict() | {"on": "all"}), model_of(drive))


def _known_signals(config: FarmConfig, devices: Sequence[DeviceConfig]) -> KnownDevices:
    """Signals by the names of devices, and of models of the plant, whose files are run."""
    if config.plant is None:
        # what reads a plant takes the compiler with it
        return {device.name: device.known_signals for device in devices}
    from pnfarm.farm.farm import model_of
    from pnfarm.farm.plant import known_signals

    return known_signals(config, model_of)[0]


def check_program(config: FarmConfig) -> None:
    """Load the file of the controller's own program, if it has one; raises :class:`ConfigError`."""
    if all(section.program.python is None for section in config.controllers):
        return
    from pnfarm.controller.program_file import program_of
    from pnfarm.errors import ConfigError
    from pnfarm.vocabulary.issues import FarmFileError, FileIssue, field_path

    try:
        program_of(config)
    except ConfigError as exc:
        if not isinstance(exc.__cause__, OSError):
            raise
        # its name is wrong, which is in this file
        at = next(one.at("program", "python") for one in config.controllers if one.program.python is not None)
        _, _, what = str(exc).partition(": ")
        issue = FileIssue(*config.place(at), field_path(at), what, "a Python file, relative to this one")
        raise FarmFileError([issue]) from exc


def summary(config: FarmConfig) -> str:
    """A summary of the farm file in one line."""
    from pnfarm.farm.file.choice import bus_of_controller
    from pnfarm.farm.file.reading import expand
    from pnfarm.vocabulary.endpoints import host_port

    drives = expand(config)
    kinds = ", ".join(f"{count} {model}" for model, count in Counter(drive.model for drive in drives).items())
    parts = [f"{counted(len(drives), 'drive')} ({kinds})"] if drives else []
    if config.devices:
        parts.append(counted(sum(group.count for group in config.devices), "device"))
    if config.farm is not None:
        api = config.api
        parts.insert(0, f"farm {config.farm}")
        parts.append(f"on {link_text(config)}")
        parts.append("no API" if api is None else f"API {host_port(api.host, api.port)}")
    several = len(config.controllers) > 1
    for section in config.controllers:
        on = f" on {bus_of_controller(section).title}" if several else ""
        parts.append(f"controller {section.name}{on}")
        if section.device_names:
            parts.append(f"{counted(len(section.device_names), 'device')} by {section.description_file} file")
    return ", ".join(parts)


def described(config: FarmConfig) -> Iterator[str]:
    """What was taken from the files of the farm's devices, group by group."""
    for group in config.devices:
        for sentence in group.described.sentences() if group.is_described else ():
            yield f"{group.name}: {sentence}"


def link_text(config: FarmConfig) -> str:
    """``macvlan eth1``, ``veth``."""
    link = config.link
    if link is None:
        return "no link"
    target = getattr(link, "parent", None) or getattr(link, "bridge", None)
    return f"{link.kind} {target}" if target else link.kind


def counted(number: int, word: str) -> str:
    """``1 drive``, ``8 drives``."""
    return f"{number} {word}{'' if number == 1 else 's'}"
