"""From a model's folder to a :class:`~pnfarm.drives.description.model.Model`.

:mod:`~pnfarm.drives.description.files` describes the files and how those of product and bus are joined.  Each kind of
data has its module: :mod:`~pnfarm.drives.description.sections`, :mod:`~pnfarm.drives.parameters.rows`,
:mod:`~pnfarm.drives.description.fault_rows`, :mod:`~pnfarm.drives.telegrams.tables`,
:mod:`~pnfarm.drives.description.behaviour`.  Every mistake is a :class:`~pnfarm.errors.ConfigError` that names file,
line and field.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pnfarm.drives.description.axis_sections import (
    read_limits,
    read_motion_tasks,
    read_parameter_texts,
    read_position_units,
    read_watched,
)
from pnfarm.drives.description.behaviour import BUS_FACTS, SECTIONS, read_behaviour, with_behaviour
from pnfarm.drives.description.behaviour_sets import read_sets
from pnfarm.drives.description.bus_sections import (
    read_access,
    read_address_mode,
    read_communication_loss,
    read_dap,
    read_description_file,
    read_diagnoses,
    read_diagnosis_coding,
    read_lamps,
    read_parameter_words,
)
from pnfarm.drives.description.fault_rows import read_faults
from pnfarm.drives.description.files import ModelFiles
from pnfarm.drives.description.model import Model
from pnfarm.drives.description.motor_kinds import axis_values, read_motor_kinds
from pnfarm.drives.description.numbering import read_numbering
from pnfarm.drives.description.parts import FollowingError, Identity, SignOfLife
from pnfarm.drives.description.realism import read_realism
from pnfarm.drives.description.sections import Sections
from pnfarm.drives.parameters.consequences import read_consequences
from pnfarm.drives.parameters.control_limits import read_control_limits
from pnfarm.drives.parameters.effects import read_effects
from pnfarm.drives.parameters.factor_group import read_factor_group
from pnfarm.drives.parameters.rows import axis_parameters, parameter_names, read_only_names, read_parameters
from pnfarm.drives.profiles.cip.part import CIP, Cip, read_cip
from pnfarm.drives.profiles.profidrive.part import PROFIDRIVE, Profidrive
from pnfarm.drives.telegrams.tables import read_telegrams
from pnfarm.drives.telegrams.telegram import NO_MODULE
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pnfarm.drives.description.parts import Fault
    from pnfarm.drives.description.sections import Section
    from pnfarm.drives.parameters.numbers import ParameterNumbers
    from pnfarm.drives.parameters.parameter import Parameter

__all__ = ["load_model"]

#: Keys outside of sections in ``model.toml`` or ``bus.toml``.
TEXTS = ("name", "title", "maker", "bus", "manual", "edition", "firmware_version")


def load_model(folder: Path) -> Model:
    """Read and check a model's folder, and those of its bus and its product."""
    try:
        return _load(folder)
    except (TypeError, AttributeError, LookupError, ValueError) as exc:
        # TOML has values of every form anywhere: a list where a text has to be
        raise ConfigError(f"{folder}: a value in its files has a wrong form: {exc}") from exc


def _load(folder: Path) -> Model:
    files = ModelFiles(folder)
    sections = Sections(files)
    numbering = read_numbering(sections.section("numbering"))
    parameters, numbers = read_parameters(files, numbering)
    sections.number(numbers)
    names = sections.data.get("parameter_names", {})
    faults = read_faults(files, sections.without_faults, parameters, numbers)
    limits = read_limits(sections.section("limits"))
    described = Model(
        **{key: sections.wanted(key) for key in TEXTS},
        aliases=tuple(sections.data.get("aliases", ())),
        profile=sections.data.get("profile", ""),
        # the drive
        parameters=parameters,
        parameter_names=parameter_names(parameters, names, numbering, sections.place),
        read_only_names=read_only_names(names),
        axis_parameters=axis_parameters(parameters),
        numbering=numbering,
        faults=faults,
        limits=limits,
        motor=axis_values(sections.section("motor"), "station"),
        firmware=axis_values(sections.section("firmware"), "parameter"),
        motor_kinds=read_motor_kinds(sections.motors, parameters),
        realism=read_realism(sections.section("realism")),
        following_error=read_watched(FollowingError, sections.section("following_error"), faults),
        motion_tasks=read_motion_tasks(sections.section("motion_tasks"), parameters),
        position_units=read_position_units(sections.section("position_units"), parameters),
        control_limits=read_control_limits(sections.section("control_limits"), parameters),
        factor_group=read_factor_group(sections.section("factor_group"), parameters),
        parameter_texts=read_parameter_texts(sections.section("parameter_texts"), parameters),
        consequences=read_consequences(
            sections.data.get("consequence", ()), parameters, numbers, sections.file("consequence")
        ),
        # the drive on its bus
        profidrive=_profidrive(files, sections, parameters, numbers, faults),
        cip=read_cip(files, parameters) if sections.data.get("profile") == CIP else Cip(),
        dap=read_dap(sections.wanted("dap"), sections.place) if sections.data["bus"] == "profinet" else NO_MODULE,
        bus_facts=sections.section(sections.data["bus"]),
        access=read_access(sections.section("parameter_access"), parameters),
        communication_loss=read_communication_loss(sections.section("communication_loss"), faults, parameters),
        address_mode=read_address_mode(sections.section("address_mode"), parameters),
        lamps=read_lamps(sections.section("lamps")),
        description_file=read_description_file(sections.section("description_file")),
        diagnoses=read_diagnoses(sections.section("diagnosis"), faults, limits),
        diagnosis_coding=read_diagnosis_coding(sections.section("diagnosis_coding"), parameters),
        facts=sections.facts,
    )
    written = {parameter.argument for parameter in described.axis_parameters}
    fixed: set[object] = {*written, *described.firmware, *((BUS_FACTS, key) for key in described.bus_facts)}
    fixed.update(*(kind.firmware for kind in described.motor_kinds.values()))

    def value_of(section: str, key: str, value: Any, where: str) -> Any:
        """The value of a section's key under a reading that sets it; checked like the section itself."""
        changed = sections.section(section).with_value(key, value, where).numbered(numbers)
        return changed[key] if section == described.bus else getattr(_part(changed, faults, parameters), key)

    places = SECTIONS | {described.bus: BUS_FACTS}
    points = read_behaviour(files, parameters, numbers, fixed, places, value_of)
    sets = read_sets(files, points, faults, described.diagnoses)
    described = replace(
        described, behaviour=points, behaviour_sets=sets, effects=read_effects(described, sections.section("effects"))
    )
    return with_behaviour(described, {})


def _profidrive(
    files: ModelFiles,
    sections: Sections,
    parameters: Mapping[int, Parameter],
    numbers: ParameterNumbers,
    faults: Mapping[int, Fault],
) -> Profidrive:
    """The model's PROFIdrive data; empty for a model without the profile."""
    if sections.data.get("profile") != PROFIDRIVE:
        return Profidrive()
    # PROFIBUS has no numbers of modules: a telegram is known by its identifiers
    layout = None if sections.data["bus"] == "profibus" else sections.wanted("telegram_module")
    signals, telegrams, supplements, bits = read_telegrams(files, layout, parameters, numbers)
    default = sections.wanted("default_telegram")
    if default not in telegrams:
        raise ConfigError(f"{sections.place('', 'default_telegram')}: there is no telegram {default}")
    return Profidrive(
        identity=sections.section("identity").build(Identity),
        default_telegram=default,
        telegrams=telegrams,
        supplements=supplements,
        signals=signals,
        word_bits=bits,
        parameter_words=read_parameter_words(sections.section("parameter_words"), telegrams.values()),
        sign_of_life=read_watched(SignOfLife, sections.section("sign_of_life"), faults),
    )


def _part(section: Section, faults: Mapping[int, Fault], parameters: Mapping[int, Parameter]) -> Any:
    """One of the sections whose values a reading may set (:data:`pnfarm.drives.description.behaviour.SECTIONS`)."""
    match section.name:
        case "communication_loss":
            return read_communication_loss(section, faults, parameters)
        case "parameter_access":
            return read_access(section, parameters)
        case _:
            return read_position_units(section, parameters)
