"""What the controllers of the drives did during a run, for its report."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.farm.views.controller_view import controller_view

if TYPE_CHECKING:
    from pnfarm.farm.core import FarmCore

__all__ = ["controllers"]

#: Drives of a report.
MAX_DRIVES = 64


def controllers(core: FarmCore, begin_ns: int, now: int) -> list[dict[str, Any]]:
    """Fault situations and start-ups since ``begin_ns``, of drives that had one; ``at_seconds`` of the run."""
    found: list[dict[str, Any]] = []
    length = (now - begin_ns) / 1e9
    for station in core.axes:
        record = core.controllers.of(station.configured_name)
        if not any(one.begin_ns >= begin_ns for one in record.situations) and not any(
            when >= begin_ns for one in record.start_ups for when in one.phases.values()
        ):
            continue
        if len(found) >= MAX_DRIVES:
            break
        view = controller_view(core, station, now)
        faults = [one for one in view["faults"] if one["seconds_ago"] <= length]
        start_ups = [
            shown
            for shown, one in zip(view["start_ups"], record.start_ups, strict=True)
            if any(when >= begin_ns for when in one.phases.values())
        ]
        found.append(
            {
                "drive": view["drive"],
                "faults": [{"at_seconds": length - one.pop("seconds_ago"), **one} for one in faults],
                "start_ups": start_ups,
            }
        )
    return found
