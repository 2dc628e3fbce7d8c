"""``pnfarm verify``: a sound package passes, what is broken is named, and the report can be checked by others."""

from __future__ import annotations

import asyncio
import json
import shutil
import subprocess
from contextlib import AbstractAsyncContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from json_schema import wrongs

import pnfarm as package
from pnfarm.cli.commands import verify
from pnfarm.cli.verify import wire
from pnfarm.cli.verify.limits import CYCLES_NS, cycle_figures
from pnfarm.cli.verify.machine import package as package_digest
from pnfarm.cli.verify.report import Answer, Check, CycleFigures, Part, Verdict, report_schema
from pnfarm.cli.verify.run import KNOWN, in_memory, on_wire
from pnfarm.drives import catalogue
from pnfarm.errors import EnvironmentError_, InternalError
from pnfarm.scenario.definition import file as scenario_file
from pnfarm.scenario.own_farm import Outcome

FOLDER = Path(package.__file__).parent
#: Every class of fault, as the checks' names begin.
CLASSES = {
    "timeout", "drive fault", "sign of life", "bad IOPS", "cable pulled", "power cycle", "frame loss", "plant",
    "whole run",
}  # fmt: skip


def titles(step):
    """Of a step and of those inside of it."""
    return [one.values.get("name", "") for one in scenario_file.walk([step])]


def is_wanted(step, classes):
    return step.kind in {"fault", "clear"} or any(name.startswith(("start", *classes)) for name in titles(step))


@pytest.fixture
def broken(tmp_path, monkeypatch):
    """The checks that did not pass, with a farm file or scenario edited and only the steps of some classes."""
    load = scenario_file.load_scenario

    def run(edits: dict[str, str], *classes: str, where: str = "memory.pnfarm.yml") -> dict[str, Check]:
        folder = tmp_path / "a" / "b" / "c" / "known"
        shutil.copytree(KNOWN, folder)
        text = (folder / where).read_text()
        for old, new in edits.items():
            assert old in text
            text = text.replace(old, new)
        text = text.replace("../../../bench/", f"{FOLDER}/bench/")
        (folder / where).write_text(text)
        farm = folder / "memory.pnfarm.yml"
        farm.write_text(farm.read_text().replace("../../../bench/", f"{FOLDER}/bench/"))

        def some(path):
            whole = load(path)
            return replace(whole, steps=tuple(step for step in whole.steps if is_wanted(step, classes)))

        monkeypatch.setattr(scenario_file, "load_scenario", some)
        part = asyncio.run(in_memory(folder))
        assert len(part.checks) >= 5
        return {check.name: check for check in part.checks if check.verdict is not Verdict.PASSED}

    return run


@pytest.mark.slow
def test_a_sound_package_passes_every_check_of_every_model(pnfarm, tmp_path):
    file = tmp_path / "report.json"
    done = pnfarm("verify", "--quick", "--json", file)
    assert done.code == 0, done.out
    report = json.loads(file.read_text())
    schema = report_schema()
    words = {word: value for word, value in schema.items() if not word.startswith("$")}
    assert list(wrongs(report, words, schema)) == []
    (part,) = report["parts"]
    assert (report["verdict"], part["name"], report["seeds"]) == ("passed", "memory", [20261129])
    checks = part["checks"]
    assert {check["name"].partition(":")[0].partition(",")[0] for check in checks} == CLASSES
    assert {check["verdict"] for check in checks} == {"passed"}
    for axis in "ahmped":
        assert sum(f"axis-{axis}" in check["expected"] for check in checks) > 15
    assert all(fault["confirmed"] for fault in part["faults"])
    assert report["left_out"] == ["wire and limits: --quick"]
    assert report["limits"] is None
    assert f"memory: {len(checks)} checks in" in done.out
    assert done.out.endswith("verdict: passed\n")


@pytest.mark.parametrize(
    ("edits", "classes", "named"),
    [
        # a fieldbus watchdog that reports its fault
        ({"10.77.0.13/24,": "10.77.0.13/24, params: {P-1283: 20},"}, ("timeout, axis-m",),
         {"timeout, axis-m: the drive stops without a fault (P-1283 is 0)"}),
        # a drive that tolerates more
        ({"telegram: 3": "telegram: 3, params: {925: 9}"}, ("sign of life",),
         {"sign of life: then the drive reports its fault"}),
        # a machine that moves more slowly
        ({"time: 300ms": "time: 400ms"}, ("timeout, axis-a",), {"plant: the gripper is at its end position"}),
    ],
)  # fmt: skip
def test_a_drive_or_a_plant_that_behaves_otherwise_is_a_difference_with_its_name(broken, edits, classes, named):
    found = broken(edits, *classes)
    assert found.keys() == named
    assert {check.verdict for check in found.values()} == {Verdict.FAILED}


@pytest.fixture
def changed_models(tmp_path, monkeypatch):
    """The folder of the package's models, a copy that may be changed."""
    folder = tmp_path / "models"
    shutil.copytree(catalogue.SHIPPED_FOLDER, folder)
    monkeypatch.setattr(catalogue, "SHIPPED_FOLDER", folder)
    catalogue._entries.cache_clear()
    yield folder
    catalogue._entries.cache_clear()


def test_a_model_whose_data_was_changed_in_the_package_is_a_difference_of_its_drive(broken, changed_models):
    file = changed_models / "kollmorgen_akd" / "profinet" / "2017" / "model.toml"
    file.write_text(file.read_text().replace("fault = { value = 702,", "fault = { value = 602,"))
    found = broken({}, "timeout, axis-a")
    (check,) = found.values()
    assert check.name == "timeout, axis-a: the drive reports its fault"
    assert check.expected == "axis-a: fault == 702, within 8ms"
    assert "not true within 8ms on axis-a (axis-a: fault = 602)" in check.observed


def test_a_drive_that_is_disturbed_by_another_ones_fault_is_a_difference(broken):
    impair = "address: 11, impair: [{kind: link-down, after: 1900ms, for: 300ms}]"
    found = broken({"address: 11": impair}, "drive fault")
    assert any(name.startswith("drive fault: no other drive is disturbed") for name in found)
    assert any("axis-d" in check.observed for check in found.values())


def test_another_seed_loses_other_frames(broken):
    found = broken({"seed: 20261129": "seed: 7"}, "frame loss", where="memory.scenario.yml")
    check = found["frame loss: of axis-h"]
    assert check.observed.startswith("increases ")
    assert check.expected.startswith('pnfarm_frames_received_total{drive="axis-h"} increases ==')


# -- the report


def part(*verdicts: Verdict) -> Part:
    checks = [Check(name=f"check {n}", line=n, expected="x", observed="y", verdict=v) for n, v in enumerate(verdicts)]
    verdict = Verdict.FAILED if Verdict.FAILED in verdicts else Verdict(max(verdicts, key=list(Verdict).index))
    return Part(
        name="memory", scenario="s", verdict=verdict, seconds=1.0, runs=1, late_seconds=None, stalls=None,
        checks=checks, faults=[],
    )  # fmt: skip


@pytest.fixture
def found(monkeypatch):
    """What the runs find, without running."""

    def set_to(memory: Part, answer: Answer | None = None) -> None:
        async def run() -> Part:
            return memory

        monkeypatch.setattr("pnfarm.cli.verify.run.in_memory", run)
        monkeypatch.setattr("pnfarm.cli.commands.verify._on_wire", lambda: answer or Answer())
        monkeypatch.setattr("pnfarm.farm.doctor.machine.examine", list)
        monkeypatch.setattr("pnfarm.cli.verify.limits.measured_costs", lambda: (2000.0, 1000.0, ""))

    return set_to


@pytest.mark.parametrize(
    ("verdicts", "code"),
    [
        ((Verdict.PASSED,), 0),
        ((Verdict.PASSED, Verdict.FAILED, Verdict.INCONCLUSIVE), 1),
        ((Verdict.PASSED, Verdict.INCONCLUSIVE), 3),
    ],
)
def test_the_exit_code_says_whether_all_was_as_expected(pnfarm, found, verdicts, code):
    found(part(*verdicts))
    done = pnfarm("verify", "--quick")
    assert done.code == code
    assert done.out.endswith(f"verdict: {'passed' if code == 0 else 'failed' if code == 1 else 'inconclusive'}\n")


def test_what_was_left_out_is_named_with_the_reason_and_does_not_fail(pnfarm, found, tmp_path):
    found(part(Verdict.PASSED), Answer(left_out=["wire and shortest cycle: not permitted"]))
    done = pnfarm("verify", "--json", tmp_path / "r.json")
    assert done.code == 0
    assert "shortest cycle that" not in done.out
    assert "left out: wire and shortest cycle: not permitted" in done.out.splitlines()
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["left_out"] == ["wire and shortest cycle: not permitted"]
    # 0.6 of a processor, two frames and a step for each
    assert report["limits"]["drives_at_1_ms"] == 120
    assert "drives with 1 ms: about 120, an estimate" in done.out


def test_a_machine_without_a_private_network_is_reported_with_the_reason(monkeypatch, capsys):
    def refuse(near: str, far: str) -> None:
        raise EnvironmentError_("no namespace for you")

    monkeypatch.setattr("pnfarm.cli.verify.wire.enter_private_line", refuse)
    assert wire.main() == 0
    answer = Answer.model_validate_json(capsys.readouterr().out)
    assert (answer.part, answer.cycles) == (None, [])
    (reason,) = answer.left_out
    assert reason.startswith("wire and shortest cycle: ")
    assert reason.endswith("no namespace for you")


@pytest.fixture
def answered(monkeypatch):
    """What the command takes from a process that said this and ended with this code, or never."""

    def take(said: str, code: int | None) -> Answer:
        def run(program: list[str], **_: Any) -> Any:
            if code is None:
                raise subprocess.TimeoutExpired(program, 300, said.encode() or None)
            return subprocess.CompletedProcess(program, code, said.encode())

        with monkeypatch.context() as patch:
            patch.setattr(verify.subprocess, "run", run)
            return verify._on_wire()

    return take


def test_a_wire_that_does_not_come_to_an_end_has_not_passed(pnfarm, found, answered):
    answer = answered("", None)
    assert answer.left_out == ["wire and shortest cycle: not at an end after 300 s"]
    found(part(Verdict.PASSED), answer)
    assert pnfarm("verify").code == 3


@pytest.mark.parametrize(("code", "why"), [(None, "not at an end after 300 s"), (-9, "its process ended with code -9")])
def test_the_part_on_the_wire_counts_also_if_the_limits_are_not_measured(answered, code, why):
    failed = Answer(part=part(Verdict.FAILED))
    answer = answered(f"{failed.model_dump_json()}\n", code)
    assert (answer.part, answer.left_out) == (failed.part, [f"shortest cycle: {why}"])


@pytest.mark.parametrize("error", [InternalError("16 stations did not connect"), FileNotFoundError(2, "none", "ip")])
def test_limits_that_cannot_be_measured_leave_the_verdict_on_the_wire(monkeypatch, capsys, error):
    def refuse() -> None:
        raise error

    for name in ("enter_private_line", "create_cable"):
        monkeypatch.setattr(wire, name, lambda near, far: None)
    monkeypatch.setattr(wire, "_known_farm", lambda: part(Verdict.FAILED))
    monkeypatch.setattr(wire, "_cycles", refuse)
    assert wire.main() == 0
    answer = Answer.model_validate_json(capsys.readouterr().out.splitlines()[-1])
    assert (answer.part, answer.left_out) == (part(Verdict.FAILED), [f"shortest cycle: {error}"])


def test_the_shortest_cycle_is_shown_beside_the_floor_and_the_load_of_others(pnfarm, found):
    cycles = [figures(1_000_000, held=True), figures(500_000, held=False).model_copy(update={"others_cores": 1.5})]
    found(part(Verdict.PASSED), Answer(cycles=cycles))
    lines = pnfarm("verify").out.splitlines()
    assert "shortest cycle that this machine holds: 1 ms" in lines
    assert "other programs ran meanwhile: measure again on an idle machine" in lines
    (row,) = (line for line in lines if line.startswith("500 us"))
    assert row.split()[-3:] == ["cores", "not", "held"]


def test_the_digest_is_that_of_coreutils_and_changes_with_a_file(tmp_path):
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "__pycache__").mkdir()
    (tmp_path / "b" / "__pycache__" / "x.pyc").write_bytes(b"compiled")
    (tmp_path / "machine_code").mkdir()
    (tmp_path / "machine_code" / "x.nbc").write_bytes(b"compiled")
    (tmp_path / "b" / "x.py").write_text("one")
    (tmp_path / "b.py").write_text("two")
    script = (
        "find . -type f -not -path '*/__pycache__/*' -not -path './machine_code/*' "
        "| LC_ALL=C sort | xargs sha256sum | sha256sum"
    )
    said = subprocess.run(["sh", "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert package_digest(tmp_path).sha256 == said.split()[0]
    assert package_digest(tmp_path).files == 2
    (tmp_path / "b" / "x.py").write_text("three")
    assert package_digest(tmp_path).sha256 != said.split()[0]


# -- the signature


@pytest.fixture
def key(tmp_path):
    if shutil.which("ssh-keygen") is None:
        pytest.skip("needs ssh-keygen")
    path = tmp_path / "key"
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", path], check=True)
    return path


def test_a_signed_report_is_checked_with_the_public_key_and_a_changed_one_is_refused(pnfarm, found, tmp_path, key):
    found(part(Verdict.PASSED))
    file, signature, allowed = (tmp_path / name for name in ("r.json", "r.json.sig", "allowed"))
    signature.write_text("an older one")
    done = pnfarm("verify", "--quick", "--json", file, "--sign", key)
    assert done.code == 0, done.err
    assert done.out.splitlines()[-1] == f"signature: {signature}"
    allowed.write_text(f"tester {key.with_suffix('.pub').read_text()}")
    check = ["ssh-keygen", "-Y", "verify", "-f", allowed, "-I", "tester", "-n", "pnfarm-verify", "-s", signature]

    def is_good() -> bool:
        return subprocess.run(check, input=file.read_bytes(), capture_output=True, check=False).returncode == 0

    assert is_good()
    file.write_text(file.read_text().replace('"passed"', '"failed"', 1))
    assert not is_good()


def test_a_key_that_cannot_sign_is_refused_in_a_sentence(pnfarm, found, tmp_path, monkeypatch):
    found(part(Verdict.PASSED))
    file, wrong = tmp_path / "r.json", tmp_path / "key"
    done = pnfarm("verify", "--quick", "--sign", wrong)
    assert (done.code, done.err) == (
        2, "pnfarm: invalid value for --sign: signs the JSON file; add --json FILE; see `pnfarm verify --help`\n"
    )  # fmt: skip
    done = pnfarm("verify", "--quick", "--json", file, "--sign", wrong)
    assert done.code == 2
    assert f"--sign {wrong} is not a file that can be read" in done.err
    wrong.write_text("no key")
    wrong.chmod(0o600)
    if shutil.which("ssh-keygen") is not None:
        done = pnfarm("verify", "--quick", "--json", file, "--sign", wrong)
        assert done.code == 2
        assert f"{wrong} cannot sign {file}: " in done.err.splitlines()[-1]
    monkeypatch.setattr("shutil.which", lambda name: None)
    done = pnfarm("verify", "--quick", "--json", file, "--sign", wrong)
    assert (done.code, done.err) == (
        4, "pnfarm: --sign needs ssh-keygen, which is not installed; it belongs to OpenSSH's client\n"
    )  # fmt: skip


def test_a_report_that_cannot_be_written_is_refused_before_the_run(pnfarm, tmp_path):
    done = pnfarm("verify", "--json", tmp_path / "no" / "file")
    assert (done.code, done.out) == (2, "")
    assert "which is not a folder" in done.err


def test_a_report_that_cannot_be_written_in_the_end_is_printed_nevertheless(pnfarm, found):
    found(part(Verdict.FAILED))
    done = pnfarm("verify", "--quick", "--json", "/dev/full")
    assert (done.code, done.err.splitlines()[-1]) == (4, "pnfarm: /dev/full cannot be written: no space left on device")
    assert done.out.endswith("verdict: failed\n")


# -- the limits


@pytest.mark.parametrize(
    ("holds_from_ns", "tried", "held"),
    [
        (0, [1_000_000, 500_000, 250_000], 250_000),
        (500_000, [1_000_000, 500_000, 250_000], 500_000),
        (1_000_000, [1_000_000, 500_000], 1_000_000),
        (4_000_000, [1_000_000, 2_000_000, 4_000_000], 4_000_000),
        (8_000_000, [1_000_000, 2_000_000, 4_000_000], None),
    ],
)
def test_the_shortest_cycle_that_is_held_is_searched_from_1_ms(holds_from_ns, tried, held):
    found, missing = cycle_figures(lambda: 0.0, lambda cycle_ns: figures(cycle_ns, held=cycle_ns >= holds_from_ns))
    assert [round(one.cycle_seconds * 1e9) for one in found] == tried
    assert min((round(one.cycle_seconds * 1e9) for one in found if one.held), default=None) == held
    assert missing == []
    assert set(tried) <= set(CYCLES_NS)


def test_a_slow_machine_measures_fewer_cycles_and_says_so():
    times = iter(range(0, 10_000, 100))
    found, missing = cycle_figures(lambda: float(next(times)), lambda cycle_ns: figures(cycle_ns, held=True))
    assert [one.cycle_seconds for one in found] == [0.001]
    assert missing == ["cycle of 500us: the measurements took long enough"]


def figures(cycle_ns: int, *, held: bool) -> CycleFigures:
    return CycleFigures(
        cycle_seconds=cycle_ns / 1e9, drives=1, seconds=1.0, lateness_p50_seconds=0.0, lateness_p99_seconds=0.0,
        lateness_max_seconds=0.0, floor_p99_seconds=0.0, stalls=0, lost_connections=0, others_cores=0.0, held=held,
    )  # fmt: skip


# -- the part on the wire


@pytest.mark.parametrize(("verdicts", "runs"), [(["inconclusive", "passed"], 2), (["inconclusive"] * 3, 3)])
def test_a_machine_that_stalls_gets_three_runs(monkeypatch, verdicts, runs):
    left = list(verdicts)

    class Controllers(AbstractAsyncContextManager):
        def __init__(self, config, log):
            del config, log

        async def __aexit__(self, *_):
            return None

    async def started(binding, config, opened):
        del config, opened
        number = next(number for number, step in enumerate(binding.scenario.every_step()) if step.kind == "expect")
        case = {"number": number, "name": "check", "line": 1, "verdict": left.pop(0), "measured": "", "message": "late"}
        late = {"farm_late_seconds": 0.5, "overruns": 7}
        return Outcome({"cases": [case], "faults": [], "seconds": 1.0, "lateness": late}, 0)

    monkeypatch.setattr("pnfarm.controller.runtime.Plc", Controllers)
    monkeypatch.setattr("pnfarm.scenario.own_farm.run_started", started)
    found = asyncio.run(on_wire())
    assert (found.runs, found.verdict.value, left) == (runs, verdicts[runs - 1], [])
    assert (found.late_seconds, found.stalls) == (0.5, 7)
