// One device: its identity, and its modules with their signals live; inputs of the controller can be written and forced.
import {call, get, path} from "../lib/api.js";
import {html, useMemo, useRef, useState} from "../lib/html.js";
import {farm as live, linkOf, takeWritten, valuesOf} from "../lib/live.js";
import {Act, Problem, Tabs, UsualFaults, act, useFarm, useLoaded} from "../lib/ui.js";
import {hex, plural, time} from "../lib/words.js";
import {DeviceState, deviceController} from "./devices.js";
import {Entries, Facts, Relation} from "./drive.js";
import {Trace} from "./trace.js";

export const TABS = [["signals", "Signals"], ["trace", "Trace"]];

/** Signals that are shown before a module is opened: more of them make a page slow. */
const SHOWN = 200;
/** Signals that a browser leaves out together while they are not in sight. */
const PART = 64;
const EVENTS = 20;
const WIDE = 24;

const signalsOf = device => path("devices", device, "signals");

/**
 * Write an input that the reader saw as `seen`: {tag, shown}, or force it, if `how` is so; null releases it, however it
 * is.  Who overrules it, if somebody does.  The tag is of all signals of the device: if it is not the present one, the
 * input itself may still be as it was seen.
 */
async function write(device, name, value, seen, how = "value") {
  const where = `${signalsOf(device)}?as=${how}`, of = found => found.signals.find(one => one.name === name);
  let done;
  try {
    done = await call("PATCH", where, {[name]: value}, value === null ? {} : {"If-Match": seen.tag});
  } catch (problem) {
    if (problem.status !== 412) throw problem;
    const now = of(await get(signalsOf(device)));
    if (!now || now.shown !== seen.shown) throw new Error(`${name} is ${now ? now.shown : "no signal"} meanwhile; nothing was written`);
    done = await call("PATCH", where, {[name]: value});
  }
  takeWritten(device, of(done));
  return (done.overruled || {})[name];
}

/** What became of the last write of a signal: [a sentence about it, how to write]; the sentence is empty if all is well. */
function useWrite(device, name) {
  const [told, setTold] = useState({text: "", kind: ""});
  const send = async (value, seen, how) => {
    try {
      const overruled = await write(device, name, value, seen, how);
      setTold({text: overruled ? `waits: a ${overruled} has the signal` : "", kind: "warn"});
      return true;
    } catch (problem) {
      setTold({text: problem.message, kind: "bad"});
      return false;
    }
  };
  return [told, send, () => setTold({text: "", kind: ""})];
}

const Told = ({id, told}) => told.text ? html`<p id=${id} class=${`${told.kind} small`} role="alert">${told.text}</p>` : null;

const seenNow = (device, state) => ({tag: valuesOf(device).tag, shown: state.shown});

/** Owners that overrule what is written. */
const OWNERS = {fault: "fault", force: "forced"};

/** Why a signal's value is not what was written or sent: `of` is the fault on it, if the page knows which. */
function Marks({state, of}) {
  return html`${state.good ? null : html` <span class="bad" title="the provider status of its data is BAD">bad</span>`}${OWNERS[state.owner] ? html` <span class="warn" title=${of ? `under the fault ${of.id}` : null}>${of ? of.kind : OWNERS[state.owner]}</span>` : null}`;
}

/** Forces an input to `value`, unless that is null, and releases a forced one; `text` is what the first of the buttons says. */
function Force({signal, state, value, text, force}) {
  if (!live.writes) return null;
  const button = (does, what, of) => html`<button type="button" aria-label=${`${what[0].toUpperCase()}${what.slice(1)} ${signal.label || signal.name}`} title=${does} onClick=${() => force(of)}>${what}</button>`;
  return html`<span class="force">${value === null ? null : button("this value has priority over written ones, until it is released", text, value)}${state.forced === null ? null : button("the signal gets its last written value again", "release", null)}</span>`;
}

/** One bit: a lamp, or a switch if it is an input; `place`: a short text before its name, which a `label` replaces where it is beside it. */
export function Bit({device, signal, state, of, place}) {
  const [told, send] = useWrite(device, signal.name);
  const {writes} = live, on = state.value === true, id = `why-${device}-${signal.name}`;
  const text = html`<i aria-hidden="true"></i>${place ? html`<span class="place dim small" aria-hidden="true">${place}</span>` : null}<span class=${signal.label ? "hidden" : "name"} title=${`${signal.name}, ${signal.place}`}>${signal.label || signal.name}</span><${Marks} state=${state} of=${of}/>`;
  return html`${signal.direction === "input"
    ? html`<button type="button" role="switch" class=${"bit" + (on ? " on" : "")} aria-checked=${String(on)} aria-describedby=${told.text ? id : null} disabled=${!writes} title=${writes ? null : "this token may read only"} onClick=${() => send(!on, seenNow(device, state))}>${text}<strong aria-hidden="true">${on ? 1 : 0}</strong></button>`
    : html`<span class=${"bit" + (on ? " on" : "")}>${text}<strong>${on ? 1 : 0}</strong></span>`}
    ${signal.direction === "input" ? html`<${Force} signal=${signal} state=${state} value=${state.forced === null ? on : !state.forced} text=${state.forced === null ? "force" : `force ${state.forced ? 0 : 1}`} force=${value => send(value, seenNow(device, state), "force")}/>` : null}
    <${Told} id=${id} told=${told}/>`;
}

/** A number, a text or octets: a field if it is an input.  What is typed is written by Enter, or left by Escape. */
export function Value({device, signal, state}) {
  const [edit, setEdit] = useState(null);
  const [told, send, forget] = useWrite(device, signal.name);
  const {writes} = live, id = `why-${device}-${signal.name}`, changed = edit && (!edit.seen || edit.text !== edit.seen.shown);
  const submit = async (event, how) => {
    event.preventDefault();
    if (!edit) return;
    const written = await send(edit.text, edit.seen || seenNow(device, valuesOf(device).states.get(signal.name) || state), how);
    // who has read what another wrote meanwhile may write over it: what the page shows then counts
    setEdit(written ? null : {...edit, seen: null});
  };
  const type = text => setEdit({text, seen: edit ? edit.seen : seenNow(device, state)});
  const leave = () => { setEdit(null); forget(); };
  return html`${signal.direction === "input"
      ? html`<form class="edit" onSubmit=${submit}><input class=${state.shown.length > WIDE ? "wide" : ""} aria-label=${signal.label || signal.name} value=${edit ? edit.text : state.shown} readonly=${!writes} title=${writes ? "" : "this token may read only"} spellcheck="false" autocomplete="off"
          aria-invalid=${told.kind === "bad" ? "true" : null} aria-describedby=${told.text ? id : null} onFocus=${event => writes && !edit && type(event.target.value)} onInput=${event => type(event.target.value)} onBlur=${() => { if (edit && !changed) leave(); }} onKeyDown=${event => { if (event.key === "Escape") leave(); }}/>
          ${changed ? html`<button type="submit">Write</button>` : null}
          <${Force} signal=${signal} state=${state} value=${changed || state.forced === null ? state.shown : null} text="force" force=${value => changed && value !== null ? submit(new Event("force"), "force") : send(value, seenNow(device, state), "force")}/></form>`
      : html`<output aria-label=${signal.name}>${state.shown || "–"}</output>`}
      <${Told} id=${id} told=${told}/>`;
}

const BitItem = ({signal, ...more}) => html`<li><${Bit} signal=${signal} place=${signal.place.split(".").slice(2).join(".")} ...${more}/></li>`;

const ValueRow = ({signal, state, of, device}) => html`<tr><th scope="row" class="text">${signal.name}</th><td class="dim">${signal.place}</td><td class="dim">${signal.type}</td>
    <td class="text"><${Value} device=${device} signal=${signal} state=${state}/></td>
    <td>${signal.unit}</td><td>${state.good ? html`<span class="dim">good</span>` : null}<${Marks} state=${state} of=${of}/></td></tr>`;

/** What `make` gave before, if it was of the same `key`: what has not changed is not compared again. */
function kept(known, id, key, make) {
  const before = known.get(id);
  if (before && before.key.length === key.length && before.key.every((one, i) => one === key[i])) return before.node;
  const node = make();
  known.set(id, {key, node});
  return node;
}

const sliced = list => Array.from({length: Math.ceil(list.length / PART)}, (_, i) => list.slice(i * PART, (i + 1) * PART));

function Submodule({device, submodule, signals, states, faults}) {
  const known = useRef(new Map()).current;
  const draw = (Kind, signal) => {
    const state = states.get(signal.name) || signal, of = faults.get(signal.name);
    return kept(known, signal.name, [signal, state, of && of.id, live.writes], () => html`<${Kind} key=${signal.name} device=${device} signal=${signal} state=${state} of=${of}/>`);
  };
  const parts = (Kind, what, some, make) => sliced(some).map((part, place, {length}) => {
    const nodes = part.map(one => draw(Kind, one)), label = `${what} of subslot ${submodule.subslot}${length > 1 ? `, part ${place + 1}` : ""}`;
    return kept(known, `${what} ${place}`, nodes, () => html`<div class="part" key=${label}>${make(nodes, label)}</div>`);
  });
  const bits = direction => parts(BitItem, direction + "s", signals.filter(one => one.type === "bool" && one.direction === direction), (nodes, label) => html`<ul class="bits" aria-label=${label}>${nodes}</ul>`);
  const octets = [submodule.input_octets ? plural(submodule.input_octets, "octet") + " in" : "", submodule.output_octets ? plural(submodule.output_octets, "octet") + " out" : ""].filter(Boolean).join(", ");
  return html`<div role="group" aria-label=${`Subslot ${submodule.subslot}, ${submodule.name}`}><h3>Subslot ${submodule.subslot} · ${submodule.name} <span class="dim">ident ${hex(submodule.ident)}${octets ? ` · ${octets}` : ""}</span></h3>
    ${submodule.safety ? html`<p class="warn">PROFIsafe: the device does not run the safety protocol, so an F-CPU passivates this submodule. Its octets are exchanged like any others.</p>` : null}
    ${bits("input")}${bits("output")}
    ${parts(ValueRow, "values", signals.filter(one => one.type !== "bool"), (nodes, label) => html`<table class="values" aria-label=${label}><thead><tr><th scope="col">Signal</th><th scope="col">Place</th><th scope="col">Type</th><th scope="col">Value</th><th scope="col">Unit</th><th scope="col">Status</th></tr></thead>
      <tbody>${nodes}</tbody></table>`)}</div>`;
}

const countOf = (signals, direction) => plural(signals.filter(one => one.direction === direction).length, direction);

/** One module; what is in it is drawn while it is open. */
function Module({module, signals, open, toggle, ...more}) {
  const of = submodule => signals.filter(one => one.at[1] === submodule.subslot);
  return html`<details class="panel module" open=${open} onToggle=${event => toggle(module.slot, event.currentTarget.open)}>
    <summary><strong>Slot ${module.slot} · ${module.name}</strong> <span class="dim">ident ${hex(module.ident)}${signals.length ? ` · ${countOf(signals, "input")}, ${countOf(signals, "output")}` : ""}</span>${module.submodules.some(one => one.safety) ? html` <span class="warn">PROFIsafe</span>` : null}</summary>
    ${open ? module.submodules.map(submodule => html`<${Submodule} key=${submodule.subslot} submodule=${submodule} signals=${of(submodule)} ...${more}/>`) : null}</details>`;
}

const title = key => (key[0].toUpperCase() + key.slice(1)).replaceAll("_", " ").replace(/\bid\b/, "ID");

/** The modules whose signals are shown at first: those that have some, up to a number. */
function openAtFirst(modules) {
  const found = new Set();
  let shown = 0;
  for (const {module, signals} of modules) if (signals.length && (shown += signals.length) <= SHOWN) found.add(module.slot);
  return found;
}

export function Device({name, tab}) {
  const farm = useFarm();
  const row = farm.deviceByName.get(name);
  const [view, error] = useLoaded(() => row ? get(path("devices", name)) : Promise.resolve(null), [name, row !== undefined, farm.begun, row && row.connected]);
  const [active, problem, again] = useLoaded(() => get("faults"), [], 1);
  const [text, setText] = useState("");
  const [opened, setOpened] = useState({});
  const signals = useMemo(() => view ? view.signals.map(one => ({...one, at: one.place.split(".").map(Number)})) : [], [view]);
  const modules = useMemo(() => {
    const wanted = text.toLowerCase();
    const found = signals.filter(one => `${one.name} ${one.unit} ${one.place}`.toLowerCase().includes(wanted));
    return view ? view.modules.map(module => ({module, signals: found.filter(one => one.at[0] === module.slot)})).filter(one => !text || one.signals.length) : [];
  }, [signals, text]);
  const first = useMemo(() => openAtFirst(modules), [modules]);
  if (!row) return farm.devicesKnown ? html`<section aria-label="Unknown device"><h2>There is no device ${name} in farm ${farm.name}</h2><p><a href="#/">Overview</a></p></section>` : html`<p class="dim">Loading…</p>`;
  const mine = active ? active.faults.filter(one => name in one.drives && one.drives[name].state !== "ended") : [];
  const faults = new Map(mine.filter(one => one.drives[name].state === "active" && (one.spec.params || {}).signal).map(one => [one.spec.params.signal, one]));
  const {states} = valuesOf(name);
  const forced = signals.filter(one => (states.get(one.name) || one).forced !== null).length;
  const toggle = (slot, open) => { if ((opened[slot] ?? first.has(slot)) !== open) setOpened({...opened, [slot]: open}); };
  const all = open => setOpened(Object.fromEntries(modules.map(one => [one.module.slot, open])));
  const entries = farm.log.filter(one => one.drive === name).slice(-EVENTS);
  const {controller, ...connection} = row.connection;
  return html`<section aria-label=${"Device " + name}>
    <div class="bar"><h2>${name}</h2><${DeviceState} device=${row}/><span class="dim">${row.description}</span>
      <span class=${row.connected ? "good" : "dim"}>${connection.state}${controller ? ` with ${deviceController(row)}, ${time(connection.cycle_seconds)}` : ""}</span></div>
    <div class="bar">
      ${mine.map(one => html`<span key=${one.id} class="warn" title=${one.id}>${one.kind}${(one.spec.params || {}).signal ? ` on ${one.spec.params.signal}` : ""}${one.drives[name].state === "active" ? "" : ` (${one.drives[name].state})`} <${Act} title="end this fault" label=${`Clear ${one.kind}, ${one.id}`} onClick=${async () => { await act(() => call("DELETE", path("faults", one.id)), `${one.id} cleared`); again(); }}>clear<//></span>`)}
      ${forced ? html`<${Act} title="the signals get their last written values again" onClick=${() => act(() => call("PATCH", signalsOf(name) + "?as=force", {"*": null}), "no signal is forced")}>release ${plural(forced, "force")}<//>` : null}
      <span class="gap"></span>
      <div class="bar" role="group" aria-label="Usual faults">
      <${UsualFaults} on=${name} kinds=${["timeout", "link-down"]} injected=${again}/>
      <a class="button" href=${`#/faults?on=${encodeURIComponent(name)}&kind=signal-stuck`}>signal fault…</a>
      <a class="button" href=${"#/faults?on=" + encodeURIComponent(name)}>other fault…</a></div>
    </div>
    <${Problem} text=${error || problem}/>
    <${Tabs} label="Views of the device" tabs=${TABS} chosen=${tab} link=${which => `${linkOf(name)}/${which}`}/>
    ${tab === "trace" ? html`<${Trace} key=${name} name=${name}/>` : view ? html`<details class="panel"><summary><strong>Identity</strong> <span class="dim">${[view.identity.vendor, view.identity.order_number, view.access_point, row.ip].filter(Boolean).join(" · ")}</span></summary>
      <${Facts} pairs=${[["Access point", view.access_point], ...Object.entries(view.identity).map(([key, value]) => [title(key), typeof value === "number" ? `${value} (${hex(value)})` : value]), ["Station name", row.station_name], ["Bus", row.bus],
        ["IP address", row.ip], ["Station address", row.station_address], ["MAC address", row.mac], ["Controller", controller && [controller.name, controller.ip, controller.mac].filter(Boolean).join(", ")],
        ["Cycle", controller && time(connection.cycle_seconds)], ["Watchdog", controller && time(connection.watchdog_seconds)]]}/>
      ${(view.details.connections || []).map((one, i) => html`<h3 key=${i}>What was agreed</h3><${Relation} key=${"agreed" + i} one=${one} station="device"/>`)}</details>
    <div class="bar"><h2>Modules</h2>
      <input type="search" placeholder="name, unit or place of a signal" aria-label="Find a signal by name, unit or place" value=${text} onInput=${event => { setText(event.target.value); setOpened({}); }}/>
      <span class="dim" role="status">${text ? `${modules.reduce((sum, one) => sum + one.signals.length, 0)} of ${plural(signals.length, "signal")}` : `${countOf(signals, "input")}, ${countOf(signals, "output")}`}</span>
      <span class="gap"></span><button type="button" onClick=${() => all(true)}>Open all</button><button type="button" onClick=${() => all(false)}>Close all</button></div>
    ${modules.map(one => html`<${Module} key=${one.module.slot} ...${one} open=${opened[one.module.slot] ?? first.has(one.module.slot)} toggle=${toggle} device=${name} states=${states} faults=${faults}/>`)}
    ${text && !modules.length ? html`<p class="dim">No signal matches.</p>` : null}
    ${entries.length ? html`<h2>Events since this page was opened</h2><${Entries} entries=${entries} drive=${false}/>` : null}` : null}
  </section>`;
}
