"""The pytest plugin: the fixtures ``pnfarm_farm`` and ``pnfarm_rig``.  Nothing is imported before a test asks for one.

::

    def test_the_axis_runs(pnfarm_farm):  # in memory, in virtual time
        line = pnfarm_farm("axis-01", model="hiwin-e1")
        line.wait_running()


    def test_the_plc_brings_it_back(pnfarm_rig):  # pytest --pnfarm-rig line-1.pnfarm.yml
        axis = pnfarm_rig.drive("axis-01")
        with axis.inject("f702", count=1):
            axis.wait_for("state == S4 and fault == 0", within=5)
"""

from __future__ import annotations

import os
from itertools import chain
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Generator, Iterable, Iterator
    from pathlib import Path

    from pnfarm.testing import Line, Rig

__all__ = ["Lines", "pnfarm_farm", "pnfarm_rig"]

OPTION = "--pnfarm-rig"
#: With this in the environment a test that lacks its rig fails.
REQUIRE_ALL = "PNFARM_REQUIRE_ALL"
#: Drives, and events of each line or rig, that the report of a failed test shows.
MOST_DRIVES = 16
MOST_EVENTS = 25

#: What a test uses, a list of each fixture: shown when it fails.
_USED = pytest.StashKey["list[list[Line | Rig]]"]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """``--pnfarm-rig``."""
    group = parser.getgroup("pnfarm", "virtual drives")
    group.addoption(
        OPTION,
        metavar="FILE",
        default=os.environ.get("PNFARM_RIG"),
        help="Farm file, or URL of a running farm's API, for tests with pnfarm_rig; default: PNFARM_RIG. The token of "
        "an API is in PNFARM_TOKEN or PNFARM_TOKEN_FILE.",
    )


class Lines:
    """Makes lines in memory (:class:`pnfarm.testing.Line`) and closes them at the end of the test."""

    def __init__(self) -> None:
        self.open: list[Line | Rig] = []

    def __call__(self, *names: str, **options: Any) -> Line:
        """Drives by name; arguments of :class:`pnfarm.testing.Line`."""
        from pnfarm.testing import Line  # noqa: PLC0415 - a session without a line does not pay for the engine

        return self._kept(Line(*names, **options))

    def from_file(self, path: str | Path) -> Line:
        """The drives and the controller of a farm file."""
        from pnfarm.testing import Line  # noqa: PLC0415 - as above

        return self._kept(Line.from_file(path))

    def from_text(self, text: str) -> Line:
        """As :meth:`from_file`, from the file's text."""
        from pnfarm.testing import Line  # noqa: PLC0415 - as above

        return self._kept(Line.from_text(text))

    def _kept(self, line: Line) -> Line:
        self.open.append(line)
        return line

    def close(self) -> None:
        """Close every line, then raise the first error, if there was one."""
        failures: list[Exception] = []
        while self.open:
            try:
                self.open.pop().close()
            except Exception as exc:  # noqa: BLE001 - raised below, when the others are closed
                failures.append(exc)
        if failures:
            raise failures[0]


@pytest.fixture
def pnfarm_farm(request: pytest.FixtureRequest) -> Iterator[Lines]:
    """Farms in memory, in virtual time: ``pnfarm_farm("axis-01", model="hiwin-e1")`` is a pnfarm.testing.Line."""
    lines = Lines()
    request.node.stash.setdefault(_USED, []).append(lines.open)
    yield lines
    lines.close()


@pytest.fixture(scope="session")
def _pnfarm_session_rig(request: pytest.FixtureRequest) -> Iterator[Rig]:
    where = request.config.getoption(OPTION)
    if not where:
        why = f"needs a rig: {OPTION} FILE, a farm file or the URL of a running farm"
        if os.environ.get(REQUIRE_ALL, "") not in {"", "0"}:
            pytest.fail(f"{why} ({REQUIRE_ALL} is set)", pytrace=False)
        pytest.skip(why)
    from pnfarm.errors import PnfarmError  # noqa: PLC0415 - as above
    from pnfarm.testing import Rig  # noqa: PLC0415 - as above

    try:
        rig = Rig(where, token=os.environ.get("PNFARM_TOKEN"))
        rig.open()
    except PnfarmError as exc:
        pytest.fail(f"{OPTION} {where}: {exc}", pytrace=False)
    try:
        yield rig
    finally:
        rig.close()


@pytest.fixture
def pnfarm_rig(request: pytest.FixtureRequest, _pnfarm_session_rig: Rig) -> Iterator[Rig]:
    """The farm that ``--pnfarm-rig`` names (pnfarm.testing.Rig), the same for all tests; each ends with a reset."""
    request.node.stash.setdefault(_USED, []).append([_pnfarm_session_rig])
    yield _pnfarm_session_rig
    _pnfarm_session_rig.reset()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Show the drives of a failed test, and what happened to them last."""
    report = yield
    if report.failed and report.when == "call":
        fixtures = item.stash.get(_USED, [])
        for used in chain.from_iterable(fixtures):
            report.sections.append(("pnfarm", "\n".join(_shown(used))))
    return report


def _shown(used: Line | Rig) -> Iterable[str]:
    try:
        drives, events = used.drives, used.events()
    except Exception as exc:  # noqa: BLE001 - the report of the failure itself must come
        yield f"the drives cannot be shown: {exc}"
        return
    for drive in drives[:MOST_DRIVES]:
        yield repr(drive)
    if len(drives) > MOST_DRIVES:
        yield f"... and {len(drives) - MOST_DRIVES} more drives"
    yield f"the last of {len(events)} events:"
    for event in events[-MOST_EVENTS:]:
        yield f"  {event}"
