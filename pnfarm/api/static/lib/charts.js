// Plots of uPlot in the page's colours, and rows of a logic analyser.
import {html, useEffect, useRef} from "./html.js";

const COLORS = ["--c1", "--c2", "--c3", "--c4", "--c5", "--c6", "--c7", "--c8"];

export const color = (element, name) => getComputedStyle(element).getPropertyValue(name).trim();
export const colorOf = (element, place) => color(element, COLORS[place % COLORS.length]);

/**
 * One plot: `data` is [times, values, ...], `series` [{label, unit, stepped}].  `cursor`: a key under which plots share it.
 * `range` is [least, greatest] time; null: all.  Dragging zooms, a double click shows all.
 */
export function Plot({data, series, height = 160, cursor = null, range = null, label, onZoom = null}) {
  const box = useRef(null), plot = useRef(null);
  const zoomed = useRef(null);
  const wanted = useRef(range);
  wanted.current = range;
  const kinds = series.map(one => one.label + (one.unit || "")).join("|");
  useEffect(() => {
    const element = box.current;
    const axis = {stroke: color(element, "--text"), grid: {stroke: color(element, "--line"), width: 1}, ticks: {stroke: color(element, "--line"), width: 1}, font: "11px system-ui", size: 56};
    const made = plot.current = new uPlot({
      width: Math.max(200, element.clientWidth), height,
      cursor: {sync: cursor ? {key: cursor} : undefined, drag: {x: true, y: false}},
      legend: {live: true},
      scales: {x: {time: false, range: (_, low, high) => wanted.current && !zoomed.current ? wanted.current : [low, high]}},
      axes: [{...axis, size: 34, values: (_, ticks) => ticks.map(tick => `${+tick.toFixed(4)} s`)}, axis],
      series: [{label: "time", value: (_, value) => value === null ? "–" : `${value.toFixed(4)} s`},
        ...series.map((one, place) => ({
          label: one.unit ? `${one.label} [${one.unit}]` : one.label, stroke: colorOf(element, one.color ?? place), width: 1.4, points: {show: false},
          paths: one.stepped ? uPlot.paths.stepped({align: 1}) : undefined,
          value: (_, value) => value === null || value === undefined ? "–" : one.names ? (one.names[value] || value) : +value.toPrecision(6),
        }))],
      hooks: {setSelect: [self => { if (self.select.width > 0) { zoomed.current = true; if (onZoom) onZoom(true); } }]},
    }, data, element);
    made.over.addEventListener("dblclick", () => { zoomed.current = null; if (onZoom) onZoom(false); });
    const observer = new ResizeObserver(() => made.setSize({width: Math.max(200, element.clientWidth), height}));
    observer.observe(element);
    return () => { observer.disconnect(); made.destroy(); plot.current = null; };
  }, [kinds, height]);
  useEffect(() => { if (plot.current && data[0].length) plot.current.setData(data, !zoomed.current); }, [data]);
  return html`<div class="plot" ref=${box} role="img" aria-label=${label}></div>`;
}

const BIT_HEIGHT = 16;

/** The bits of a word over time as rows, with their names: `bits` [{bit, name}], `range` [least, greatest] time. */
export function LogicRows({times, values, bits, range, label}) {
  const ref = useRef(null);
  useEffect(() => {
    const canvas = ref.current;
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth || 600, height = bits.length * BIT_HEIGHT;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const on = color(canvas, "--c1"), line = color(canvas, "--line");
    const x = at => (at - range[0]) / (range[1] - range[0] || 1) * width;
    const first = Math.max(0, times.findIndex(at => at >= range[0]) - 1);
    bits.forEach(({bit}, row) => {
      const low = (row + 1) * BIT_HEIGHT - 3, high = row * BIT_HEIGHT + 3;
      context.strokeStyle = line;
      context.beginPath(); context.moveTo(0, low + 2.5); context.lineTo(width, low + 2.5); context.stroke();
      context.strokeStyle = on;
      context.fillStyle = on;
      context.lineWidth = 1.3;
      context.beginPath();
      let before = null;
      for (let i = first; i < times.length; i++) {
        const value = values[i] >> bit & 1, y = value ? high : low, at = Math.max(0, x(times[i]));
        if (before === null) context.moveTo(at, y);
        else if (value !== before) { context.lineTo(at, before ? high : low); context.lineTo(at, y); }
        before = value;
      }
      if (before !== null) context.lineTo(Math.min(width, x(times[times.length - 1])), before ? high : low);
      context.stroke();
    });
  });
  return html`<div class="logic" role="img" aria-label=${label}>
    <div class="names">${bits.map(({bit, name}) => {
      const now = times.length ? values[times.length - 1] >> bit & 1 : 0;
      return html`<div key=${bit} style=${{height: `${BIT_HEIGHT}px`}}><span class="dim">${bit}</span> ${name} <strong>${now}</strong></div>`;
    })}</div>
    <canvas ref=${ref} style=${{height: `${bits.length * BIT_HEIGHT}px`}}></canvas></div>`;
}

/** A histogram as bars with their numbers: `buckets` [{up_to_seconds, count}]. */
export function Histogram({buckets, text, label}) {
  const most = Math.max(1, ...buckets.map(one => one.count)), all = buckets.reduce((sum, one) => sum + one.count, 0);
  // those beyond the last that has something say nothing
  buckets = buckets.slice(0, buckets.findLastIndex(one => one.count) + 1);
  if (!buckets.length) return html`<p class="dim">nothing counted yet</p>`;
  return html`<table class="histogram" aria-label=${label}><thead><tr><th scope="col">up to</th><th scope="col" class="number">count</th><th scope="col">share</th></tr></thead>
    <tbody>${buckets.map(one => html`<tr key=${String(one.up_to_seconds)}>
      <td>${one.up_to_seconds === null ? "more" : text(one.up_to_seconds)}</td><td class="number">${one.count}</td>
      <td class="wide"><div class="barbox"><div class="bar-fill" style=${{width: `${100 * one.count / most}%`}}></div></div>
        <span class="dim">${all ? (100 * one.count / all).toFixed(one.count && one.count / all < 0.001 ? 3 : 1) : "0.0"} %</span></td></tr>`)}</tbody></table>`;
}
