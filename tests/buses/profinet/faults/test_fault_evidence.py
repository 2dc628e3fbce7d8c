"""The evidence of every kind: confirmed when it happened, and told why not when something prevented it."""

from __future__ import annotations

from typing import Any

import pytest
from fault_line import FaultLine
from kinds_of import kinds_of
from profinet_state import read

from pnfarm.faults.kind import InjectionKind

#: How each model's line is run.
LINES: dict[str, dict[str, Any]] = {"akd-profinet": {}, "hiwin-e1": {"cycle": "4ms", "telegram": 3}}
PARAMS: dict[str, dict[str, Any]] = {
    "drive-fault": {"fault": 702},
    "drive-warning": {"warning": 107},
    "digital-input": {"input": 0},
    # slower than the drive's frames
    "throttle": {"rate": 10},
}
#: What has to happen for the fault to have something to act on: a new connection, a record that is read.
RECONNECTS = frozenset(
    {
        "connect-refuse", "dcp-silence", "duplicate-name", "late-application-ready", "no-application-ready",
        "record-delay", "rpc-delay", "rpc-silence",
    }
)  # fmt: skip
READS = frozenset({"parameter-busy", "record-error"})
#: Of these, something is seen also without a controller, or of a drive without supply: the cable, what others send.
WITHOUT_CONNECTION = frozenset(
    {
        "corrupt", "dcp-silence", "delay", "duplicate", "duplicate-ip", "duplicate-name", "link-down", "link-flap",
        "loss", "mac-change", "power-cycle", "reorder", "silence",
    }
)  # fmt: skip

EVERY_KIND = pytest.mark.parametrize("kind", kinds_of("profinet"), ids=lambda kind: kind.name)


def model_of(kind: InjectionKind) -> str:
    return "hiwin-e1" if kind.family == "liveness" else "akd-profinet"


def add(line: FaultLine, kind: InjectionKind):
    return line.add(kind.name, params=PARAMS.get(kind.name, {}))


@EVERY_KIND
def test_every_kind_in_force_is_confirmed_by_what_the_farm_sees_on_the_wire(kind: InjectionKind) -> None:
    model = model_of(kind)
    line = FaultLine(model=model, **LINES[model])
    line.connect(20.0)
    line.enable(20.0)
    fault = add(line, kind)
    if kind.name == "fault-not-acknowledging":
        line.add("f702")
    if kind.name in READS:
        assert read(line) != "answered"
    if kind.name in RECONNECTS:
        line.add("ar-abort")
    line.run(5.0 if kind.name in RECONNECTS else 1.0)
    seen = fault.evidence()
    assert (seen.confirmation, seen.reason) == ("confirmed", "")
    assert seen.checks >= seen.activations >= 1
    assert seen.first_ns <= seen.last_ns <= line.world.now
    shown = fault.as_dict()
    for evidence in (shown["evidence"], shown["drives"]["axis-01"]["evidence"]):
        assert (evidence["confirmed"], evidence["confirmation"], evidence["reason"]) == (True, "confirmed", "")


@pytest.mark.parametrize("prevented_by", ["no controller", "no supply"])
@EVERY_KIND
def test_what_cannot_show_is_inconclusive_and_says_why(kind: InjectionKind, prevented_by: str) -> None:
    model = model_of(kind)
    line = FaultLine(model=model, controller=prevented_by != "no controller", **LINES[model])
    station = line.farm.axes[0]
    if prevented_by == "no supply":
        station.station.power_off(line.world.now)
        line.farm.settle(station.station, line.world.now)
    line.run(0.1)
    fault = add(line, kind)
    line.run(1.0)
    seen = fault.evidence()
    if kind.name in WITHOUT_CONNECTION and seen.confirmed:
        assert seen.activations
        return
    assert seen.confirmation == "inconclusive"
    if seen.activations:
        assert seen.reason == "it happened, and nothing that left the drive since could show it"
    elif seen.checks:
        assert seen.reason == f"it could have happened {seen.checks} times, and did not"
    else:
        assert seen.reason == "there was nothing yet that it could act on"


def test_on_several_drives_the_sum_is_confirmed_only_if_every_drive_is() -> None:
    line = FaultLine(2)
    line.connect()
    line.enable()
    station = line.farm.axes[1]
    station.station.power_off(line.world.now)
    line.farm.settle(station.station, line.world.now)
    fault = line.add("not-ready")
    line.run(0.5)
    assert fault.evidence("axis-01").confirmation == "confirmed"
    assert fault.evidence("axis-02").confirmation == "inconclusive"
    assert fault.evidence().confirmation == "inconclusive"
    assert fault.evidence().reason
