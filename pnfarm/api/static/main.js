// The page: views by their address after #, one live stream.
import {html, render, useEffect, useState} from "./lib/html.js";
import {linkOf, loadDevices, look} from "./lib/live.js";
import {Problem, Toasts, useFarm, useLoaded} from "./lib/ui.js";
import {clock, plural} from "./lib/words.js";
import {TABS as DEVICE_TABS, Device} from "./views/device.js";
import {Drive, TABS} from "./views/drive.js";
import {Faults} from "./views/faults.js";
import {Health} from "./views/health.js";
import {Overview} from "./views/overview.js";
import {Plant} from "./views/plant.js";
import {Reactions} from "./views/reactions.js";
import {Readiness} from "./views/readiness.js";
import {Scenarios} from "./views/scenarios.js";
import {Topology} from "./views/topology.js";

const VIEWS = [["", "Overview"], ["faults", "Faults"], ["reactions", "PLC reaction"], ["topology", "Topology"], ["scenarios", "Scenarios"], ["readiness", "Readiness"], ["health", "Health"], ["plant", "Plant"]];

function readPlace() {
  const [where, query] = location.hash.replace(/^#\/?/, "").split("?");
  const parts = where.split("/").map(part => { try { return decodeURIComponent(part); } catch { return part; } });
  return {parts, query: new URLSearchParams(query || "")};
}

function View({parts, query}) {
  switch (parts[0]) {
    case "": return html`<${Overview}/>`;
    case "drive": return TABS.some(([id]) => id === (parts[2] || "live")) ? html`<${Drive} name=${parts[1]} tab=${parts[2] || "live"}/>` : html`<${Unknown} parts=${parts}/>`;
    case "device": return DEVICE_TABS.some(([id]) => id === (parts[2] || "signals")) ? html`<${Device} key=${parts[1]} name=${parts[1]} tab=${parts[2] || "signals"}/>` : html`<${Unknown} parts=${parts}/>`;
    case "faults": return html`<${Faults} on=${query.get("on") || ""} kind=${query.get("kind") || ""}/>`;
    case "readiness": return html`<${Readiness}/>`;
    case "reactions": return html`<${Reactions}/>`;
    case "topology": return html`<${Topology}/>`;
    case "scenarios": return html`<${Scenarios} id=${parts[1] || ""}/>`;
    case "plant": return html`<${Plant} model=${parts[1] || ""}/>`;
    case "health": return html`<${Health}/>`;
    default: return html`<${Unknown} parts=${parts}/>`;
  }
}

/** An address that leads nowhere: which, and where the reader may want to go. */
function Unknown({parts = []}) {
  const farm = useFarm();
  const known = parts.find(part => farm.byName.has(part) || farm.deviceByName.has(part));
  return html`<section aria-label="Unknown address"><h2>There is no page ${location.hash}</h2>
    <p>${known ? html`<a href=${linkOf(known)}>The ${farm.byName.has(known) ? "drive" : "device"} ${known}</a> · ` : null}<a href="#/">Overview</a></p></section>`;
}

function App() {
  const [place, setPlace] = useState(readPlace());
  const farm = useFarm();
  useEffect(() => {
    const moved = () => { setPlace(readPlace()); window.scrollTo(0, 0); };
    const key = event => {
      if (event.target.closest("input, select, textarea") || event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.key === "/") { const field = document.querySelector("input[type=search]"); if (field) { event.preventDefault(); field.focus(); } }
      const number = Number(event.key);
      if (number >= 1 && number <= VIEWS.length) location.hash = "#/" + VIEWS[number - 1][0];
    };
    addEventListener("hashchange", moved);
    addEventListener("keydown", key);
    return () => { removeEventListener("hashchange", moved); removeEventListener("keydown", key); };
  }, []);
  // a stream of a drive or device that the farm has not is refused
  const [what, name] = place.parts, known = {drive: farm.byName, device: farm.deviceByName}[what];
  const wanted = known && known.has(name) ? {[what]: name} : {};
  useEffect(() => look(wanted), [wanted.drive, wanted.device]);
  // a shard that is away may have some
  const follow = (farm.devices.length > 0 || farm.devicesAway) && ["", "device", "topology"].includes(what);
  const [, problem] = useLoaded(loadDevices, [farm.begun, follow], follow ? 2 : 0);
  const chosen = known ? "" : what;
  return html`
    <header><a class="skip" href="#main" onClick=${event => { event.preventDefault(); document.getElementById("main").focus(); }}>Skip to the content</a>
      <h1>${farm.name}</h1>
      <nav aria-label="Views">${VIEWS.map(([id, text], i) => html`<a key=${id} href=${"#/" + id} aria-current=${id === chosen ? "page" : null} title=${`key ${i + 1}`}>${text}</a>`)}</nav>
      <span class="gap"></span>
      ${farm.writes ? null : html`<span class="warn">read only</span>`}
      ${farm.engine ? html`<span class=${farm.engine.overruns ? "warn" : "dim"}>${plural(farm.engine.overruns, "overrun")}</span>` : null}
      <span class=${farm.connected ? "good" : "bad"} role="status">${farm.connected ? "live" : farm.error ? farm.error + (farm.told ? `; shown as of ${clock(farm.told)}` : "") : "connecting"}</span></header>
    <main id="main" tabindex="-1" class=${farm.error ? "stale" : ""} data-place=${place.parts.join("/")}><${Problem} text=${problem}/><${View} ...${place}/></main>
    <${Toasts}/>`;
}

render(html`<${App}/>`, document.getElementById("app"));
