"""A controller's view of one station: a row for the terminal and for JSON; times are seconds."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from pnfarm.buses.controllers.axis_program import PHASES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.buses.controllers.device_plan import PlannedDevice
    from pnfarm.buses.controllers.session import Session
    from pnfarm.engine.columns import Columns

__all__ = ["axis_part", "reaction_part", "session_row"]


def axis_part(plan: PlannedDevice, row: Any, *, mac: str, ip: str, state: str) -> dict[str, Any]:
    """Who it is, and what its axis program does; ``row`` is the program's."""
    return {
        "name": plan.name,
        "model": plan.model,
        "mac": mac,
        "ip": ip,
        "state": state,
        "phase": PHASES[int(row.phase)],
        "zsw1": int(row.zsw1),
        "stw1": int(row.stw1),
        "moves": int(row.moves),
        "faults": int(row.faults),
    }


def reaction_part(row: Any) -> dict[str, Any]:
    """How fast the axis reacted to its program."""
    return {
        "reaction_seconds": _seconds(int(row.reaction_ns) or None),
        "reaction_max_seconds": _seconds(int(row.reaction_max_ns) or None),
        "recovery_seconds": _seconds(int(row.recovery_ns) or None),
    }


def session_row(
    session: Session,
    columns: Columns,
    *,
    ip: str,
    cycle_ns: int,
    of_bus: Mapping[str, Any],
    of_axis: Mapping[str, Any] = MappingProxyType({}),
    of_losses: Mapping[str, Any] = MappingProxyType({}),
) -> dict[str, Any]:
    """A session's row, with what only its bus has: of the axis, of losses, and besides."""
    row, measures = columns.program[session.row], session.measures
    sent = sum(int(columns.ppm[row].sent) for row in session.providers)
    received = sum(int(columns.cpm[row].received) for row in session.consumers)
    return {
        **axis_part(session.plan, row, mac=session.mac.hex(":"), ip=ip, state=session.state.value),
        **of_axis,
        "connects": measures.connects,
        "losses": measures.losses,
        "refusals": measures.refusals,
        "expirations": measures.expirations,
        **of_losses,
        "connect_seconds": _seconds(measures.connect_ns),
        "reconnect_seconds": _seconds(measures.reconnect_ns),
        **reaction_part(row),
        "cycle_seconds": cycle_ns / 1e9,
        "frames_sent": measures.frames_sent + sent,
        "frames_received": measures.frames_received + received,
        **of_bus,
        "unusable": session.out_of_use,
        "identification": None if session.identification is None else session.identification.as_dict(),
        "last_reason": measures.last_reason,
    }


def _seconds(value: int | None) -> float | None:
    return None if value is None else value / 1e9
