"""Plots of what `find` steps tried, for the report: one point for each trial, in the coordinates of a drawing."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from pnfarm.scenario.measures import show_value

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

__all__ = ["plots"]

#: Area of the curve in the drawing, and the room at its left and above it.
WIDTH, HEIGHT, LEFT, TOP = 720.0, 180.0, 110.0, 12.0


def plots(record: Mapping[str, Any]) -> list[dict[str, Any]]:
    """One for each `find` with a trial: points, ticks, the place of the limit, and a table of the trials."""
    return [_plot(found) for found in record.get("finds", ()) if found["tries"]]


def _plot(found: Mapping[str, Any]) -> dict[str, Any]:
    tries = sorted(found["tries"], key=lambda item: item["number"])
    numbers = [item["number"] for item in tries]
    values = [item["measured"] if item["measured"] is not None else float(item["held"]) for item in tries]
    measured = found["measure"] is not None
    name = re.split(r"[\s{]", found["measure"] or "", maxsplit=1)[0]
    least, most = min(numbers), max(numbers)
    highest = max(*values, 0.0, 1e-12) if measured else 1.0

    def x(number: float) -> float:
        return round(LEFT + WIDTH * ((number - least) / (most - least) if most > least else 0.5), 1)

    def y(value: float) -> float:
        return round(TOP + HEIGHT * (1.0 - min(max(value / highest, 0.0), 1.0)), 1)

    points = [
        {
            "x": x(item["number"]),
            "y": y(value),
            "held": item["held"],
            "text": f"{item['value']}: " + ("held" if item["held"] else item["message"])
            + (f", {found['measure']} {show_value(name, value)}" if measured else ""),
        }
        for item, value in zip(tries, values, strict=True)
    ]  # fmt: skip
    return {
        "name": found["name"],
        "verdict": found["verdict"],
        "message": found["message"],
        "variable": found["variable"],
        "measure": found["measure"] or "",
        "width": LEFT + WIDTH + 40,
        "height": TOP + HEIGHT + 42,
        "bottom": TOP + HEIGHT,
        "left": LEFT,
        "right": LEFT + WIDTH,
        "points": points,
        "line": " ".join(f"{point['x']},{point['y']}" for point in points) if measured else "",
        "limit": _limit(found, tries, x),
        "xticks": [{"x": x(item["number"]), "text": str(item["value"])} for item in _few(tries)],
        "yticks": (
            [
                {"y": y(highest * part), "text": show_value(name, float(f"{highest * part:.3g}"))}
                for part in (0.0, 0.5, 1.0)
            ]
            if measured
            else [{"y": y(1.0), "text": "held"}, {"y": y(0.0), "text": "not"}]
        ),
        "tries": tries,
    }


def _limit(found: Mapping[str, Any], tries: list[Mapping[str, Any]], x: Any) -> float | None:
    """Between the last value that held and the first that did not."""
    numbers = {str(item["value"]): item["number"] for item in tries}
    ends = [numbers[str(found[key])] for key in ("found", "beyond") if str(found[key]) in numbers]
    return round((x(ends[0]) + x(ends[1])) / 2, 1) if len(ends) == 2 else None


def _few(tries: list[Mapping[str, Any]], most: int = 10) -> Iterator[Mapping[str, Any]]:
    step = -(-len(tries) // most)
    yield from tries[::step]
