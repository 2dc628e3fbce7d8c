// Plots of uPlot in the page's colours, and rows of a logic analyser.
import {html, useEffect, useRef} from "./html.js";

const COLORS = ["--c1", "--c2", "--c3", "--c4", "--c5", "--c6", "--c7", "--c8"];

export const color = (element, name) => getComputedStyle(element).getPropertyValue(name).trim();
const colorOf = (element, place) => color(element, COLORS[place % COLORS.length]);

/** Width of the column of names beside plots and rows of bits, so that all have one time axis. */
const namesWidth = element => parseFloat(color(element, "--names")) || 200;
const RIGHT = 24;

/**
 * One plot: `data` is [times, values, ...], `series` [{label, unit, stepped, names}].  `cursor`: a key under which plots share it.
 * `range` is [least, greatest] time; `onZoom` gets what was dragged over, or null after a double click; `onCursor` the place of
 * the sample under the cursor, or null.
 */
export function Plot({data, series, height = 160, cursor = null, range, label, onZoom, onCursor}) {
  const box = useRef(null), plot = useRef(null);
  const now = useRef({});
  now.current = {range, onZoom, onCursor, data};
  const kinds = series.map(one => one.label + (one.unit || "")).join("|");
  const stepped = series.every(one => one.stepped);
  useEffect(() => {
    const element = box.current;
    const axis = {stroke: color(element, "--text"), grid: {stroke: color(element, "--line"), width: 1}, ticks: {stroke: color(element, "--line"), width: 1}, font: "11px system-ui"};
    const names = series[0].names;
    const numbers = Object.keys(names || {}).map(Number), span = [Math.min(...numbers) - 0.5, Math.max(...numbers) + 0.5];
    const made = plot.current = new uPlot({
      width: Math.max(320, element.clientWidth), height, padding: [8, RIGHT, 0, 0],
      cursor: {sync: cursor ? {key: cursor} : undefined, drag: {x: true, y: false, setScale: false}},
      legend: {live: true},
      scales: {x: {time: false, range: () => now.current.range}, y: {range: numbers.length ? span : (_, low, high) => low === high ? [low - 1, high + 1] : uPlot.rangeNum(low, high, 0.1, true)}},
      axes: [{...axis, size: 26, space: 70, values: (_, ticks) => ticks.map(tick => `${+tick.toFixed(4)} s`)},
        {...axis, size: () => namesWidth(element), space: numbers.length ? 9 : 22, gap: 6, ...(stepped ? {incrs: [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000, 20000, 50000]} : {}),
          values: (_, ticks) => ticks.map(tick => names ? names[tick] ?? "" : +tick.toPrecision(6))}],
      series: [{label: "time", value: (_, value) => value === null || value === undefined ? "–" : `${value.toFixed(4)} s`},
        ...series.map((one, place) => ({
          label: one.unit ? `${one.label} [${one.unit}]` : one.label, stroke: colorOf(element, one.color ?? place), width: 1.4, points: {show: false},
          paths: one.stepped ? uPlot.paths.stepped({align: 1}) : undefined,
          value: (_, value) => value === null || value === undefined ? "–" : one.names ? (one.names[value] || value) : +value.toPrecision(5),
        }))],
      hooks: {
        setSelect: [self => {
          if (self.select.width <= 0) return;
          const zoom = [self.select.left, self.select.left + self.select.width].map(at => self.posToVal(at, "x"));
          self.setSelect({left: 0, top: 0, width: 0, height: 0}, false);
          if (now.current.onZoom) now.current.onZoom(zoom);
        }],
        setCursor: [self => {
          const idx = self.cursor.left >= 0 ? self.cursor.idx : null;
          if (now.current.onCursor) now.current.onCursor(idx ?? null);
          // without a cursor the newest values are shown
          if (idx === null || idx === undefined) newest(self);
        }],
      },
    }, data, element);
    made.over.addEventListener("dblclick", () => { if (now.current.onZoom) now.current.onZoom(null); });
    const observer = new ResizeObserver(() => made.setSize({width: Math.max(320, element.clientWidth), height}));
    observer.observe(element);
    return () => { observer.disconnect(); made.destroy(); plot.current = null; };
  }, [kinds, height]);
  useEffect(() => {
    if (!plot.current || !data[0].length) return;
    plot.current.setData(data, true);
    if (!(plot.current.cursor.left >= 0)) newest(plot.current);
  }, [data, range[0], range[1]]);
  return html`<div class="plot" ref=${box} role="img" aria-label=${label}></div>`;
}

function newest(plot) {
  const last = plot.data[0].length - 1;
  if (last >= 0) plot.setLegend({idx: last}, false);
}

const BIT_HEIGHT = 16;

/** The bits of a word over time as rows, with their names: `bits` [{bit, name}], `range` [least, greatest] time, `at` the place of a cursor or null. */
export function LogicRows({times, values, bits, range, label, at: place = null}) {
  const ref = useRef(null);
  useEffect(() => {
    const canvas = ref.current;
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth || 600, height = bits.length * BIT_HEIGHT;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.beginPath(); context.rect(0, 0, width - RIGHT, height); context.clip();
    const on = color(canvas, "--c1"), line = color(canvas, "--line");
    const x = at => (at - range[0]) / (range[1] - range[0] || 1) * (width - RIGHT);
    const first = Math.max(0, times.findIndex(at => at >= range[0]) - 1);
    const after = times.findIndex(at => at > range[1]), end = after < 0 ? times.length : after + 1;
    bits.forEach(({bit}, row) => {
      const low = (row + 1) * BIT_HEIGHT - 3, high = row * BIT_HEIGHT + 3;
      context.strokeStyle = line;
      context.beginPath(); context.moveTo(0, low + 2.5); context.lineTo(width, low + 2.5); context.stroke();
      context.strokeStyle = on;
      context.fillStyle = on;
      context.lineWidth = 1.3;
      context.beginPath();
      let before = null;
      for (let i = first; i < end; i++) {
        // not known yet
        if (values[i] === null) continue;
        const value = values[i] >> bit & 1, y = value ? high : low, at = Math.max(0, x(times[i]));
        if (before === null) context.moveTo(at, y);
        else if (value !== before) { context.lineTo(at, before ? high : low); context.lineTo(at, y); }
        before = value;
      }
      if (before !== null) context.lineTo(Math.min(width, x(times[end - 1])), before ? high : low);
      context.stroke();
    });
    if (place !== null && place < times.length) {
      context.strokeStyle = color(canvas, "--dim");
      context.lineWidth = 1;
      context.setLineDash([4, 3]);
      context.beginPath(); context.moveTo(x(times[place]), 0); context.lineTo(x(times[place]), height); context.stroke();
    }
  });
  return html`<div class="logic" role="img" aria-label=${label}>
    <div class="names">${bits.map(({bit, name}) => {
      const value = values[place !== null && place < times.length ? place : times.length - 1], now = value === undefined || value === null ? "–" : value >> bit & 1;
      return html`<div key=${bit} style=${{height: `${BIT_HEIGHT}px`}}><span class="dim">${bit}</span><span class="name" title=${name}>${name}</span><strong>${now}</strong></div>`;
    })}</div>
    <canvas ref=${ref} style=${{height: `${bits.length * BIT_HEIGHT}px`}}></canvas></div>`;
}

/** A histogram as bars with their numbers: `buckets` [{up_to_seconds, count}]. */
export function Histogram({buckets, text, label}) {
  const most = Math.max(1, ...buckets.map(one => one.count)), all = buckets.reduce((sum, one) => sum + one.count, 0);
  // those before the first and beyond the last that has something say nothing
  buckets = buckets.slice(Math.max(0, buckets.findIndex(one => one.count)), buckets.findLastIndex(one => one.count) + 1);
  if (!buckets.length) return html`<p class="dim">nothing counted yet</p>`;
  return html`<table class="histogram" aria-label=${label}><thead><tr><th scope="col">up to</th><th scope="col" class="number">count</th><th scope="col">share</th></tr></thead>
    <tbody>${buckets.map(one => html`<tr key=${String(one.up_to_seconds)}>
      <td>${one.up_to_seconds === null ? "more" : text(one.up_to_seconds)}</td><td class="number">${one.count}</td>
      <td class="wide"><div class="barbox"><div class="bar-fill" style=${{width: `${100 * one.count / most}%`}}></div></div>
        <span class="dim">${all ? (100 * one.count / all).toFixed(one.count && one.count / all < 0.001 ? 3 : 1) : "0.0"} %</span></td></tr>`)}</tbody></table>`;
}
