"""A drive's properties on a bus, from its sections: identity, access to parameters, lost data, diagnosis, lamps."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from functools import partial
from typing import TYPE_CHECKING, Any

from pnfarm.drives.description.axis_sections import wants_stored
from pnfarm.drives.description.fault_rows import number_of_fault
from pnfarm.drives.description.lamps import Lamps
from pnfarm.drives.description.parts import (
    DIAGNOSIS_CODINGS,
    AddressMode,
    CommunicationLoss,
    DescriptionFile,
    DiagnosisCoding,
    ParameterAccess,
)
from pnfarm.drives.profiles.profidrive.pkw import PARAMETER_TASKS, ParameterWords
from pnfarm.drives.telegrams.telegram import Module, Submodule
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from pnfarm.drives.description.parts import Fault, Limits
    from pnfarm.drives.description.sections import Section
    from pnfarm.drives.parameters.parameter import Parameter
    from pnfarm.drives.telegrams.telegram import Telegram

__all__ = [
    "read_access",
    "read_address_mode",
    "read_communication_loss",
    "read_dap",
    "read_description_file",
    "read_diagnoses",
    "read_diagnosis_coding",
    "read_lamps",
    "read_parameter_words",
]


def read_dap(dap: Mapping[str, Any], place: Callable[[str], str]) -> Module:
    """The section ``dap``: the module in slot 0."""
    try:
        submodules = tuple(Submodule(input_bytes=0, output_bytes=0, **entry) for entry in dap["submodules"])
        ident = dap["module_ident"]
        return Module(ident["value"], submodules, ident["source"], ident.get("note", ""))
    except (KeyError, TypeError) as exc:
        raise ConfigError(f"{place('dap')}: {exc}") from exc


def read_description_file(section: Section) -> DescriptionFile | None:
    if not section:
        return None
    file: DescriptionFile = section.build(DescriptionFile)
    try:
        datetime.strptime(str(file.date), "%Y%m%d")  # noqa: DTZ007  # a day, in no time zone
    except ValueError:
        raise section.wrong("date", f"{file.date!r} is not a date such as 20261121") from None
    for key, text in (("family", file.family), ("info_text", file.info_text)):
        if not isinstance(text, str) or not text or not text.isprintable():
            raise section.wrong(key, f"{text!r} is not a text of one line")
    return file


def read_communication_loss(
    section: Section, faults: Mapping[int, Fault], parameters: Mapping[int, Parameter]
) -> CommunicationLoss:
    loss: CommunicationLoss = section.build(CommunicationLoss)
    loss = replace(loss, fault=number_of_fault(str(loss.fault), partial(section.where, "fault")))
    if loss.fault not in faults or {loss.action_parameter, loss.stop_parameter} - parameters.keys() - {0}:
        raise section.wrong("", "names a fault or a parameter that does not exist")
    if type(loss.on_stop) is not bool or (loss.stop_parameter and "on_stop" in section):
        raise section.wrong("on_stop", "true or false, of a drive without stop_parameter")
    return loss


def read_parameter_words(section: Section, telegrams: Iterable[Telegram]) -> ParameterWords | None:
    """The section ``parameter_words`` of a drive with a cyclic parameter channel."""
    if not section:
        if any(telegram.parameter_words for telegram in telegrams):
            raise section.wrong("", "missing, and a telegram has a parameter channel")
        return None
    words: ParameterWords = section.build(ParameterWords)
    unknown = set(words.tasks) - PARAMETER_TASKS if isinstance(words.tasks, tuple) else True
    if unknown or len(words.tasks) > 16:
        raise section.wrong("tasks", f"must be at most 16, each one of {', '.join(sorted(PARAMETER_TASKS))}")
    for key, value in section.values_by_key().items():
        if key != "tasks" and value not in range(1, 16):
            raise section.wrong(key, f"{value!r} is not a response identifier from 1 to 15")
    return words


def read_access(section: Section, parameters: Mapping[int, Parameter]) -> ParameterAccess:
    """The section about access to parameters; checks that the named ones exist."""
    access: ParameterAccess = section.build(ParameterAccess)
    name = parameters.get(access.station_name)
    if access.station_name and (name is None or not name.text or not name.defaults):
        raise section.wrong("station_name", f"{access.station_name} is not a parameter of type String with a default")
    for key, numbers in (("disabled_only", access.disabled_only), ("absent", access.absent)):
        if unknown := set(numbers) - parameters.keys():
            raise section.wrong(key, f"there is no parameter {min(unknown)}")
    elements = [parameters.get(pnu) for pnu in access.mapping_elements]
    if elements and (len(elements) != 2 or any(p is None or not p.elements for p in elements)):
        raise section.wrong("mapping_elements", f"{list(access.mapping_elements)} are not two arrays")
    return access


def read_address_mode(section: Section, parameters: Mapping[int, Parameter]) -> AddressMode | None:
    if not section:
        return None
    mode: AddressMode = section.build(AddressMode)
    parameter = wants_stored(section, "parameter", parameters)
    if not parameter.nonvolatile:
        raise section.wrong("parameter", f"{mode.parameter} is not permanent")
    if not isinstance(mode.dcp, int) or not parameter.allows(mode.dcp):
        raise section.wrong("dcp", f"{mode.dcp!r} is not a value of {parameter.name}")
    return mode


def read_lamps(section: Section) -> Lamps | None:
    if not section:
        return None
    lengths = {len(value) if isinstance(value, tuple) else 0 for value in section.values_by_key().values()}
    if 0 in lengths or len(lengths) > 1:
        raise section.wrong("", "each state needs as many entries as there are names")
    lamps: Lamps = section.build(Lamps)
    return lamps


def read_diagnoses(section: Section, faults: Mapping[int, Fault], limits: Limits) -> dict[int, int]:
    """Fault -> ChannelErrorType, within the ranges of manufacturers and profiles (IEC 61158-6-10, ChannelErrorType)."""
    found: dict[int, int] = {}
    for key, value in section.values_by_key().items():
        number = number_of_fault(key, partial(section.where, key))
        if number not in faults:
            raise section.wrong(key, f"there is no fault {number}")
        if not isinstance(value, int) or not (0x0100 <= value <= 0x7FFF or 0x9000 <= value <= 0x9FFF):
            raise section.wrong(key, f"{value!r} is not within 0x0100..0x7FFF and 0x9000..0x9FFF")
        found[number] = value
    if found and not limits.alarms:
        raise section.wrong("", "a drive without alarms reports no diagnosis; it needs limits.alarms")
    return found


def read_diagnosis_coding(section: Section, parameters: Mapping[int, Parameter]) -> DiagnosisCoding | None:
    if not section:
        return None
    coding: DiagnosisCoding = section.build(DiagnosisCoding)
    if coding.mode_parameter not in parameters:
        raise section.wrong("mode_parameter", f"there is no parameter {coding.mode_parameter}")
    unknown = set(coding.modes) - DIAGNOSIS_CODINGS
    if unknown or len(coding.modes) != len(coding.subslots):
        allowed = ", ".join(sorted(DIAGNOSIS_CODINGS))
        raise section.wrong("modes", f"each is one of {allowed}, with a subslot for each in subslots")
    if not 1 <= coding.user_structure <= 0x7FFF:
        raise section.wrong("user_structure", f"{coding.user_structure} is not within 1..0x7FFF")
    if len(coding.user_fields) != len(coding.user_octets) or set(coding.user_octets) - {1, 2, 4}:
        raise section.wrong("user_fields", "each needs its 1, 2 or 4 octets in user_octets")
    return coding
