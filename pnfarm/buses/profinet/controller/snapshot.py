"""The controller's view of one drive: a row for the terminal and for JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.axis_program import PHASES
from pnfarm.wire.rtc import SEND_CLOCK_NS

if TYPE_CHECKING:
    from pnfarm.buses.profinet.controller.session import DeviceSession
    from pnfarm.engine.columns import Columns

__all__ = ["snapshot_row"]


def snapshot_row(session: DeviceSession, columns: Columns) -> dict[str, Any]:
    """Names, states, counts and times (seconds) of one drive's connection."""
    row = columns.program[session.index]
    consumer = None if session.consumer is None else columns.cpm[session.consumer]
    provider = None if session.provider is None else columns.ppm[session.provider]
    measures = session.measures
    return {
        "name": session.plan.name,
        "model": session.plan.model,
        "mac": session.mac.hex(":"),
        "ip": str(session.plan.ip.ip),
        "state": session.state.value,
        "phase": PHASES[int(row.phase)],
        "zsw1": int(row.zsw1),
        "stw1": int(row.stw1),
        "moves": int(row.moves),
        "faults": int(row.faults),
        "connects": measures.connects,
        "losses": measures.losses,
        "refusals": measures.refusals,
        "expirations": measures.expirations,
        "connect_seconds": _seconds(measures.connect_ns),
        "reconnect_seconds": _seconds(measures.reconnect_ns),
        "reaction_seconds": _seconds(int(row.reaction_ns) or None),
        "reaction_max_seconds": _seconds(int(row.reaction_max_ns) or None),
        "recovery_seconds": _seconds(int(row.recovery_ns) or None),
        "cycle_seconds": session.plan.send_clock_factor * session.plan.reduction_ratio * SEND_CLOCK_NS / 1e9,
        "frames_sent": measures.frames_sent + (int(provider.sent) if provider is not None else 0),
        "frames_received": measures.frames_received + (int(consumer.received) if consumer is not None else 0),
        "alarms_received": measures.alarms_received,
        "last_alarm": measures.last_alarm,
        "unusable": session.out_of_use,
        "identification": None if session.identification is None else session.identification.as_dict(),
        "last_reason": measures.last_reason,
    }


def _seconds(value: int | None) -> float | None:
    return None if value is None else value / 1e9
