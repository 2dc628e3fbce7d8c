"""The charts of recordings for a browser: zoom by dragging, a cursor in all charts of one at once (uPlot, inlined).

A page has :func:`chart_head` in its head, and for each recording :func:`chart_body` behind an element of the class
``picture`` with a drawing, which the charts replace where scripts run and the reader looks.
"""

from __future__ import annotations

import functools
import json
from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.trace.recording import Column

__all__ = ["chart_body", "chart_head"]

#: Distance of two bits that are drawn as lanes of one chart.
_LANE = 1.5
_STYLE = """
.charts { margin: 0; }
@media print { .charts { display: none; } .picture[hidden] { display: block; } }
"""
_SCRIPT = """
function drawCharts(box, trace) {
const plots = [], ink = getComputedStyle(box).color, line = "#8884";
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
// all charts of a trace begin at one place: beside the longest name of a lane
const pen = document.createElement("canvas").getContext("2d");
pen.font = "12px system-ui, sans-serif";
const names = trace.charts.flatMap(chart => chart.lanes ? chart.columns.map(column => column.name) : []);
const left = Math.max(80, ...names.map(name => Math.ceil(pen.measureText(name).width) + 24));
for (const chart of trace.charts) {
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
    title: chart.title, width: Math.max(480, Math.min(960, box.clientWidth)),
    height: chart.lanes ? 80 + 26 * chart.columns.length : 220,
    cursor: {sync: {key: box.id}, drag: {x: true, y: false}},
    scales: {x: {time: false}},
    axes: [{stroke: ink, grid: {stroke: line}, ticks: {stroke: line}}, {
      size: left, stroke: ink, grid: {stroke: line}, ticks: {stroke: line},
      // each lane has its name, in the middle of its height
      ...(chart.lanes && {
        splits: () => chart.columns.map(column => column.lane + 0.5), filter: (u, at) => at,
        values: () => chart.columns.map(column => column.name), grid: {show: false},
      }),
    }],
    hooks: {setScale: [together], draw: [zero]},
    series: [{label: "time", value: (u, x) => x === null ? "--" : x.toFixed(6) + " s"}, ...series],
  }, [trace.time, ...chart.columns.map(column => column.values)], box));
}
}
// a long report draws what its reader comes to
const seen = new IntersectionObserver(entries => {
  for (const {isIntersecting, target} of entries) if (isIntersecting) {
    seen.unobserve(target);
    const box = document.createElement("div");
    box.className = "charts";
    box.id = target.id + "-charts";
    target.after(box);
    drawCharts(box, JSON.parse(document.getElementById(target.id + "-data").textContent));
    target.hidden = true;
  }
}, {rootMargin: "400px"});
addEventListener("DOMContentLoaded", () => document.querySelectorAll(".picture").forEach(one => seen.observe(one)));
"""


@functools.cache
def _vendored(name: str) -> str:
    return resources.files("pnfarm.trace").joinpath("uplot", name).read_text("utf-8")


def _values(column: Column, lane: float) -> list[float | int | None]:
    """As JSON knows them: a value that is not there is null."""
    if column.form == "real":
        return [value if np.isfinite(value) else None for value in column.values.tolist()]
    return [value + lane for value in column.values.tolist()] if lane else column.values.tolist()


def chart_head() -> str:
    """Styles and scripts, once for a page."""
    return (
        f"<style>{_vendored('uPlot.min.css')}{_STYLE}</style>\n"
        f"<script>{_vendored('uPlot.iife.min.js')}</script>\n<script>{_SCRIPT}</script>\n"
    )


def chart_body(
    place: str, time: Any, charts: Sequence[tuple[str, Sequence[Column], Sequence[str]]], colours: Sequence[str]
) -> str:
    """The data of the charts that replace the element ``place``, which is of the class ``picture``.

    A chart is a title, columns, and where these are bits in lanes the name of each lane.
    """
    drawn = []
    for title, columns, lanes in charts:
        places = [_LANE * (len(columns) - 1 - number) if lanes else 0.0 for number in range(len(columns))]
        drawn.append(
            {
                "title": title,
                "lanes": bool(lanes),
                "columns": [
                    {
                        "title": column.title,
                        "colour": colours[number % len(colours)],
                        "real": column.form == "real",
                        "lane": lane,
                        "name": lanes[number] if lanes else column.title,
                        "labels": {str(value): label for value, label in column.labels.items()},
                        "values": _values(column, lane),
                    }
                    for number, (column, lane) in enumerate(zip(columns, places, strict=True))
                ],
            }
        )
    # "<" could end the script's element
    data = json.dumps({"time": time.tolist(), "charts": drawn}, allow_nan=False).replace("<", "\\u003c")
    return f'<script type="application/json" id="{place}-data">{data}</script>\n'
