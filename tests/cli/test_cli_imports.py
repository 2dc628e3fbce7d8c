"""What a process has imported when it does its work: speed of the short commands, and which terms meet in it."""

import importlib.metadata
import json
import signal
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import licenses
import pytest
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[2]
#: Runs the program and writes the names of the modules that it had imported at its end.
PROGRAM = """
import sys
from pnfarm.cli.main import main
code = main(sys.argv[2:])
with open(sys.argv[1], "w") as out:
    out.write("\\n".join(sys.modules))
sys.exit(code)
"""
FARM = """\
farm: imports
link: {kind: veth}
api: 127.0.0.1:8711
drives: [{name: axis-01, model: akd-profinet, ip: 10.77.0.11/24}]
controller: {name: plc, ip: 10.77.0.1/24, cycle: 16ms, watchdog_factor: 6}
"""


def imported(folder, *line):
    """Top-level modules at the end of a command that ends by itself."""
    out = folder / "modules"
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, out, *line], check=False, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return tops(out)


def tops(file):
    return {name.partition(".")[0] for name in file.read_text().split()}


def started(folder, *line):
    """A command that runs until it is stopped; its modules go into the folder."""
    with (folder / "out").open("w") as out, (folder / "err").open("w") as err:
        return subprocess.Popen([sys.executable, "-c", PROGRAM, folder / "modules", *line], stdout=out, stderr=err)


def stop(process):
    process.send_signal(signal.SIGTERM)
    return process.wait(60)


def wait_for(file, text, process):
    end = time.monotonic() + 240
    while text not in file.read_text():
        assert process.poll() is None, file.read_text()
        assert time.monotonic() < end
        time.sleep(0.05)


def test_a_farm_at_work_has_not_imported_scapy(network, tmp_path):
    """With its API, its metrics, its controller, a capture and a fault."""
    file = tmp_path / "imports.pnfarm.yml"
    file.write_text(FARM)
    folders = [tmp_path / name for name in ("farm", "plc")]
    for folder in folders:
        folder.mkdir()
    farm = started(folders[0], "--log-format", "json", "up", file, "--pcap", tmp_path / "all.pcapng")
    try:
        wait_for(folders[0] / "err", "api listening", farm)
        plc = started(folders[1], "--log-format", "json", "plc", file)
        try:
            wait_for(folders[1] / "err", '"connected"', plc)
            body = json.dumps({"kind": "f702", "on": "all"}).encode()
            headers = {"Content-Type": "application/json"}
            api = "http://127.0.0.1:8711"
            for path in ("/", "/metrics", "/openapi.json", "/api/v1/drives", "/api/v1/events?follow=false"):
                urllib.request.urlopen(f"{api}{path}", timeout=10).read()
            urllib.request.urlopen(urllib.request.Request(f"{api}/api/v1/faults", body, headers), timeout=10).read()
        finally:
            assert stop(plc) == 0
    finally:
        assert stop(farm) == 0
    for folder in folders:
        found = tops(folder / "modules")
        assert "numba" in found
        assert "scapy" not in found
    assert "fastapi" in tops(folders[0] / "modules")
    assert (tmp_path / "all.pcapng").stat().st_size > 1000


def test_decode_reads_with_scapy_and_with_nothing_that_its_terms_forbid(tmp_path):
    capture = tmp_path / "empty.pcap"
    # a classic capture with one LLDP frame
    frame = bytes.fromhex("0180c200000e02000000000188cc") + bytes(46)
    header = bytes.fromhex("d4c3b2a1020004000000000000000000ffff000001000000")
    capture.write_bytes(header + bytes(8) + len(frame).to_bytes(4, "little") * 2 + frame)
    found = imported(tmp_path, "decode", capture)
    assert "scapy" in found
    owners = importlib.metadata.packages_distributions()
    packages = {canonicalize_name(package) for name in found for package in owners.get(name, ())}
    # what comes with pnfarm; what tests bring into the environment is theirs
    ours = packages & licenses.pinned("runtime.txt").keys()
    assert {"scapy", "numpy"} <= ours
    for package in ours:
        terms = licenses.terms(package)
        assert "Apache" not in terms or " OR " in terms or "LLVM-exception" in terms, f"{package}: {terms}"
        assert "GPL-3.0" not in terms, package


@pytest.mark.parametrize("line", [("validate", "configs/demo.pnfarm.yml"), ("fault", "kinds"), ("models",)])
def test_a_short_command_waits_for_no_compiler_and_no_server(tmp_path, monkeypatch, line):
    monkeypatch.chdir(ROOT)
    found = imported(tmp_path, *line)
    assert found.isdisjoint({"numba", "llvmlite", "fastapi", "starlette", "uvicorn", "scapy", "pyroute2", "anyio"})
