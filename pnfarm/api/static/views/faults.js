// Faults: a form made from the catalogue, whom it would hit, what is in force with its evidence.
import {call, get, path} from "../lib/api.js";
import {html, useEffect, useMemo, useState} from "../lib/html.js";
import {farm as live, linkOf} from "../lib/live.js";
import {Act, Problem, act, inject, useFarm, useLoaded} from "../lib/ui.js";
import {plural} from "../lib/words.js";

/** A value as the API takes it, by the parameter's type; undefined where the field is empty. */
function valueOf(type, text) {
  if (text === "" || text === undefined) return undefined;
  if (type === "yes or no") return text === "yes";
  if (["number", "whole number"].includes(type) && text.trim() !== "" && Number.isFinite(Number(text))) return Number(text);
  if (type === "fault" && /^\d+$/.test(text)) return Number(text);
  return text;
}

const COMMON = {
  for: ["for", "how long, such as 2s; empty: until cleared", "7"],
  count: ["count", "how many occurrences", "5"],
  cycles: ["cycles", "for how many cycles", "5"],
  after: ["after", "seconds before it begins, such as 500ms", "7"],
  after_cycles: ["after cycles", "healthy cycles before it begins", "5"],
  probability: ["probability", "of each occurrence, 0 to 1", "5"],
  seed: ["seed", "of the random choice", "6"],
  rate: ["rate", "how often it begins, such as 6/min", "7"],
  ttl: ["ttl", "ends unless renewed in this time", "7"],
  when: ["when", "a condition of the drive, such as velocity > 100", "18"],
};

function specOf(kind, form) {
  const params = {};
  for (const [key, parameter] of Object.entries(kind.params)) {
    const value = valueOf(parameter.type, form.params[key]);
    if (value !== undefined) params[key] = value;
  }
  const spec = {kind: kind.kind, on: form.on.split(",").map(one => one.trim()).filter(Boolean)};
  if (Object.keys(params).length) spec.params = params;
  for (const key of Object.keys(COMMON)) {
    const text = (form.common[key] || "").trim();
    if (text && kind.takes.includes(key)) spec[key] = ["count", "cycles", "after_cycles", "probability", "seed"].includes(key) && Number.isFinite(Number(text)) ? Number(text) : text;
  }
  if (form.direction) spec.direction = form.direction;
  return spec;
}

/** Text whose words between backticks are shown as code. */
const coded = text => text.split("`").map((part, i) => i % 2 ? html`<code>${part}</code>` : part);

function Parameter({name, parameter, value, suggested, onInput}) {
  const id = "param-" + name;
  const hint = [parameter.doc, parameter.allowed && !parameter.words.length && `Allowed: ${parameter.allowed}.`].filter(Boolean).join(" ");
  const words = parameter.type === "yes or no" ? ["yes", "no"] : suggested.length ? suggested : parameter.words;
  const shown = parameter.default === null || parameter.default === "" ? "" : typeof parameter.default === "boolean" ? (parameter.default ? "yes" : "no") : String(parameter.default);
  const chosen = ["yes or no", "word"].includes(parameter.type);
  return html`<div class="field"><label for=${id}>${name.replaceAll("_", " ")}${parameter.required ? html` <span class="bad" title="required">*</span>` : null}</label>
    ${chosen
      ? html`<select id=${id} value=${value ?? ""} onChange=${event => onInput(event.target.value)}>
          <option value="">${shown ? `as usual (${shown})` : "choose"}</option>${words.map(word => html`<option key=${word} value=${word} selected=${word === value}>${word}</option>`)}</select>`
      : html`<input id=${id} list=${"words-" + name} value=${value ?? ""} placeholder=${shown} aria-describedby=${id + "-hint"} onInput=${event => onInput(event.target.value)}/>
          <datalist id=${"words-" + name}>${words.map(word => html`<option key=${word} value=${word}/>`)}</datalist>`}
    <span class="dim">${parameter.unit}</span><p id=${id + "-hint"} class="hint dim">${coded(hint)}</p></div>`;
}

function Reach({spec}) {
  const [text, setText] = useState({good: "", bad: ""});
  const key = JSON.stringify(spec);
  useEffect(() => {
    let alive = true;
    const tell = found => { if (alive) setText(found); };
    const timer = setTimeout(async () => {
      if (!spec.on.length) return tell({good: "", bad: "Name a drive, or all."});
      try {
        const reach = await call("POST", "faults?dry_run=true", spec);
        const hit = reach.drives, reasons = byReason(reach.cannot);
        const others = reach.left_out.map(one => one.drive || one);
        tell({
          good: `Would hit ${plural(hit.length, wordFor(hit))}: ${hit.slice(0, 12).join(", ")}${hit.length > 12 ? " …" : ""}${others.length ? `; leaves out ${others.slice(0, 12).join(", ")}` : ""}`,
          bad: reasons.slice(0, 4).join("; ") + (reasons.length > 4 ? `; and ${reasons.length - 4} more cannot` : ""),
        });
      } catch (problem) {
        tell({good: "", bad: problem.message});
      }
    }, 300);
    return () => { alive = false; clearTimeout(timer); };
  }, [key]);
  return html`<p role="status"><span class="good">${text.good}</span> <span class="bad">${text.bad}</span></p>`;
}

const wordFor = names => names.some(name => live.deviceByName.has(name)) ? "station" : "drive";

/** Drives that cannot have a fault, by the reason without their names: `8 drives (a, b, c ...): reason`. */
function byReason(cannot) {
  const found = new Map();
  for (const {drive, why} of cannot) {
    const reason = why.startsWith(`${drive} `) ? why.slice(drive.length + 1) : why.replaceAll(drive, "the drive");
    found.set(reason, [...(found.get(reason) || []), drive]);
  }
  return [...found].map(([reason, drives]) => drives.length === 1
    ? `${drives[0]} ${reason}` : `${plural(drives.length, wordFor(drives))} (${drives.slice(0, 3).join(", ")}${drives.length > 3 ? " …" : ""}): ${reason}`);
}

const blank = (on, kind = "") => ({kind, on, params: {}, common: {}, direction: ""});

function Form({kinds, on, chosen, again, names}) {
  const [form, setForm] = useState(blank(on || "all", chosen));
  const device = live.deviceByName.has(form.on) ? form.on : "";
  const [view] = useLoaded(() => device ? get(path("devices", device)) : Promise.resolve(null), [device]);
  const inputs = view ? view.signals.filter(one => one.direction === "input").map(one => one.name) : [];
  const [find, setFind] = useState("");
  const families = useMemo(() => {
    const found = new Map();
    for (const kind of kinds) {
      if (find && ![kind.kind, kind.doc, kind.family].some(text => text.toLowerCase().includes(find.toLowerCase()))) continue;
      if (!found.has(kind.family)) found.set(kind.family, []);
      found.get(kind.family).push(kind);
    }
    return [...found];
  }, [kinds, find]);
  const kind = kinds.find(one => one.kind === form.kind) || null;
  const spec = kind ? specOf(kind, form) : null;
  const submit = async event => {
    event.preventDefault();
    if (await inject(spec)) again();
  };
  return html`<div class="columns faultform">
    <div class="kinds"><input type="search" placeholder="find a kind" aria-label="Find a kind of fault" value=${find} onInput=${event => setFind(event.target.value)}/>
      <div class="kindlist" tabindex="0" role="region" aria-label="Kinds of faults">${families.map(([family, members]) => html`<div key=${family}><h3 class="family">${family}</h3>
        ${members.map(one => html`<button key=${one.kind} type="button" class="kind" aria-pressed=${one.kind === form.kind} onClick=${() => setForm(blank(form.on, one.kind))}>${one.kind}</button>`)}</div>`)}</div></div>
    <div>${kind ? html`<form class="panel" onSubmit=${submit}>
      <h3>${kind.kind}</h3><p>${coded(kind.doc)}</p>
      <div class="field"><label for="on">on</label><input id="on" list="drive-names" value=${form.on} size="36" onInput=${event => setForm({...form, on: event.target.value})}/>
        <datalist id="drive-names">${names.slice(0, 200).map(name => html`<option key=${name} value=${name}/>`)}</datalist><p class="hint dim">names of drives and devices with * and ?, model:NAME, or all; several with commas</p></div>
      ${Object.entries(kind.params).map(([name, parameter]) => html`<${Parameter} key=${kind.kind + name} name=${name} parameter=${parameter} value=${form.params[name]} suggested=${name === "signal" ? inputs : []} onInput=${value => setForm({...form, params: {...form.params, [name]: value}})}/>`)}
      ${kind.directions.length ? html`<div class="field"><label for="direction">direction</label><select id="direction" value=${form.direction} onChange=${event => setForm({...form, direction: event.target.value})}><option value="">${kind.directions[0]} (usual)</option>
        ${kind.directions.slice(1).map(one => html`<option key=${one} value=${one} selected=${one === form.direction}>${one}</option>`)}</select><p class="hint dim">seen from the drive</p></div>` : null}
      <fieldset><legend>When and how long</legend><div class="checks">${Object.entries(COMMON).filter(([key]) => kind.takes.includes(key)).map(([key, [label, hint, size]]) => html`<label key=${key} title=${hint}>${label} <input size=${size} value=${form.common[key] || ""} placeholder=${hint.split(",")[0].length < 14 ? hint.split(",")[0] : ""} onInput=${event => setForm({...form, common: {...form.common, [key]: event.target.value}})}/></label>`)}</div></fieldset>
      <div class="bar send"><${SubmitButton} kind=${kind}/><${Reach} spec=${spec}/></div>
      <dl class="facts"><div><dt>On the wire</dt><dd>${kind.wire}</dd></div><div><dt>Controllers report</dt><dd>${kind.reports}</dd></div>
        ${Object.entries(kind.buses).map(([bus, one]) => html`<div key=${bus}><dt>${bus}</dt><dd>${one.refused || [one.wire, one.reports].filter(Boolean).join(" ") || "as above"}</dd></div>`)}</dl>
    </form>` : html`<p class="dim">Choose a kind of fault: the form then shows what is on the wire and what controllers report.</p>`}</div></div>`;
}

function SubmitButton({kind}) {
  const farm = useFarm();
  return html`<button type="submit" class="main" disabled=${!farm.writes} title=${farm.writes ? "" : "this token may read only"}>Inject ${kind.kind}</button>`;
}

function Active({fault, again}) {
  const {evidence} = fault;
  const drives = Object.entries(fault.drives);
  const stopped = async () => { await act(() => call("DELETE", path("faults", fault.id)), done => `${done.id} cleared: ${plural(done.evidence.activations, "activation")}`); again(); };
  return html`<tr><th scope="row">${fault.id}</th><td>${fault.kind}</td>
    <td class="text">${drives.slice(0, 6).map(([drive]) => html`<a key=${drive} href=${linkOf(drive)}>${drive}</a> `)}${drives.length > 6 ? `and ${drives.length - 6} more` : ""}</td>
    <td class=${fault.state === "active" ? "bad" : "warn"}>${fault.state}${drives[0] && drives[0][1].waits_for ? html` <span class="dim">for ${drives[0][1].waits_for}</span>` : null}</td>
    <td class="number">${evidence.activations}${evidence.checks > evidence.activations ? html` <span class="dim">of ${evidence.checks}</span>` : null}</td>
    <td title=${evidence.reason} class=${evidence.confirmation === "confirmed" ? "good" : evidence.confirmation === "contradicted" ? "bad" : "dim"}>${evidence.confirmation}</td>
    <td><${Act} title="end this fault" label=${"Clear " + fault.id} onClick=${stopped}>Clear<//></td></tr>`;
}

export function Faults({on, kind}) {
  const farm = useFarm();
  const [kinds, error] = useLoaded(() => get("fault-kinds"), [farm.begun]);
  const [active, problem, again] = useLoaded(() => get("faults"), [], 1);
  const reset = async () => { await act(() => call("POST", "reset"), done => `${plural(done.cleared.length, "fault")} cleared`); again(); };
  const names = [...farm.drives.filter(drive => drive.known), ...farm.devices].map(one => one.name);
  return html`<section aria-label="Faults">
    <div class="bar"><h2>In force</h2><span class="gap"></span><${Act} title="end every fault" disabled=${!active || !active.faults.length} onClick=${reset}>Clear all faults<//></div>
    <${Problem} text=${problem || error}/>
    ${active && active.faults.length ? html`<div class="scroll" tabindex="0" role="region" aria-label="Faults in force"><table><thead><tr><th scope="col">Id</th><th scope="col">Kind</th><th scope="col">Drives</th><th scope="col">State</th><th scope="col" class="number">Activations</th><th scope="col">On the wire</th><td></td></tr></thead>
      <tbody>${active.faults.map(fault => html`<${Active} key=${fault.id} fault=${fault} again=${again}/>`)}</tbody></table></div>` : active ? html`<p class="dim">No fault is pending or active.</p>` : null}
    <h2>Inject</h2>
    ${kinds ? html`<${Form} key=${on + " " + kind} kinds=${kinds.kinds} on=${on} chosen=${kind} again=${again} names=${names}/>` : null}
  </section>`;
}
