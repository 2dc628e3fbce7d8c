"""What is done to a farm at random: a seed makes the same choices again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Any

from kinds_of import kinds_of
from storm import random_fault

from pnfarm.drives.catalogue import model

__all__ = ["MODELS", "PARAMETERS", "Action", "Choices", "farm_text"]

#: The PROFINET models, with the cycle that they run at: slow, because the run is about hours, and not about load.
MODELS: Mapping[str, str] = {
    "akd-profinet": "32ms",
    "akd-profinet-2012": "32ms",
    "moog-msd": "32ms",
    "hiwin-e1": "4ms",
}
#: Parameters that are written at random: they are used by nothing that keeps the drive from its operation.
PARAMETERS: Mapping[str, Sequence[str]] = {
    "akd-profinet": ("AIN.CUTOFF", "AIN.DEADBAND", "AIN.OFFSET", "AOUT.OFFSET", "BODE.IAMP", "CAP0.EDGE"),
    "akd-profinet-2012": ("1004", "1005", "1006", "1007", "1001"),
    "moog-msd": ("202", "326", "925"),
    "hiwin-e1": ("925", "Pt385", "Pt533", "Pt534", "Pt537", "Pt538"),
}
#: One in so many drives is a HIWIN E1, whose longest cycle is 4 ms.
_E1_SHARE = 8

_FILE = """\
farm: soak
link: {{kind: {link}}}
api: {api}
drives:
{groups}
controller:
  name: plc
  ip: 10.77.1.250/23
  cycle: 32ms
  watchdog_factor: 16
  program: {{kind: sine, speed_rpm: 300, period: 4s, acknowledge_after: 300ms}}
  reconnect: {{after: 500ms}}
"""


def farm_text(drives: int, link: str, api: str) -> str:
    """A farm file with so many drives of all models, as many of each as their cycles suggest."""
    counts = dict.fromkeys(MODELS, 0)
    counts["hiwin-e1"] = max(1, drives // _E1_SHARE) if drives > 3 else 0
    others = [name for name in MODELS if name != "hiwin-e1"]
    for place in range(drives - counts["hiwin-e1"]):
        counts[others[place % len(others)]] += 1
    lines, first = [], 11
    for name, count in counts.items():
        if count:
            telegram = ", telegram: 3" if name == "hiwin-e1" else ""
            lines.append(
                f'  - {{name: "{name.partition("-")[0]}{"-old" if name.endswith("2012") else ""}-{{n:02}}",'
                f" count: {count}, model: {name}, ip: 10.77.0.{first}/23, cycle: {MODELS[name]}{telegram}}}"
            )
            first += count
    return _FILE.format(link=link, api=api, groups="\n".join(lines))


@dataclass(frozen=True, slots=True)
class Action:
    """``what``: fault, invalid, clear, reset, power-cycle, write, wrong-write, trace, scenario, scrape, look.

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
    """``drives``: name -> model.  :meth:`next` is an action, :meth:`pause` the seconds until the one behind it."""

    def __init__(self, seed: object, drives: Mapping[str, str], rate: float, *, scenarios: bool = True) -> None:
        self._rng = Random(f"soak/{seed}")
        self._drives = dict(drives)
        self._names = list(drives)
        self._kinds = kinds_of("profinet")
        self._faults = {
            name: sorted(fault.number for fault in model(name).faults.values()) for name in set(drives.values())
        }
        self._rate = rate
        self._scenarios = scenarios
        self._number = 0

    def pause(self) -> float:
        return self._rng.expovariate(self._rate)

    def next(self) -> Action:
        rng = self._rng
        what = rng.choices(list(_WEIGHTS), list(_WEIGHTS.values()))[0]
        drive = rng.choice(self._names)
        match what:
            case "fault":
                return Action(what, drive, self._fault(drive))
            case "dry-run":
                return Action(what, drive, self._fault(drive))
            case "invalid":
                return Action(what, drive, self._invalid(drive), refused=True)
            case "write":
                return Action(what, drive, {"pnu": rng.choice(PARAMETERS[self._drives[drive]])})
            case "wrong-write":
                return Action(what, drive, self._wrong_write(), refused=True)
            case "trace":
                return Action(what, drive, self._trace(drive))
            case "scenario" if self._scenarios:
                self._number += 1
                kind = rng.choice(("f702", "silence", "drive-warning", "not-ready", "link-down", "sto"))
                text = _SCENARIO.format(
                    name=f"soak-{self._number}", kind=kind, drive=drive, seconds=rng.uniform(0.5, 3.0)
                )
                return Action(what, drive, {"text": text})
            case "scenario":
                return Action("look", drive)
            case _:
                return Action(what, drive)

    def fraction(self) -> float:
        return self._rng.random()

    def chosen(self, names: Sequence[str]) -> str:
        return self._rng.choice(names)

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
            return {"on": sorted(rng.sample(self._names, min(len(self._names), rng.randint(2, 4))))}
        if where < 0.9:
            return {"on": f"model:{self._drives[drive]}", "share": f"{rng.randint(1, 30)}%"}
        if where < 0.98:
            return {"on": f"{drive[:-1]}*", "most": rng.randint(1, 4)}
        return {"on": "all", "for": f"{rng.randint(50, 800)}ms"}

    def _fault(self, drive: str) -> dict[str, Any]:
        rng = self._rng
        kind = rng.choice(self._kinds)
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
