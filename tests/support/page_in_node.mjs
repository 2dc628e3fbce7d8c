// The page's modules without a browser: a document of plain objects, a stream and a farm that the test plays.
import {register} from "node:module";
import {pathToFileURL} from "node:url";

const [folder, test] = process.argv.slice(2);
export const page = pathToFileURL(folder + "/").href;
register("data:text/javascript," + encodeURIComponent(`
  const named = {preact: "vendor/preact.mjs", "preact/hooks": "vendor/hooks.mjs", htm: "vendor/htm.mjs"};
  export const resolve = async (name, context, next) => {
    const found = await next(named[name] ? ${JSON.stringify(page)} + named[name] : name, context);
    return found.url.startsWith(${JSON.stringify(page)}) ? {...found, format: "module"} : found;
  };`));

class Node {
  constructor(name) { Object.assign(this, {localName: name, nodeType: 1, childNodes: [], parentNode: null, attributes: {}, listeners: {}, style: {setProperty() {}}, scrollTop: 0, clientHeight: 600}); }
  get firstChild() { return this.childNodes[0] || null; }
  get nextSibling() { const all = this.parentNode ? this.parentNode.childNodes : []; return all[all.indexOf(this) + 1] || null; }
  insertBefore(node, before) {
    if (node.parentNode) node.parentNode.removeChild(node);
    this.childNodes.splice(before ? this.childNodes.indexOf(before) : this.childNodes.length, 0, node);
    node.parentNode = this;
    return node;
  }
  appendChild(node) { return this.insertBefore(node, null); }
  removeChild(node) { this.childNodes.splice(this.childNodes.indexOf(node), 1); node.parentNode = null; }
  remove() { if (this.parentNode) this.parentNode.removeChild(this); }
  setAttribute(name, value) { this.attributes[name] = value; }
  removeAttribute(name) { delete this.attributes[name]; }
  addEventListener(name, take) { this.listeners[name] = take; }
  removeEventListener(name) { delete this.listeners[name]; }
  getContext() { return new Proxy({}, {get: () => () => {}, set: () => true}); }
  getBoundingClientRect() { return {left: 0, top: 0}; }
  get textContent() { return this.nodeType === 3 ? this.data : this.childNodes.map(one => one.textContent).join(""); }
  all(name) { return this.childNodes.flatMap(one => [...(one.localName === name ? [one] : []), ...one.all(name)]); }
}
const textOf = data => Object.assign(new Node("#text"), {nodeType: 3, data: String(data)});
globalThis.document = {createElement: name => new Node(name), createElementNS: (_, name) => new Node(name), createTextNode: textOf, title: "", querySelector: () => null};
const app = new Node("div");
document.getElementById = () => app;
globalThis.addEventListener = globalThis.removeEventListener = () => {};
globalThis.scrollTo = () => {};
globalThis.window = globalThis;
globalThis.location = {hash: ""};
globalThis.requestAnimationFrame = draw => setTimeout(draw, 0);
globalThis.cancelAnimationFrame = clearTimeout;
globalThis.getComputedStyle = () => ({getPropertyValue: () => ""});
globalThis.ResizeObserver = class { observe() {} disconnect() {} };
globalThis.uPlot = class { constructor() { this.over = new Node("div"); this.cursor = {left: -1}; this.data = [[]]; } setData() {} setLegend() {} setSize() {} destroy() {} };
globalThis.uPlot.paths = {stepped() {}};

/** What the farm answers, by method and path without what is behind "?": a value, or a function that gives it or throws. */
export const answers = {};
export const asked = [];
globalThis.fetch = async (where, {method, body}) => {
  const key = `${method} ${where.replace("/api/v1/", "").split("?")[0]}`;
  asked.push(key);
  const answer = answers[key], value = typeof answer === "function" ? await answer(body && JSON.parse(body)) : answer;
  if (value === undefined) return {ok: false, status: 404, json: async () => ({detail: `there is no ${key}`})};
  return {ok: true, status: 200, json: async () => value};
};

/** The page's stream: `say(event, data, id)` as the farm does. */
export const streams = [];
globalThis.EventSource = class {
  static CLOSED = 2;
  constructor(where) { this.where = where; this.takers = {}; streams.push(this); }
  addEventListener(event, take) { this.takers[event] = take; }
  close() {}
};
export const say = (event, data, lastEventId = "") => streams[streams.length - 1].takers[event]({data: JSON.stringify(data), lastEventId});
export const FARM = {farm: "line", link: "memory", parent: null, drives: 1, writes: true, lines: {}, faults: {}};
export const row = (name, more = {}) => ({
  name, station_name: name, model: "akd-profinet", bus: "profinet", mac: "02:00:00:00:00:01", ip: "10.0.0.1/24", address: null, ar_state: "DATA", connected: true,
  controller: "plc", controller_ip: "10.0.0.9", cycle_seconds: 0.004, injected: [], neighbours: [], ...more,
});

/** A component in a document of its own. */
export async function shown(component, properties = {}) {
  const {html, render} = await import(page + "lib/html.js");
  const root = new Node("div");
  render(html`<${component} ...${properties}/>`, root);
  return root;
}

/** Wait until it is so; the test ends if it never is. */
export async function until(so) {
  for (let i = 0; i < 400; i++) {
    if (so()) return;
    await new Promise(done => setTimeout(done, 5));
  }
  throw new Error(`never true: ${so}`);
}

if (test) {
  const Test = Object.getPrototypeOf(async () => {}).constructor;
  const names = {page, app, answers, asked, say, FARM, row, shown, until, streams};
  console.log(JSON.stringify(await new Test(...Object.keys(names), test)(...Object.values(names)) ?? null));
  process.exit(0);
}
