"""Alarms that an injection raises: their parameters, and the alarm that they describe."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from pnfarm.buses.profinet.faults.alarms import OwnAlarm
from pnfarm.buses.profinet.faults.slot_effect import SLOT, SUBSLOT
from pnfarm.faults.kind import ParamSpec, words_of
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmItem, AlarmType
from pnfarm.protocols.profinet.wire.records.diagnosis import (
    WHOLE_SUBMODULE,
    ChannelDiagnosis,
    ChannelProperties,
    emit_items,
)
from pnfarm.protocols.profinet.wire.records.diagnosis_texts import (
    CHANNEL_ERROR_TYPES,
    EXT_CHANNEL_ERROR_TYPES,
    PROFIDRIVE_ERROR_TYPES,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pnfarm.buses.profinet.faults.modules import Modules

__all__ = ["ERROR_TYPES", "EXT_TYPES", "NEVER_BY_ITSELF", "OWN_ALARM_PARAMS", "own_alarm"]

#: Part of the description of such a kind.
NEVER_BY_ITSELF = (
    "No drive of the farm does this by itself, and manuals may deny alarms (AKD: 5.13, not implemented); this tests "
    "the controller."
)


def _slugs(tables: Iterable[Mapping[int, str]]) -> dict[str, int]:
    """Names of codes as a user writes them: ``wire-break``."""
    found: dict[str, int] = {}
    for table in tables:
        for code, words in table.items():
            plain = words.lower().replace("'s", "")
            found.setdefault(re.sub("[^a-z0-9]+", "-", plain).strip("-"), code)
    return found


ERROR_TYPES = _slugs((CHANNEL_ERROR_TYPES, PROFIDRIVE_ERROR_TYPES))
EXT_TYPES = _slugs(EXT_CHANNEL_ERROR_TYPES.values())

OWN_ALARM_PARAMS = {
    "type": ParamSpec("whole number", "AlarmType.", default="process", words=words_of(AlarmType), low=1, high=0xFFFF),
    "priority": ParamSpec(
        "word",
        "Of the alarm; left out, high for process alarms and low for all others.",
        words={"low": 0, "high": 1},
    ),
    "slot": SLOT,
    "subslot": SUBSLOT,
    "error": ParamSpec(
        "whole number",
        "The alarm carries this ChannelErrorType as channel diagnosis; left out, it carries nothing.",
        words=ERROR_TYPES,
        low=1,
        high=0xFFFF,
    ),
}


def own_alarm(values: dict[str, Any], modules: Modules) -> OwnAlarm:
    """The alarm that the parameters of such a kind describe."""
    alarm_type, priority = values["type"], values["priority"]
    items: tuple[AlarmItem, ...] = ()
    if values["error"] is not None:
        item = ChannelDiagnosis(WHOLE_SUBMODULE, ChannelProperties(), values["error"])
        items = tuple(AlarmItem(usi, data) for usi, data in emit_items((item,)))
    high = alarm_type == AlarmType.PROCESS if priority is None else priority == "high"
    return OwnAlarm(alarm_type, modules.place(values["slot"], values["subslot"]), high, items)
