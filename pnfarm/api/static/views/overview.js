// Every drive at a glance: rows or tiles, a filter, a selection, and what can be done to the selection; and every device.
import {call, path} from "../lib/api.js";
import {html, useEffect, useRef, useState} from "../lib/html.js";
import {faultOf} from "../lib/live.js";
import {Act, FaultText, Spark, State, UsualFaults, act, useFarm} from "../lib/ui.js";
import {ROW, useWindow} from "../lib/window.js";
import {controllerOf, number, plural, stateOf, time} from "../lib/words.js";
import {DeviceList, deviceMatches} from "./devices.js";

const TILE_WIDTH = 224, TILE_HEIGHT = 112;
const COLUMNS = [
  ["name", "Drive", drive => drive.name],
  ["state", "State", drive => (drive.fault ? 10 : 0) + drive.state],
  ["velocity", "rpm", drive => drive.velocity],
  ["setpoint", "set rpm", drive => drive.setpoint],
  ["curve", "6 s", null],
  ["current", "A", drive => drive.current],
  ["controller", "Controller", controllerOf],
  ["cycle", "Cycle", drive => drive.cycle_seconds || 0],
  ["connection", "Connection", drive => drive.ar_state || ""],
  ["address", "Address", drive => drive.ip || String(drive.address ?? "")],
  ["fault", "Fault", drive => (faultOf(drive) || {label: ""}).label],
  ["injected", "Injected", drive => drive.injected.length],
];
const NUMBERS = new Set(["velocity", "setpoint", "current", "cycle"]);
const STATES = [["", "any state"], ["run", "in operation"], ["idle", "not in operation"], ["fault", "fault"], ["off", "off or booting"],
  ["away", "unreachable"], ["disconnected", "not connected"], ["injected", "fault injected"]];

// what was chosen stays while other views are open
const kept = {text: "", model: "", bus: "", state: "", tiles: false, order: ["place", 1], selected: new Set()};

function matches(drive, {text, model, bus, state}) {
  if (!drive.known) return false;
  if (model && drive.model !== model) return false;
  if (bus && drive.bus !== bus) return false;
  if (state === "disconnected" ? drive.connected : state === "injected" ? !drive.injected.length : state === "away" ? drive.state !== -2 : state && stateOf(drive).kind !== state) return false;
  if (!text) return true;
  const wanted = text.toLowerCase();
  return [drive.name, drive.station_name, drive.ip, drive.mac, drive.controller, drive.controller_ip].some(one => one && one.toLowerCase().includes(wanted));
}

function ordered(drives, [key, sign]) {
  const column = COLUMNS.find(([id]) => id === key);
  const value = column && column[2];
  if (!value) return drives;
  return [...drives].sort((a, b) => {
    const x = value(a), y = value(b);
    return sign * (x < y ? -1 : x > y ? 1 : a.place - b.place);
  });
}

function Selection({selected, select, shown}) {
  const names = [...selected];
  const cycle = () => act(async () => {
    const refused = [];
    for (const name of names) await call("POST", path("drives", name, "power-cycle")).catch(problem => refused.push(problem.message));
    if (refused.length) throw new Error(`${refused.length} of ${plural(names.length, "drive")} not power-cycled: ${[...new Set(refused)].slice(0, 4).join("; ")}`);
  }, `${plural(names.length, "drive")} power-cycled`);
  return html`<div class="bar" role="group" aria-label="Selected drives">
    <strong>${plural(names.length, "drive")} selected</strong>
    <button type="button" onClick=${() => select(new Set(shown.map(drive => drive.name)))}>Select all ${shown.length} shown</button>
    <button type="button" onClick=${() => select(new Set())}>Select none</button>
    <span class="gap"></span>
    <div class="bar" role="group" aria-label="Faults for the selected drives">
    <${UsualFaults} on=${names}/>
    <a class="button" href=${"#/faults?on=" + encodeURIComponent(names.join(","))}>other fault…</a>
    <${Act} title="off and on again" onClick=${cycle}>Power-cycle<//></div>
  </div>`;
}

function Injected({drive}) {
  return drive.injected.length ? html`<span title=${drive.injected.map(([id, kind]) => `${kind} (${id})`).join(", ")}>${drive.injected.map(([, kind]) => kind).join(", ")}</span>` : null;
}

function Row({drive, selected, toggle}) {
  return html`<tr key=${drive.name} class=${selected ? "selected" : ""}>
    <td class="pick"><input type="checkbox" aria-label=${"select " + drive.name} checked=${selected} onChange=${() => toggle(drive.name)}/></td>
    <th scope="row"><a href=${"#/drive/" + encodeURIComponent(drive.name)}>${drive.name}</a>${drive.station_name && drive.station_name !== drive.name ? html` <span class="dim">${drive.station_name}</span>` : null}</th>
    <td><${State} drive=${drive}/></td>
    <td class="number">${number(drive.velocity)}</td>
    <td class="number">${drive.state > 0 ? number(drive.setpoint) : "–"}</td>
    <td><${Spark} drive=${drive}/></td>
    <td class="number">${number(drive.current, 2)}</td>
    <td title=${drive.controller}>${controllerOf(drive) || "–"}</td>
    <td class="number">${time(drive.cycle_seconds)}</td>
    <td class=${drive.connected ? "good" : "dim"}>${drive.ar_state}</td>
    <td title=${drive.ip}>${drive.ip ? drive.ip.split("/")[0] : drive.address ?? "–"}</td>
    <td class="wide"><${FaultText} drive=${drive}/></td>
    <td class="wide warn"><${Injected} drive=${drive}/></td>
  </tr>`;
}

function Tile({drive, selected, toggle}) {
  const {kind, long} = stateOf(drive);
  return html`<li key=${drive.name} class=${"tile " + kind + (selected ? " selected" : "")} style=${{height: `${TILE_HEIGHT - 8}px`}}>
    <div class="line"><input type="checkbox" aria-label=${"select " + drive.name} checked=${selected} onChange=${() => toggle(drive.name)}/>
      <a href=${"#/drive/" + encodeURIComponent(drive.name)}>${drive.name}</a><span class="gap"></span><${State} drive=${drive}/></div>
    <div class="line"><span class="number">${number(drive.velocity)} rpm</span><span class="gap"></span><${Spark} drive=${drive}/></div>
    <div class="line small"><span class=${drive.connected ? "good" : "dim"} title=${long}>${drive.ar_state}</span><span class="dim">${controllerOf(drive)} ${drive.cycle_seconds ? time(drive.cycle_seconds) : ""}</span><span class="gap"></span><span class="warn"><${Injected} drive=${drive}/></span></div>
    <div class="line small cut"><${FaultText} drive=${drive}/></div>
  </li>`;
}

function Choice({label, value, values, onChange}) {
  return html`<select aria-label=${label} value=${value} onChange=${event => onChange(event.target.value)}>
    ${values.map(([id, text]) => html`<option key=${id} value=${id} selected=${id === value}>${text}</option>`)}</select>`;
}

export function Overview() {
  const farm = useFarm();
  const [wanted, setWanted] = useState(kept);
  const [width, setWidth] = useState(1200);
  const box = useRef(null);
  const change = more => { Object.assign(kept, more); setWanted({...kept}); };
  // of drives that a farm had before it was started again, none
  const selected = new Set([...wanted.selected].filter(name => farm.byName.has(name)));
  const known = farm.drives.filter(drive => drive.known);
  const models = [["", "any model"], ...[...new Set(known.map(drive => drive.model))].sort().map(one => [one, one])];
  const buses = [["", "any bus"], ...[...new Set([...known, ...farm.devices].map(one => one.bus))].sort().map(one => [one, one])];
  const shown = ordered(known.filter(drive => matches(drive, wanted)), wanted.order);
  const columns = wanted.tiles ? Math.max(1, Math.floor((width - 12) / TILE_WIDTH)) : 1;
  const part = useWindow(box, shown.length, wanted.tiles ? TILE_HEIGHT : ROW, columns);
  useEffect(() => {
    const element = box.current;
    const observer = new ResizeObserver(() => setWidth(element.clientWidth));
    observer.observe(element);
    return () => observer.disconnect();
  }, []);
  const toggle = name => {
    const next = new Set(kept.selected);
    if (!next.delete(name)) next.add(name);
    change({selected: next});
  };
  const sort = key => change({order: wanted.order[0] === key ? [key, -wanted.order[1]] : [key, 1]});
  const devices = farm.devices.filter(device => deviceMatches(device, wanted));
  const visible = shown.slice(part.first, part.last);
  const faulty = known.filter(drive => drive.fault).length, connected = known.filter(drive => drive.connected).length;
  const running = known.filter(drive => drive.state === 4).length, away = known.filter(drive => drive.state === -2).length;
  return html`<section class="fill" aria-label="Overview">
    <div class="bar">
      <input type="search" placeholder="name, address or controller" aria-label="Filter by name, address or controller" value=${wanted.text}
        onInput=${event => change({text: event.target.value})}/>
      <${Choice} label="Model" value=${wanted.model} values=${models} onChange=${model => change({model})}/>
      ${buses.length > 2 ? html`<${Choice} label="Bus" value=${wanted.bus} values=${buses} onChange=${bus => change({bus})}/>` : null}
      <${Choice} label="State" value=${wanted.state} values=${STATES} onChange=${state => change({state})}/>
      <span class="dim" role="status">${shown.length === farm.drives.length ? plural(shown.length, "drive") : `${shown.length} of ${plural(farm.drives.length, "drive")}`}:
        ${" "}${connected} connected, ${running} in operation, <span class=${faulty ? "bad" : ""}>${plural(faulty, "fault")}</span>${away ? html`, <span class="bad">${away} unreachable</span>` : null}</span>
      <span class="gap"></span>
      <div role="group" aria-label="Form of the list">
        <button type="button" aria-pressed=${!wanted.tiles} onClick=${() => change({tiles: false})}>Rows</button>
        <button type="button" aria-pressed=${wanted.tiles} onClick=${() => change({tiles: true})}>Tiles</button>
      </div>
    </div>
    ${selected.size ? html`<${Selection} selected=${selected} select=${next => change({selected: next})} shown=${shown}/>` : null}
    <div class="list" hidden=${!farm.drives.length && farm.devices.length > 0} ref=${box} tabindex="0" role="region" aria-label="Drives">
      ${wanted.tiles
        ? html`<div style=${{height: `${part.before}px`}}></div>
          <ul class="tiles" style=${{gridTemplateColumns: `repeat(${columns}, 1fr)`}}>
            ${visible.map(drive => html`<${Tile} key=${drive.name} drive=${drive} selected=${selected.has(drive.name)} toggle=${toggle}/>`)}</ul>
          <div style=${{height: `${part.after}px`}}></div>`
        : html`<table class="drives" aria-rowcount=${shown.length + 1}>
          <thead><tr><th class="pick"><input type="checkbox" aria-label="select all shown" checked=${shown.length > 0 && shown.every(drive => selected.has(drive.name))} onChange=${event => change({selected: new Set(event.target.checked ? shown.map(drive => drive.name) : [])})}/></th>
            ${COLUMNS.map(([id, text, value]) => html`<th key=${id} scope="col" class=${NUMBERS.has(id) ? "number" : ""}
              aria-sort=${wanted.order[0] === id ? (wanted.order[1] > 0 ? "ascending" : "descending") : null}>
              ${value ? html`<button type="button" class="sort" onClick=${() => sort(id)}>${text}${wanted.order[0] === id ? (wanted.order[1] > 0 ? " ▲" : " ▼") : ""}</button>` : text}</th>`)}</tr></thead>
          <tbody>
            <tr class="space" aria-hidden="true"><td style=${{height: `${part.before}px`}}></td></tr>
            ${visible.map(drive => html`<${Row} key=${drive.name} drive=${drive} selected=${selected.has(drive.name)} toggle=${toggle}/>`)}
            <tr class="space" aria-hidden="true"><td style=${{height: `${part.after}px`}}></td></tr>
          </tbody></table>`}
      ${shown.length || !farm.drives.length ? null : html`<p class="dim">No drive matches the filter.</p>`}
    </div>
    ${farm.devices.length ? html`<${DeviceList} devices=${devices} all=${farm.devices.length} alone=${!farm.drives.length}/>` : null}
  </section>`;
}
