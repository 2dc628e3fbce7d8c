"""PLC programs of one's own: what each of ``configs/programs`` does to drives, and what a wrong file or call does."""

from __future__ import annotations

import asyncio
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Self

import pytest

from pnfarm.controller.line import VirtualLine
from pnfarm.controller.program_file import load_program
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import FarmFileError, parse_farm
from pnfarm.station.event_log import EventLog
from pnfarm.table.signals import ZSW2

PROGRAMS = Path(__file__).parents[2] / "configs" / "programs"
MODELS = {"akd-profinet": (1, "16ms"), "akd-profinet-2012": (1, "16ms"), "hiwin-e1": (3, "2ms"), "moog-msd": (2, "4ms")}
FILE = """
farm: programs
link: {{kind: memory}}
drives:
  - {{name: "axis-{{n:02}}", count: {drives}, model: {model}, telegram: {telegram}, ip: 10.77.0.11/24}}
controller:
  ip: 10.77.0.1/24
  cycle: {cycle}
  program: {{python: "{program}"{more}}}
"""
HEAD = "from pnfarm import AxisProgram\n\n\nclass Mine(AxisProgram):\n    def cycle(self, inputs, outputs, now):\n"


class Rig:
    """``run`` a program against drives; ``state`` and ``word`` of a drive."""

    def __init__(self, program: Path, *, model: str = "akd-profinet", drives: int = 1, more: str = "") -> None:
        telegram, cycle = MODELS[model]
        text = FILE.format(drives=drives, model=model, telegram=telegram, cycle=cycle, program=program, more=more)
        self.log = EventLog(quiet=True)
        self.line = asyncio.run(VirtualLine.create(parse_farm(text), plc_log=self.log))
        self.world, self.plc = self.line.world, self.line.plc

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        asyncio.run(self.line.close())

    def start(self) -> None:
        assert self.world.run(10, until=lambda: self.plc.all_running), self.plc.snapshot()
        self.world.run(0.5)

    def wait(self, condition, within: float = 5.0) -> bool:
        return self.world.run(within, until=condition, look_ns=1_000_000)

    def inject(self, kind: str, on: str = "axis-01") -> str:
        return self.line.farm.injections.inject({"kind": kind, "on": on}, self.world.now).id

    def axis(self, number: int = 0):
        return self.line.farm.columns.axis[number]

    def state(self, number: int = 0) -> int:
        return int(self.axis(number).drive.state)

    def faulty(self, number: int = 0) -> bool:
        return bool(self.axis(number).faults.code[0])

    def failure(self, name: str = "axis-01") -> str:
        return self.line.programs.snapshot(name)["failure"]


def trip(rig: Rig) -> None:
    model = rig.line.farm.axes[0].model.name
    fault = {"hiwin-e1": "AL.FB1", "moog-msd": "32-1"}.get(model, "702")
    fields = {"kind": "drive-fault", "on": "axis-01", "params": {"fault": fault}, "count": 1}
    rig.line.farm.injections.inject(fields, rig.world.now)
    assert rig.wait(rig.faulty)


@pytest.mark.parametrize("model", MODELS)
def test_the_right_program_runs_every_model_and_brings_it_back_behind_a_fault(model):
    with Rig(PROGRAMS / "right.py", model=model) as rig:
        rig.start()
        assert float(rig.axis().motor.velocity) == pytest.approx(60, abs=1)
        assert rig.line.programs.line["axis-01"].inputs.velocity == pytest.approx(60, abs=1)
        trip(rig)
        assert rig.wait(lambda: rig.state() == 4 and not rig.faulty())
        assert rig.line.programs.snapshot("axis-01")["errors"] == 0


def test_a_program_that_never_acknowledges_leaves_the_axis_down():
    with Rig(PROGRAMS / "never_acknowledges.py") as rig:
        rig.start()
        trip(rig)
        assert not rig.wait(lambda: not rig.faulty(), 10)
        assert rig.state() != 4


def test_a_program_that_acknowledges_blindly_clears_the_fault_at_once_and_pulses_for_ever():
    with Rig(PROGRAMS / "acknowledges_blindly.py") as rig:
        rig.start()
        trip(rig)
        assert rig.wait(lambda: not rig.faulty(), 0.3)
        words = set()
        rig.wait(lambda: bool(words.add(int(rig.plc.columns.program[0].stw1) & 0x80)), 1)
        assert words == {0, 0x80}


def test_a_program_that_ignores_the_fault_keeps_enable_and_set_point():
    with Rig(PROGRAMS / "ignores_fault.py") as rig:
        rig.start()
        trip(rig)
        rig.world.run(3)
        assert rig.faulty()
        assert int(rig.plc.columns.program[0].stw1) == 0x047F
        assert rig.line.programs.line["axis-01"].outputs.velocity == pytest.approx(60, abs=0.1)


def test_a_program_without_the_edge_acknowledges_and_the_drive_stays_inhibited():
    with Rig(PROGRAMS / "no_edge.py") as rig:
        rig.start()
        trip(rig)
        assert rig.wait(lambda: not rig.faulty())
        assert not rig.wait(lambda: rig.state() == 4, 5)
        assert rig.state() == 1


@pytest.mark.parametrize(("program", "stops"), [("restarts_line.py", True), ("right.py", False)])
def test_only_the_program_that_restarts_the_line_stops_the_healthy_axis(program, stops):
    with Rig(PROGRAMS / program, drives=2) as rig:
        rig.start()
        trip(rig)
        assert rig.wait(lambda: rig.state(1) != 4, 3) is stops
        assert rig.wait(lambda: rig.state(0) == 4 and rig.state(1) == 4)


@pytest.mark.parametrize(("program", "stops"), [("no_sign_of_life.py", False), ("right.py", True)])
def test_only_the_program_that_watches_the_sign_of_life_stops_a_drive_that_froze(program, stops):
    with Rig(PROGRAMS / program, model="moog-msd") as rig:
        rig.start()
        image = rig.plc.columns.image[0]
        life = int(image.received[ZSW2])
        assert life >> 12
        # a drive that froze: its telegrams arrive, with the same sign of life in each
        inputs = rig.line.programs.line["axis-01"].inputs
        read = type(inputs).__getattr__
        frozen = inputs.zsw2

        class Frozen(type(inputs)):
            def __getattr__(self, name):
                return frozen if name == "zsw2" else read(self, name)

        inputs.__class__ = Frozen
        assert rig.wait(lambda: rig.state() != 4, 2) is stops


def test_words_have_the_models_bits_and_units_and_say_what_is_wrong(tmp_path):
    with Rig(PROGRAMS / "right.py") as rig:
        rig.start()
        inputs, outputs = (getattr(rig.line.programs.line["axis-01"], side) for side in ("inputs", "outputs"))
        assert inputs.zsw1.operation_enabled is True
        assert inputs.zsw1.bit_2 is True
        assert inputs["ZSW1"] == int(inputs.zsw1) == inputs.zsw1
        assert "operation_enabled" in inputs.zsw1.bits
        with pytest.raises(AttributeError, match="did you mean fault_present"):
            inputs.zsw1.fault_presnt  # noqa: B018 - the access is the test
        with pytest.raises(AttributeError, match=r"did you mean nist_a.*it has zsw1, nist_a"):
            inputs.nist_q  # noqa: B018 - the access is the test
        with pytest.raises(AttributeError, match="comes from the drive"):
            inputs.zsw1.fault_present = True
        with pytest.raises(ValueError, match="16 bits"):
            outputs.stw1 = 0x10000
        with pytest.raises(ValueError, match="not a number in rpm"):
            outputs.nsoll_a = float("nan")
        with pytest.raises(ValueError, match="not a whole number"):
            outputs.stw1 = 1.5
        outputs.nsoll_a = 1e9
        assert outputs["NSOLL_A"] == 0x7FFF
        outputs.nsoll_a = -60.0
        assert outputs.velocity == pytest.approx(-60, abs=0.2)
        outputs.stw1 = 0
        outputs.stw1.on = True
        assert outputs["STW1"] == 1


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("def x(:\n", r"mine.py:1: invalid syntax"),
        ("import pnfarm\n\nx = 1 / 0\n", r"mine.py:3: ZeroDivisionError: division by zero"),
        ("import sys\nsys.exit(3)\n", r"mine.py:2: SystemExit: 3"),
        ("x = 1\n", r"mine.py has no class derived from pnfarm.AxisProgram"),
        ("from pnfarm import AxisProgram\nclass A(AxisProgram): pass\n", r"class A has no method cycle"),
        (HEAD.replace(", now", "") + "        pass\n", r"mine.py:5: Mine needs cycle\(self, inputs, outputs, now\)"),
        (HEAD.replace("def cycle", "async def cycle") + "        pass\n", r"mine.py:5: .*neither `async`"),
        (HEAD + "        pass\nclass B(AxisProgram):\n    cycle = Mine.cycle\n", r"classes Mine, B; choose one"),
        (HEAD + "        pass\n    def __init__(self, a): pass\n", r"mine.py:7: Mine needs __init__\(self\)"),
        ("\0", r"mine.py:1: .*null"),
        ("x = '\xff'\n".encode("latin-1"), r"mine.py:1: .*(utf-8|Non-UTF)"),
    ],
)
def test_what_is_wrong_with_a_program_file_is_one_sentence_with_its_line(tmp_path, source, message):
    file = tmp_path / "mine.py"
    file.write_bytes(source if isinstance(source, bytes) else source.encode())
    with pytest.raises(ConfigError, match=message) as raised:
        load_program(file)
    assert "\n" not in str(raised.value)


def test_a_missing_file_and_a_missing_class_are_told(tmp_path):
    with pytest.raises(ConfigError, match=r"none\.py cannot be read: no such file"):
        load_program(tmp_path / "none.py")
    with pytest.raises(ConfigError, match=r"no class 'Righ'.*did you mean Right"):
        load_program(PROGRAMS / "right.py", "Righ")


def test_keys_of_built_in_programs_do_not_go_with_a_file():
    with pytest.raises(FarmFileError, match="speed_rpm: does not go with `python`"):
        parse_farm(FILE.format(drives=1, model="akd-profinet", telegram=1, cycle="16ms", program="x.py",
                               more=", speed_rpm: 5"))  # fmt: skip


def test_an_exception_stops_its_axis_alone_with_its_line_told_once(tmp_path):
    file = tmp_path / "mine.py"
    right = (PROGRAMS / "right.py").read_text()
    file.write_text(right.replace("        outputs.stw1, outputs.velocity = OFF, 0.0\n",
                                  "        if self.name == 'axis-01' and self.seconds > 2:\n            {}['gone']\n"
                                  "        outputs.stw1, outputs.velocity = OFF, 0.0\n"))  # fmt: skip
    line_number = file.read_text().split("{}['gone']")[0].count("\n") + 1
    with Rig(file, drives=2) as rig:
        rig.start()
        assert rig.wait(lambda: rig.state() != 4, 5)
        rig.world.run(2)
        assert not rig.faulty(), "the drive ramped down; it did not trip"
        assert float(rig.axis().motor.velocity) == pytest.approx(0, abs=0.5)
        assert rig.state(1) == 4
        assert rig.failure() == f"{file}:{line_number}: KeyError: 'gone'"
        failed = [entry for entry in rig.log.entries("axis-01") if entry.event == "axis program failed"]
        assert [entry.data["line"] for entry in failed] == [line_number]
        assert rig.line.programs.snapshot("axis-01")["errors"] == 1
        assert rig.failure("axis-02") == ""


#: Calls that would not return: each is ended or left behind, so none of them makes a test wait.
ENDLESS = {
    "a loop": "while True: pass",
    "a wait": "import time; time.sleep(3600)",
    "a lock": "import threading; lock = threading.Lock(); lock.acquire(); lock.acquire()",
    "a loop that catches everything": """
            while True:
                try:
                    while True:
                        try:
                            sum(range(20))
                        except:
                            pass
                except BaseException:
                    continue""",
}


@pytest.mark.parametrize("loop", ENDLESS.values(), ids=ENDLESS)
def test_a_call_that_does_not_return_stops_its_axis_and_not_the_others(tmp_path, loop):
    file = tmp_path / "mine.py"
    right = (PROGRAMS / "right.py").read_text()
    file.write_text(right.replace("        outputs.stw1, outputs.velocity = OFF, 0.0\n",
                                  f"        if self.name == 'axis-01' and self.seconds > 2:\n            {loop}\n"
                                  "        outputs.stw1, outputs.velocity = OFF, 0.0\n"))  # fmt: skip
    with Rig(file, drives=2, more=", limit: 300ms") as rig:
        rig.start()
        assert rig.wait(lambda: rig.state() != 4, 5)
        rig.world.run(1)
        assert "cycle() did not return within 0.3 s" in rig.failure()
        assert rig.failure("axis-02") == ""
        assert rig.state(1) == 4


@pytest.mark.parametrize("name", ["a loop", "a lock"])
def test_a_call_that_does_not_return_stops_its_axis_where_no_signal_can_end_it(tmp_path, name):
    with ThreadPoolExecutor(1) as other:
        other.submit(
            test_a_call_that_does_not_return_stops_its_axis_and_not_the_others, tmp_path, ENDLESS[name]
        ).result()


def test_a_failing_call_of_a_method_that_is_no_function_stops_its_axis_alone(tmp_path):
    program = tmp_path / "mine.py"
    program.write_text(
        """from functools import partial

from pnfarm import AxisProgram


class Logged:
    def __init__(self, call):
        self.call = call

    def __get__(self, one, kind=None):
        return self if one is None else partial(self.call, one)

    def __call__(self, one, inputs, outputs, now):
        return self.call(one, inputs, outputs, now)


class Mine(AxisProgram):
    @Logged
    def cycle(self, inputs, outputs, now):
        outputs.speed = 1
"""
    )
    with Rig(program) as rig:
        assert rig.wait(rig.failure)
        assert rig.failure().startswith(f"{program}:20: AttributeError: ")


def test_a_program_may_use_dataclasses_and_a_module_beside_it(tmp_path):
    (tmp_path / "speeds_beside.py").write_text("SPEED = 5.0\n")
    (tmp_path / "mine.py").write_text(
        "from __future__ import annotations\nfrom dataclasses import dataclass\nfrom speeds_beside import SPEED\n"
        "@dataclass\nclass Thing:\n    x: int = 1\n" + HEAD + "        outputs.velocity = SPEED\n"
    )
    assert load_program(tmp_path / "mine.py").__name__ == "Mine"
