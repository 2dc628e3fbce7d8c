"""``pnfarm demo`` as a newcomer runs it: a process of its own, its output, its JSON, its exit code."""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

import pytest
from machine_code import copy_machine_code

from pnfarm.buses.registry import fault_kinds

KEYS = {
    "name", "model", "mac", "ip", "station_address", "connected", "frames_sent", "frames_received", "cycle_seconds",
    "faults", "recovered",
}  # fmt: skip


def demo(tmp_path: Path, *options: str, **environment: str) -> tuple[str, dict, int]:
    file = tmp_path / "demo.json"
    command = [
        sys.executable,
        "-m",
        "pnfarm.cli.main",
        "demo",
        "--seconds",
        "4",
        "--json",
        str(file),
        *options,
    ]
    run = subprocess.run(
        command,
        capture_output=True,
        text=True,
        timeout=180,
        check=False,
        env={**os.environ, "TMPDIR": str(tmp_path), **environment},
    )
    summary = json.loads(file.read_text()) if file.exists() else {}
    return run.stdout + run.stderr, summary, run.returncode


#: Every model, with a cycle that its manual grants.
CYCLES = {
    "akd-profinet": 0.016,
    "akd-profinet-2012": 0.008,
    "hiwin-e1": 0.004,
    "moog-msd": 0.004,
    "akd-ethernetip": 0.010,
    # measured: a master polls as its line lets it, and a busy machine holds a pty's octets back
    "moog-msd-dp": pytest.approx(0.5, abs=0.4999),
}


#: Of each kind of fault; those of signals need devices.
FAMILY = {name: kind.family for name, kind in fault_kinds().items()}
FAMILIES = set(FAMILY.values()) - {"signals"}

EXPECTATIONS = [
    "the other drives run on",
    "the connection breaks",
    "the PLC connects again",
    "the PLC brings it back",
]


def check(output: str, summary: dict, code: int, drives: int) -> None:
    assert code == 0, output
    assert summary["ok"] is True
    assert len(summary["drives"]) == drives
    for drive in summary["drives"]:
        assert set(drive) == KEYS
        assert drive["connected"]
        assert drive["recovered"]
        assert drive["frames_sent"] > 100
        assert drive["frames_received"] > 100
        assert (drive["station_address"] is None) == bool(drive["ip"])
        assert drive["cycle_seconds"] == CYCLES[drive["model"]]
    if drives >= 8:
        assert {drive["model"] for drive in summary["drives"]} == CYCLES.keys()
    # one of each family; an AKD alone has no sign of life
    faults = [kind for drive in summary["drives"] for kind in drive["faults"]]
    families = [FAMILY[kind] for kind in faults]
    assert sorted(families) == sorted(FAMILIES - {"liveness"} if drives < 3 else FAMILIES)
    assert set(summary["engine"]) == {"cycles", "overruns", "lateness_p50_seconds", "lateness_p99_seconds"}
    assert "F702" in output
    assert "back in operation" in output
    check_scenario(output, summary["scenario"], drives)


def check_scenario(output: str, scenario: dict, drives: int) -> None:
    # on a machine that is busy the farm itself may be late
    assert scenario["verdict"] in {"passed", "inconclusive"}
    assert [case["name"] for case in scenario["expectations"]] == EXPECTATIONS[drives == 1 :]
    report = Path(scenario["report"])
    assert f"scenario cable-pulled: {scenario['verdict']}; report: {report}" in output.splitlines()
    assert "the connection breaks" in report.read_text()


def test_demo_runs_eight_drives_through_a_fault_of_each_family_and_the_recoveries(tmp_path):
    check(*demo(tmp_path), drives=8)


@pytest.mark.parametrize("option", ["--json", "--svg", "--pcap", "--html"])
def test_demo_says_before_it_runs_that_a_file_cannot_be_written(tmp_path, pnfarm, option):
    missing = pnfarm("demo", option, tmp_path / "no" / "file")
    assert (missing.code, missing.out) == (2, "")
    where = f"{tmp_path}/no/file is in {tmp_path}/no, which is not a folder"
    assert missing.err == f"pnfarm: {where}; give the name of a file in a folder that exists\n"
    folder = pnfarm("demo", option, tmp_path)
    name = f"{tmp_path} is a folder; give the name of a file in a folder that exists"
    assert (folder.code, folder.err) == (2, f"pnfarm: {name}\n")


def test_demo_without_any_namespace_runs_in_memory_and_says_so(tmp_path):
    output, summary, code = demo(tmp_path, "--drives", "3", PNFARM_DEMO_MEMORY="1")
    check(output, summary, code, drives=3)
    assert "runs in memory" in output


def test_demo_of_one_drive_gives_it_all_faults(tmp_path):
    output, summary, code = demo(tmp_path, "--drives", "1", PNFARM_DEMO_MEMORY="1")
    check(output, summary, code, drives=1)


def _open_to_all(path: Path) -> bool:
    return all(folder.stat().st_mode & 0o001 for folder in path.resolve().parents)


#: Shows the folder ``$1`` at ``$2`` to the command behind them alone.
SHOWN_AT = 'mount --bind "$1" "$2" && shift 2 && exec "$@"'


def _interpreter(home: Path) -> tuple[list[str], dict[str, str]] | None:
    """How an ordinary user runs this interpreter with this environment's packages; None where others cannot read them.

    An interpreter in a private folder is shown under ``home``.
    """
    if _open_to_all(Path(sys.executable)) and _open_to_all(Path(os.__file__)):
        return [sys.executable], {}
    packages = [sysconfig.get_path("purelib"), str(Path(__file__).resolve().parents[2])]
    if shutil.which("unshare") is None or not all(_open_to_all(Path(package)) for package in packages):
        return None
    place = home / "python"
    place.mkdir(mode=0o755)
    shown = ["unshare", "--mount", "sh", "-c", SHOWN_AT, "sh", sys.base_prefix, str(place)]
    python = place / "bin" / f"python{sys.version_info.major}.{sys.version_info.minor}"
    return [*shown, str(python)], {"PYTHONPATH": os.pathsep.join(packages), "LD_LIBRARY_PATH": str(place / "lib")}


@pytest.mark.interop
def test_demo_needs_no_root():
    if os.geteuid() != 0 or shutil.which("setpriv") is None:
        pytest.skip("needs root and setpriv (util-linux), to become an ordinary user")
    with tempfile.TemporaryDirectory(prefix="pnfarm-demo-") as folder:
        home = Path(folder)
        home.chmod(0o777)
        interpreter = _interpreter(home)
        if interpreter is None:
            pytest.skip("needs packages that everybody may read")
        (*shown, python), extra = interpreter
        # what root compiled, as the user's own: else this is a test of the compiler, which takes a minute
        copy_machine_code(home / "cache" / "pnfarm" / "code")
        subprocess.run(["chown", "-R", "65534:65534", f"{home}/cache"], check=True)
        file = home / "demo.json"
        run = subprocess.run(
            [*shown, "setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", "--no-new-privs",
             "--bounding-set=-all", python, "-m", "pnfarm.cli.main", "demo", "--seconds", "4", "--json", str(file)],
            capture_output=True, text=True, timeout=240, check=False, cwd=home,
            env={**os.environ, **extra, "HOME": str(home), "XDG_CACHE_HOME": f"{home}/cache"},
        )  # fmt: skip
        output = run.stdout + run.stderr
        assert "user and network namespace of its own" in output or "runs in memory" in output, output
        check(output, json.loads(file.read_text()), run.returncode, drives=8)
