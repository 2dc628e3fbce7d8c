// Scenarios that the farm carries out: start one, watch its steps, read its verdict.
import {call, get, path, url} from "../lib/api.js";
import {html, useState} from "../lib/html.js";
import {Act, Problem, act, useFarm, useLoaded} from "../lib/ui.js";
import {time} from "../lib/words.js";

const EXAMPLE = `scenario: f702-recovery
steps:
  - wait: {until: all-connected, within: 20s}
  - fault: {kind: f702, on: DRIVE, as: trip}
  - expect: {drive: DRIVE, that: "zsw1.fault_present", within: 100ms}
  - expect: {drive: DRIVE, that: "stw1.enable_operation == 0", within: 500ms, name: PLC stops the axis}
  - clear: trip
  - expect: {drive: DRIVE, that: "state == S4", within: 5s, name: PLC brings it back}
`;
const kept = {text: ""};
const KINDS = {passed: "good", failed: "bad", inconclusive: "warn", error: "bad"};

function Verdict({found}) {
  return found.verdict === null ? html`<span class="warn">running</span>` : html`<span class=${KINDS[found.verdict] || "dim"}>${found.verdict}</span>`;
}

function Report({id}) {
  const [found, error] = useLoaded(() => get(path("scenarios", id) + "?cases_from=0"), [id], 0.5);
  const [record] = useLoaded(() => get(path("scenarios", id)), [id, found && found.verdict], 0);
  if (!found) return html`<${Problem} text=${error}/>`;
  const {cases} = found;
  const stop = () => act(() => call("DELETE", path("scenarios", id)), "the scenario was ended");
  const save = () => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([JSON.stringify(record, null, 1)], {type: "application/json"}));
    link.download = `${found.scenario}-${id}.json`;
    link.click();
    URL.revokeObjectURL(link.href);
  };
  return html`<div class="panel" aria-label=${"Scenario " + found.scenario} role="region">
    <div class="bar"><h3>${found.scenario}</h3><${Verdict} found=${found}/><span class="dim">${found.seconds ? time(found.seconds) + (Object.values(found.counts).some(count => count) ? ", " : "") : ""}${Object.entries(found.counts).filter(([, count]) => count).map(([verdict, count]) => `${count} ${verdict}`).join(", ")}</span>
      <span class="gap"></span>${found.state === "running" ? html`<${Act} title="end it: its faults are cleared" onClick=${stop}>Stop<//>` : html`<a class="button" href=${url(path("scenarios", id, "report"))} target="_blank" rel="noopener">Open the report</a> ${record ? html`<button type="button" onClick=${save}>Record as JSON</button>` : null}`}</div>
    <${Problem} text=${error}/>
    ${found.ended_early ? html`<p class="warn">${found.ended_early}</p>` : null}
    ${found.state === "running" ? html`<p role="status">Step ${found.steps_begun} of ${found.steps}: ${found.step}; at most ${time(found.left_seconds)} more for it <progress max=${found.steps} value=${found.steps_begun}></progress></p>` : null}
    ${cases.length ? html`<div class="scroll" tabindex="0" role="region" aria-label="Expectations"><table><thead><tr><th scope="col">Line</th><th scope="col">Expectation</th><th scope="col">Verdict</th><th scope="col">Allowed</th><th scope="col">Measured</th><th scope="col">Message</th></tr></thead>
      <tbody>${cases.map((one, i) => html`<tr key=${i}><td class="number dim">${one.line}</td><th scope="row" class="text">${one.name}</th><td class=${KINDS[one.verdict] || "dim"}>${one.verdict}</td><td>${one.allowed}</td><td>${one.measured}</td><td class="text">${one.message}${one.drives.length ? html` <span class="dim">${one.drives.join(", ")}</span>` : null}</td></tr>`)}</tbody></table></div>` : null}
    ${record && record.state === "ended" ? html`<details><summary>Timeline (${record.timeline.length})</summary><ol class="steps">${record.timeline.slice(0, 500).map((one, i) => html`<li key=${i}><span class="number">${time(one.seconds)}</span> ${one.what === "step" ? html`<strong>${one.text}</strong>` : one.text} <span class="dim">${one.drive || ""}</span></li>`)}</ol></details>` : null}
  </div>`;
}

export function Scenarios({id}) {
  const farm = useFarm();
  const first = (farm.drives.find(drive => drive.known) || {name: "axis-01"}).name;
  const [text, setText] = useState(kept.text);
  const [issues, setIssues] = useState("");
  const [list, error, again] = useLoaded(() => get("scenarios"), [], 1);
  const value = text || EXAMPLE.replaceAll("DRIVE", first);
  const change = next => { kept.text = next; setText(next); };
  const start = async () => {
    setIssues("");
    try {
      const found = await call("POST", "scenarios", {text: value});
      again();
      location.hash = "#/scenarios/" + encodeURIComponent(found.id);
    } catch (problem) {
      setIssues(problem.message);
    }
  };
  const load = async ({target}) => {
    const [file] = target.files;
    // the same file can be chosen again once it was changed
    target.value = "";
    if (file) change(await file.text());
  };
  const all = list ? [...list.scenarios].reverse() : [];
  const shown = id || (all[0] && all[0].id);
  return html`<section aria-label="Scenarios">
    <div class="columns"><div>
      <div class="bar"><h2>Start a scenario</h2><span class="gap"></span><label class="button">From a file<input type="file" class="hidden" accept=".yml,.yaml" onChange=${load}/></label></div>
      <textarea rows="16" wrap="off" spellcheck="false" aria-label="The scenario's text" value=${value} onInput=${event => change(event.target.value)}></textarea>
      <div class="bar"><button type="button" class="main" disabled=${!farm.writes} onClick=${start}>Check and start</button></div>
      <${Problem} text=${issues || error}/></div>
      <div><h2>Runs</h2>${all.length ? html`<table><thead><tr><th scope="col">Scenario</th><th scope="col">Verdict</th><th scope="col" class="number">Time</th></tr></thead>
        <tbody>${all.map(one => html`<tr key=${one.id} class=${one.id === shown ? "selected" : ""}><th scope="row"><a href=${"#/scenarios/" + encodeURIComponent(one.id)}>${one.scenario}</a></th><td><${Verdict} found=${one}/></td><td class="number">${one.seconds ? time(one.seconds) : "–"}</td></tr>`)}</tbody></table>` : html`<p class="dim">None has run since the farm started.</p>`}</div></div>
    ${shown ? html`<${Report} key=${shown} id=${shown}/>` : null}
  </section>`;
}
