// What the PLC did about each fault and each lost connection: a timeline of each, and histograms over all.
import {get} from "../lib/api.js";
import {Histogram} from "../lib/charts.js";
import {html, useState} from "../lib/html.js";
import {Problem, useLoaded} from "../lib/ui.js";
import {plural, time} from "../lib/words.js";

const EDGES = [0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 30];

function buckets(values) {
  const counts = new Array(EDGES.length + 1).fill(0);
  for (const value of values) {
    const place = EDGES.findIndex(edge => value <= edge);
    counts[place < 0 ? EDGES.length : place] += 1;
  }
  return counts.map((count, place) => ({up_to_seconds: EDGES[place] ?? null, count}));
}

function quantile(values, share) {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted.length ? sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] : null;
}

const SHAPES = {injected: "◆", wire: "◇", fault: "●", control: "▲", acknowledged: "■", lost: "●", "start-up": "▲"};

function Timeline({one}) {
  const first = Math.min(0, ...one.steps.map(step => step.seconds)), last = Math.max(0.001, ...one.steps.map(step => step.seconds));
  const place = seconds => 100 * (seconds - first) / (last - first);
  return html`<div class="timeline" aria-hidden="true">${one.steps.map((step, i) => html`<span key=${i} class=${"mark " + step.what} style=${{left: `${place(step.seconds)}%`}} title=${`${step.text}, ${time(step.seconds)}`}>${SHAPES[step.what] || "●"}</span>`)}</div>
    <ol class="steps">${one.steps.map((step, i) => html`<li key=${i}><span class="number">${step.seconds >= 0 ? "+" : ""}${time(step.seconds)}</span><span aria-hidden="true">${SHAPES[step.what]}</span><span>${step.text}</span></li>`)}</ol>`;
}

export function Reactions() {
  const [found, error] = useLoaded(() => get("reactions"), [], 2);
  const [text, setText] = useState("");
  const all = found ? found.reactions.filter(one => !text || [one.drive, one.kind, one.code, one.name].some(word => word.toLowerCase().includes(text.toLowerCase()))) : [];
  const reacted = all.filter(one => one.what === "fault" && one.reaction_seconds !== null).map(one => one.reaction_seconds);
  const acknowledged = all.filter(one => one.what === "fault" && one.recovered_seconds !== null).map(one => one.recovered_seconds);
  const back = all.filter(one => one.what === "connection" && one.recovered_seconds !== null).map(one => one.recovered_seconds);
  const summary = (title, values) => html`<div><h2>${title}</h2>${values.length
    ? html`<p>${plural(values.length, "time")}, median ${time(quantile(values, 0.5))}, longest ${time(Math.max(...values))}</p><${Histogram} buckets=${buckets(values)} text=${time} label=${title}/>`
    : html`<p class="dim">none yet</p>`}</div>`;
  return html`<section aria-label="PLC reaction">
    <div class="bar"><input type="search" placeholder="drive, kind or fault" aria-label="Filter by drive, kind or fault" value=${text} onInput=${event => setText(event.target.value)}/>
      <span class="dim" role="status">${plural(all.length, "reaction")}; a drive keeps its last 16 faults and start-ups</span></div>
    <${Problem} text=${error}/>
    <div class="columns">${summary("Fault until the enable was withdrawn", reacted)}${summary("Fault until it was acknowledged", acknowledged)}${summary("Loss of the connection until data flow again", back)}</div>
    ${all.length ? html`<div class="scroll" tabindex="0" role="region" aria-label="Reactions"><table><thead><tr><th scope="col">Drive</th><th scope="col">What</th><th scope="col">Injected</th><th scope="col" class="number">Ago</th><th scope="col" class="number">Reaction</th><th scope="col" class="number">Recovered</th><th scope="col">What the PLC did</th></tr></thead>
      <tbody>${all.slice(0, 100).map((one, i) => html`<tr key=${one.drive + one.what + i}><th scope="row"><a href=${"#/drive/" + encodeURIComponent(one.drive) + "/events"}>${one.drive}</a></th>
        <td class=${"text " + (one.what === "fault" ? "bad" : "warn")}>${one.what === "fault" ? `fault ${one.code} ${one.name}` : `connection lost${one.name ? ` by ${one.name}` : ""}`}</td><td>${one.what === "fault" ? (one.kind === "none" ? "–" : one.kind) : one.kind || "–"}</td>
        <td class="number dim">${time(Math.round(one.seconds_ago))}</td><td class="number">${time(one.reaction_seconds)}</td>
        <td class=${"number " + (one.recovered_seconds === null ? "bad" : "good")}>${one.recovered_seconds === null ? "not yet" : time(one.recovered_seconds)}</td><td class="wide"><${Timeline} one=${one}/></td></tr>`)}</tbody></table></div>`
      : html`<p class="dim">No fault and no loss of a connection has been seen. Inject one to see here what the PLC does.</p>`}
  </section>`;
}
