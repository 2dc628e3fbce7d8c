// Devices at a glance: a list beside that of the drives.
import {html, useRef} from "../lib/html.js";
import {linkOf} from "../lib/live.js";
import {ROW, useWindow} from "../lib/window.js";
import {controllerOf, plural, time} from "../lib/words.js";

/** Class and word for what a device does. */
function deviceState(device) {
  if (device.unreachable) return {kind: "off", short: "unreachable", long: device.unreachable.reason};
  if (!device.powered) return {kind: "off", short: "off", long: "no supply"};
  return device.connected ? {kind: "run", short: "connected", long: "exchanges cyclic data"} : {kind: "idle", short: "not connected", long: "no connection exchanges cyclic data"};
}

export function DeviceState({device}) {
  const {kind, short, long} = deviceState(device);
  return html`<span class=${"state " + kind} title=${long}>${short}</span>`;
}

/** Who controls a device, as of a drive. */
export const deviceController = ({connection: {controller}}) => controller ? controllerOf({controller: controller.name, controller_ip: controller.ip}) : "";

export function deviceMatches(device, {text, model, bus, state}) {
  // a device has no model, and no state of a drive
  if (model || bus && device.bus !== bus) return false;
  if (state === "disconnected" ? device.connected : state === "injected" ? !device.injected.length : state === "away" ? !device.unreachable : state && deviceState(device).kind !== state) return false;
  const wanted = text.toLowerCase();
  return !text || [device.name, device.station_name, device.description, device.ip, device.mac, deviceController(device)].some(one => one && one.toLowerCase().includes(wanted));
}

function Row({device}) {
  return html`<tr><th scope="row"><a href=${linkOf(device.name)}>${device.name}</a>${device.station_name && device.station_name !== device.name ? html` <span class="dim">${device.station_name}</span>` : null}</th>
    <td title=${device.description}>${device.description || "–"}</td><td><${DeviceState} device=${device}/></td>
    <td>${deviceController(device) || "–"}</td><td class="number">${time(device.connection.cycle_seconds)}</td><td class=${device.connected ? "good" : "dim"}>${device.connection.state}</td>
    <td title=${device.ip}>${device.ip ? device.ip.split("/")[0] : device.station_address ?? "–"}</td>
    <td class="number">${device.inputs}</td><td class="number">${device.outputs}</td>
    <td class="warn">${device.injected.map(one => one.kind).join(", ")}</td></tr>`;
}

/** `devices`: those that fit the filter; `all`: how many there are. */
export function DeviceList({devices, all, alone}) {
  const box = useRef(null);
  const part = useWindow(box, devices.length, ROW, 1);
  return html`<div class="bar"><h2>Devices</h2><span class="dim" role="status">${devices.length === all ? plural(all, "device") : `${devices.length} of ${plural(all, "device")}`}: ${devices.filter(one => one.connected).length} connected</span></div>
    <div class=${"list" + (alone ? "" : " devices")} ref=${box} tabindex="0" role="region" aria-label="Devices">
      <table class="devices" aria-rowcount=${devices.length + 1}><thead><tr>${["Device", "Title", "State", "Controller"].map(one => html`<th key=${one} scope="col">${one}</th>`)}<th scope="col" class="number">Cycle</th>
        <th scope="col">Connection</th><th scope="col">Address</th><th scope="col" class="number">Inputs</th><th scope="col" class="number">Outputs</th><th scope="col">Injected</th></tr></thead>
        <tbody><tr class="space" aria-hidden="true"><td style=${{height: `${part.before}px`}}></td></tr>
          ${devices.slice(part.first, part.last).map(device => html`<${Row} key=${device.name} device=${device}/>`)}
          <tr class="space" aria-hidden="true"><td style=${{height: `${part.after}px`}}></td></tr></tbody></table>
      ${devices.length ? null : html`<p class="dim">No device matches the filter.</p>`}</div>`;
}
