"""``pnfarm trace`` against the API of a farm in virtual time: the command's waiting lets the time pass."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from typing import Any

import api_client
import pytest
from device_cell import DRIVES, ONE, Cell
from virtual_line import VirtualLine

from pnfarm.api import make_app
from pnfarm.errors import EnvironmentError_


class Farm(api_client.Farm):
    """Stands for ``httpx.Client``; ``sleep`` and ``monotonic`` are the farm's."""

    def __init__(self, line: Any = None) -> None:
        super().__init__(self)
        self.line = line or VirtualLine(2)
        self.app = make_app(
            self.line.farm,
            now=lambda: self.line.world.now,
            poke=lambda: self.line.farm.service(self.line.world.now),
        )
        #: What happens in the next waits, one call each.
        self.next: list[Any] = []

    def sleep(self, seconds: float) -> None:
        if self.next:
            self.next.pop(0)()
        self.line.world.run(seconds)

    def monotonic(self) -> float:
        return self.line.world.now / 1e9

    def inject(self) -> None:
        self.line.farm.injections.inject({"kind": "f702", "on": "axis-02"}, self.line.world.now)
        self.line.farm.service(self.line.world.now)


@pytest.fixture
def farm(monkeypatch, request):
    farm = Farm(getattr(request, "param", None) and request.param())
    if isinstance(farm.line, VirtualLine):
        farm.line.enable()
    monkeypatch.setattr("httpx.Client", farm.client)
    monkeypatch.setattr("pnfarm.cli.commands.trace.time", farm)
    return farm


def test_a_trace_is_written_in_every_form_and_plotted_plainly(farm, pnfarm, tmp_path):
    files = [tmp_path / f"run.{form}" for form in ("csv", "json", "svg", "html")]
    outputs = [word for file in files for word in ("-o", file)]
    farm.next = [lambda: None, lambda: None, lambda: None, farm.inject]
    done = pnfarm(
        "trace", "axis-*", "--signals", "velocity,zsw1.fault_present", "-s", "state", "--trigger", "fault 702",
        "--pre", "0.2s", "--length", "300ms", *outputs,
    )  # fmt: skip
    assert done.code == 0, done.err
    assert "axis-02 zsw1.fault_present" in done.out
    assert "trigger fault 702 (axis-02), 0 missed" in done.out
    assert "\x1b" not in done.out
    assert max(map(len, done.out.splitlines())) <= 100 + len(str(tmp_path)) + 40
    head, *rows = files[0].read_text().splitlines()
    assert head.startswith("time [s],axis-01 velocity [rpm],axis-01 zsw1.fault_present,axis-01 state,axis-02 ")
    assert rows[0].startswith("-0.2")
    assert len(rows) == 501
    assert json.loads(files[1].read_text())["triggered_by"] == "axis-02"
    root = ET.fromstring(files[2].read_text())
    lines = root.findall("{http://www.w3.org/2000/svg}polyline")
    assert len(lines) == 6
    page = files[3].read_text()
    assert "<svg" in page
    # names of a schema and, in a comment, of the library: nothing is loaded
    names = ("http://www.w3.org/2000/svg", "https://github.com/leeoniya/uPlot")
    assert "http" not in page.replace(names[0], "").replace(names[1], "")
    # nothing is left on the farm
    assert farm.line.farm.traces.kept() == []


def test_the_signals_are_listed_with_their_units(farm, pnfarm):
    done = pnfarm("trace", "axis-01", "--list")
    assert done.code == 0
    assert any(line.split()[:3] == ["axis-01", "velocity", "rpm"] for line in done.out.splitlines())
    assert "zsw1.fault_present" in done.out
    assert {one["drive"] for one in json.loads(pnfarm("trace", "all", "--list", "--format", "json").out)["drives"]} == {
        "axis-01", "axis-02",
    }  # fmt: skip


@pytest.mark.parametrize("farm", [lambda: Cell(DRIVES + ONE)], indirect=True)
def test_signals_of_a_device_are_listed_traced_and_written_beside_a_drives(farm, pnfarm, tmp_path):
    listed = pnfarm("trace", "island", "--list").out.splitlines()
    assert ["island", "pressure", "bar", "input", "3.1.0,", "int16"] in [line.split() for line in listed]
    both = json.loads(pnfarm("trace", "all", "--list", "--format", "json").out)["drives"]
    assert [one["drive"] for one in both] == ["axis-1", "axis-2", "island"]
    farm.next = [lambda: None, lambda: farm.line.signals().set({"pressure": 7, "part_present": True})]
    done = pnfarm(
        "trace", "axis-1", "-s", "velocity,island.pressure,island.part_present", "--trigger",
        "island.pressure > 6.5 bar", "--length", "5ms", "-o", tmp_path / "run.csv",
    )  # fmt: skip
    assert done.code == 0, done.err
    assert "trigger island.pressure > 6.5 bar (island)" in done.out
    head, first, *_ = (tmp_path / "run.csv").read_text().splitlines()
    assert head == "time [s],axis-1 velocity [rpm],island pressure [bar],island part_present"
    assert first == "0.000000000,0,7,1"
    wrong = pnfarm("trace", "island", "-s", "pressure", "--trigger", "pressure > 6 rpm")
    assert (wrong.code, "pressure is not measured in rpm; allowed: a number in bar" in wrong.err) == (2, True)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("axis-01", "-s", "velocty"), "did you mean velocity?"),
        (("axis-01",), "--signals is missing"),
        (("axis-9", "-s", "velocity"), "no drive matches 'axis-9', did you mean axis-0"),
        (("axis-9", "--list"), "no drive matches axis-9"),
        (("axis-01", "-s", "velocity", "-o", "run.xls"), ".csv, .json, .svg, .html"),
        (("axis-01", "-s", "velocity", "-o", "/nowhere/at/all/run.csv"), "there is no folder"),
        (("axis-01", "-s", "velocity", "--within", "3"), "--within '3' is not a duration"),
        (("axis-01", "-s", "velocity", "--trigger", "velocity ~ 3"), "is not a trigger"),
    ],
)
def test_wrong_input_is_one_sentence_and_exit_code_2(farm, pnfarm, arguments, words):
    done = pnfarm("trace", *arguments)
    assert done.code == 2
    assert words in " ".join(done.err.split())
    assert farm.line.farm.traces.kept() == []


def test_a_trigger_that_never_comes_ends_with_exit_code_1_and_leaves_nothing(farm, pnfarm):
    done = pnfarm("trace", "all", "-s", "velocity", "--trigger", "fault", "--within", "3s")
    assert done.code == 1
    assert "was not triggered within 3 s" in " ".join(done.err.split())
    assert "waiting for the trigger: fault" in done.err
    assert farm.line.farm.traces.kept() == []


def test_ctrl_c_deletes_the_trace(farm, pnfarm):
    def interrupted() -> None:
        raise KeyboardInterrupt

    farm.next = [interrupted]
    done = pnfarm("trace", "all", "-s", "velocity", "--trigger", "fault")
    assert done.code == 130
    assert farm.line.farm.traces.kept() == []


@pytest.mark.parametrize(("trigger", "code"), [("now", 0), ("fault", 1)])
def test_a_farm_that_is_gone_before_the_trace_is_deleted_costs_neither_recording_nor_reason(
    farm, pnfarm, monkeypatch, trigger, code
):
    def gone(*_: object) -> None:
        raise EnvironmentError_("no farm answers any more")

    monkeypatch.setattr("pnfarm.terminal.client.FarmClient.delete", gone)
    done = pnfarm("trace", "all", "-s", "velocity", "--trigger", trigger, "--length", "10ms", "--within", "3s")
    assert done.code == code
    assert ("samples" in done.out) if code == 0 else ("was not triggered within 3 s" in " ".join(done.err.split()))
