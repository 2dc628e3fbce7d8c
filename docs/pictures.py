"""Takes the pictures of the web page: ``python docs/pictures.py [FOLDER]``, with Debian's chromium.

They are of a farm in memory with a controller, some seconds after a fault.  Without FOLDER they replace those of
``docs/pictures``.
"""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "support")]

import httpx  # noqa: E402
from browser import Browser  # noqa: E402 - from the tests

FARM = """
farm: line-1
link: {kind: memory}
api: 127.0.0.1:0
drives:
  - {name: "infeed-{n:02}", count: 8, model: akd-profinet, ip: 10.77.0.11/24}
  - {name: "press-{n:02}", count: 6, model: moog-msd, ip: 10.77.0.31/24}
  - {name: "gripper-{n:02}", count: 4, model: hiwin-e1, ip: 10.77.0.51/24}
  - {name: "conveyor-{n:02}", count: 2, model: akd-ethernetip, ip: 10.77.0.71/24}
  - {name: "winder-{n:02}", count: 2, model: moog-msd-dp, address: 11}
controller:
  name: plc
  ip: 10.77.0.100/24
  ethernetip: {ip: 10.77.0.101/24}
  program: {kind: sine, speed_rpm: 600, period: 6s, acknowledge_after: 700ms}
  reconnect: {after: 500ms}
"""
SIZE = (1366, 768)


def _call(url: str, method: str, path: str, body: object = None) -> None:
    httpx.request(method, f"{url}/api/v1/{path}", json=body, timeout=20).raise_for_status()


def _pictures(url: str, browser: Browser, folder: Path) -> None:
    def take(
        name: str, view: str, ready: str = "document.querySelector('main section') !== null", wait: float = 0
    ) -> None:
        browser.ask(f"location.hash = '{view}'")
        browser.until(f"document.querySelector('main').dataset.place === '{view[2:].partition('?')[0]}' && ({ready})")
        time.sleep(0.5 + wait)
        browser.picture(folder / f"{name}.png", whole=False)

    browser.open(f"{url}/")
    browser.until("document.querySelectorAll('.state.run').length > 15")
    time.sleep(6)
    _call(
        url,
        "POST",
        "faults",
        {"kind": "drive-fault", "on": "press-03", "params": {"fault": "undervoltage", "hold": True}},
    )
    _call(url, "POST", "faults", {"kind": "silence", "on": "gripper-02"})
    _call(url, "POST", "faults", {"kind": "f702", "on": "infeed-02"})
    time.sleep(2)
    take("overview", "#/", wait=1)
    browser.ask("[...document.querySelectorAll('button')].find(one => one.textContent === 'Tiles').click()")
    take("tiles", "#/", wait=1)
    take("drive", "#/drive/infeed-02/live", "document.querySelectorAll('.plot .uplot').length > 2", wait=9)
    take("reactions", "#/reactions", "document.querySelectorAll('main tbody tr').length > 0")
    take("faults", "#/faults?on=press-01", "document.querySelectorAll('button.kind').length > 10")
    browser.ask("[...document.querySelectorAll('button.kind')].find(one => one.textContent === 'loss').click()")
    time.sleep(1)
    browser.picture(folder / "faults.png", whole=False)


def main() -> None:
    """See the module's docstring."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "pictures"
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name, (Path(name) / "log").open("w+b") as log:
        file = Path(name) / "line.pnfarm.yml"
        file.write_text(FARM)
        arguments = [sys.executable, "-m", "pnfarm", "--log-format", "json", "up", str(file)]
        process = subprocess.Popen(arguments, stdout=log, stderr=log, cwd=ROOT)
        try:
            while (found := re.search(r'"url": "(http[^"]+)"', (Path(name) / "log").read_text())) is None:
                if process.poll() is not None:
                    raise SystemExit((Path(name) / "log").read_text())
                time.sleep(0.1)
            with Browser(Path(name) / "browser", *SIZE) as browser:
                _pictures(found[1], browser, folder)
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(30)


if __name__ == "__main__":
    main()
