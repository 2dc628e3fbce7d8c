// What each controller has found, configured and refused, and the line of the farm file to change.
import {get} from "../lib/api.js";
import {html, useState} from "../lib/html.js";
import {linkOf} from "../lib/live.js";
import {Problem, useLoaded} from "../lib/ui.js";
import {plural, time} from "../lib/words.js";

const STEPS = ["searched", "named", "addressed", "connected", "parameters", "ready", "data"];
const STATES = {
  ready: ["run", "ready"], partly: ["fault", "data, refused"], refused: ["fault", "refused"], starting: ["idle", "starting"], ended: ["idle", "not connected"],
  found: ["idle", "found only"], unseen: ["idle", "not asked for"], off: ["off", "no supply"],
};
const VISITS = {data: ["run", "data"], refused: ["fault", "refused"], starting: ["idle", "starting"], ended: ["idle", "not connected"], found: ["idle", "found only"]};
const SHOWN = 300;

const nameOf = one => [one.name, /^\d+$/.test(one.address) ? `station ${one.address}` : one.address || one.mac].filter(Boolean).join(" ") || "unknown";
const fileOf = one => one.file.split("/").pop();

/** Where in the farm file: its line and key. */
function Place({one, why = "change"}) {
  return one.key ? html` <span class="dim">${why}</span> <code title=${one.file}>${fileOf(one)}${one.line ? `:${one.line}` : ""} ${one.key}</code>` : null;
}

function State({of: [kind, text]}) {
  return html`<span class=${"state " + kind}>${text}</span>`;
}

function Refusals({visit}) {
  return html`${visit.refusals.map((one, i) => html`<div key=${i} class=${one.works ? "warn" : "bad"}>${one.text}${one.count > 1 ? html` <span class="dim">${one.count} times</span>` : null}<${Place} one=${one}/></div>`)}
    ${visit.refusals_left_out ? html`<div class="dim">and ${visit.refusals_left_out} more</div>` : null}
    ${visit.ended ? html`<div class="warn">connection ended: ${visit.ended}</div>` : null}`;
}

/** The stations that one controller found. */
function Controller({controller, rows}) {
  const bad = controller.refused, short = controller.stations - controller.exchanging;
  return html`<div role="group" aria-label=${nameOf(controller)}><h2>${nameOf(controller)} <span class="dim small">${[controller.bus, controller.address && controller.mac].filter(Boolean).join(" · ")}</span>
      <span class=${bad ? "bad small" : short ? "warn small" : "good small"}> ${controller.exchanging} of ${plural(controller.stations, "station")} exchange data${bad ? `, ${bad} refuse something` : ""}</span></h2>
    ${rows.length ? html`<div class="scroll" tabindex="0" role="region" aria-label=${`Stations of ${nameOf(controller)}`}><table><thead><tr><th scope="col">Station</th><th scope="col">State</th><th scope="col">Refused</th>${STEPS.map(id => html`<th key=${id} scope="col">${id}</th>`)}<th scope="col" class="number">Cycle</th><th scope="col" class="number">Watchdog</th></tr></thead>
      <tbody>${rows.slice(0, SHOWN).map(({station, visit}) => html`<tr key=${station.name}><th scope="row"><a href=${linkOf(station.axes[0] || station.name)}>${station.name}</a></th><td><${State} of=${VISITS[visit.state]}/></td><td class="text"><${Refusals} visit=${visit}/></td>
        ${STEPS.map(id => html`<td key=${id} class=${visit.steps[id] == null ? "dim" : "good"}>${visit.steps[id] == null ? "–" : "✓"}</td>`)}
        <td class="number">${time(visit.cycle_seconds)}</td><td class="number">${time(visit.watchdog_seconds)}</td></tr>`)}</tbody></table></div>` : null}
    ${rows.length > SHOWN ? html`<p class="dim">${rows.length - SHOWN} more: filter by name</p>` : null}</div>`;
}

export function Readiness() {
  const [found, error] = useLoaded(() => get("readiness"), [], 2);
  const [text, setText] = useState("");
  const [open, setOpen] = useState(false);
  if (!found) return html`<section aria-label="Readiness"><${Problem} text=${error}/></section>`;
  const wanted = found.stations.filter(one => (!open || one.state !== "ready") && (!text || [one.name, one.station_name].some(word => word.toLowerCase().includes(text.toLowerCase()))));
  const rows = number => wanted.flatMap(station => station.visits.filter(visit => visit.controller === number).map(visit => ({station, visit})));
  const alone = wanted.filter(one => !one.visits.length);
  const counts = Object.keys(STATES).map(state => [state, found.stations.filter(one => one.state === state).length]).filter(([, count]) => count);
  return html`<section aria-label="Readiness">
    <div class="bar"><input type="search" placeholder="station" aria-label="Filter by station" value=${text} onInput=${event => setText(event.target.value)}/>
      <label><input type="checkbox" checked=${open} onChange=${event => setOpen(event.target.checked)}/> only what is not ready</label>
      <span role="status">${counts.map(([state, count]) => html`<span key=${state}><${State} of=${STATES[state]}/> ${count} </span>`)}</span>
      ${found.ready ? html`<strong class="good">Every station exchanges data, and nothing is refused.</strong>` : null}</div>
    <${Problem} text=${error}/>
    ${found.missing.length ? html`<div role="group" aria-label="Missing"><h2>Requested, but not in the farm</h2><div class="scroll" tabindex="0" role="region" aria-label="Missing stations"><table><thead><tr><th scope="col">Name or address</th><th scope="col">Controller</th><th scope="col">What to change</th></tr></thead>
      <tbody>${found.missing.map((one, i) => html`<tr key=${i}><th scope="row">${one.name}</th><td>${found.controllers[one.controller] ? nameOf(found.controllers[one.controller]) : "–"}</td><td class="text warn">${one.text}<${Place} one=${one}/></td></tr>`)}</tbody></table></div></div>` : null}
    ${found.controllers.map((controller, number) => html`<${Controller} key=${number} controller=${controller} rows=${rows(number)}/>`)}
    ${alone.length ? html`<div role="group" aria-label="Not asked for"><h2>Stations that no controller asked for</h2><div class="scroll" tabindex="0" role="region" aria-label="Stations that no controller asked for"><table><thead><tr><th scope="col">Station</th><th scope="col">Name on the bus</th><th scope="col">State</th><th scope="col">Farm file</th></tr></thead>
      <tbody>${alone.slice(0, SHOWN).map(one => html`<tr key=${one.name}><th scope="row"><a href=${linkOf(one.axes[0] || one.name)}>${one.name}</a></th><td>${one.station_name || "–"}</td><td><${State} of=${STATES[one.state]}/></td><td><${Place} one=${one} why=""/></td></tr>`)}</tbody></table></div></div>` : null}
  </section>`;
}
