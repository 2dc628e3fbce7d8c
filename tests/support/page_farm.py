"""A farm in a process of its own and its page in a browser."""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

__all__ = ["FARM", "TOOLS", "call", "running", "show"]

GSDML = Path(__file__).parents[2] / "configs" / "gsdml"
FARM = """
farm: line-1
link: {kind: memory}
api: 127.0.0.1:0
drives:
  - {name: "akd-{n:02}", count: 3, model: akd-profinet, ip: 10.0.0.11/24}
  - {name: hiwin-01, model: hiwin-e1, ip: 10.0.0.31/24}
  - {name: msd-01, model: moog-msd, ip: 10.0.0.51/24}
  - {name: dp-01, model: moog-msd-dp, address: 11}
  - {name: eip-01, model: akd-ethernetip, ip: 10.0.0.71/24}
devices:
  - name: island
    gsdml: ISLAND
    access_point: DAP 1
    ip: 10.0.0.81/24
    slots: {1: 16DI, 2: {module: 8DO, parameters: {Substitute: hold}}, 3: EX-AI-4, 4: FDI4}
    signals:
      part_present: 1.1.0.3
      pressure: {at: 3.1.0, type: int16, unit: bar, scale: 0.01}
  - {name: scanner, gsdml: SCANNER, ip: 10.0.0.91/24, signals: {MANY}}
plant:
  step: 2ms
  models:
    - {name: gripper, kind: cylinder, time: 300ms}
    - {name: lamp, kind: lamp}
    - {name: shaft, python: FRAGILE, step: 10ms}
  wires:
    - gripper.extended -> lamp.on
controller:
  name: plc
  ip: 10.0.0.100/24
  ethernetip: {ip: 10.0.0.101/24}
  watchdog: 200ms
  program: {kind: sine, speed_rpm: 500, period: 4s, acknowledge_after: 300ms}
  reconnect: {after: 300ms}
"""
# the scanner has a thousand signals, most of them bits of the code that it reads
BITS = [f"bit_{octet}_{bit}: 2.1.{octet}.{bit}" for octet in range(64) for bit in range(8)]
OCTETS = [f"octet_{octet}_{n}: {{at: 2.1.{octet}, type: uint8}}" for octet in range(64) for n in range(8)]
for word, place in (
    ("ISLAND", GSDML / "GSDML-V2.35-Example-Island-20261127.xml"),
    ("SCANNER", GSDML / "GSDML-V2.43-Example-Scanner-20261127.xml"),
    ("FRAGILE", Path(__file__).parent / "fragile_model.py"),
    ("MANY", ", ".join(BITS + OCTETS)),
):
    FARM = FARM.replace(word, str(place))
#: What a person finds by its text.
TOOLS = """
globalThis.all = (selector, text) => [...document.querySelectorAll(selector)]
  .filter(one => text === undefined || one.textContent.trim() === text || one.getAttribute("aria-label") === text);
globalThis.press = (selector, text) => {
  const [one] = all(selector, text);
  if (!one || one.disabled) return false;
  one.click();
  return true;
};
globalThis.labelled = label => document.querySelector(`[aria-label="${label}"]`)
  || all("label").find(one => one.textContent.trim().startsWith(label))?.control;
globalThis.type = (label, text) => {
  const one = labelled(label);
  if (!one) return false;
  one.value = text;
  one.dispatchEvent(new Event(one.tagName === "SELECT" ? "change" : "input", {bubbles: true}));
  return true;
};
globalThis.rows = first => all("main .scroll tbody tr")
  .filter(row => row.cells[0].textContent === first).map(row => row.textContent);
globalThis.hover = on => {
  // every element as it looks under the pointer: a copy of each rule for it that holds anywhere
  for (const sheet of document.styleSheets) for (let i = sheet.cssRules.length - 1; i >= 0; i--) {
    const rule = sheet.cssRules[i].cssText;
    if (!on && rule.includes(":not(.no-such)")) sheet.deleteRule(i);
    else if (on && rule.includes(":hover")) sheet.insertRule(rule.replaceAll(":hover", ":not(.no-such)"), i + 1);
  }
};
globalThis.text = selector => all(selector).map(one => one.textContent).join(" ");
"""


@contextlib.contextmanager
def running(folder, text=FARM):
    """The URL of a farm in a process of its own."""
    file = folder / "line.pnfarm.yml"
    # names of farms that run are taken on this machine
    file.write_text(text.replace("farm: line-1", f"farm: page-{os.getpid()}-{folder.name[-20:].replace('_', '-')}"))
    arguments = [sys.executable, "-m", "pnfarm", "--log-format", "json", "up", str(file)]
    with (folder / "log").open("w+b") as log:
        process = subprocess.Popen(arguments, stdout=log, stderr=log, cwd=folder)
        try:
            found = None
            while found is None:
                assert process.poll() is None, (folder / "log").read_text()
                found = re.search(r'"url": "(http[^"]+)"', (folder / "log").read_text())
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(0.1)
            yield found[1]
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(30)


def call(url, method, path, body=None):
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(f"{url}/api/v1/{path}", data, {"Content-Type": "application/json"}, method=method)
    with urllib.request.urlopen(request, timeout=20) as answer:
        return json.load(answer)


def show(page, view):
    page.ask(f"location.hash = '{view}'")
    # a drive's page has its buttons once the drive is known
    page.until(f"document.querySelector('main').dataset.place === '{view[2:]}' && all('main section').length === 1")
    if "/drive/" in view or "/device/" in view:
        page.until(f"all('main h2', '{view.split('/')[2]}').length === 1")
