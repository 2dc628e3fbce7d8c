"""The charts of a recording for a browser: zoom by dragging, a cursor in all of them at once (uPlot, inlined)."""

from __future__ import annotations

import functools
import json
from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.trace.recording import Column

__all__ = ["interactive"]

#: Distance of two bits that are drawn as lanes of one chart.
_LANE = 1.5
_SCRIPT = """
const box = document.getElementById("charts"), plots = [];
let busy = false;
const together = (u, key) => {
  if (key !== "x" || busy) return;
  busy = true;
  for (const other of plots) if (other !== u) other.setScale("x", {min: u.scales.x.min, max: u.scales.x.max});
  busy = false;
};
const zero = u => {
  const x = Math.round(u.valToPos(0, "x", true)), {left, top, width, height} = u.bbox;
  if (x < left || x > left + width) return;
  u.ctx.save();
  u.ctx.strokeStyle = "#888";
  u.ctx.setLineDash([4, 4]);
  u.ctx.beginPath();
  u.ctx.moveTo(x, top);
  u.ctx.lineTo(x, top + height);
  u.ctx.stroke();
  u.ctx.restore();
};
for (const chart of TRACE.charts) {
  const shown = (column, y) => {
    if (y === null || y === undefined) return "--";
    const value = chart.lanes ? Math.round(y - column.lane) : y;
    return column.labels[value] ?? (column.real ? Number(value.toPrecision(7)) : value) + "";
  };
  const series = chart.columns.map(column => ({
    label: column.title, stroke: column.colour, width: 1, points: {show: false},
    paths: column.real ? undefined : uPlot.paths.stepped({align: 1}),
    value: (u, y) => shown(column, y),
  }));
  plots.push(new uPlot({
    title: chart.title, width: 960, height: chart.lanes ? 80 + 26 * chart.columns.length : 220,
    cursor: {sync: {key: "trace"}, drag: {x: true, y: false}},
    scales: {x: {time: false}},
    axes: [{}, {size: 80, ...(chart.lanes && {values: (u, at) => at.map(() => ""), grid: {show: false}})}],
    hooks: {setScale: [together], draw: [zero]},
    series: [{label: "time", value: (u, x) => x === null ? "--" : x.toFixed(6) + " s"}, ...series],
  }, [TRACE.time, ...chart.columns.map(column => column.values)], box));
}
document.getElementById("picture").hidden = true;
"""


@functools.cache
def _vendored(name: str) -> str:
    return resources.files("pnfarm.trace").joinpath("uplot", name).read_text("utf-8")


def _values(column: Column, lane: float) -> list[float | int | None]:
    """As JSON knows them: a value that is not there is null."""
    if column.form == "real":
        return [value if np.isfinite(value) else None for value in column.values.tolist()]
    return [value + lane for value in column.values.tolist()] if lane else column.values.tolist()


def interactive(
    time: Any, charts: Sequence[tuple[str, Sequence[Column], bool]], colours: Sequence[str]
) -> tuple[str, str]:
    """What goes into a page's head, and in its body before the element ``picture``, which is then hidden.

    A chart is a title, columns, and whether they are bits in lanes.  Without scripts the page shows the picture.
    """
    drawn = []
    for title, columns, lanes in charts:
        places = [_LANE * (len(columns) - 1 - number) if lanes else 0.0 for number in range(len(columns))]
        drawn.append(
            {
                "title": title,
                "lanes": lanes,
                "columns": [
                    {
                        "title": column.title,
                        "colour": colours[number % len(colours)],
                        "real": column.form == "real",
                        "lane": lane,
                        "labels": {str(value): label for value, label in column.labels.items()},
                        "values": _values(column, lane),
                    }
                    for number, (column, lane) in enumerate(zip(columns, places, strict=True))
                ],
            }
        )
    # "<" could end the script's element
    data = json.dumps({"time": time.tolist(), "charts": drawn}, allow_nan=False).replace("<", "\\u003c")
    head = f"<style>{_vendored('uPlot.min.css')}</style>\n<script>{_vendored('uPlot.iife.min.js')}</script>\n"
    return head, f'<div id="charts"></div>\n<script>const TRACE = {data};{_SCRIPT}</script>\n'
