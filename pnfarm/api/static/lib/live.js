// The farm as the live stream reports it: one stream for the page, of all drives, and of the drive or device that is looked at.
import {get} from "./api.js";

const HISTORY = 60;
/** Overviews that are kept, ten seconds: what a drive's plots begin with, before its own samples come. */
const PAST = 100;
const KNOWN_PAST = ["velocity", "setpoint", "current"];
const past = {seconds: new Float64Array(PAST).fill(NaN), head: 0};
const MOST_LOG = 500;
const listeners = new Set();
let source = null;
let chosen = {};
/** Names of models of the plant whose ports are shown. */
let followed = [];
let pending = false;

export const farm = {
  connected: false, begun: 0, error: "", told: 0, name: "pnfarm", link: "", parent: null, writes: true, lines: {}, faults: {}, seconds: 0,
  drives: [], byName: new Map(), devices: [], devicesKnown: false, devicesAway: false, deviceByName: new Map(), engine: null, log: [], position: "", lost: 0, drive: null, signals: null, signalsFull: false,
  // of each device and model of the plant that is looked at: the ETag of these states, and the state of each signal by name
  values: new Map(),
};

const NOTHING = {tag: "", states: new Map()};

/** What the stream has said of the signals of a device or a model of the plant. */
export const valuesOf = name => farm.values.get(name) || NOTHING;

const noPast = () => ({
  history: new Float32Array(HISTORY).fill(NaN), head: 0, past: Object.fromEntries(KNOWN_PAST.map(name => [name, new Float32Array(PAST).fill(NaN)])),
});

function blank(place) {
  return {
    place, name: "", model: "", bus: "", state: 0, velocity: 0, setpoint: 0, current: 0, fault: 0, warning: 0,
    injected: [], neighbours: [], known: false, ...noPast(),
  };
}

function tell() {
  if (pending) return;
  pending = true;
  requestAnimationFrame(() => {
    pending = false;
    for (const listener of listeners) listener();
  });
}

/** Call `listener` when something changed, at most once for each frame of the screen; returns how to end it. */
export function subscribe(listener) {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

const SCALES = {velocity: 0.1, setpoint: 0.1, current: 0.01};

function takeOverview(message) {
  farm.told = Date.now() / 1000;
  farm.seconds = message.seconds;
  if (message.rows) {
    const names = new Set(Object.values(message.rows).map(row => row.name));
    farm.drives.forEach((drive, place) => {
      const row = message.rows[place];
      // another drive has its place, or it has another place; the values of this one may have come before its row
      if (drive.known && (row ? row.name !== drive.name : names.has(drive.name))) Object.assign(drive, {name: "", known: false}, noPast());
      if (row) Object.assign(drive, row, {known: true});
    });
    farm.byName = new Map(farm.drives.filter(one => one.known).map(one => [one.name, one]));
  }
  for (const [name, [places, values]] of Object.entries(message.values || {})) {
    const scale = SCALES[name] || 1;
    // no places: all drives
    values.forEach((value, i) => { farm.drives[places ? places[i] : i][name] = value * scale; });
  }
  for (const drive of farm.drives) {
    drive.history[drive.head] = drive.velocity;
    drive.head = (drive.head + 1) % HISTORY;
    for (const name of KNOWN_PAST) drive.past[name][past.head] = drive[name];
  }
  past.seconds[past.head] = farm.seconds;
  past.head = (past.head + 1) % PAST;
  if (message.engine) farm.engine = message.engine;
}

function takeFarm(message) {
  // A stream that begins anew is of the same drives, and a view that vanished until their rows come would lose what is
  // being typed there.  Other drives take the places as their rows come.
  if (farm.name !== message.farm || farm.drives.length !== message.drives) {
    Object.assign(farm, {drives: Array.from({length: message.drives}, (_, place) => blank(place)), byName: new Map()});
  }
  Object.assign(farm, {
    connected: true, error: "", name: message.farm, link: message.link, parent: message.parent, writes: message.writes, lines: message.lines, faults: message.faults,
  });
  document.title = `${message.farm} · pnfarm`;
  farm.begun += 1;
}

const NO_CONNECTION = {state: "NO_AR", controller: null, cycle_seconds: null, watchdog_seconds: null, connected_seconds: null};

/** Read the list of devices; one whose shard is away stays, as unreachable. */
export async function loadDevices() {
  const found = await get("devices");
  const away = new Map((found.unreachable || []).map(one => [one.shard, one]));
  const here = new Set(found.devices.map(one => one.name));
  const lost = farm.devices.filter(one => away.has(one.shard) && !here.has(one.name)).map(one => ({...one, connected: false, connection: NO_CONNECTION, unreachable: away.get(one.shard)}));
  farm.devices = [...found.devices, ...lost];
  farm.devicesAway = away.size > 0;
  farm.deviceByName = new Map(farm.devices.map(one => [one.name, one]));
  farm.devicesKnown = true;
  tell();
}

/** Address of a station's view. */
export const linkOf = name => `#/${farm.deviceByName.has(name) ? "device" : "drive"}/${encodeURIComponent(name)}`;

function takeValues(message) {
  if (message.device !== chosen.device && !followed.includes(message.device)) return;
  const {states} = farm.values.get(message.device) || {states: new Map()};
  for (const state of message.signals) states.set(state.name, state);
  farm.values.set(message.device, {tag: message.tag, states});
}

function takeLog(message) {
  farm.lost += message.lost || 0;
  farm.log = [...farm.log, ...message.entries].slice(-MOST_LOG);
}

const KEPT_SECONDS = 30;

/** Samples of the drive that is looked at: joined with those before, the last seconds are kept. */
function takeSignals(message) {
  farm.signalsFull = message === null;
  if (message === null) return;
  let known = farm.signals;
  // a stream that begins anew, after a break or of a farm that was restarted, has samples that are here already
  if (!known || known.id !== message.id || !known.seconds.length || message.seconds[0] <= known.seconds[known.seconds.length - 1]) known = pastOf(message);
  const seconds = known.seconds.concat(message.seconds);
  const first = Math.max(0, seconds.findIndex(one => one >= seconds[seconds.length - 1] - KEPT_SECONDS));
  const values = {};
  for (const [name, more] of Object.entries(message.signals)) {
    values[name] = (known.values[name] || []).concat(more).slice(first);
  }
  farm.signals = {id: known.id, seconds: seconds.slice(first), values};
}

/** What the overviews had of the drive before the first of these samples; of other signals null. */
function pastOf(message) {
  const begun = {id: message.id, seconds: [], values: Object.fromEntries(Object.keys(message.signals).map(name => [name, []]))};
  const drive = farm.byName.get(chosen.drive), newest = message.seconds[message.seconds.length - 1];
  if (!drive || newest === undefined) return begun;
  // the newest sample and the newest overview are of one moment
  const newestOverview = past.seconds[(past.head + PAST - 1) % PAST];
  for (let i = 0; i < PAST; i++) {
    const place = (past.head + i) % PAST, at = past.seconds[place] - newestOverview + newest;
    if (!(at < message.seconds[0])) continue;
    begun.seconds.push(at);
    for (const name of Object.keys(begun.values)) {
      const value = name in drive.past ? drive.past[name][place] : NaN;
      begun.values[name].push(Number.isNaN(value) ? null : value);
    }
  }
  return begun;
}

/** What was written is shown before the stream has it. */
export function takeWritten(device, state) {
  if (farm.values.has(device)) farm.values.get(device).states.set(state.name, state);
  tell();
}

/** `bare`: without what is looked at in detail, which the farm may have no longer. */
function open(bare = false) {
  if (source) source.close();
  farm.drive = null;
  farm.signals = null;
  for (const name of farm.values.keys()) if (!followed.includes(name)) farm.values.delete(name);
  const detail = bare ? [] : [...Object.entries(chosen).filter(([, name]) => name), ...followed.map(name => ["device", name])];
  const query = new URLSearchParams(detail);
  // a stream that begins anew has the entries of the log that came meanwhile
  if (farm.position) query.append("after", farm.position);
  const stream = source = new EventSource(`/api/v1/live?${query}`);
  const on = (event, take) => stream.addEventListener(event, message => {
    if (stream !== source) return;
    farm.position = message.lastEventId || farm.position;
    take(JSON.parse(message.data));
    tell();
  });
  const again = (seconds, how) => setTimeout(() => { if (stream === source) open(how); }, seconds * 1000);
  on("farm", message => {
    takeFarm(message);
    if (bare) again(5);
  });
  on("overview", takeOverview);
  on("log", takeLog);
  on("drive", drive => { farm.drive = drive; });
  on("signals", takeSignals);
  on("values", takeValues);
  stream.onerror = () => {
    if (stream !== source) return;
    // a refused stream is not tried again by the browser
    const refused = stream.readyState === EventSource.CLOSED;
    if (refused && detail.length) return open(true);
    farm.connected = false;
    farm.error = "no connection to the farm; trying again";
    if (refused) {
      again(2);
      get("live?follow=false&overview=false").catch(problem => {
        if (stream !== source || !problem.status) return;
        farm.error = problem.message;
        tell();
      });
    }
    tell();
  };
}

/** Look at a drive in detail, at a device's signals, or at none: `{drive}`, `{device}` or `{}`. */
export function look(wanted) {
  if (source && wanted.drive === chosen.drive && wanted.device === chosen.device) return;
  chosen = wanted;
  open();
}

/** Follow the ports of these models of the plant. */
export function follow(names) {
  if (names.length === followed.length && names.every((name, i) => name === followed[i])) return;
  followed = names;
  if (source) open();
}

/** The names of a drive's fault: [number as the manual writes it, name]. */
export function faultOf(drive) {
  const number = drive.fault || drive.warning;
  if (!number) return null;
  const [label, name] = (farm.faults[drive.model] || {})[number] || [String(number), ""];
  return {label, name, warning: !drive.fault};
}
