"""What the controller of a drive did, seen from the drive, as plain JSON values: times in seconds, names of bits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.farm.views.snapshot import bit_labels
from pnfarm.table.channel import INTERVAL_EDGES_NS, JITTER_EDGES_NS

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pnfarm.farm.core import FarmCore
    from pnfarm.farm.views.controller_record import Situation, StartUp
    from pnfarm.station.axis import Axis

__all__ = ["controller_view"]

#: Frames of a sequence after which the sign of life is monitored (PROFIdrive 4.2).
SEQUENCE = 15


def controller_view(core: FarmCore, station: Axis, now: int) -> dict[str, Any]:
    """One drive; counters are sums over all connections since the farm started."""
    device, record = station.device, core.controllers.of(station.configured_name)
    connection = device.connection()
    rows = [core.columns.cpm[row] for row in device.channel_rows[1]]
    parts = [device.closed, *rows]
    late, own = (sum(int(getattr(part, name)) for part in parts) for name in ("late", "late_own"))
    expired, expired_own = device.watchdog_expirations, device.watchdog_expirations_by_farm
    life = station.handle.axis.life
    return {
        "drive": station.configured_name,
        "cycle_seconds": connection.cycle_ns / 1e9 if connection is not None and connection.cyclic else None,
        "intervals": _distribution(parts, "intervals", "interval_sum_ns", INTERVAL_EDGES_NS),
        "jitter": _distribution(parts, "jitters", "jitter_sum_ns", JITTER_EDGES_NS),
        "missed_updates": sum(int(part.missed) for part in parts),
        "late_frames": {"controller": late - own, "farm": own},
        "last_late_frame": _last_late(rows, now),
        "watchdog_expirations": {"controller": expired - expired_own, "farm": expired_own},
        "attempts": record.attempts,
        "refused": record.refused,
        "connects": device.connects,
        "start_ups": [_start_up(one) for one in record.start_ups],
        "faults": [_situation(station, one, now) for one in record.situations],
        "sign_of_life": {
            "monitored": int(life.run) >= SEQUENCE,
            "errors": int(life.errors),
            "tolerance": int(life.settings.tolerance),
        }
        if life.settings.watched
        else None,
    }


def _distribution(parts: Iterable[Any], buckets: str, total: str, edges_ns: Sequence[int]) -> dict[str, Any]:
    """A histogram of the table, over several channels."""
    counts = sum(getattr(part, buckets) for part in parts).tolist()
    frames, time_ns = sum(counts), sum(int(getattr(part, total)) for part in parts)
    bounds = [edge / 1e9 for edge in edges_ns] + [None]
    return {
        "mean_seconds": time_ns / frames / 1e9 if frames else None,
        "buckets": [{"up_to_seconds": b, "count": n} for b, n in zip(bounds, counts, strict=True) if n],
    }


def _last_late(rows: Sequence[Any], now: int) -> dict[str, float] | None:
    row = max(rows, key=lambda one: int(one.late_at_ns), default=None)
    if row is None or not row.late_at_ns:
        return None
    return {
        "seconds_ago": (now - int(row.late_at_ns)) / 1e9,
        "late_seconds": int(row.late_by_ns) / 1e9,
        "engine_late_seconds": int(row.late_engine_ns) / 1e9,
    }


def _start_up(one: StartUp) -> dict[str, Any]:
    end = next(reversed(one.phases.values()), None)
    whole = (end - one.lost_ns) / 1e9 if one.complete and end is not None and one.lost_ns is not None else None
    return {
        "controller": one.controller or None,
        "attempts": one.attempts,
        "complete": one.complete,
        "after_loss_seconds": whole,
        "phases": one.seconds(),
    }


def _situation(station: Axis, one: Situation, now: int) -> dict[str, Any]:
    labels = bit_labels(station, "STW1")
    return {
        "code": one.code,
        "kind": one.kind,
        "seconds_ago": (now - one.begin_ns) / 1e9,
        "reaction_seconds": one.reaction_ns / 1e9 if one.reaction_ns is not None else None,
        "acknowledged_seconds": one.acknowledged_ns / 1e9 if one.acknowledged_ns is not None else None,
        "stw1": [
            {"bit": bit, "name": labels[bit], "value": value, "after_seconds": after / 1e9}
            for bit, (value, after) in sorted(one.bits.items())
        ],
    }
