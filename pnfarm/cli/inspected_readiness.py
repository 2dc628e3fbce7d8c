"""What controllers found, configured and refused, in ``pnfarm inspect --readiness``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.cli.farm_file import counted
from pnfarm.terminal.output import print_line, print_section, seconds

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["print_readiness"]

_STATES = {"partly": "data, refused", "ended": "not connected", "found": "found only", "unseen": "not asked for"}


def print_readiness(view: dict[str, Any]) -> None:
    """The controllers, the stations of each, what is refused, and what is missing."""
    controllers = view["controllers"]
    for number, controller in enumerate(controllers):
        if number:
            print_line()
        rows = [
            (station["name"], _state(visit), ", ".join(visit["steps"]), seconds(visit["cycle_seconds"]))
            for station in view["stations"]
            for visit in station["visits"]
            if visit["controller"] == number
        ]
        count = counted(controller["stations"], "station")
        print_line(f"{_name(controller)} on {controller['bus']}: {controller['exchanging']} of {count} exchange data")
        print_section(("STATION", "STATE", "~STEPS", ">CYCLE"), rows)
    alone = [
        (station["name"], _state(station), _place(station)) for station in view["stations"] if not station["visits"]
    ]
    _print_table(("NO CONTROLLER", "STATE", "~FARM FILE"), alone)
    ended = [
        (station["name"], "not connected", f"the connection ended: {visit['ended']}")
        for station in view["stations"]
        for visit in station["visits"]
        if visit.get("ended")
    ]
    refused = [
        (station["name"], "accepted" if one["works"] else "refused", f"{one['text']}{_change(one)}")
        for station in view["stations"]
        for visit in station["visits"]
        for one in visit["refusals"]
    ]
    _print_table(("STATION", "", "~WHY, AND WHAT TO CHANGE"), [*refused, *ended])
    missing = [
        (
            one["name"],
            _name(controllers[one["controller"]]) if one["controller"] >= 0 else "-",
            one["text"] + _change(one),
        )
        for one in view["missing"]
    ]
    _print_table(("ASKED FOR", "~BY", "~NOT IN THE FARM"), missing)
    if view["ready"]:
        print_line()
        print_line("every station exchanges data, and nothing is refused")


def _print_table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    if rows:
        print_section(columns, rows)


def _state(one: dict[str, Any]) -> str:
    """Of a station or a visit, in words."""
    return _STATES.get(one["state"], str(one["state"]))


def _name(controller: dict[str, Any]) -> str:
    return " ".join(word for word in (controller["name"], controller["address"] or controller["mac"]) if word)


def _place(one: dict[str, Any]) -> str:
    return f"{one['file']}:{one['line']} {one['key']}" if one["line"] else one["key"]


def _change(one: dict[str, Any]) -> str:
    return f"; change {_place(one)}" if one["key"] else ""
