"""Kinds of injections that drives on any bus can have, as they are on PROFIBUS; and those that it has not."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pnfarm.faults.kind import KindOnBus, ParamSpec

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["ON_PROFIBUS"]

_TITLE: Final = "PROFIBUS"
#: What masters report of a slave that does not answer.
_GONE: Final = (
    "S7-300/400: station failure (OB86), and I/O access errors (OB122); CODESYS: the slave is not running (assumed)."
)


def _on(wire: str, reports: str, params: Mapping[str, ParamSpec] | None = None) -> KindOnBus:
    return KindOnBus(_TITLE, params or {}, wire=wire, reports=reports)


def _no(why: str) -> KindOnBus:
    return KindOnBus(_TITLE, refused=why)


_RETRIED: Final = "The master repeats the request as often as its retries permit, with the same FCB."
_TELEGRAMS: Final = {
    "loss": _on(
        f"Answers are missing, or requests are not received. {_RETRIED}",
        f"Nothing while a repetition is answered; then: {_GONE}",
    ),
    "delay": _on(
        "Answers come later, also later than the slot time permits; the line waits, or the answer falls into the next "
        "request.",
        f"Within the slot time nothing; beyond it the request is repeated, then: {_GONE}",
    ),
    "duplicate": _on(
        "An answer is sent twice, the second one without a request.",
        "Nothing, or a line error that is counted: the second answer belongs to no request (assumed).",
    ),
    "corrupt": _on(
        "Inverted bits anywhere in a telegram: wrong FCS, wrong delimiters, another address.",
        f"The telegram is discarded. {_RETRIED} Then: {_GONE}",
    ),
    "silence": _on(f"No answer of the slave; it receives everything. {_RETRIED}", _GONE),
    "timeout": _on(
        "No answer of the slave for a little more than its watchdog; then it is parametrised again.",
        f"Once: {_GONE} The slave comes back.",
    ),
    "link-down": _on("The plug is pulled at the slave: it neither receives nor answers; the line continues.", _GONE),
    "link-flap": _on("The plug is pulled repeatedly.", f"Each time: {_GONE} Then the slave is parametrised again."),
    "drop-cycles": _on(
        f"That many answers to Data_Exchange are missing. {_RETRIED}",
        f"Fewer than the retries: nothing. From them on: {_GONE}",
    ),
    "late-frames": _on(
        "An answer to Data_Exchange is late by `by`.",
        "Within the slot time nothing; beyond it as one that is missing.",
    ),
}

_CONNECTION: Final = {
    "ar-abort": _on(
        "The slave leaves its data exchange and waits for parameters: a Data_Exchange is answered as by one that was "
        "just switched on (RS).",
        "The slave is parametrised again; S7: station failure and return (assumed).",
    ),
    "watchdog-expire": _on(
        "The slave behaves as if its watchdog had expired: outputs are zero, a drive raises 32-1, and it waits for "
        "parameters.",
        "The slave is parametrised again; the program sees the drive's fault.",
    ),
    "connect-refuse": _on(
        "Set_Prm is acknowledged, and the diagnosis after it says Prm_Fault: data exchange does not begin.",
        "Parameter assignment error of the slave, again and again.",
    ),
    "record-error": _on(
        "Negative responses to Read and Write on MSAC1 and MSAC2 with the error code given.",
        "RDREC, WRREC, SFB52 and SFB53 end with the error code in STATUS.",
        {
            "error": ParamSpec(
                "whole number",
                "Error_Code_1: class and code (PROFIBUS guideline 2.182, table 4).",
                default="state-conflict",
                words={
                    "read-error": 0xA0,
                    "write-error": 0xA1,
                    "module-failure": 0xA2,
                    "invalid-index": 0xB0,
                    "invalid-length": 0xB1,
                    "invalid-slot": 0xB2,
                    "access-denied": 0xB6,
                    "invalid-range": 0xB7,
                    "invalid-parameter": 0xB8,
                    "state-conflict": 0xB5,
                    "resource-busy": 0xC2,
                    "resource-unavailable": 0xC3,
                },
                low=1,
                high=0xFF,
            ),
        },
    ),
    "record-delay": _on(
        "Polls of the answer are answered as not ready, for the time given.",
        "The bus reports nothing: reading and writing takes longer, or ends by the program's own time limit.",
    ),
}

_SHOWN: Final = "ZSW1.3 is set, and the slave reports a diagnosis if it has more than six octets"
_SEEN: Final = "The program sees it in ZSW1; with an extended diagnosis, S7: diagnostic interrupt (OB82)."
_DRIVE: Final = {
    "drive-fault": _on(f"{_SHOWN}; the power stage goes off if the fault's reaction says so.", _SEEN),
    "drive-warning": _on("ZSW1.7 is set.", "The bus reports nothing: the program sees it in ZSW1."),
    "fault-not-acknowledging": _on(f"{_SHOWN}; ZSW1.3 stays set, whatever acknowledges.", _SEEN),
    **{
        cause: _on(f"{_SHOWN}, and ZSW1.2 falls.", _SEEN)
        for cause in ("undervoltage", "encoder-error", "following-error", "sto")
    },
    "limit-switch": _on("The velocity falls to 0; ZSW1 and the digital inputs show it.", "The bus reports nothing."),
    "load": _on("Actual velocity, position and torque change.", "The bus reports nothing."),
    "stuck-axis": _on("The actual position does not change, the actual velocity is 0.", "The bus reports nothing."),
    "slow-ramp": _on("The actual velocity changes more slowly.", "The bus reports nothing."),
    "not-ready": _on("ZSW1.0 falls, and no control word switches the drive on.", "The bus reports nothing."),
    "digital-input": _on("The input's bit where a telegram or parameter has it.", "The bus reports nothing."),
    "power-cycle": _on(
        f"The slave is mute until it has booted. {_RETRIED}", f"{_GONE} The slave is parametrised again."
    ),
}

_SIGNALS: Final = {
    "wire-break": _on(
        "The signal's octets in the inputs; answers of high priority (DH), and the diagnosis has the error 6, line "
        "break, of its channel.",
        "S7: diagnostic interrupt (OB82), coming, and going at the end; CODESYS: a diagnosis (assumed).",
    ),
}

_NO_ADDRESS: Final = "a slave has no hardware address; wrong-ident and duplicates of a station address are its own"
_NO_LIFE: Final = "the manual has a sign of life for PROFINET only (8.3.2)"
_NO_CALLS: Final = "requests are answered in the same slot or not at all; record-delay makes the drive's answers late"
_NO_STREAMS: Final = "it has no TCP"
_REFUSED: Final = {
    "reorder": _no("each request is answered before the next one: there is nothing to overtake"),
    "throttle": _no("the line has one baud rate for all; baud-change gives the slave another one"),
    "wrong-length": _no("the slave answers with its configured length; config-fault makes it another one"),
    "mac-change": _no(_NO_ADDRESS),
    "f702": _no("702 is a fault of the AKD; drive-fault with 32-1 is this drive's"),
    "sign-of-life-freeze": _no(_NO_LIFE),
    "sign-of-life-skip": _no(_NO_LIFE),
    "sign-of-life-loss": _no(_NO_LIFE),
    "rpc-delay": _no(_NO_CALLS),
    "rpc-silence": _no(_NO_CALLS),
    "session-drop": _no(_NO_STREAMS),
    "tcp-refuse": _no(_NO_STREAMS),
}

ON_PROFIBUS: Mapping[str, KindOnBus] = {**_TELEGRAMS, **_CONNECTION, **_DRIVE, **_SIGNALS, **_REFUSED}
