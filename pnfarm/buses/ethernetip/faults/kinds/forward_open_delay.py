"""forward-open-delay: Forward_Open is answered late."""

from __future__ import annotations

from pnfarm.buses.ethernetip.faults.frames import CIP_FRAMES
from pnfarm.buses.ethernetip.faults.messages import OPEN
from pnfarm.faults.effects.late import LATE_PARAMS, LateMessages
from pnfarm.faults.kind import EACH, InjectionKind

__all__ = ["KIND"]


class ForwardOpenDelay(LateMessages):
    """Whatever the answer says."""

    messages = CIP_FRAMES

    def classes(self) -> frozenset[str]:
        return frozenset({OPEN})


KIND = InjectionKind(
    "forward-open-delay",
    "connection",
    "Answers to Forward_Open and Large_Forward_Open leave late, and after them all that follows on the same TCP "
    "connection.  The drive's own end of the connection is open before the answer leaves.",
    "an answer that is late",
    ForwardOpenDelay,
    LATE_PARAMS,
    takes=EACH,
    place=42,
    wire="The answer is late; with a connection accepted, the drive's cyclic packets come before it.",
    reports="A slower start-up. Beyond the scanner's own time it gives up and asks again, with another serial number "
    "(Logix: module fault 16#0204, connection request timed out; CODESYS the same state (assumed)); the drive then "
    "still has the first connection until its timeout, and refuses the second one as an owner's.",
)
