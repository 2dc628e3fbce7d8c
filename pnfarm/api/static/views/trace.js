// The oscilloscope: signals, a trigger, a cursor with values, zoom, export.
import {call, get, path, url} from "../lib/api.js";
import {LogicRows, Plot} from "../lib/charts.js";
import {html, useEffect, useMemo, useState} from "../lib/html.js";
import {Act, Problem, act, say, useFarm, useLoaded} from "../lib/ui.js";
import {plural} from "../lib/words.js";

const USUAL = ["setpoint", "velocity", "stw1", "zsw1", "control", "status_1", "state", "fault"];
const TRIGGERS = ["now", "manual", "fault", "disconnect", "state changes", "velocity rising 100", "zsw1.fault_present", "watchdog"];
const OF_DEVICES = ["now", "manual", "disconnect", "connected falling", "injection"];
const OF_MODELS = ["now", "manual"];
/** Signals of a device or a model that are chosen at first, and those that are shown before one is looked for. */
const FIRST = 6, SHOWN = 60;
const kept = {trigger: "now", pre: "200ms", length: "1s", interval: "1ms", drive: null, device: null, model: null};
// By drive, the trace begun last: it goes on while other views are looked at.
const begun = new Map();

/** Columns of one unit share a plot; each word whose bits are `signals`, too, has its rows of bits. */
function grouped(columns, signals) {
  const plots = new Map(), words = [];
  for (const column of columns) {
    if (column.form === "real") {
      if (!plots.has(column.unit)) plots.set(column.unit, []);
      plots.get(column.unit).push(column);
    } else if (column.form !== "bit" && signals.some(one => one.signal.startsWith(column.signal + "."))) words.push(column);
    else plots.set(column.signal, [column]);
  }
  return [[...plots.values()], words];
}

function Picture({recording, signals}) {
  const [plots, words] = useMemo(() => grouped(recording.columns, signals), [recording]);
  const [zoom, setZoom] = useState(null);
  const [at, setAt] = useState(null);
  const times = recording.time, range = zoom || [times[0] || 0, times[times.length - 1] || 1];
  const bitsOf = word => signals.filter(one => one.signal.startsWith(word + ".")).map((one, bit) => ({bit, name: one.signal.split(".")[1]}));
  return html`<div>
    ${times.length ? html`<p class="dim small">Drag over a plot to zoom all, double-click to go back. The cursor's values are beside each plot, and each bit's at its row.</p>` : null}
    ${plots.map((columns, place) => html`<${Plot} key=${recording.time[0] + columns.map(one => one.signal).join()} height=${columns[0].form === "real" ? 190 : 110} cursor="trace" range=${range} onZoom=${setZoom} onCursor=${place === 0 ? setAt : null}
      label=${`${columns.map(one => one.signal).join(", ")} from ${range[0].toFixed(3)} to ${range[1].toFixed(3)} s`}
      series=${columns.map(one => ({label: one.signal, unit: one.unit, stepped: one.form !== "real", names: one.labels}))} data=${[times, ...columns.map(one => one.values)]}/>`)}
    ${words.map(column => html`<div key=${column.signal}><h3>${column.signal}</h3>
      <${LogicRows} times=${times} values=${column.values} range=${range} at=${at} bits=${bitsOf(column.signal)} label=${"bits of " + column.signal}/></div>`)}
    ${times.length ? html`<details><summary>As a table (${plural(times.length, "sample")})</summary><div class="scroll" tabindex="0" role="region" aria-label="Samples"><table>
      <thead><tr><th scope="col" class="number">s</th>${recording.columns.map(one => html`<th key=${one.signal} scope="col" class="number">${one.signal} ${one.unit}</th>`)}</tr></thead>
      <tbody>${times.slice(0, 200).map((at, place) => html`<tr key=${place}><td class="number">${at.toFixed(4)}</td>${recording.columns.map(one => html`<td key=${one.signal} class="number">${one.values[place] === null ? "–" : +one.values[place].toPrecision(6)}</td>`)}</tr>`)}</tbody></table></div>
      ${times.length > 200 ? html`<p class="dim">The first 200; CSV has all.</p>` : null}</details>` : null}
  </div>`;
}

export function Trace({name}) {
  const farm = useFarm(), {writes} = farm, kind = farm.byName.has(name) ? "drive" : farm.deviceByName.has(name) ? "device" : "model";
  const triggers = {drive: TRIGGERS, device: OF_DEVICES, model: OF_MODELS}[kind];
  const [text, setText] = useState("");
  const [list, error] = useLoaded(() => get("traces/signals/" + path(name)), [name, farm.begun]);
  const [form, setForm] = useState({...kept});
  const [trace, setTrace] = useState(begun.get(name) || null);
  const [recording, setRecording] = useState(null);
  const change = more => setForm(before => Object.assign(kept, {...before, ...more}) && {...before, ...more});
  const names = useMemo(() => list ? list.signals.filter(one => !one.signal.includes(".")).map(one => one.signal) : [], [list]);
  const wanted = form[kind] || USUAL, chosen = wanted.filter(signal => names.includes(signal));
  // those that were chosen last are of another device or model
  if (kind !== "drive" && wanted.length && !chosen.length) chosen.push(...names.slice(0, FIRST));
  const found = names.filter(signal => signal.toLowerCase().includes(text.toLowerCase())), first = found.slice(0, SHOWN);
  const shown = names.filter(signal => chosen.includes(signal) || first.includes(signal));
  const follow = status => { begun.set(name, status); setTrace(status); };
  useEffect(() => {
    if (!trace || (trace.state === "complete" && recording)) return undefined;
    let alive = true;
    const timer = setTimeout(async () => {
      try {
        const status = await get(path("traces", trace.id) + "?format=status");
        const samples = status.state === "complete" ? await get(path("traces", trace.id)) : null;
        if (!alive) return;
        setRecording(samples);
        follow({...status});
      } catch (problem) {
        if (!alive) return;
        // whether the trace is still there, only the farm can say
        if (problem.status !== 404) return setTrace({...trace});
        say(problem.message, "bad");
        follow(null);
      }
    }, 250);
    return () => { alive = false; clearTimeout(timer); };
  }, [trace]);
  if (!list) return html`<${Problem} text=${error}/>`;
  const start = event => {
    event.preventDefault();
    act(async () => {
      if (trace) await call("DELETE", path("traces", trace.id)).catch(() => null);
      setRecording(null);
      follow(null);
      follow(await call("POST", "traces", {on: [name], signals: chosen, trigger: form.trigger, pre: form.pre || "0ms", length: form.length, interval: form.interval}));
    });
  };
  const toggle = signal => change({[kind]: chosen.includes(signal) ? chosen.filter(one => one !== signal) : [...chosen, signal]});
  const field = (key, label, size, more = {}) => html`<label>${label} <input size=${size} value=${form[key]} onInput=${event => change({[key]: event.target.value})} ...${more}/></label>`;
  return html`<div>
    <form class="panel" onSubmit=${start}>
      <fieldset><legend>Signals</legend>${names.length > SHOWN ? html`<input type="search" aria-label="Find a signal" placeholder="name of a signal" value=${text} onInput=${event => setText(event.target.value)}/> <span class="dim" role="status">${found.length > SHOWN ? `the first ${SHOWN} of ` : ""}${plural(found.length, "signal")}</span>` : null}<div class="checks">${shown.map(signal => html`<label key=${signal}><input type="checkbox" checked=${chosen.includes(signal)} onChange=${() => toggle(signal)}/> ${signal}</label>`)}</div></fieldset>
      <div class="bar">
        ${field("trigger", "Trigger", 24, {list: "triggers"})}<datalist id="triggers">${triggers.map(one => html`<option key=${one} value=${one}/>`)}</datalist>
        ${field("pre", "before it", 7)} ${field("length", "after it", 7)} ${field("interval", "a sample every", 7)}
        <button type="submit" class="main" disabled=${!writes || !chosen.length} title=${writes ? null : "this token may read only"}>Start</button>
        ${trace && trace.state === "waiting" ? html`<${Act} title="trigger now" onClick=${() => act(() => call("POST", path("traces", trace.id, "trigger")))}>Trigger now<//>` : null}
        ${trace ? html`<span role="status">${trace.id}: ${trace.state}, ${plural(trace.samples, "sample")}${trace.triggered_by ? `, triggered by ${trace.triggered_by}` : ""}${trace.missed ? `, ${trace.missed} missed` : ""}</span>` : null}
        ${recording ? html`<a class="button" href=${url(path("traces", trace.id) + "?format=csv")} download=${trace.id + ".csv"}>CSV</a>
          <a class="button" href=${url(path("traces", trace.id))} download=${trace.id + ".json"}>JSON</a>` : null}
      </div>
    </form>
    ${recording ? html`<${Picture} recording=${recording} signals=${list.signals}/>` : html`<p class="dim">Choose signals and a trigger, and start. A trigger is an event (fault 702, disconnect), a comparison (velocity > 100), an edge (velocity rising 100), a bit, or manual. island-1.pressure > 6.5 bar is a signal of a device, gripper.position > 0.5 of a model of the plant.</p>`}
  </div>`;
}
