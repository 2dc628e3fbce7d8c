// Parts that several views use.
import {call} from "./api.js";
import {html, useEffect, useRef, useState} from "./html.js";
import {farm, faultOf, subscribe} from "./live.js";
import {stateOf} from "./words.js";

/** The farm; the component is drawn anew when it changed. */
export function useFarm() {
  const [, draw] = useState(0);
  useEffect(() => subscribe(() => draw(count => count + 1)), []);
  return farm;
}

/** What `load()` gives, anew every `seconds` if given, and when `keys` change: [value, error, load again]. */
export function useLoaded(load, keys, seconds = 0) {
  const [found, setFound] = useState({value: null, error: ""});
  const [again, setAgain] = useState(0);
  useEffect(() => {
    let alive = true;
    let timer = 0;
    const run = async () => {
      try {
        const value = await load();
        if (alive) setFound({value, error: ""});
      } catch (error) {
        if (alive) setFound(before => ({value: before.value, error: error.message}));
      }
      if (alive && seconds) timer = setTimeout(run, seconds * 1000);
    };
    run();
    return () => { alive = false; clearTimeout(timer); };
  }, [...keys, again]);
  return [found.value, found.error, () => setAgain(count => count + 1)];
}

const toasts = {items: [], listeners: new Set(), next: 1};

function changed() {
  for (const listener of toasts.listeners) listener();
}

/** Say something for a while: the result of what the user did. */
export function say(text, kind = "good") {
  const one = {id: toasts.next++, text, kind};
  toasts.items = [...toasts.items.slice(-3), one];
  changed();
  setTimeout(() => {
    toasts.items = toasts.items.filter(other => other !== one);
    changed();
  }, kind === "bad" ? 10000 : 4000);
}

export function Toasts() {
  const [, draw] = useState(0);
  useEffect(() => {
    const listener = () => draw(count => count + 1);
    toasts.listeners.add(listener);
    return () => toasts.listeners.delete(listener);
  }, []);
  return html`<div class="toasts" role="status" aria-live="polite">
    ${toasts.items.map(one => html`<div key=${one.id} class=${"toast " + one.kind}>${one.text}</div>`)}</div>`;
}

/** What a hub could not do of it, as shards are away; empty: it is done. */
function missed({not_hit, unreachable}) {
  const places = not_hit && not_hit.length ? not_hit.map(one => one.drive) : (unreachable || []).map(one => one.shard || one);
  return places.length ? `; not at ${places.slice(0, 8).join(", ")}${places.length > 8 ? " …" : ""}, which ${places.length > 1 ? "do" : "does"} not answer` : "";
}

/** Do something that may fail, and say how it went; false if it failed. */
export async function act(action, done) {
  try {
    const result = await action();
    const left = missed(result || {});
    if (done) say((typeof done === "function" ? done(result) : done) + left, left ? "bad" : "good");
    return true;
  } catch (error) {
    say(error.message, "bad");
    return false;
  }
}

/** Inject a fault; `fields` as the API takes them. */
export const inject = fields => act(() => call("POST", "faults", fields), fault => `${fault.id}: ${fault.kind} on ${Object.keys(fault.drives).length === 1 ? Object.keys(fault.drives)[0] : Object.keys(fault.drives).length + " drives"}`);

export function State({drive}) {
  const {kind, short, long} = stateOf(drive);
  return html`<span class=${"state " + kind} title=${long}>${short}</span>`;
}

export function FaultText({drive}) {
  const found = faultOf(drive);
  if (!found) return null;
  return html`<span class=${found.warning ? "warn" : "bad"} title=${found.name}>${found.warning ? "warning " : ""}${found.label} ${found.name}</span>`;
}

/** A button for what changes the farm; it is off for who may only read. */
export function Act({onClick, children, title, kind = "", disabled = false, label}) {
  return html`<button type="button" class=${kind} title=${farm.writes ? title : "this token may read only"} aria-label=${label}
    disabled=${disabled || !farm.writes} onClick=${onClick}>${children}</button>`;
}

/** Faults that are often injected. */
const USUAL = [
  [{kind: "timeout"}, "timeout", "send nothing until the controller's watchdog has expired"],
  [{kind: "f702"}, "f702", "raise fault 702"],
  [{kind: "sign-of-life-loss", for: "2s"}, "sign-of-life-loss", "the sign of life freezes for 2 s"],
  [{kind: "link-down", for: "2s"}, "cable 2 s", "pull the cable for 2 s"],
];

/** Buttons for these faults, or for some `kinds` of them, on one station or several. */
export function UsualFaults({on, kinds = null, injected = () => {}}) {
  return USUAL.filter(([{kind}]) => !kinds || kinds.includes(kind)).map(([fields, word, title]) => html`<${Act} key=${word} kind="hot" title=${title}
    onClick=${async () => { await inject({...fields, on}); injected(); }}>${word}<//>`);
}

export function Problem({text}) {
  return text ? html`<p class="bad" role="alert">${text}</p>` : null;
}

/** A curve of the last velocities, between their extremes. */
export function Spark({drive, width = 90, height = 22}) {
  const ref = useRef(null);
  useEffect(() => {
    const canvas = ref.current;
    if (!canvas) return;
    const ratio = window.devicePixelRatio || 1;
    if (canvas.width !== width * ratio) {
      canvas.width = width * ratio;
      canvas.height = height * ratio;
    }
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    const values = drive.history;
    let low = 0, high = 0;
    for (const value of values) if (value < low) low = value; else if (value > high) high = value;
    if (high - low < 1) { high += 0.5; low -= 0.5; }
    context.strokeStyle = getComputedStyle(canvas).color;
    context.lineWidth = 1.2;
    context.beginPath();
    let begun = false;
    for (let i = 0; i < values.length; i++) {
      const value = values[(drive.head + i) % values.length];
      // not known yet
      if (Number.isNaN(value)) continue;
      const x = i / (values.length - 1) * (width - 2) + 1, y = (high - value) / (high - low) * (height - 4) + 2;
      if (begun) context.lineTo(x, y); else context.moveTo(x, y);
      begun = true;
    }
    context.stroke();
  });
  return html`<canvas ref=${ref} class="spark" style=${{width: `${width}px`, height: `${height}px`}} aria-hidden="true"></canvas>`;
}

/** Tabs by links, so that each has an address. */
export function Tabs({tabs, chosen, link, label}) {
  return html`<nav class="tabs" aria-label=${label}>
    ${tabs.map(([id, text]) => html`<a key=${id} href=${link(id)} aria-current=${id === chosen ? "page" : null}>${text}</a>`)}</nav>`;
}
