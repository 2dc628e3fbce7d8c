"""A recording drawn: as text for a terminal, as SVG, and as a page of HTML that opens without a network.

Quantities of one unit share a chart; words and codes have one each; bits are drawn as lanes, as a logic analyser
does.  Every chart has the same time axis, with the trigger at 0.
"""

from __future__ import annotations

import html
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pnfarm.trace.interactive import chart_body, chart_head

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from pnfarm.trace.recording import Column, Recording

__all__ = ["as_charts", "as_html", "as_svg", "as_text"]

#: Charts of one drawing, and lines of one chart: more cannot be distinguished.
MAX_CHARTS, MAX_LINES = 64, 16
_BLOCKS = " ▁▂▃▄▅▆▇█"
_COLOURS = ("#1f5fbf", "#c2410c", "#15803d", "#7c3aed", "#b91c1c", "#0e7490", "#a16207", "#be185d")
_WIDTH, _LEFT, _RIGHT, _HEIGHT, _LANE, _GAP = 960, 84, 16, 150, 22, 34
#: Characters of a lane's name, and the room for each beside it.
_NAME, _CHARACTER = 36, 6


@dataclass(frozen=True, slots=True)
class _Chart:
    """Lines that share one scale; ``lanes``: bits, each in a lane of its own."""

    title: str
    columns: tuple[Column, ...]
    lanes: bool = False


def _charts(recording: Recording) -> tuple[list[_Chart], int]:
    """The charts, and how many columns are left out."""
    reals: dict[str, list[Column]] = {}
    others: list[_Chart] = []
    bits: list[Column] = []
    for column in recording.columns:
        if column.form == "real":
            reals.setdefault(column.unit or column.signal, []).append(column)
        elif column.form == "bit":
            bits.append(column)
        else:
            others.append(_Chart(column.title, (column,)))
    charts = [
        _Chart(unit, tuple(columns[start : start + MAX_LINES]))
        for unit, columns in reals.items()
        for start in range(0, len(columns), MAX_LINES)
    ]
    charts += others
    charts += [_Chart("bits", tuple(bits[at : at + 2 * MAX_LINES]), True) for at in range(0, len(bits), 2 * MAX_LINES)]
    left_out = sum(len(chart.columns) for chart in charts[MAX_CHARTS:])
    return charts[:MAX_CHARTS], left_out


def _lane_names(columns: Sequence[Column]) -> list[str]:
    """What stands beside each lane: without the drive where all are of one, long ones without their middle."""
    of_one = len({column.drive for column in columns}) == 1
    names = [column.signal if of_one else column.title for column in columns]
    half = _NAME // 2
    return [name if len(name) <= _NAME else f"{name[: half - 1]}…{name[-half:]}" for name in names]


def _left(charts: Sequence[_Chart]) -> int:
    """Where the charts of a drawing begin: beside the longest name of a lane."""
    names = [name for chart in charts if chart.lanes for name in _lane_names(chart.columns)]
    return max([_LEFT, *(12 + _CHARACTER * len(name) for name in names)])


def _span(recording: Recording) -> tuple[float, float]:
    if not len(recording.time):
        return 0.0, 1.0
    first, last = float(recording.time[0]), float(recording.time[-1])
    return (first, last) if last > first else (first, first + 1e-3)


def _bounds(columns: Sequence[Column]) -> tuple[float, float]:
    values = [column.values[found] for column in columns if (found := np.isfinite(column.values)).any()]
    if not values:
        return 0.0, 1.0
    low, high = float(min(map(np.min, values))), float(max(map(np.max, values)))
    return (low, high) if high > low else (low - 0.5, low + 0.5)


def _share(value: float, low: float, high: float) -> float:
    """Where a value is between two, 0 to 1; also of those whose difference is beyond what numbers hold."""
    room = high / 2 - low / 2
    return (value / 2 - low / 2) / room if room else 0.5


# -- text --------------------------------------------------------------------------------------------------------------


def as_text(recording: Recording, width: int = 80) -> str:
    """One line of blocks for each column, with its smallest and largest value; ``width`` in characters."""
    titles = [column.title for column in recording.columns]
    ranges = [_range(column) for column in recording.columns]
    # a narrow terminal shortens the names, not the drawing
    name = min(max(map(len, titles), default=0), max(8, width // 3))
    side = max(map(len, ranges), default=0)
    cells = max(10, width - name - side - 4)
    first, last = _span(recording)
    edges = np.searchsorted(recording.time, np.linspace(first, last, cells + 1))
    # the last sample is in the last cell
    edges[-1] = len(recording.time)
    lines = []
    for column, title, text in zip(recording.columns, titles, ranges, strict=True):
        short = title if len(title) <= name else title[: name - 1] + "…"
        lines.append(f"{short:<{name}}  {_blocks(column, edges)}  {text}".rstrip())
    zero = round((0.0 - first) / (last - first) * (cells - 1)) if first <= 0.0 <= last else -1
    ruler = "".join("┼" if place == zero else "─" for place in range(cells))
    lines.append(f"{'':<{name}}  {ruler}")
    begin, end = f"{first:.6g} s", f"{last:.6g} s"
    lines.append(f"{'':<{name}}  {begin}{end:>{max(len(end) + 1, cells - len(begin))}}")
    return "\n".join(lines)


def _range(column: Column) -> str:
    if not len(column.values):
        return "no samples"
    low, high = column.values.min(), column.values.max()
    labels = column.labels
    shown = [labels.get(int(v), "") if labels else f"{v:.4g}" if column.form == "real" else str(v) for v in (low, high)]
    return shown[0] if low == high else f"{shown[0]} … {shown[1]}"


def _blocks(column: Column, edges: NDArray[Any]) -> str:
    """For each cell, the mean of its samples; a cell without a sample repeats the one before."""
    low, high = _bounds([column])
    cells = []
    last = " "
    for start, end in zip(edges[:-1], np.maximum(edges[1:], edges[:-1]), strict=True):
        part = column.values[start:end]
        part = part[np.isfinite(part)]
        if len(part):
            # of bits and codes the largest, so that a short pulse is seen
            value = float((part / len(part)).sum() if column.form == "real" else part.max())
            last = _BLOCKS[1 + round(_share(value, low, high) * (len(_BLOCKS) - 2))]
        cells.append(last)
    return "".join(cells)


# -- SVG ---------------------------------------------------------------------------------------------------------------


def as_svg(recording: Recording) -> str:
    """One picture with a chart below another; long recordings are drawn by their extremes, so that no pulse is lost."""
    charts, left_out = _charts(recording)
    parts: list[str] = []
    top = 46
    first, last = _span(recording)
    left = _left(charts)
    for chart in charts:
        height = _LANE * len(chart.columns) if chart.lanes else _HEIGHT
        parts += _draw(chart, recording, first, last, left, top, height)
        top += height + _GAP + (0 if chart.lanes else 14 * ((len(chart.columns) + 2) // 3))
    foot = f"{left_out} more columns are not drawn" if left_out else ""
    by = f" on {recording.triggered_by}" if recording.triggered_by and " on " not in recording.trigger else ""
    head = f"{recording.id}: trigger {recording.trigger}{by}" + ("" if recording.triggered else " (not yet)")
    total = top + 20
    size = f'viewBox="0 0 {_WIDTH} {total}" width="{_WIDTH}" height="{total}"'
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="system-ui, sans-serif" font-size="11">',
            f'<rect width="{_WIDTH}" height="{total}" fill="#fff"/>',
            f'<text x="{left}" y="20" font-size="14">{html.escape(head)}</text>',
            *parts,
            f'<text x="{left}" y="{total - 6}" fill="#555">{html.escape(foot)}</text>',
            "</svg>",
            "",
        ]
    )


def _draw(
    chart: _Chart, recording: Recording, first: float, last: float, left: int, top: int, height: int
) -> Iterator[str]:
    right = _WIDTH - _RIGHT

    def x_of(time: float) -> float:
        return left + (time - first) / (last - first) * (right - left)

    yield f'<rect x="{left}" y="{top}" width="{right - left}" height="{height}" fill="#f8fafc" stroke="#cbd5e1"/>'
    for time in _ticks(first, last):
        x = x_of(time)
        yield f'<line x1="{x:.1f}" y1="{top}" x2="{x:.1f}" y2="{top + height}" stroke="#e2e8f0"/>'
        yield f'<text x="{x:.1f}" y="{top + height + 12}" text-anchor="middle" fill="#555">{time:.6g} s</text>'
    if recording.triggered and first <= 0.0 <= last:
        x = x_of(0.0)
        place = f'x1="{x:.1f}" y1="{top}" x2="{x:.1f}" y2="{top + height}"'
        yield f'<line {place} stroke="#dc2626" stroke-dasharray="4 3"/>'
    low, high = _bounds(chart.columns)
    if not chart.lanes:
        for bound, y in ((high, top + 10), (low, top + height - 2)):
            text = chart.columns[0].labels.get(int(bound), "") if chart.columns[0].labels else ""
            shown = html.escape(text or f"{bound:.5g}")
            yield f'<text x="{left - 6}" y="{y}" text-anchor="end" fill="#555">{shown}</text>'
        middle, name = top + height // 2, html.escape(chart.title[:14])
        yield f'<text x="{left - 6}" y="{middle}" text-anchor="end">{name}</text>'
    names = _lane_names(chart.columns)
    for number, column in enumerate(chart.columns):
        colour = _COLOURS[number % len(_COLOURS)]
        title = html.escape(column.title)
        if chart.lanes:
            base, room = top + _LANE * (number + 1) - 4, _LANE - 8
            points = _points(recording.time, column.values, x_of, lambda v, b=base, r=room: b - v * r, steps=True)
            name = html.escape(names[number])
            beside = f'x="{left - 6}" y="{base}" text-anchor="end" fill="{colour}"'
            yield f"<text {beside}><title>{title}</title>{name}</text>"
        else:
            finite = np.isfinite(column.values)
            points = _points(
                recording.time[finite],
                column.values[finite],
                x_of,
                lambda v: top + height - 4 - _share(v, low, high) * (height - 8),
                steps=column.form != "real",
            )
            at_x, at_y = left + 290 * (number % 3), top + height + 28 + 14 * (number // 3)
            yield f'<text x="{at_x}" y="{at_y}" fill="{colour}">{title}</text>'
        line = f'fill="none" stroke="{colour}" stroke-width="1.3" points="{points}"'
        yield f"<polyline {line}><title>{title}</title></polyline>"


def _ticks(first: float, last: float) -> list[float]:
    """Round times, about eight."""
    rough = (last - first) / 8
    power = 10.0 ** np.floor(np.log10(rough))
    step = float(power * next(m for m in (1, 2, 5, 10) if m * power >= rough))
    return [
        round(number * step, 12) + 0.0 for number in range(int(np.ceil(first / step)), int(np.floor(last / step)) + 1)
    ]


def _points(time: NDArray[Any], values: NDArray[Any], x_of: Any, y_of: Any, *, steps: bool) -> str:
    """The points of a line; of more samples than the picture has columns, the smallest and largest of each column."""
    chosen = np.arange(len(time))
    columns = _WIDTH - _LEFT - _RIGHT
    if len(time) > 4 * columns:
        kept: set[int] = set()
        for part in np.array_split(chosen, columns):
            kept |= {
                int(part[0]),
                int(part[-1]),
                int(part[np.argmin(values[part])]),
                int(part[np.argmax(values[part])]),
            }
        chosen = np.array(sorted(kept))
    points: list[str] = []
    before: float | None = None
    for number in chosen.tolist():
        x, y = x_of(float(time[number])), y_of(float(values[number]))
        if steps and before is not None and before != y:
            points.append(f"{x:.1f},{before:.1f}")
        points.append(f"{x:.1f},{y:.1f}")
        before = y
    return " ".join(points)


# -- HTML --------------------------------------------------------------------------------------------------------------


def as_charts(recording: Recording, place: str) -> str:
    """The drawing, and what makes charts of it in a page with :func:`.chart_head`; ``place`` is unique in the page."""
    charts = [
        (chart.title, chart.columns, _lane_names(chart.columns) if chart.lanes else [])
        for chart in _charts(recording)[0]
    ]
    body = chart_body(place, recording.time, charts, _COLOURS)
    return f'<div class="picture" id="{place}">{as_svg(recording)}</div>\n{body}'


def as_html(recording: Recording) -> str:
    """A page with charts to zoom into, what was recorded, and the samples; nothing is loaded from elsewhere.

    Without scripts it shows the picture of :func:`as_svg`.
    """
    title = html.escape(f"Trace {recording.id}")
    facts = [
        ("trigger", recording.trigger + (f" ({recording.triggered_by})" if recording.triggered_by else "")),
        ("state", recording.state),
        ("samples", f"{len(recording.time)}, one every {recording.interval_seconds * 1e3:.6g} ms"),
        ("samples missed", str(recording.missed)),
    ]
    rows = "".join(f"<tr><th>{html.escape(k)}</th><td>{html.escape(v)}</td></tr>" for k, v in facts)
    ranges = "".join(
        f"<tr><td>{html.escape(c.drive)}</td><td>{html.escape(c.signal)}</td><td>{html.escape(c.unit)}</td>"
        f"<td>{html.escape(_range(c))}</td></tr>"
        for c in recording.columns
    )
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>\n<style>\n'
        "body{font:14px system-ui,sans-serif;margin:2em;max-width:1000px}svg{max-width:100%;height:auto}\n"
        "table{border-collapse:collapse;margin:1em 0}th,td{text-align:left;padding:2px 12px 2px 0;"
        "border-bottom:1px solid #ddd}pre{max-height:24em;overflow:auto;background:#f8fafc;padding:1em}\n"
        f"</style>\n{chart_head()}</head><body>\n<h1>{title}</h1>\n<table>{rows}</table>\n"
        "<p>Drag to zoom, double-click for the whole; the cursor's values are below each chart.</p>\n"
        f"{as_charts(recording, 'trace')}"
        f"<table><tr><th>drive</th><th>signal</th><th>unit</th><th>range</th></tr>{ranges}</table>\n"
        f"<details><summary>Samples (CSV)</summary><pre>{html.escape(recording.csv())}</pre></details>\n"
        "</body></html>\n"
    )
