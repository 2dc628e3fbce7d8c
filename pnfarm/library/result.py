"""What a scenario found."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["ScenarioResult"]


@dataclass(frozen=True, slots=True)
class ScenarioResult:
    """``record`` is all of it, as ``pnfarm run --json`` writes it."""

    record: Mapping[str, Any]

    @property
    def verdict(self) -> str:
        """``passed``, ``failed``, ``inconclusive`` or ``error``."""
        return str(self.record["verdict"])

    @property
    def passed(self) -> bool:
        return self.verdict == "passed"

    @property
    def cases(self) -> list[Mapping[str, Any]]:
        """Each expectation with ``name``, ``verdict``, ``message``, ``held_after_seconds``."""
        return list(self.record["cases"])

    def check(self) -> None:
        """Raises :class:`AssertionError` unless it passed, with every expectation that did not hold."""
        if not self.passed:
            wrong = [f"{c['name']}: {c['verdict']}, {c['message']}" for c in self.cases if c["verdict"] != "passed"]
            why = "; ".join(wrong) or self.record["ended_early"]
            raise AssertionError(f"scenario {self.record['scenario']} {self.verdict}: {why}")

    def write_junit(self, path: str | Path) -> None:
        """JUnit XML, each expectation a test case."""
        from pnfarm.scenario.report.junit import write_junit  # noqa: PLC0415 - only for those who write one

        write_junit(self.record, Path(path))

    def write_html(self, path: str | Path) -> None:
        """The report for a browser, in one file."""
        from pnfarm.scenario.report.page import report_html  # noqa: PLC0415 - only for those who write one

        Path(path).write_text(report_html(self.record), "utf-8")

    def __repr__(self) -> str:
        return f"<ScenarioResult {self.record['scenario']}: {self.verdict}>"
