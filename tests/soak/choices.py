"""What is done to a farm at random: a seed makes the same choices again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Any

from kinds_of import kinds_of
from storm import random_fault, value_of

from pnfarm.buses.registry import fault_kinds
from pnfarm.drives.catalogue import model
from pnfarm.faults.signals import SIGNALS
from tests.soak.cell import DEVICES, PARAMETERS

__all__ = ["Action", "Choices"]


@dataclass(frozen=True, slots=True)
class Action:
    """``what``: fault, signal, force, invalid, clear, reset, power-cycle, write, wrong-write, trace, scenario, scrape,
    look, page.

    ``refused``: the farm must refuse it (True), accept it (False), or may do either (None).
    """

    what: str
    drive: str = ""
    fields: Mapping[str, Any] = field(default_factory=dict)
    refused: bool | None = None


_WEIGHTS = {
    "fault": 60, "invalid": 6, "dry-run": 3, "clear": 12, "reset": 0.6, "power-cycle": 3, "write": 6, "wrong-write": 3,
    "trace": 3, "scenario": 1.0, "scrape": 4, "look": 5,
}  # fmt: skip
#: With devices, and with programs that can be started anew.
_OF_DEVICES = {"signal": 5, "force": 4, "device-fault": 4}
_OF_PAGES = {"page": 1.5}

_SCENARIO = """\
scenario: {name}
farm: this
steps:
  - fault: {{kind: {kind}, on: {drive}, for: 1s, as: {name}}}
  - expect: {{drive: {drive}, that: connected, within: 2s}}
  - wait: {seconds:.1f}s
  - expect: {{drive: {drive}, that: state == S4, within: 5s}}
"""


class Choices:
    """``drives``: name -> model.  :meth:`next` is an action, :meth:`pause` the seconds until the one behind it.

    ``devices``: the names of those that there are; ``pages``: whether there are clients of the page.
    """

    def __init__(
        self, seed: object, drives: Mapping[str, str], rate: float, *, devices: Sequence[str] = (), pages: bool = False
    ) -> None:
        self._rng = Random(f"soak/{seed}")
        self._drives = dict(drives)
        self._names = list(drives)
        self._devices = [name for name in devices if name in DEVICES]
        self._stations = list(devices)
        self._weights = _WEIGHTS | (_OF_DEVICES if self._devices else {}) | (_OF_PAGES if pages else {})
        self._bus = {name: model(of).bus for name, of in drives.items()}
        self._kinds = {name: kinds_of(name) for name in sorted(set(self._bus.values()))}
        self._signal_kinds = [kind for kind in fault_kinds().values() if SIGNALS in kind.effect.needs]
        self._faults = {
            name: sorted(fault.number for fault in model(name).faults.values()) for name in set(drives.values())
        }
        self._rate = rate
        self._number = 0

    def pause(self) -> float:
        return self._rng.expovariate(self._rate)

    def next(self) -> Action:
        rng = self._rng
        what = rng.choices(list(self._weights), list(self._weights.values()))[0]
        drive = rng.choice(self._names)
        match what:
            case "fault":
                return Action(what, drive, self._fault(drive))
            case "dry-run":
                return Action(what, drive, self._fault(drive))
            case "signal":
                return Action("fault", drive, self._signal_fault())
            case "device-fault":
                return Action("fault", drive, self._device_fault())
            case "force":
                return self._force()
            case "invalid":
                return Action(what, drive, self._invalid(drive), refused=True)
            case "write":
                return Action(what, drive, {"pnu": rng.choice(PARAMETERS[self._drives[drive]])})
            case "wrong-write":
                return Action(what, drive, self._wrong_write(), refused=True)
            case "trace":
                return Action(what, drive, self._trace(drive))
            case "scenario":
                self._number += 1
                kind = rng.choice(("f702", "silence", "drive-warning", "not-ready", "link-down", "sto"))
                text = _SCENARIO.format(
                    name=f"soak-{self._number}", kind=kind, drive=drive, seconds=rng.uniform(0.5, 3.0)
                )
                return Action(what, drive, {"text": text})
            case _:
                return Action(what, drive)

    def drive(self) -> str:
        return self._rng.choice(self._names)

    def value(self, low: float, high: float) -> int:
        """A value of a parameter from its range: often one of the ends."""
        where = self._rng.random()
        if where < 0.1:
            return int(low)
        if where < 0.2:
            return int(high)
        return self._rng.randint(int(low), int(high))

    # -- faults ------------------------------------------------------------------------------------------------------

    def _on(self, drive: str) -> dict[str, Any]:
        """Whom a fault hits: mostly one drive, now and then some, a share of a model, or all for a moment."""
        rng = self._rng
        where = rng.random()
        if where < 0.7:
            return {"on": drive}
        if where < 0.8:
            alike = [name for name in self._names if self._bus[name] == self._bus[drive]]
            return {"on": sorted(rng.sample(alike, min(len(alike), rng.randint(2, 4))))}
        if where < 0.9:
            return {"on": f"model:{self._drives[drive]}", "share": f"{rng.randint(1, 30)}%"}
        if where < 0.98 and len(drive) > 1:
            return {"on": f"{drive[:-1]}*", "most": rng.randint(1, 4)}
        return {"on": "all", "for": f"{rng.randint(50, 800)}ms"}

    def _fault(self, drive: str) -> dict[str, Any]:
        rng = self._rng
        kind = rng.choice(self._kinds[self._bus[drive]])
        fields = random_fault(rng, kind, drive, self._faults[self._drives[drive]])
        whom = self._on(drive)
        if "for" in whom and "for" not in kind.takes:
            whom = {"on": drive}
        fields.update(whom)
        if rng.random() < 0.15:
            fields["ttl"] = f"{rng.randint(100, 8000)}ms"
        if rng.random() < 0.1:
            fields["after_cycles"] = rng.randint(1, 200)
        ends = {"for", "count", "cycles"} & fields.keys()
        if "rate" in kind.common and ends and rng.random() < 0.15:
            fields["rate"] = f"{rng.randint(1, 120)}/min"
            if rng.random() < 0.5:
                fields["times"] = rng.randint(1, 5)
        if {"share", "most", "rate"} & fields.keys():
            # a random one otherwise, and the run could not be repeated
            fields["seed"] = rng.randrange(1 << 30)
        return fields

    def _signal_fault(self) -> dict[str, Any]:
        """A fault on an input of a device."""
        rng = self._rng
        kind, device = rng.choice(self._signal_kinds), rng.choice(self._devices)
        params = {
            name: value_of(rng, kind, name, spec, [])
            for name, spec in kind.params.items()
            if spec.required and name != "signal"
        }
        params["signal"] = rng.choice(DEVICES[device])
        if "values" in params:
            params["values"] = "0:false 0.5:true 1s:false"
        return {"kind": kind.name, "on": device, "params": params, "for": f"{rng.randint(50, 5000)}ms"}

    def _device_fault(self) -> dict[str, Any]:
        """A fault that any station may have."""
        rng = self._rng
        kind = rng.choice(("silence", "link-down", "power-cycle", "loss"))
        fields: dict[str, Any] = {"kind": kind, "on": rng.choice(self._stations)}
        if kind == "loss":
            fields["probability"] = rng.uniform(0.05, 0.5)
        if kind != "power-cycle":
            fields["for"] = f"{rng.randint(50, 5000)}ms"
        return fields

    def _force(self) -> Action:
        """Force an input or release it."""
        rng = self._rng
        device = rng.choice(self._devices)
        values = {name: None if rng.random() < 0.6 else rng.random() < 0.5 for name in DEVICES[device]}
        chosen = rng.sample(sorted(values), rng.randint(1, len(values)))
        fields = {
            name: int(values[name]) if name == "parts" and values[name] is not None else values[name] for name in chosen
        }
        return Action("force", device, fields)

    def _invalid(self, drive: str) -> Any:
        """Something that no farm may take."""
        rng = self._rng
        good = {"kind": "f702", "on": drive, "for": "1s"}
        wrong: list[Any] = [
            {**good, "kind": "f70" + str(rng.randint(3, 9))},
            {**good, "on": "nobody-*"},
            {**good, "on": []},
            {**good, "on": {"drive": drive}},
            {**good, "for": f"-{rng.randint(1, 9)}s"},
            {**good, "for": rng.random()},
            {**good, "for": "999999999999999h"},
            {**good, "params": {"no-such-parameter": rng.random()}},
            {**good, "params": [drive]},
            {**good, "count": -rng.randint(0, 1 << 40)},
            {**good, "seed": "a" * rng.randint(1, 1000)},
            {**good, "ttl": "1ms"},
            {**good, "share": "0%"},
            {**good, "rate": "often", "for": "1s"},
            {**good, rng.randbytes(6).hex(): None},
            {"kind": "loss", "on": drive, "probability": rng.choice([-0.1, 1.1, "often", []])},
            {"kind": "delay", "on": drive, "params": {"delay": rng.choice(["1h", "-1ms", "soon", 7])}},
            {"kind": "loss", "on": drive, "params": {"model": "burst", "burst": 0}},
            {"on": drive},
            [good],
            "f702",
            None,
        ]
        return rng.choice(wrong)

    def _wrong_write(self) -> dict[str, Any]:
        rng = self._rng
        return {
            "pnu": rng.choice(("no-such-name", "65536", "-1", "1.2.3.4", "99999999999999999999", "Pt999", "944")),
            "value": rng.choice((0, -1, 1 << 70, 1.5, "one", None, [1])),
        }

    def _trace(self, drive: str) -> dict[str, Any]:
        rng = self._rng
        triggers = (
            "now", "fault", "state changes", "velocity > 100", "disconnect", "injection", "zsw1.fault_present",
            "manual",
        )  # fmt: skip
        signals = ("velocity", "zsw1.*", "state", "frame_age", "injected", "stw1", "fault", "following_error")
        return {
            "on": drive,
            "signals": sorted(rng.sample(signals, rng.randint(1, 4))),
            "trigger": rng.choice(triggers),
            "pre": f"{rng.randint(0, 500)}ms",
            "length": f"{rng.randint(50, 4000)}ms",
            "every": rng.randint(1, 20),
            "keep": f"{rng.randint(1, 60)}s",
        }
