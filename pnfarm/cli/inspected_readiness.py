"""What controllers found, configured and refused, in ``pnfarm inspect --readiness``."""

from __future__ import annotations

from typing import Any

from pnfarm.cli.farm_file import counted
from pnfarm.terminal.output import print_line, print_section, seconds

__all__ = ["print_readiness"]

_STATES = {"partly": "data, refused", "ended": "not connected", "found": "found only", "unseen": "not asked for"}


def print_readiness(view: dict[str, Any]) -> None:
    """The controllers, the stations of each, what is refused, and what is missing."""
    controllers = view["controllers"]
    for number, controller in enumerate(controllers):
        rows = [
            (station["name"], visit["state"], ", ".join(visit["steps"]), seconds(visit["cycle_seconds"]))
            for station in view["stations"]
            for visit in station["visits"]
            if visit["controller"] == number
        ]
        count = counted(controller["stations"], "station")
        print_line(f"{_name(controller)} on {controller['bus']}: {controller['exchanging']} of {count} exchange data")
        print_section(("STATION", "STATE", "~STEPS", ">CYCLE"), rows)
        print_line()
    alone = [
        (station["name"], _STATES.get(station["state"], station["state"]), _place(station))
        for station in view["stations"]
        if not station["visits"]
    ]
    print_section(("NO CONTROLLER", "STATE", "~FARM FILE"), alone)
    refused = [
        (station["name"], "accepted" if one["works"] else "refused", f"{one['text']}{_change(one)}")
        for station in view["stations"]
        for visit in station["visits"]
        for one in visit["refusals"]
    ]
    print_section(("STATION", "", "~WHY, AND WHAT TO CHANGE"), refused)
    missing = [
        (
            one["name"],
            _name(controllers[one["controller"]]) if one["controller"] >= 0 else "-",
            one["text"] + _change(one),
        )
        for one in view["missing"]
    ]
    print_section(("ASKED FOR", "~BY", "~NOT IN THE FARM"), missing)
    if view["ready"]:
        print_line("every station exchanges data, and nothing is refused")


def _name(controller: dict[str, Any]) -> str:
    return " ".join(word for word in (controller["name"], controller["address"] or controller["mac"]) if word)


def _place(one: dict[str, Any]) -> str:
    return f"{one['file']}:{one['line']} {one['key']}" if one["line"] else one["key"]


def _change(one: dict[str, Any]) -> str:
    return f"; change {_place(one)}" if one["key"] else ""
