"""What is done to a farm at random through its API, and taking it back."""

# ruff: noqa: T201 - what it prints is its answer

from __future__ import annotations

import threading
import time
from collections import Counter
from random import Random
from typing import Any
from urllib.parse import quote

from tests.soak.cell import DEVICES
from tests.soak.choices import Action, Choices
from tests.soak.client import Answer, Api, PageReader
from tests.soak.judge import Stream

__all__ = ["V1", "Harm"]

V1 = "/api/v1"
#: A fault without an end of its own is cleared after this time, on average; a written parameter is put back.
HELD_SECONDS = 15.0
#: Pages open at once, and how long one is open.
MOST_PAGES, PAGE_SECONDS = 3, (20.0, 90.0)


class Harm:
    """``stream`` is told, under ``lock``, which faults the farm accepted; ``pages``: the ports that have a page."""

    def __init__(
        self, api: Api, choices: Choices, seed: object, lock: threading.Lock, stream: Stream, pages: list[int]
    ) -> None:
        self.api = api
        self.choices = choices
        self.rng = Random(f"times/{seed}")
        self._lock, self._stream, self._ports = lock, stream, pages
        self.done: Counter[str] = Counter()
        self.kinds: Counter[str] = Counter()
        self.wrong: list[str] = []
        self.due: list[tuple[float, str]] = []  # faults without an end: when they are cleared
        self.before: dict[tuple[str, str], int] = {}  # parameters that were written: their values
        self._pages: list[tuple[float, PageReader]] = []
        self._opened = 0

    def act(self, action: Action) -> None:
        answer: Answer | None = None
        fields = action.fields
        match action.what:
            case "fault" | "invalid":
                answer = self.api("POST", f"{V1}/faults", fields)
                if action.what == "fault" and answer.done:
                    self._injected(answer.json(), fields)
            case "dry-run":
                answer = self.api("POST", f"{V1}/faults?dry_run=true", fields)
            case "clear":
                if self.due:
                    _, name = self.due.pop(self.rng.randrange(len(self.due)))
                    self._clear(name)
            case "reset":
                self.due.clear()
                answer = self.api("POST", f"{V1}/reset")
            case "power-cycle":
                answer = self.api("POST", f"{V1}/drives/{action.drive}/power-cycle")
            case "force":
                answer = self.api("PATCH", f"{V1}/devices/{action.drive}/signals?as=force", fields)
            case "page":
                self._page()
            case "write":
                answer = self._write(action.drive, fields["pnu"])
            case "wrong-write":
                path = f"{V1}/drives/{action.drive}/params/{quote(fields['pnu'], safe='')}"
                answer = self.api("PUT", path, {"value": fields["value"]})
            case "trace":
                answer = self._trace(fields)
            case "scenario":
                answer = self.api("POST", f"{V1}/scenarios", fields)
                if answer.done and self.rng.random() < 0.2:
                    self.api("DELETE", f"{V1}/scenarios/{answer.json()['id']}")
            case "scrape":
                answer = self.api("GET", "/metrics")
                if not answer.text.startswith("#"):
                    self.note(f"/metrics: {answer.status} {answer.text[:200]}")
            case "look":
                paths = (f"{V1}/drives/{action.drive}", f"{V1}/drives/{action.drive}/controller", f"{V1}/faults",
                         f"{V1}/traces", f"{V1}/scenarios", f"{V1}/devices", f"{V1}/plant", f"{V1}/readiness",
                         f"{V1}/reactions", "/")  # fmt: skip
                answer = self.api("GET", self.rng.choice(paths))
        self.done[action.what] += 1
        if answer is not None:
            self.done[f"{action.what} {answer.status}"] += 1
            if action.refused and answer.status and not answer.refused:
                self.note(f"{action} was not refused: {answer.status} {answer.text[:300]}")

    def _injected(self, view: dict[str, Any], fields: Any) -> None:
        self.kinds[view["kind"]] += 1
        with self._lock:
            self._stream.acknowledged(view["id"])
        if view["state"] != "ended":
            self.due.append((time.monotonic() + self.rng.expovariate(1 / HELD_SECONDS), view["id"]))

    def _clear(self, name: str) -> None:
        """One fault; it may have ended by itself, which the farm answers with 404."""
        answer = self.api("DELETE", f"{V1}/faults/{name}")
        self.done[f"clear {answer.status}"] += 1
        if answer.status not in {0, 200, 404}:
            self.note(f"clearing {name}: {answer.status} {answer.text[:300]}")

    def clear_due(self, now: float) -> None:
        for at, name in [entry for entry in self.due if entry[0] <= now]:
            self.due.remove((at, name))
            self._clear(name)

    def _write(self, drive: str, pnu: str) -> Answer:
        path = f"{V1}/drives/{drive}/params/{pnu}"
        answer = self.api("GET", path)
        if not answer.done:
            return answer
        seen = answer.json()
        if (drive, pnu) in self.before and self.rng.random() < 0.5:
            answer = self.api("PUT", path, {"value": self.before[drive, pnu]})
            if answer.done:
                del self.before[drive, pnu]
            return answer
        answer = self.api("PUT", path, {"value": self.choices.value(seen["minimum"], seen["maximum"])})
        if answer.done:
            self.before.setdefault((drive, pnu), seen["value"])
        return answer

    def _trace(self, fields: Any) -> Answer:
        answer = self.api("POST", f"{V1}/traces", fields)
        if answer.refused:
            kept = self.api("GET", f"{V1}/traces").json()["traces"]
            if len(kept) > 8:
                for trace in kept[:4]:
                    self.api("GET", f"{V1}/traces/{trace['id']}?format=csv")
                    self.api("DELETE", f"{V1}/traces/{trace['id']}")
        return answer

    def note(self, what: str) -> None:
        if len(self.wrong) < 100:
            self.wrong.append(what)
            print(f"  wrong: {what}", flush=True)

    # -- pages -------------------------------------------------------------------------------------------------------

    def _page(self) -> None:
        """Open one, of a drive or a device, at the farm or the hub."""
        if len(self._pages) >= MOST_PAGES:
            return
        self._opened += 1
        place = self.rng.randrange(len(self._ports))
        drive = self.choices.drive()
        query = self.rng.choice((f"drive={drive}", "device=all", ""))
        reader = PageReader(self._ports[place], self._opened, query, alone=place == 0)
        reader.start()
        self._pages.append((time.monotonic() + self.rng.uniform(*PAGE_SECONDS), reader))

    def close_pages(self, now: float | None = None) -> None:
        """Those whose time is over, or all."""
        for at, reader in [(at, reader) for at, reader in self._pages if now is None or at <= now]:
            self._pages.remove((at, reader))
            reader.stop()
            reader.join(20.0)
            if reader.is_alive():
                self.note(f"the {reader.name} had no message for 20 s")
            self.done["messages to pages"] += reader.messages
            for what in reader.broken:
                self.note(f"{reader.name}: {what}")

    # -- taking back -------------------------------------------------------------------------------------------------

    def take_back(self, devices: list[str]) -> None:
        """Pages, scenarios, traces, faults and forces; parameters are left (:meth:`put_back`)."""
        self.close_pages()
        self.due.clear()
        for scenario in self.api("GET", f"{V1}/scenarios").json()["scenarios"]:
            # one whose task died is answered by 500
            self.api("GET", f"{V1}/scenarios/{scenario['id']}")
            self.api("DELETE", f"{V1}/scenarios/{scenario['id']}")
        for trace in self.api("GET", f"{V1}/traces").json()["traces"]:
            self.api("DELETE", f"{V1}/traces/{trace['id']}")
        self.api("POST", f"{V1}/reset")
        for name in DEVICES.keys() & set(devices):
            self.api("PATCH", f"{V1}/devices/{name}/signals?as=force", {"*": None})

    def put_back(self, drive: str, pnu: str) -> bool:
        """The value that a parameter had; false while the drive is off or boots."""
        path = f"{V1}/drives/{drive}/params/{pnu}"
        if not self.api("PUT", path, {"value": self.before[drive, pnu]}).done:
            return False
        del self.before[drive, pnu]
        return True
