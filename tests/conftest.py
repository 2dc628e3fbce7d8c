"""Says at the end what could not be run, and why; with ``PNFARM_REQUIRE_ALL=1`` that is a failure."""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import settings

# A time is no property: the machine may be busy, or the code interpreted.
settings.register_profile("pnfarm", deadline=None)
settings.load_profile("pnfarm")

REQUIRE_ALL = "PNFARM_REQUIRE_ALL"
#: Folders and files whose tests use real time, processes of their own or the kernel's network.
EXCLUSIVE = (
    "api/test_api_limits.py", "api/test_api_page.py", "api/test_api_server.py", "cli", "engine/test_engine_realtime.py",
    "farm/test_farm_library.py",
    "faults/test_fault_real_link.py", "interop", "links", "test_rig_dashboards.py", "test_rig_files.py",
    "test_rig_warm.py",
)  # fmt: skip
_skipped: Counter[tuple[str, str]] = Counter()


def pytest_collection_modifyitems(items):
    exclusive = [Path(__file__).parent / name for name in EXCLUSIVE]
    for item in items:
        if any(item.path.is_relative_to(place) for place in exclusive):
            item.add_marker(pytest.mark.exclusive)


def _note(report):
    if not report.skipped or hasattr(report, "wasxfail"):
        return
    reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
    _skipped[report.nodeid.split("::")[0], reason.removeprefix("Skipped: ")] += 1


def pytest_runtest_logreport(report):
    _note(report)


def pytest_collectreport(report):
    _note(report)


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session, exitstatus):
    required = os.environ.get(REQUIRE_ALL, "") not in {"", "0"}
    if _skipped and required and exitstatus in {pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED}:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter):
    if not _skipped:
        return
    required = os.environ.get(REQUIRE_ALL, "") not in {"", "0"}
    terminalreporter.section("could not run", red=required, bold=True)
    for (place, reason), count in sorted(_skipped.items()):
        tests = "1 test" if count == 1 else f"{count} tests"
        terminalreporter.line(f"could not run {tests} of {place} because: {reason}")
    if required:
        terminalreporter.line(f"{REQUIRE_ALL} is set: that is a failure", red=True)
