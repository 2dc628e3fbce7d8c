"""What PROFINET adds to kinds of injections that drives on any bus can have."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pnfarm.faults.kind import OCTET, KindOnBus, ParamSpec, words_of
from pnfarm.protocols.profinet.errors import AccessError, CmrpcError, ConnectFault, RtaError

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["ON_PROFINET"]

_TITLE: Final = "PROFINET"

ON_PROFINET: Mapping[str, KindOnBus] = {
    "ar-abort": KindOnBus(
        _TITLE,
        {
            "code": ParamSpec(
                "whole number",
                "ErrorCode2 of the abort.",
                default="abort-request",
                words=words_of(RtaError),
                **OCTET,
            )
        },
        wire="An ERR-RTA-PDU (RTA_ERR_CLS_PROTOCOL) with the error code; cyclic frames end.",
    ),
    "connect-refuse": KindOnBus(
        _TITLE,
        {
            "code1": ParamSpec(
                "whole number",
                "ErrorCode1: the block or protocol machine.",
                default="cmrpc",
                words=words_of(ConnectFault),
                **OCTET,
            ),
            "code2": ParamSpec(
                "whole number",
                "ErrorCode2; the words are those of CMRPC.",
                default="out-of-ar-resources",
                words=words_of(CmrpcError),
                **OCTET,
            ),
        },
        wire="Connect responses with the error code in PNIO status (DB 81 and two codes).",
    ),
    "record-error": KindOnBus(
        _TITLE,
        {
            "code": ParamSpec(
                "whole number", "ErrorCode1.", default="module-failure", words=words_of(AccessError), **OCTET
            ),
            "code2": ParamSpec("whole number", "ErrorCode2.", default=0, **OCTET),
        },
        wire="Read and write responses of the drive's own records with the error code in PNIO status (DE or DF 80).",
    ),
    "record-delay": KindOnBus(
        _TITLE, wire="Parameter responses are late; to a repeated call the drive answers meanwhile that it is working."
    ),
    "session-drop": KindOnBus(_TITLE, refused="it has no sessions; ar-abort ends a connection"),
    "wire-break": KindOnBus(
        _TITLE,
        wire="The signal's octets in the device's cyclic data, with status GOOD.  If the device's file has the "
        'ChannelErrorType 6, "wire break": its channel diagnosis, as an alarm and in the diagnosis records, and '
        "ProblemIndicator in the data status.",
        reports="S7-1500: OB82 and an entry in the diagnosis buffer. CODESYS: the diagnosis of the device (assumed).",
    ),
    "tcp-refuse": KindOnBus(_TITLE, refused="it listens to no stream; connect-refuse refuses connections"),
}
