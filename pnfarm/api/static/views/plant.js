// The plant: its models with their ports live; inputs without a wire can be written and forced; plots, wires.
import {get, path} from "../lib/api.js";
import {Plot} from "../lib/charts.js";
import {html, useEffect, useMemo, useState} from "../lib/html.js";
import {farm as live, follow, subscribe, valuesOf} from "../lib/live.js";
import {Problem, useFarm, useLoaded} from "../lib/ui.js";
import {plural, time} from "../lib/words.js";
import {Bit, Value} from "./device.js";
import {Trace} from "./trace.js";

/** Models and wires that are listed, and models that are open, at most; ports that are shown before one is opened. */
const SHOWN = 200, FOLLOWED = 100, FIRST = 200;
const PLOTS = 8, PLOT_SECONDS = 30;

const linkOf = model => "#/" + path("plant", model);

/** A port as the stream has it, else as it was read. */
const stateOf = (model, port) => valuesOf(model).states.get(port.name) || {value: port.value, shown: String(port.value), good: true, owner: port.owner, forced: null};

/** Its value in a plot; null where it is no number. */
const plotted = value => typeof value === "number" ? value : typeof value === "boolean" ? Number(value) : null;

/** The last seconds of a port, from when it was asked for. */
function PortPlot({model, port}) {
  const [data, setData] = useState([[], []]);
  useEffect(() => {
    let known = [[], []];
    return subscribe(() => {
      const [times, values] = known, newest = times[times.length - 1], state = valuesOf(model).states.get(port.name);
      if (!state || live.seconds === newest) return;
      // a farm that began anew counts from 0
      const first = live.seconds < newest ? times.length : Math.max(0, times.findIndex(one => one >= live.seconds - PLOT_SECONDS));
      known = [[...times.slice(first), live.seconds], [...values.slice(first), plotted(state.value)]];
      setData(known);
    });
  }, [model, port.name]);
  const [times] = data, now = times.length ? times[times.length - 1] : PLOT_SECONDS, bit = port.type === "bit";
  return html`<${Plot} height=${bit ? 90 : 150} range=${[Math.max(times.length ? times[0] : 0, now - PLOT_SECONDS), now]} label=${`${model}.${port.name} over the last ${PLOT_SECONDS} s`}
    series=${[{label: port.name, unit: port.unit, stepped: true, names: bit ? {0: "0", 1: "1"} : undefined}]} data=${data}/>`;
}

function Port({model, port, wires, chosen, toggle}) {
  const state = stateOf(model, port), full = `${model}.${port.name}`, writable = port.direction === "input" && port.owner !== "plant";
  const joined = wires.get(full) || [], text = joined.map(one => one.target === full ? `← ${one.source}` : `→ ${one.target}`).join(", ");
  const signal = {name: port.name, label: full, direction: writable ? "input" : "output", place: text || "no wire", unit: port.unit};
  return html`<tr><th scope="row">${port.name}</th><td class="dim">${port.direction}</td>
    <td class="text">${port.type === "bit" ? html`<${Bit} device=${model} signal=${signal} state=${state}/>` : writable ? html`<${Value} device=${model} signal=${signal} state=${state}/>`
      : html`<output aria-label=${full} title=${state.shown}>${typeof state.value === "number" ? +state.value.toPrecision(6) : state.shown}</output>`}</td>
    <td>${port.unit}</td><td class=${state.owner === "force" ? "warn" : "dim"}>${state.owner}</td><td class="text dim" title=${joined.map(one => one.text).join("\n")}>${text || "–"}</td>
    <td><button type="button" aria-pressed=${String(chosen)} aria-label=${`Plot ${full}`} onClick=${() => toggle(full)}>plot</button></td></tr>`;
}

function Model({model, wires, open, turn, plots, toggle}) {
  return html`<details class="panel module" open=${open} onToggle=${event => turn(model.name, event.currentTarget.open)}>
    <summary><strong>${model.name}</strong> <span class="dim">${model.kind} · ${plural(model.ports.length, "port")} · every ${time(model.step_seconds)}${model.shard ? ` · ${model.shard}` : ""}</span>
      ${model.failure ? html` <span class="bad">stopped</span>` : null}${model.missed_steps ? html` <span class="warn">${plural(model.missed_steps, "step")} missed</span>` : null}</summary>
    ${model.failure ? html`<p class="bad" role="alert">${model.name} makes no more steps: ${model.failure}</p>` : null}
    ${open ? html`<div class="scroll" tabindex="0" role="region" aria-label=${`Ports of ${model.name}`}><table class="plant"><thead><tr>${["Port", "Direction", "Value", "Unit", "Owner", "Wires", "Plot"].map(one => html`<th key=${one} scope="col">${one}</th>`)}</tr></thead>
      <tbody>${model.ports.map(port => html`<${Port} key=${port.name} model=${model.name} port=${port} wires=${wires} chosen=${plots.includes(`${model.name}.${port.name}`)} toggle=${toggle}/>`)}</tbody></table></div>
      ${model.ports.filter(port => plots.includes(`${model.name}.${port.name}`)).map(port => html`<${PortPlot} key=${port.name} model=${model.name} port=${port}/>`)}
      <p class="small"><a href=${linkOf(model.name)}>Trace of ${model.name}, with a trigger</a>${model.longest_seconds === null ? null : html` <span class="dim">longest step ${time(model.longest_seconds)}</span>`}</p>` : null}</details>`;
}

function Wires({wires, wanted}) {
  const found = wires.filter(one => one.text.toLowerCase().includes(wanted));
  return wires.length ? html`<details class="panel"><summary><strong>Wires</strong> <span class="dim">${wanted ? `${found.length} of ` : ""}${wires.length}</span></summary>
    <div class="scroll" tabindex="0" role="region" aria-label="Wires"><table><thead><tr><th scope="col">From</th><th scope="col">To</th><th scope="col">In the farm file</th></tr></thead>
      <tbody>${found.slice(0, SHOWN).map((one, i) => html`<tr key=${i}><td>${one.source}</td><td>${one.target}</td><td class="text"><code>${one.text}</code></td></tr>`)}</tbody></table></div>
    ${found.length > SHOWN ? html`<p class="dim">${found.length - SHOWN} more: filter by name</p>` : null}</details>` : null;
}

const EXAMPLE = `plant:
  step: 1ms
  models:
    - {name: gripper, kind: cylinder, time: 300ms}
  wires:
    - island-1.grip -> gripper.extend
    - gripper.extended -> island-1.gripped`;

const Empty = () => html`<p>This farm has no plant. Add <code>plant:</code> with models and wires to the farm file, and start the farm again; <code>pnfarm plant --kinds</code> lists the built-in models.</p><pre class="panel">${EXAMPLE}</pre>`;

/** `model`: the one whose trace is shown; empty: all with their ports. */
export function Plant({model}) {
  const farm = useFarm();
  const [found, error] = useLoaded(() => get("plant"), [farm.begun], 3);
  const [text, setText] = useState("");
  const [opened, setOpened] = useState({});
  const [plots, setPlots] = useState([]);
  const wanted = text.toLowerCase();
  const fits = useMemo(() => found ? found.models.filter(one => [one.name, one.kind, ...one.ports.map(port => port.name)].some(word => word.toLowerCase().includes(wanted))) : [], [found, wanted]);
  const wires = useMemo(() => {
    const ends = new Map();
    for (const wire of found ? found.wires : []) for (const end of [wire.source, wire.target]) ends.set(end, [...ends.get(end) || [], wire]);
    return ends;
  }, [found]);
  let ports = 0;
  const shown = model ? [] : fits.slice(0, SHOWN).map(one => {
    ports += one.ports.length;
    return {one, open: opened[one.name] ?? ports <= FIRST};
  });
  const names = shown.filter(one => one.open).slice(0, FOLLOWED).map(one => one.one.name);
  useEffect(() => follow(names), [names.join("\n")]);
  useEffect(() => () => follow([]), []);
  if (!found) return html`<section aria-label="Plant"><${Problem} text=${error}/></section>`;
  const turn = (name, open) => { if (names.includes(name) !== open) setOpened(before => ({...before, [name]: open})); };
  const toggle = name => setPlots(before => before.includes(name) ? before.filter(one => one !== name) : [...before, name].slice(-PLOTS));
  if (model) {
    return html`<section aria-label=${"Trace of " + model}><div class="bar"><h2>${model}</h2><a href="#/plant">All models</a></div>
      ${found.models.some(one => one.name === model) ? html`<${Trace} key=${model} name=${model}/>` : html`<p>There is no model ${model} in the plant of farm ${farm.name}.</p>`}</section>`;
  }
  return html`<section aria-label="Plant"><${Problem} text=${error}/>
    ${!found.models.length && !found.wires.length ? html`<${Empty}/>` : html`<div class="bar"><input type="search" placeholder="model, kind or port" aria-label="Find a model by its name, kind or ports" value=${text} onInput=${event => { setText(event.target.value); setOpened({}); }}/>
      <span class="dim" role="status">${wanted ? `${fits.length} of ` : ""}${plural(found.models.length, "model")}, ${plural(found.wires.length, "wire")}, a step every ${time(found.step_seconds)}</span>
      ${found.steps_left_out ? html`<span class="warn" title="the machine stalled for longer than the plant makes up for">${plural(found.steps_left_out, "step")} left out</span>` : null}</div>
    ${shown.map(({one, open}) => html`<${Model} key=${one.name} model=${one} wires=${wires} open=${open} turn=${turn} plots=${plots} toggle=${toggle}/>`)}
    ${fits.length > SHOWN ? html`<p class="dim">${fits.length - SHOWN} more: filter by name</p>` : null}${wanted && !fits.length ? html`<p class="dim">No model matches.</p>` : null}
    <${Wires} wires=${found.wires} wanted=${wanted}/>`}</section>`;
}
