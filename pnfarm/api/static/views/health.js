// How the farm itself does: the engine's lateness, the event loop, the machine; and the newest events.
import {get} from "../lib/api.js";
import {Histogram} from "../lib/charts.js";
import {html} from "../lib/html.js";
import {Problem, useFarm, useLoaded} from "../lib/ui.js";
import {time} from "../lib/words.js";
import {Entries} from "./drive.js";

const MARKS = new Map([[true, ["good", "ok"]], [false, ["bad", "missing"]], [null, ["warn", "note"]]]);

export function Health() {
  const farm = useFarm();
  const [health, error] = useLoaded(() => get("health"), [], 2);
  const [doctor, problem] = useLoaded(() => get("doctor"), [farm.begun]);
  const engine = health && health.engine;
  return html`<section aria-label="Health">
    <${Problem} text=${error}/>
    ${health ? html`<dl class="facts">
      <div><dt>Engine late, last ${health.last_seconds} s</dt><dd>${health.lateness_measured ? time(health.engine_late_seconds) : "not measured"}</dd></div>
      <div><dt>Event loop late, last ${health.last_seconds} s</dt><dd>${time(health.loop_late_seconds)}</dd></div>
      <div><dt>Stolen, last ${health.last_seconds} s</dt><dd>${time(health.stolen_seconds)}</dd></div>
      <div><dt>Ticks</dt><dd>${engine.cycles}</dd></div><div><dt>Overruns</dt><dd class=${engine.overruns ? "warn" : ""}>${engine.overruns}</dd></div>
      <div><dt>Latest tick ever</dt><dd>${health.lateness_measured ? time(engine.lateness_max_seconds) : "not measured"}</dd></div>
      <div><dt>Frames sent</dt><dd>${engine.frames_sent}</dd></div><div><dt>Frames received</dt><dd>${engine.frames_received}</dd></div>
      <div><dt>Unknown, malformed</dt><dd>${engine.frames_unknown}, ${engine.frames_malformed}</dd></div><div><dt>Send errors</dt><dd class=${engine.send_errors ? "bad" : ""}>${engine.send_errors}</dd></div>
      <div><dt>Events lost</dt><dd class=${engine.events_lost ? "bad" : ""}>${engine.events_lost}</dd></div></dl>
      <div class="columns"><div><h2>How late ticks began</h2>${health.lateness_measured
        ? html`<p>mean ${time(health.lateness_mean_seconds)}</p><${Histogram} buckets=${health.lateness} text=${time} label="Lateness of the engine's ticks"/>`
        : html`<p class="dim">Not measured on a memory link: drives and controller share one loop there, and a tick begins when its turn comes.</p>`}</div>
      <div><h2>This machine</h2><${Problem} text=${problem}/>${doctor ? html`<table><tbody>${doctor.findings.map(one => html`<tr key=${one.name}><th scope="row">${one.name}</th><td class=${MARKS.get(one.ok)[0]}>${MARKS.get(one.ok)[1]}</td><td class="text">${one.detail}${one.remedy ? html`<div class="dim small">${one.remedy}</div>` : null}</td></tr>`)}</tbody></table>` : html`<p class="dim">Being examined…</p>`}</div></div>` : null}
    ${health && health.shards ? html`<h2>Shards</h2><table><thead><tr><th scope="col">Shard</th><th scope="col">Farm</th><th scope="col">State</th><th scope="col" class="number">Drives</th><th scope="col" class="number">Clock offset</th><th scope="col" class="number">Uncertainty</th><th scope="col">Notes</th></tr></thead>
      <tbody>${health.shards.map(one => html`<tr key=${one.shard}><th scope="row">${one.shard}</th><td>${one.farm}</td><td class=${one.state === "up" ? "good" : "bad"}>${one.state}</td><td class="number">${one.drives}</td><td class="number">${time(one.offset_seconds)}</td><td class="number">${time(one.offset_uncertainty_seconds)}</td><td class="text">${[one.reason, ...one.notes].filter(Boolean).join("; ")}</td></tr>`)}</tbody></table>` : null}
    <h2>Events since this page was opened</h2>
    ${farm.lost ? html`<p class="warn">${farm.lost} were missed: too many to follow.</p>` : null}
    <${Entries} entries=${farm.log.slice(-200)}/>
  </section>`;
}
