"""Kinds of faults that speak through the alarm channel."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from pnfarm.faults.catalogue_modules import SLOT, SUBSLOT
from pnfarm.faults.kind import FaultKind, ParamSpec, words_of
from pnfarm.protocols.profinet.wire.alarms import AlarmType
from pnfarm.protocols.profinet.wire.diagnosis import WHOLE_SUBMODULE, Usi
from pnfarm.protocols.profinet.wire.diagnosis_words import (
    CHANNEL_ERROR_TYPES,
    EXT_CHANNEL_ERROR_TYPES,
    PROFIDRIVE_ERROR_TYPES,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

__all__ = ["ALARM_KINDS", "SEVERITIES"]

_WORD: dict[str, Any] = {"low": 0, "high": 0xFFFF}
_NEVER_BY_ITSELF = (
    "No drive of the farm does so by itself, and manuals may deny alarms (AKD: 5.13, not implemented); this tests the "
    "controller."
)

#: In rising order of severity; "advice" takes a qualified coding.
SEVERITIES = {"advice": 0, "maintenance-required": 1, "maintenance-demanded": 2, "fault": 3}
_CODINGS = {"channel": Usi.CHANNEL, "extended": Usi.EXT_CHANNEL, "qualified": Usi.QUALIFIED_CHANNEL, "manufacturer": 0}


def _slugs(tables: Iterable[Mapping[int, str]]) -> dict[str, int]:
    """The words for codes as they are written in a fault: ``wire-break``."""
    found: dict[str, int] = {}
    for table in tables:
        for code, words in table.items():
            plain = words.lower().replace("'s", "")
            found.setdefault(re.sub("[^a-z0-9]+", "-", plain).strip("-"), code)
    return found


_ERROR_TYPES = _slugs((CHANNEL_ERROR_TYPES, PROFIDRIVE_ERROR_TYPES))
_EXT_TYPES = _slugs(EXT_CHANNEL_ERROR_TYPES.values())

_TYPE = ParamSpec("whole number", "AlarmType.", default="process", words=words_of(AlarmType), low=1, high=0xFFFF)
_PRIORITY = ParamSpec(
    "word",
    "Of the alarm; left out, high for process alarms and low for all others.",
    words={"low": 0, "high": 1},
)
_ERROR_IN_ALARM = ParamSpec(
    "whole number",
    "The alarm carries this ChannelErrorType as channel diagnosis; left out, it carries nothing.",
    words=_ERROR_TYPES,
    low=1,
    high=0xFFFF,
)
_PLACE = {"slot": SLOT, "subslot": SUBSLOT}

ALARM_KINDS = (
    FaultKind(
        "alarm-storm",
        "alarms",
        "The drive sends one alarm after the other, as fast as the controller acknowledges them, or at a rate.  A "
        "submodule that they said came or went is told by a plug when this ends.  " + _NEVER_BY_ITSELF,
        "an alarm; one that finds the alarm queue full is a check without an activation",
        "alarm-storm",
        {
            "type": _TYPE,
            "priority": _PRIORITY,
            **_PLACE,
            "error": _ERROR_IN_ALARM,
            "interval": ParamSpec("duration", "From one alarm to the next, at least; 100us is the shortest.", "1ms"),
            "wait": ParamSpec("yes or no", "For the controller's AlarmAck before the next alarm.", default=True),
        },
        takes=frozenset({"count", "for"}),
    ),
    FaultKind(
        "alarm-unacknowledged",
        "alarms",
        "The alarm handshake breaks.  With `no-ack` the drive sends an alarm and never acknowledges the controller's "
        "AlarmAck, so that the controller repeats it and ends the connection.  With `repeat` the drive repeats its "
        "alarm, as if the controller's acknowledgement had not come, and then ends the connection.  "
        + _NEVER_BY_ITSELF,
        "one broken connection; without `count` and `for` it happens once",
        "alarm-unacknowledged",
        {
            "what": ParamSpec("word", "Who misses an acknowledgement.", "no-ack", words={"no-ack": 0, "repeat": 1}),
            "raise": ParamSpec(
                "yes or no", "An alarm of its own begins it; otherwise the next one that comes.", default=True
            ),
            "type": _TYPE,
            "priority": _PRIORITY,
            **_PLACE,
            "error": _ERROR_IN_ALARM,
        },
        takes=frozenset({"probability", "seed", "count", "for"}),
    ),
    FaultKind(
        "diagnosis",
        "alarms",
        "A diagnosis of a submodule appears, and disappears when this ends: alarms, the ModuleDiffBlock, the diagnosis "
        "records, and for a fault the problem indicator of the data status.  It waits for its submodule, and comes "
        "back with it.  " + _NEVER_BY_ITSELF,
        "the diagnosis",
        "diagnosis",
        {
            "error": ParamSpec(
                "whole number", "ChannelErrorType.", default="error", words=_ERROR_TYPES, low=1, high=0xFFFF
            ),
            "ext": ParamSpec(
                "whole number", "ExtChannelErrorType, where the coding has one.", default=0, words=_EXT_TYPES, **_WORD
            ),
            "add-value": ParamSpec(
                "whole number", "ExtChannelAddValue, where the coding has one.", default=0, low=0, high=0xFFFF_FFFF
            ),
            "channel": ParamSpec(
                "whole number",
                "ChannelNumber.",
                default="submodule",
                words={"submodule": WHOLE_SUBMODULE},
                low=0,
                high=WHOLE_SUBMODULE,
            ),
            **_PLACE,
            "severity": ParamSpec(
                "word", "How bad it is; advice only in the qualified coding.", "fault", words=SEVERITIES
            ),
            "coding": ParamSpec("word", "How it is told.", "channel", words=_CODINGS),
            "usi": ParamSpec(
                "whole number",
                "UserStructureIdentifier of the manufacturer's coding.",
                default=1,
                low=0,
                high=Usi.MANUFACTURER_LAST,
            ),
            "data": ParamSpec("octets", "What the manufacturer's coding carries.", default="", high=128),
        },
        takes=frozenset({"for", "cycles"}),
    ),
)
