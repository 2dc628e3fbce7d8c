"""Says at the end what could not be run, and why; with ``PNFARM_REQUIRE_ALL=1`` that is a failure."""

from __future__ import annotations

import functools
import gc
import os
import random
import sys
import time
import types
from collections import Counter
from pathlib import Path

import pytest
from _pytest.runner import runtestprotocol
from hypothesis import HealthCheck, settings
from hypothesis.database import DirectoryBasedExampleDatabase

# A time is no property: the machine may be busy, or the code interpreted.  Nor is how often a draw is filtered out.
# What failed once is tried again on this machine, by any checkout: a clone of CI is new each time.
EXAMPLES = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "pnfarm" / "examples"
settings.register_profile(
    "pnfarm",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
    database=DirectoryBasedExampleDatabase(EXAMPLES),
)
settings.load_profile("pnfarm")

REQUIRE_ALL = "PNFARM_REQUIRE_ALL"
TESTS = Path(__file__).resolve().parent
#: Folders and files whose tests use real time or the kernel's network; the replay takes what all others kept.
EXCLUSIVE = (
    "api/test_api_limits.py", "api/page/test_api_page.py", "api/page/test_api_page_devices.py",
    "api/page/test_api_page_plant.py",
    "api/test_api_server.py", "api/test_api_tls.py", "buses/profibus/test_profibus_line.py",
    "cli/test_cli_attacked.py", "cli/test_cli_bench.py", "cli/test_cli_client.py", "cli/test_cli_demo.py",
    "cli/test_cli_log_limit.py", "cli/test_cli_memory.py", "cli/test_cli_run_library.py",
    "cli/test_cli_run_rigs.py", "cli/test_cli_running.py", "cli/test_cli_verify_wire.py",
    "engine/test_engine_realtime.py", "engine/test_engine_replay.py", "farm/test_farm_library.py",
    "farm/test_machine_failures.py", "farm/test_postgres_memory.py", "library/test_library_real.py",
    "testing/test_pytest_examples.py", "faults/test_fault_real_link.py", "interop", "links", "opcua/test_opcua_farm.py",
    "soak/test_soak_real.py", "test_rig_dashboards.py",
    "test_rig_files.py",
)  # fmt: skip
#: Files in those folders that live in memory and virtual time after all.
SHARED = (
    "interop/test_interop_captures.py", "interop/test_interop_edcon.py", "interop/test_interop_everything.py",
    "interop/test_interop_gsdml.py", "links/test_links_memory.py", "links/test_links_network_down.py",
    "links/test_links_pcap_files.py", "links/test_links_wrappers.py",
)  # fmt: skip
#: Files of which those tests are exclusive that take one of ``EXCLUSIVE_FIXTURES``.
MIXED = (
    "cli/test_cli_decode.py", "cli/test_cli_import_check.py", "cli/test_cli_imports.py", "cli/test_cli_lease.py",
    "cli/test_cli_plant.py",
    "cli/test_cli_scan.py", "cli/test_cli_shards.py", "farm/test_farm_parameter_words.py",
)  # fmt: skip
#: Fixtures that start what runs in real time.
EXCLUSIVE_FIXTURES = {"background", "network", "shared_background"}
#: Folders whose tests call nothing that is compiled: they run beside the compiler.
UNCOMPILED = ("protocols", "wire")
_skipped: Counter[tuple[str, str]] = Counter()
#: How often a test of real time runs at most, where the machine stalled while it failed.
TRIES = 3


def _within(path, names):
    return any(path.is_relative_to(TESTS / name) for name in names)


@functools.cache
def _place(path):
    """Of a file's tests: all are exclusive, some are, they call nothing that is compiled."""
    alone = _within(path, EXCLUSIVE) and not _within(path, SHARED)
    return alone, _within(path, MIXED), _within(path, UNCOMPILED)


def pytest_collection_modifyitems(items):
    for item in items:
        alone, mixed, uncompiled = _place(item.path)
        real_time = not EXCLUSIVE_FIXTURES.isdisjoint(item.fixturenames)
        if real_time and not (alone or mixed):
            # the part for exclusive tests collects no other files
            raise pytest.UsageError(f"{item.nodeid} runs in real time: name its file in tests/conftest.py")
        if alone or real_time:
            item.add_marker(pytest.mark.exclusive)
        if uncompiled:
            item.add_marker(pytest.mark.uncompiled)
    # the longest ones first: the others are spread over the cores that are free
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)


@pytest.fixture(autouse=True)
def _seeds_of_faults(request, monkeypatch):
    """A fault to which a test gives no seed has the same one in each run: what fails by chance fails again."""
    start = sys.modules.get("pnfarm.faults.start")
    if start is not None:
        same = types.SimpleNamespace(randbits=random.Random(request.node.nodeid).getrandbits)
        monkeypatch.setattr(start, "secrets", same)


@pytest.fixture(autouse=True)
def _no_lines_held_back():
    """What the log holds back of a test is not written in a later one, which may have set up its own."""
    yield
    logs = sys.modules.get("pnfarm.cli.log.setup")
    if logs is not None:
        logs._flush()


class RepeatStalled:
    """Runs a failed test of real time again, with new fixtures, if the machine stalled since they were made.

    Such a failure says nothing: a farm calls it inconclusive, too.  One on a machine that did not stall counts.
    """

    def __init__(self):
        self._watch = None
        self._began = {}
        self.repeated = []

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item, nextitem):
        if item.get_closest_marker("exclusive") is None:
            return None
        if self._watch is None:
            # here, because `python -m tests` imports this module without pytest's paths
            from stalls import StallWatch

            self._watch = StallWatch()
        item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
        for left in reversed(range(TRIES)):
            # what a module's fixtures hold may be older than the test
            since = self._began.setdefault(item.path, time.monotonic())
            reports = runtestprotocol(item, nextitem=nextitem, log=False)
            stalled = self._watch.longest(since)
            if not left or not stalled or not any(report.failed for report in reports):
                break
            self.repeated.append(f"{item.nodeid}: it failed, and the machine had stalled for {stalled * 1000:.0f} ms")
            if not getattr(item.module, "KEEPS_FIXTURES", False):
                item.session._setupstate.teardown_exact(None)
                del self._began[item.path]
        for report in reports:
            item.ihook.pytest_runtest_logreport(report=report)
        item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
        return True

    def pytest_sessionfinish(self):
        if self._watch is not None:
            self._watch.close()

    def pytest_terminal_summary(self, terminalreporter):
        if self.repeated:
            terminalreporter.section("repeated")
        for line in self.repeated:
            terminalreporter.line(line)


def pytest_configure(config):
    config.pluginmanager.register(RepeatStalled())


def pytest_collection_finish():
    # eight thousand tests and the modules stay until the end: no collection of garbage needs to look at them
    gc.collect()
    gc.freeze()


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
