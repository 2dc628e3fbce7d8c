"""ar-abort: the drive aborts the connection."""

from __future__ import annotations

from pnfarm.buses.profinet.faults.frames import PROFINET_FRAMES
from pnfarm.faults.breaking import BreakingEffect
from pnfarm.faults.kind import EACH, OCTET, InjectionKind, ParamSpec, words_of
from pnfarm.protocols.profinet.errors import RtaError

__all__ = ["KINDS"]


class ArAbort(BreakingEffect):
    """With an ERR-RTA-PDU, whose codes are PROFINET's."""

    needs = (*BreakingEffect.needs, PROFINET_FRAMES)

    def break_off(self, now: int) -> int:
        return self._connection.abort(self.values["code"], now)


KINDS = (
    InjectionKind(
        "ar-abort",
        "connection",
        "The drive aborts the connection with an alarm frame (ERR-RTA-PDU, RTA_ERR_CLS_PROTOCOL).",
        "one broken connection; without `count` and `for` it happens once",
        ArAbort,
        {
            "code": ParamSpec(
                "whole number",
                "ErrorCode2 of the abort.",
                default="abort-request",
                words=words_of(RtaError),
                **OCTET,
            )
        },
        takes=EACH,
        place=10,
        wire="An ERR-RTA-PDU with the error code; cyclic frames end.",
        reports=(
            "IO device failure (S7-1500: OB86; CODESYS: the device is shown as not running (assumed)). The "
            "device comes back."
        ),
    ),
)
