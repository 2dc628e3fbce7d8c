// Who is connected with whom: controllers, the farm's link, drives and devices, neighbours heard by LLDP; cables to pull.
import {html} from "../lib/html.js";
import {linkOf} from "../lib/live.js";
import {Act, State, act, inject, useFarm} from "../lib/ui.js";
import {call, get, path} from "../lib/api.js";
import {useLoaded} from "../lib/ui.js";
import {controllerOf, plural, time} from "../lib/words.js";
import {DeviceState} from "./devices.js";

const MOST = 400;

/** Ids of injections that hold a cable down, by drive. */
function pulled(faults) {
  const found = new Map();
  for (const fault of faults) {
    if (fault.kind !== "link-down") continue;
    for (const [drive, run] of Object.entries(fault.drives)) if (run.state === "active") found.set(drive, fault.id);
  }
  return found;
}

/** A device as this view draws drives. */
function stationOf(device) {
  const {controller, cycle_seconds} = device.connection;
  return {...device, device, cycle_seconds, controller: controller && controller.name, controller_ip: controller && controller.ip, address: device.station_address, neighbours: []};
}

function groupsOf(drives) {
  const found = new Map();
  for (const drive of drives) {
    const key = controllerOf(drive);
    if (!found.has(key)) found.set(key, []);
    found.get(key).push(drive);
  }
  return [...found].sort(([a], [b]) => (a === "") - (b === "") || a.localeCompare(b));
}

export function Topology() {
  const farm = useFarm();
  // what lies between a controller and its drives: the link with its interface, or a line
  const placesOf = members => [...new Set(members.map(({bus, shard}) => {
    // a hub has the lines of all shards
    const line = farm.lines[bus] || farm.lines[`${bus} ${shard}`];
    if (line) return line.way === "memory" ? `${bus}, in memory` : `${bus}, ${line.way} ${line.where}`;
    return farm.link === "memory" ? `${bus}, in memory` : farm.parent ? `${bus}, ${farm.link} on ${farm.parent}` : `${bus}, ${farm.link}`;
  }))];
  const [active, , again] = useLoaded(() => get("faults"), [], 1);
  const down = pulled(active ? active.faults : []);
  const drives = farm.drives.filter(drive => drive.known), stations = [...drives, ...farm.devices.map(stationOf)];
  const pull = async drive => {
    const id = down.get(drive.name);
    if (id) await act(() => call("DELETE", path("faults", id)), `${drive.name}: the cable is back`);
    else await inject({kind: "link-down", on: drive.name});
    again();
  };
  return html`<section aria-label="Topology">
    <p>${plural(drives.length, "drive")}${farm.devices.length ? `, ${plural(farm.devices.length, "device")}` : ""}. Press a cable to pull it, and again to plug it.</p>
    ${groupsOf(stations).map(([controller, members]) => html`<div key=${controller} class="net">
      <div class="above"><div class=${"controller " + (controller ? "" : "none")}><strong>${controller || "no controller"}</strong><div class="dim">${plural(members.length, members.some(one => one.device) ? "station" : "drive")}</div></div>
        ${controller ? html`<div class="stem" aria-hidden="true"></div><div class="between">${placesOf(members).map(one => html`<div key=${one}>${one}</div>`)}</div>` : null}</div>
      <ul class="ports">${members.slice(0, MOST).map(drive => html`<li key=${drive.name} class=${down.has(drive.name) ? "cut" : ""}>
        <${Act} kind=${"cable " + (down.has(drive.name) ? "open" : drive.connected ? "live" : "idle")} title=${down.has(drive.name) ? "plug the cable" : "pull the cable"} label=${`${down.has(drive.name) ? "Plug" : "Pull"} the cable of ${drive.name}`} onClick=${() => pull(drive)}>${down.has(drive.name) ? "✕ pulled" : drive.connected ? "━ " + time(drive.cycle_seconds) : "┄ no data"}<//>
        <div><div class="line"><a href=${linkOf(drive.name)}>${drive.name}</a> ${drive.device ? html`<${DeviceState} device=${drive.device}/>` : html`<${State} drive=${drive}/>`}</div>
          <div class="dim small">${[drive.ip || (drive.address === null ? "no address" : `station ${drive.address}`), drive.mac.startsWith("00:00:00") ? "" : drive.mac,
            drive.neighbours.length ? `LLDP neighbours: ${drive.neighbours.join(", ")}` : ""].filter(Boolean).join(" · ")}</div></div></li>`)}</ul>
      ${members.length > MOST ? html`<p class="dim">and ${members.length - MOST} more, see the overview</p>` : null}</div>`)}
  </section>`;
}
