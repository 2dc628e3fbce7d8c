// One drive: its motor live, its words as a logic analyser, trace, parameters, faults, connection, modules.
import {call, get, path} from "../lib/api.js";
import {Histogram, LogicRows, Plot} from "../lib/charts.js";
import {html, useEffect, useMemo, useState} from "../lib/html.js";
import {linkOf} from "../lib/live.js";
import {Act, FaultText, Problem, State, Tabs, UsualFaults, act, say, useFarm, useLoaded} from "../lib/ui.js";
import {clock, controllerOf, number, plural, time} from "../lib/words.js";
import {Trace} from "./trace.js";

export const TABS = [["live", "Live"], ["trace", "Trace"], ["parameters", "Parameters"], ["events", "Faults and events"], ["connection", "Connection"], ["modules", "Modules"]];
const PLOTS = [
  [["setpoint", "rpm"], ["velocity", "rpm"]],
  [["position", "rev"]],
  [["following_error", "rev"]],
  [["current", "A"], ["torque", "Nm"]],
];
const WORDS = {stw1: "STW1, control word 1", zsw1: "ZSW1, status word 1", control: "Control byte", status_1: "Status byte 1", status_2: "Status byte 2"};
const SECONDS = [5, 10, 30];

/** Names of the bits of each word, from the drive's list of signals. */
function bitsOf(signals) {
  const found = {};
  for (const {signal} of signals) {
    const [word, bit] = signal.split(".");
    if (bit !== undefined && word in WORDS) (found[word] ||= []).push({bit: found[word] ? found[word].length : 0, name: bit});
  }
  return found;
}

function Live({farm, name}) {
  const [seconds, setSeconds] = useState(10);
  const [paused, setPaused] = useState(null);
  const [zoom, setZoom] = useState(null);
  const [at, setAt] = useState(null);
  const [list, error] = useLoaded(() => get("traces/signals/" + path(name)), [name, farm.begun]);
  const bits = useMemo(() => list ? bitsOf(list.signals) : {}, [list]);
  const signals = paused || farm.signals;
  if (!list && error) return html`<${Problem} text=${error}/>`;
  if (farm.signalsFull) return html`<p class="warn">The farm cannot show one more drive live: other pages show drives, or traces use its memory.</p>`;
  if (!signals || !signals.seconds.length) return html`<p class="dim">Waiting for the first samples…</p>`;
  // times are before now
  const last = signals.seconds[signals.seconds.length - 1], range = zoom || [-seconds, 0];
  const times = signals.seconds.map(one => one - last);
  // a picture that is zoomed stands still
  const zoomTo = wanted => { setZoom(wanted); if (wanted && !paused) setPaused({...farm.signals}); };
  const goOn = () => { setPaused(paused ? null : {...farm.signals}); setZoom(null); };
  return html`<div>
    <div class="bar">
      <div role="group" aria-label="Time shown">${SECONDS.map(one => html`<button key=${one} type="button" aria-pressed=${one === seconds} onClick=${() => { setSeconds(one); setZoom(null); }}>${one} s</button>`)}</div>
      <button type="button" aria-pressed=${paused !== null} onClick=${goOn}>${paused ? "Continue" : "Pause"}</button>
      <span class="dim">100 samples a second, each from one step of the engine. Drag over a plot to zoom all, double-click to go back.</span>
    </div>
    ${PLOTS.map(plot => {
      const present = plot.filter(([signal]) => signal in signals.values);
      if (!present.length) return null;
      return html`<${Plot} key=${present.map(([signal]) => signal).join()} height=${124} cursor="live" range=${range} onZoom=${zoomTo} onCursor=${plot === PLOTS[0] ? setAt : null}
        label=${`${present.map(([signal]) => signal).join(" and ")} of the last ${seconds} s`}
        series=${present.map(([signal, unit]) => ({label: signal, unit}))} data=${[times, ...present.map(([signal]) => signals.values[signal])]}/>`;
    })}
    ${Object.keys(WORDS).filter(word => word in signals.values && bits[word]).map(word => html`<div key=${word}>
      <h3>${WORDS[word]}</h3>
      <${LogicRows} times=${times} values=${signals.values[word]} bits=${bits[word]} range=${range} at=${at} label=${`bits of ${word} over the last ${seconds} s`}/></div>`)}
  </div>`;
}

function Parameters({name, farm}) {
  const [text, setText] = useState("");
  const [asked, setAsked] = useState("");
  const [begin, setBegin] = useState(0);
  const [edited, setEdited] = useState(null);
  const most = 100;
  useEffect(() => {
    const timer = setTimeout(() => { setAsked(text); setBegin(0); }, 250);
    return () => clearTimeout(timer);
  }, [text]);
  const [list, error, again] = useLoaded(() => get(`${path("drives", name, "params")}?text=${encodeURIComponent(asked)}&from=${begin}&most=${most}`), [name, asked, begin], 2);
  const write = async event => {
    event.preventDefault();
    const {pnu} = edited, {value} = event.target.elements[0];
    const wanted = Number(value);
    if (!/^\s*[+-]?(0x[0-9a-f]+|\d+)\s*$/i.test(value) || !Number.isSafeInteger(wanted)) return say(`${value || "an empty field"} is not a whole number, decimal or 0x`, "bad");
    if (await act(() => call("PUT", path("drives", name, "params", String(pnu)), {value: wanted}), found => `${found.name || found.pnu} = ${found.value}`)) {
      setEdited(null);
      again();
    }
  };
  return html`<div>
    <div class="bar"><input type="search" placeholder="number, name or unit" aria-label="Find a parameter by number, name or unit" value=${text} onInput=${event => setText(event.target.value)}/>
      ${list ? html`<span class="dim" role="status">${plural(list.count, "parameter")}</span>` : null}
      <span class="gap"></span>
      ${list && list.count > most ? html`<button type="button" disabled=${!begin} onClick=${() => setBegin(Math.max(0, begin - most))}>Back</button>
        <span>${begin + 1} to ${Math.min(list.count, begin + most)}</span>
        <button type="button" disabled=${begin + most >= list.count} onClick=${() => setBegin(begin + most)}>On</button>` : null}</div>
    <${Problem} text=${error}/>
    <div class="scroll" tabindex="0" role="region" aria-label="Parameters"><table><thead><tr><th scope="col">Number</th><th scope="col">Name</th><th scope="col" class="number">Raw value</th><th scope="col">Physical</th><th scope="col" class="number">Min</th><th scope="col" class="number">Max</th><th scope="col" class="number">Default</th><th scope="col">Source and note</th></tr></thead>
      <tbody>${list ? list.parameters.map(one => html`<tr key=${one.pnu}>
        <th scope="row">${one.number}${one.number === String(one.pnu) ? "" : html` <span class="dim">${one.pnu}</span>`}</th><td>${one.name}${one.elements ? html` <span class="dim">[${one.elements}]</span>` : null}</td>
        <td class="number">${edited && edited.pnu === one.pnu
          ? html`<form onSubmit=${write} class="edit"><input aria-label=${"new value of " + one.name} value=${edited.value} ref=${element => element && !edited.focused && (edited.focused = true, element.focus(), element.select())}
              onInput=${event => setEdited({...edited, value: event.target.value})} onKeyDown=${event => event.key === "Escape" && setEdited(null)}/>
              <button type="submit">Write</button> <button type="button" onClick=${() => setEdited(null)}>Leave</button></form>`
          : one.writable && !one.elements
            ? html`<button type="button" class="value" disabled=${!farm.writes} aria-label=${`change ${one.name}, now ${one.value ?? "not readable"}`} onClick=${() => setEdited({pnu: one.pnu, value: String(one.value ?? "")})}>${one.value ?? "write…"}</button>`
            : one.value ?? "–"}</td>
        <td class=${one.changed ? "warn" : ""} title=${one.changed ? "differs from the default" : ""}>${one.value === null || !one.unit ? "" : `${+(one.value * one.factor).toPrecision(7)} ${one.unit}`}</td>
        <td class="number dim">${one.minimum}</td><td class="number dim">${one.maximum}</td><td class="number dim">${one.default}</td>
        <td class="text small dim">${[one.source, one.note, one.after_power_on ? "takes effect at the next power-on" : ""].filter(Boolean).join("; ")}</td></tr>`) : null}</tbody></table></div>
  </div>`;
}

const HIDDEN = new Set(["sequence", "time", "farm_seconds", "drive", "event"]);

function Entry({entry, drive}) {
  const details = Object.entries(entry).filter(([key, value]) => !HIDDEN.has(key) && value !== null && value !== "");
  return html`<tr><td class="dim">${clock(entry.time)}</td><td class="number dim">${entry.farm_seconds.toFixed(3)}</td>
    ${drive ? html`<td>${entry.drive ? html`<a href=${linkOf(entry.drive)}>${entry.drive}</a>` : ""}</td>` : null}
    <td>${entry.event}</td><td class="text small dim">${details.map(([key, value]) => `${key} ${typeof value === "object" ? JSON.stringify(value) : value}`).join(", ")}</td></tr>`;
}

/** Entries of the log, the newest first; `drive`: with the station of each. */
export function Entries({entries, drive = true}) {
  return html`<div class="scroll" tabindex="0" role="region" aria-label="Events"><table><thead><tr><th scope="col">Time</th><th scope="col" class="number">Farm s</th>${drive ? html`<th scope="col">Drive</th>` : null}<th scope="col">Event</th><th scope="col">Details</th></tr></thead>
    <tbody>${[...entries].reverse().map(entry => html`<${Entry} key=${`${entry.sequence} ${entry.time}`} entry=${entry} drive=${drive}/>`)}</tbody></table></div>`;
}

function Events({name, farm}) {
  const newest = farm.log.length ? farm.log[farm.log.length - 1].sequence : 0;
  const [found, error] = useLoaded(() => get(path("drives", name)), [name, Math.floor(newest / 4)], 3);
  if (!found) return html`<${Problem} text=${error}/>`;
  const counts = Object.entries(found.fault_counts);
  return html`<div>
    <${Problem} text=${error}/>
    <h3>Fault buffer</h3>
    ${found.fault_memory.some(one => one.length) ? html`<table class="fit"><thead><tr><th scope="col">Situation</th><th scope="col">Faults</th></tr></thead><tbody>${found.fault_memory.map((situation, place) => situation.length ? html`<tr key=${place}>
      <td>${place === 0 ? "active" : place}</td><td>${situation.map(fault => html`<span class=${found.faults.some(one => one.number === fault.number) && place === 0 ? "bad" : ""}>${fault.label} ${fault.name} </span>`)}</td></tr>` : null)}</tbody></table>` : html`<p class="dim">The fault buffer is empty.</p>`}
    ${counts.length ? html`<p>Since the farm started: ${counts.map(([code, count]) => `${code} ${count === 1 ? "once" : count + " times"}`).join(", ")}.</p>` : null}
    <h3>Events</h3>
    <${Entries} entries=${found.events} drive=${false}/>
  </div>`;
}

export function Facts({pairs}) {
  return html`<dl class="facts">${pairs.filter(([, value]) => value !== undefined && value !== null && value !== "").map(([key, value]) => html`<div key=${key}><dt>${key}</dt><dd>${value}</dd></div>`)}</dl>`;
}

/** What a bus has besides, key by key; lists of objects are shown as tables. */
const plainFacts = found => Object.entries(found).filter(([, value]) => !Array.isArray(value) || typeof value[0] !== "object").map(([key, value]) =>
  [sentence(key.replace(/_seconds$/, "")), value === null ? "" : Array.isArray(value) ? value.join(", ") : key.endsWith("_seconds") ? time(value) : value === true ? "yes" : value === false ? "no" : String(value)]);
const sentence = key => (key[0].toUpperCase() + key.slice(1).replaceAll("_", " ")).replace(/\b(uuid|rpi|ip|ar)\b/gi, word => word.toUpperCase());
const CHANNEL = {send_clock_factor: "Send clock factor", reduction_ratio: "Reduction ratio", phase: "Phase"};

/** Identifications of a connection, and what is where in its frames. */
export function Relation({one, station = "drive"}) {
  const {channels, ...facts} = one;
  const more = Object.keys(CHANNEL).filter(key => channels.some(channel => key in channel));
  return html`<div><${Facts} pairs=${plainFacts(facts)}/>
    ${channels.length ? html`<div class="scroll" tabindex="0" role="region" aria-label="Cyclic frames"><table><thead><tr><th scope="col">Frames</th><th scope="col">Identification</th><th scope="col" class="number">Octets</th><th scope="col" class="number">Cycle</th>
      ${more.map(key => html`<th key=${key} scope="col" class="number">${CHANNEL[key]}</th>`)}<th scope="col" class="number">Watchdog</th><th scope="col">Offset: what is there</th></tr></thead>
      <tbody>${channels.map(channel => html`<tr key=${channel.id + channel.direction}><th scope="row">${channel.direction} by the ${station}</th><td>${channel.id}</td><td class="number">${channel.octets}</td><td class="number">${time(channel.cycle_seconds)}</td>
        ${more.map(key => html`<td key=${key} class="number">${channel[key]}</td>`)}<td class="number">${time(channel.timeout_seconds)}</td>
        <td class="text small">${channel.places.map((place, i) => html`<div key=${i}><span class="offset">${place.offset}</span> ${place.what}${place.octets > 1 ? `, ${place.octets} octets` : ""} <span class="dim">${place.of}</span></div>`)}</td></tr>`)}</tbody></table></div>` : null}</div>`;
}

const joined = counts => Object.entries(counts).filter(([, count]) => count).map(([key, count]) => `${key} ${count}`).join(", ") || "none";

function Connection({name, drive}) {
  const [seen, error] = useLoaded(() => get(path("drives", name, "controller")), [name], 1);
  return html`<div>
    <${Problem} text=${error}/>
    ${drive ? html`<${Facts} pairs=${[
      ["State", drive.ar_state], ["Controller", drive.controller ? [drive.controller.name, drive.controller.ip, drive.controller.mac].filter(Boolean).join(", ") : "none"],
      ["Cycle", time(drive.cycle_seconds)], ["Watchdog", time(drive.watchdog_seconds)], ["Connected for", time(drive.connected_seconds)], ["Telegram", drive.telegram || null],
      ["Station name", drive.station_name], ["IP address", drive.ip], ["Gateway", drive.gateway], ["Station address", drive.station_address], ["MAC address", drive.mac],
      ["Address conflict", drive.ip_conflict && html`<span class="bad">${drive.ip_conflict}</span>`],
      ["Frames sent", drive.frames_sent], ["Frames received", drive.frames_received], ["Suppressed by faults", drive.frames_suppressed || null], ["Discarded", joined(drive.frames_discarded)],
      ["Connects", drive.connects], ["Lost connections", joined(drive.aborts)], ["of them by the farm's lateness", drive.aborts_by_farm || null],
      ["Watchdog expirations", drive.watchdog_expirations],
      ["Neighbours", drive.neighbours.map(one => `${one.station} ${one.port_id}`).join(", ") || "none heard"],
      ...plainFacts(drive.details),
    ]}/>` : null}
    ${seen ? html`<${Facts} pairs=${[["Late frames, the controller's", seen.late_frames.controller], ["Late frames, the farm's", seen.late_frames.farm], ["Missed updates", seen.missed_updates],
        ["Attempts", seen.attempts], ["Refused", seen.refused], ["Sign-of-life errors", seen.sign_of_life ? seen.sign_of_life.errors : null]]}/>
      <div class="columns">
        <div><h3>Interval between the controller's frames</h3>${seen.intervals.buckets.length ? html`<p>mean ${time(seen.intervals.mean_seconds)}</p><${Histogram} buckets=${seen.intervals.buckets} text=${time} label="Intervals"/>` : html`<p class="dim">no frame yet</p>`}</div>
        <div><h3>Deviation from the cycle</h3>${seen.jitter.buckets.length ? html`<p>mean ${time(seen.jitter.mean_seconds)}</p><${Histogram} buckets=${seen.jitter.buckets} text=${time} label="Deviations"/>` : html`<p class="dim">this bus has no agreed cycle, or no frame came yet</p>`}</div>
      </div>
      ${drive && (drive.details.connections || []).length ? html`<h3>What was agreed</h3>${drive.details.connections.map((one, i) => html`<${Relation} key=${i} one=${one}/>`)}` : null}
      <h3>Start-ups</h3>
      <table><thead><tr><th scope="col">Controller</th><th scope="col" class="number">Attempts</th><th scope="col">Complete</th><th scope="col" class="number">After the loss</th><th scope="col">Phases</th></tr></thead>
        <tbody>${[...seen.start_ups].reverse().map((one, place) => html`<tr key=${place}><td>${one.controller || "–"}</td><td class="number">${one.attempts}</td><td>${one.complete ? "yes" : "no"}</td>
          <td class="number">${time(one.after_loss_seconds)}</td><td class="text">${Object.entries(one.phases).map(([phase, took]) => `${phase} ${time(took)}`).join(", ")}</td></tr>`)}</tbody></table>` : null}
  </div>`;
}

function Modules({name, bus}) {
  const [list, error, again] = useLoaded(() => bus === "profinet" ? get(path("drives", name, "modules")) : Promise.resolve(null), [name, bus], 2);
  const [telegram, setTelegram] = useState({});
  if (bus && bus !== "profinet") return html`<p class="dim">A drive on ${bus} has no modules that could be pulled.</p>`;
  const where = slot => path("drives", name, "modules", String(slot));
  return html`<div><${Problem} text=${error}/>
    ${list ? html`<table><thead><tr><th scope="col">Slot</th><th scope="col">Module</th><th scope="col">Telegram</th><th scope="col"><div class="submodule"><span>Subslot</span><span>Submodule</span><span>In, out</span><span>Owner</span></div></th><td></td></tr></thead>
      <tbody>${list.modules.map(one => html`<tr key=${one.slot}><th scope="row">${one.slot}</th><td>${one.module_ident || html`<span class="warn">empty</span>`}${one.substitute ? html` <span class="warn">substitute</span>` : null}</td><td>${one.telegram ?? ""}</td>
        <td class="text">${one.submodules.map(sub => html`<div class="submodule"><span>${sub.subslot}</span><span>${sub.submodule_ident}</span><span>${sub.input_bytes}, ${sub.output_bytes}</span><span>${sub.owner || "–"}${sub.awaits_parameters ? ", awaits parameters" : ""}</span></div>`)}</td>
        <td>${one.slot === 0 ? null : one.module_ident
          ? html`<${Act} title="pull this module" label=${`Pull the module in slot ${one.slot}`} onClick=${async () => { await act(() => call("DELETE", where(one.slot)), `slot ${one.slot} pulled`); again(); }}>Pull<//>`
          : html`<span class="nowrap"><${Act} title="plug what was pulled" label=${`Plug the module of slot ${one.slot}`} onClick=${async () => { await act(() => call("PUT", where(one.slot), {}), `slot ${one.slot} plugged`); again(); }}>Plug<//>
            <input size="5" placeholder="telegram" aria-label=${`telegram for slot ${one.slot}`} value=${telegram[one.slot] || ""} onInput=${event => setTelegram({...telegram, [one.slot]: event.target.value})}/>
            <${Act} title="plug the module of this telegram" label=${`Plug the telegram's module in slot ${one.slot}`} disabled=${!/^\d+$/.test(telegram[one.slot] || "")} onClick=${async () => { await act(() => call("PUT", where(one.slot), {telegram: Number(telegram[one.slot])}), `slot ${one.slot} plugged`); again(); }}>Plug telegram<//></span>`}</td></tr>`)}</tbody></table>` : null}
  </div>`;
}

function Lamps({lamps}) {
  return Object.entries(lamps || {}).map(([lamp, shows]) => {
    const [colour] = /green|red|yellow|orange/.exec(`${shows} ${lamp}`) || [""];
    return html`<span key=${lamp} class=${`lamp ${/^off|^dark/.test(shows) ? "" : colour}`} title=${`lamp ${lamp}: ${shows}`}><i aria-hidden="true"></i>${lamp} ${shows}</span>`;
  });
}

export function Drive({name, tab}) {
  const farm = useFarm();
  const row = farm.byName.get(name), drive = farm.drive && farm.drive.name === name ? farm.drive : null;
  if (!row) return farm.drives.some(one => !one.known) || !farm.drives.length ? html`<p class="dim">Loading…</p>`
    : html`<section aria-label="Unknown drive"><h2>There is no drive ${name} in farm ${farm.name}</h2><p>${farm.deviceByName.has(name) ? html`<a href=${linkOf(name)}>The device ${name}</a> · ` : null}<a href="#/">Overview</a></p></section>`;
  const power = action => act(() => call("POST", path("drives", name, action)), `${name}: ${action}`);
  const others = farm.drives.filter(one => one.known);
  const place = others.indexOf(row);
  const link = (to, which = tab) => `#/drive/${encodeURIComponent(to)}/${which}`;
  return html`<section aria-label=${"Drive " + name}>
    <div class="bar">
      <h2>${name}</h2><${State} drive=${row}/><span class="dim">${row.model}</span><${FaultText} drive=${row}/>
      <${Lamps} lamps=${drive && drive.lamps}/>
      <span class="gap"></span>
      ${place > 0 ? html`<a class="button" href=${link(others[place - 1].name)} title=${others[place - 1].name}>‹ previous</a>` : null}
      ${place < others.length - 1 ? html`<a class="button" href=${link(others[place + 1].name)} title=${others[place + 1].name}>next ›</a>` : null}
    </div>
    <div class="bar">
      <span>${number(row.velocity)} rpm${row.state > 0 ? ` of ${number(row.setpoint)}` : ""}</span>
      <span class=${row.connected ? "good" : "dim"}>${row.ar_state}${row.controller ? ` with ${controllerOf(row)}, ${time(row.cycle_seconds)}` : ""}</span>
      ${drive ? html`<span class="dim">${drive.status.join(", ").replaceAll("_", " ")}</span>` : null}
      ${row.injected.map(([id, kind]) => html`<span key=${id} class="warn" title=${id}>${kind} <${Act} title="end this fault" label=${`Clear ${kind}, ${id}`} onClick=${() => act(() => call("DELETE", path("faults", id)), `${id} cleared`)}>clear<//></span>`)}
      <span class="gap"></span>
      <div class="bar" role="group" aria-label="Usual faults, and the supply">
      <${UsualFaults} on=${name}/>
      <a class="button" href=${"#/faults?on=" + encodeURIComponent(name)}>other fault…</a>
      ${row.state === -1 ? html`<${Act} title="switch the supply on" onClick=${() => power("power-on")}>Power on<//>` : html`<${Act} title="cut the supply" onClick=${() => power("power-off")}>Power off<//>`}</div>
    </div>
    <${Tabs} label="Views of the drive" tabs=${TABS.filter(([id]) => id !== "modules" || row.bus === "profinet")} chosen=${tab} link=${which => link(name, which)}/>
    ${tab === "live" ? html`<${Live} farm=${farm} name=${name} key=${name}/>`
      : tab === "trace" ? html`<${Trace} name=${name} key=${name}/>`
      : tab === "parameters" ? html`<${Parameters} name=${name} key=${name} farm=${farm}/>`
      : tab === "events" ? html`<${Events} name=${name} key=${name} farm=${farm}/>`
      : tab === "connection" ? html`<${Connection} name=${name} key=${name} drive=${drive}/>`
      : html`<${Modules} name=${name} key=${name} bus=${row.bus}/>`}
  </section>`;
}
