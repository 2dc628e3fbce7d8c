"""A limit on the address space is reported in one sentence before anything starts that would fail."""

from __future__ import annotations

import errno
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from pnfarm.cli.errors import report
from pnfarm.farm.process import address_space
from pnfarm.farm.process.address_space import is_exhausted

DEMO = Path(__file__).resolve().parents[2] / "configs" / "demo.pnfarm.yml"


def limited(kilobytes: int, *line: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["bash", "-c", f'ulimit -v {kilobytes}; exec "$@"', "-", sys.executable, "-m", "pnfarm.cli.main", *line],
        check=False, capture_output=True, text=True, timeout=120,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("kilobytes", "line"),
    [
        (100_000, ("validate", str(DEMO))),
        (200_000, ("models",)),
        (400_000, ("up", str(DEMO))),
        (400_000, ("plc", str(DEMO))),
        (400_000, ("demo",)),
        (400_000, ("bench", "scrape")),
    ],
)
def test_too_little_address_space_is_an_error_in_one_sentence(kilobytes, line):
    found = limited(kilobytes, *line)
    assert (found.returncode, found.stdout) == (4, "")
    (sentence,) = found.stderr.splitlines()
    assert sentence.startswith("pnfarm: the address space is limited to ")
    assert f"(ulimit -v {kilobytes})" in sentence
    assert "ulimit -v unlimited" in sentence


def test_a_command_that_needs_little_runs_with_little():
    found = limited(300_000, "validate", str(DEMO))
    assert found.returncode == 0, found.stderr


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        OSError(errno.ENOMEM, "Cannot allocate memory"),
        RuntimeError("can't start new thread"),
        ImportError("/lib/x.so: failed to map segment from shared object"),
    ],
)
@pytest.mark.parametrize("limit", [1 << 31, resource.RLIM_INFINITY])
def test_memory_that_runs_out_is_the_machines_affair(monkeypatch, capsys, error, limit):
    monkeypatch.setattr(address_space.resource, "getrlimit", lambda _: (limit, limit))
    assert report(error) == 4
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "internal error" not in told
    assert ("ulimit -v 2097152" in told) == (limit == 1 << 31)


@pytest.mark.parametrize(
    "error", [RuntimeError("no"), ImportError("no module"), OSError(errno.EPERM, "no"), KeyError(1)]
)
def test_other_errors_are_not_taken_for_it(error):
    assert is_exhausted(error) is None
