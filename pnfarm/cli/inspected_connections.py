"""The connections of a station in ``pnfarm inspect``: what was agreed for each, and what is where in its frames."""

from __future__ import annotations

from typing import Any

from pnfarm.terminal.output import number, print_line, print_table, seconds

__all__ = ["print_connections"]


def print_connections(connections: list[dict[str, Any]], station: str) -> None:
    """``station``: what it is called, a drive or a device."""
    for one in connections:
        facts = dict(one)
        channels = facts.pop("channels")
        shown = (
            f"{key.removesuffix('_seconds').replace('_', ' ')} {_fact(key, value)}" for key, value in facts.items()
        )
        print_line()
        print_line("agreed: " + ", ".join(shown))
        rows = [
            (
                f"{channel['direction']} by the {station}",
                channel["id"],
                number(channel["octets"]),
                seconds(channel["cycle_seconds"]),
                "; ".join(f"{place['offset']} {place['what']} {place['of']}".rstrip() for place in channel["places"]),
            )
            for channel in channels
        ]
        if rows:
            print_table(("FRAMES", "IDENTIFICATION", ">OCTETS", ">CYCLE", "~AT OFFSET"), rows)


def _fact(key: str, value: str | float | None) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return seconds(float(value)) if key.endswith("_seconds") else str(value)
