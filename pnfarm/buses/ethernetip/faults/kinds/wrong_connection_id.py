"""wrong-connection-id: cyclic packets carry another connection id than agreed."""

from __future__ import annotations

from pnfarm.buses.ethernetip.faults.frames import CipFramesEffect
from pnfarm.faults.kind import FRAMES, InjectionKind, ParamSpec
from pnfarm.table.impairment import FRAME_ID

__all__ = ["KIND"]

_IDS = 1 << 32


class WrongConnectionId(CipFramesEffect):
    """One given, or the agreed one plus one."""

    cyclic = FRAME_ID

    def fields(self) -> dict[str, float]:
        wrong = self.values["connection_id"]
        if wrong is None:
            return {"amount": 1, "whole": 0}
        # the column is signed
        return {"amount": wrong - _IDS if wrong >= _IDS // 2 else wrong, "whole": 1}


KIND = InjectionKind(
    "wrong-connection-id",
    "cyclic",
    "Cyclic packets carry another connection id than agreed; originators do not find their connection.",
    "a cyclic packet that is changed",
    WrongConnectionId,
    {
        "connection_id": ParamSpec(
            "whole number", "The wrong one; left out, the agreed one plus one.", default=None, low=0, high=_IDS - 1
        )
    },
    directions=("out",),
    takes=FRAMES,
    place=82,
    wire="Connection id `connection_id` in the sequenced address item, or the agreed one plus one.",
    reports="The packets belong to no connection: the connection times out (Logix: module fault 16#0203; CODESYS: the "
    "adapter goes to its error state (assumed)).",
)
