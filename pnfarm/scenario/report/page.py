"""A report of a run for a browser: one file that needs no network.  The timeline is drawn as SVG."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from pnfarm.scenario.definition.matrix import runs_of
from pnfarm.scenario.report.plots import plots
from pnfarm.scenario.watch import as_text
from pnfarm.trace.interactive import chart_head
from pnfarm.trace.plot import as_charts
from pnfarm.trace.recording import Recording
from pnfarm.vocabulary.durations import format_measured

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

__all__ = ["report_html"]

#: Width of the timeline's plot and of the names beside it, height of a lane; in pixels of the drawing.
PLOT, NAMES, LANE = 1000.0, 140.0, 18.0
#: Most drives that are drawn: those with something to show come first.
MAX_LANES = 64
#: Most traces of all runs of a matrix together.
MAX_PICTURES = 64
#: Characters of a drive's name beside its lane.
MAX_NAME = 20
#: Most expectations that are listed, rows of the other tables, lines of values of one expectation, and marks drawn.
MAX_CASES, MAX_ROWS, MAX_LINES, MAX_MARKS = 5000, 500, 8, 4000
#: Boxes of a lane that are closer than this are drawn as one, pixels.
LEAST = 0.5
#: Times of a drive's reaction, by the record's key.
REACTIONS = {
    "reacted_seconds": "withdrew the enable after",
    "acknowledged_seconds": "acknowledged after",
    "reconnected_seconds": "reconnected after",
}


def report_html(record: Mapping[str, Any]) -> str:
    """The page of a record (:meth:`.Record.as_dict`, or :func:`.together`); all texts in it are escaped."""
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    environment.filters["seconds"] = _seconds
    template, left = environment.get_template("run.html.j2"), MAX_PICTURES
    sections = []
    for number, run in enumerate(runs_of(record), 1):
        pictures = run["traces"][:left]
        left -= len(pictures)
        # the template escapes
        sections.append(Markup(template.render(_of_run(run, pictures, number))))  # noqa: S704 - made by the line above
    head = chart_head() if left < MAX_PICTURES else ""
    return environment.get_template("report.html.j2").render(record=record, sections=sections, chart_head=head)


def _of_run(record: Mapping[str, Any], pictures: Sequence[Mapping[str, Any]], number: int) -> dict[str, Any]:
    """What the template of one run, number ``number`` of the page, shows."""
    # what did not pass is listed before what did, where not all are
    cases = record["cases"]
    if len(cases) > MAX_CASES:
        cases = sorted(cases, key=lambda case: case["verdict"] == "passed")[:MAX_CASES]
    return {
        "record": record,
        "cases": [{**case, "shown": _shown(case)} for case in cases],
        "cases_left_out": len(record["cases"]) - len(cases),
        "drawing": _drawing(record),
        "plots": plots(record),
        "pictures": [_picture(one, f"trace-{number}-{at}") for at, one in enumerate(pictures, 1)],
        "pictures_left_out": len(record["traces"]) - len(pictures),
        "reactions": list(_reactions(record)),
        "situations": _of_controllers(record, "faults"),
        "start_ups": _of_controllers(record, "start_ups"),
        "losses": [item for item in record["timeline"] if "cause" in item][:MAX_ROWS],
    }


def _shown(case: Mapping[str, Any]) -> list[str]:
    """The values at the end of a case, a line for each drive: first those on which it did not hold."""
    shown = case["shown"]
    order = [*(name for name in case["drives"] if name in shown), *(n for n in shown if n not in case["drives"])]
    lines = [f"{name}: {as_text(shown[name])}" for name in order]
    rest = len(lines) - MAX_LINES
    return [*lines[:MAX_LINES], *([f"and {rest} more drives"] if rest > 0 else [])]


def _picture(picture: Mapping[str, Any], place: str) -> dict[str, Any]:
    """A trace as charts, which escape their texts themselves: the template takes them as they are."""
    charts = as_charts(Recording.from_dict(picture["trace"]), place)
    return {**picture, "head": picture["marks"][0]["text"], "charts": charts}


def _of_controllers(record: Mapping[str, Any], what: str) -> list[dict[str, Any]]:
    found = [{"drive": one["drive"], **row} for one in record["controllers"] for row in one[what]]
    return sorted(found, key=lambda row: row.get("at_seconds", 0.0))[:MAX_ROWS]


def _seconds(value: float | None) -> str:
    return "" if value is None else format_measured(value)


def _reactions(record: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    for drive, found in sorted(record["plc"].items()):
        for key, text in REACTIONS.items():
            times = sorted(found.get(key, ()))
            if times:
                yield {
                    "drive": drive, "what": text, "count": len(times), "least": times[0],
                    "median": times[len(times) // 2], "most": times[-1],
                }  # fmt: skip


def _drawing(record: Mapping[str, Any]) -> dict[str, Any]:
    """Rectangles and marks of the timeline, in pixels."""
    total: float = max(record["seconds"], 1e-9)

    def x(seconds: float) -> float:
        return round(NAMES + PLOT * min(max(seconds / total, 0.0), 1.0), 2)

    busy: dict[str, None] = {}
    for fault in record["faults"]:
        busy.update(dict.fromkeys(fault["drives"]))
    for case in record["cases"]:
        if case["verdict"] not in {"passed", "not run"}:
            busy.update(dict.fromkeys(case["drives"] or case["values"]))
    order = [*busy, *(drive for drive in record["drives"] if drive not in busy)][:MAX_LANES]
    lane = {drive: number + 2 for number, drive in enumerate(order)}
    boxes = [_states(record, drive, lane[drive], x) for drive in order]
    faults = [
        {
            "x": x(fault["began_seconds"]),
            "width": max(2.0, x(fault["ended_seconds"] or record["seconds"]) - x(fault["began_seconds"])),
            "y": lane[drive] * LANE,
            "text": f"{fault['kind']} on {drive}",
        }
        for fault in record["faults"]
        if fault["began_seconds"] is not None
        for drive in fault["drives"]
        if drive in lane
    ][:MAX_MARKS]
    cases = [
        {
            "x": x(case["began_seconds"]),
            "width": max(3.0, x(case["ended_seconds"]) - x(case["began_seconds"])),
            "verdict": case["verdict"].replace(" ", "-"),
            "text": f"{case['name']}: {case['message']}",
        }
        for case in record["cases"]
        if case["began_seconds"] is not None
    ][:MAX_CASES]
    marks = [
        {
            "x": x(item["seconds"]),
            "y": lane[item["drive"]] * LANE,
            "text": f"{item['drive']}: {item['text']}, {_seconds(item['seconds'])}",
            "cause": item.get("cause", ""),
        }
        for item in record["timeline"]
        if item["what"] == "event" and "state" not in item and item["drive"] in lane
    ][:MAX_MARKS]
    ticks = [{"x": x(total * part / 10), "text": _seconds(total * part / 10)} for part in range(0, 11, 2)]
    return {
        "width": NAMES + PLOT + 60, "height": (len(order) + 3) * LANE, "lane": LANE, "names": NAMES,
        "lanes": [
            {
                "name": drive,
                "short": drive if len(drive) <= MAX_NAME else drive[: MAX_NAME - 1] + "…",
                "y": lane[drive] * LANE,
            }
            for drive in order
        ],
        "states": [box for found in boxes for box in found], "faults": faults, "cases": cases, "marks": marks,
        "ticks": ticks, "left_out": len(record["drives"]) - len(order),
    }  # fmt: skip


def _states(record: Mapping[str, Any], drive: str, lane: int, x: Any) -> list[dict[str, Any]]:
    """A drive's states as boxes, from change to change."""
    found: list[dict[str, Any]] = []
    state, begin = "", 0.0
    changes = [item for item in record["timeline"] if item.get("drive") == drive and "state" in item]
    for item in (*changes, {"seconds": record["seconds"], "state": ""}):
        left = x(begin)
        # a lane has no more boxes than its picture can show
        drawn = found[-1]["x"] + found[-1]["width"] if found else 0.0
        if state and item["seconds"] > begin and x(item["seconds"]) - max(left, drawn - 1e-9) >= LEAST:
            text = f"{drive} in {state}, {_seconds(begin)} to {_seconds(item['seconds'])}"
            found.append(
                {
                    "x": left,
                    "width": round(x(item["seconds"]) - left, 2),
                    "y": lane * LANE,
                    "state": state,
                    "text": text,
                }
            )
        state, begin = item["state"], item["seconds"]
    return found
