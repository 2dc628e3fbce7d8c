"""What ``pnfarm run`` prints: progress while the scenario runs, and the table at its end."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, Self

from pnfarm.terminal.output import console, print_line, print_table

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.scenario.definition.steps import Step
    from pnfarm.scenario.report.record import Case
    from pnfarm.scenario.run import ScenarioRun

__all__ = ["Progress", "print_summary"]

_WORDS = {"passed": "PASS", "failed": "FAIL", "inconclusive": "????", "error": "ERROR", "not run": "----"}
_STYLES = {"passed": "green", "failed": "bold red", "error": "bold red", "inconclusive": "yellow", "not run": "dim"}
#: Smallest time between two redraws, and between two lines about a long wait where there is no terminal; seconds.
DRAW_SECONDS = 0.1
WAIT_SECONDS = 10.0
#: Longest title beside the bar, and longest measured value of the table, characters.
MAX_TITLE, MAX_MEASURED = 60, 80
#: Most lines of the table; with more expectations, those that passed are left out.
MAX_ROWS = 200


class Progress:
    """A context manager: on a terminal a bar, a line for each case above it; elsewhere plain lines."""

    def __init__(self, name: str, total: int) -> None:
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
        from rich.progress import Progress as Bar

        self._out = console()
        self._live = self._out.is_terminal
        self._bar = Bar(
            TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
            TextColumn("{task.fields[left]}", markup=False), console=self._out, transient=True, disable=not self._live,
        )  # fmt: skip
        self._task = self._bar.add_task(name, total=total, left="")
        self._drawn = self._said = time.monotonic()

    def __enter__(self) -> Self:
        if self._live:
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._live:
            self._bar.stop()

    def heading(self, title: str) -> None:
        """A run of a matrix begins."""
        from rich.text import Text

        if self._live:
            self._out.print(Text(title, style="bold"))
        else:
            print_line(title)

    def tell(self, step: Step, case: Case | None) -> None:
        """A step begins, or a case has its verdict."""
        if case is None:
            self.began(step.title, silent=step.kind in {"expect", "parallel"})
        else:
            self.ended(case.verdict.value, step.title, case.message)

    def began(self, title: str, begun: int | None = None, *, silent: bool = False) -> None:
        """A step begins; ``begun`` of all, where it is not simply the next one."""
        self._said = time.monotonic()
        count = {"advance": 1} if begun is None else {"completed": begun}
        self._bar.update(self._task, description=title[:MAX_TITLE], left="", **count)  # type: ignore[arg-type]  # of floats
        if not self._live and not silent:
            print_line(f"      {title}")

    def ended(self, verdict: str, title: str, message: str) -> None:
        """A case has its verdict."""
        from rich.text import Text

        line = f"{_WORDS[verdict]:5} {title}" + (f": {message}" if message else "")
        if self._live:
            self._out.print(Text(line, style=_STYLES[verdict]))
        else:
            print_line(line)

    def passing(self, run: ScenarioRun, now: int) -> None:
        """Time passes while the run waits."""
        self.left((run.due_ns - now) / 1e9)

    def left(self, seconds: float) -> None:
        """The step at work takes this much longer, at most."""
        now = time.monotonic()
        if self._live and now - self._drawn >= DRAW_SECONDS:
            self._drawn = now
            self._bar.update(self._task, left=f"at most {_clock(seconds)} left" if seconds >= 1 else "")
        elif not self._live and now - self._said >= WAIT_SECONDS:
            self._said = now
            print_line(f"      ... at most {_clock(seconds)} left")


def _clock(seconds: float) -> str:
    whole = max(0, round(seconds))
    if whole < 60:
        return f"{whole} s"
    return f"{whole // 60}:{whole % 60:02} min" if whole < 3600 else f"{whole // 3600}:{whole // 60 % 60:02} h"


def print_summary(record: Mapping[str, Any]) -> None:
    """Of each run every expectation with what was allowed and what was measured, then the verdict in one line."""
    from pnfarm.scenario.definition.matrix import runs_of

    runs = runs_of(record)
    for one in runs:
        _print_run(one)
    if len(runs) > 1:
        counts = {word: sum(one["verdict"] == word for one in runs) for word in _WORDS}
        print_line("")
        told = ", ".join(f"{count} {word}" for word, count in counts.items() if count)
        print_line(f"{record['scenario']}: {record['verdict']} ({len(runs)} runs: {told})")


def _print_run(record: Mapping[str, Any]) -> None:
    from rich.text import Text

    from pnfarm.vocabulary.durations import format_measured

    cases = record["cases"]
    shown = cases if len(cases) <= MAX_ROWS else [case for case in cases if case["verdict"] != "passed"][:MAX_ROWS]
    if shown:
        print_line("")
        print_table(
            ("VERDICT", "~EXPECTATION", "ALLOWED", "~MEASURED"),
            [
                (
                    Text(case["verdict"], style=_STYLES[case["verdict"]]),
                    case["name"],
                    case["allowed"],
                    _short(case["measured"] or case["message"]),
                )
                for case in shown
            ],
        )
    if len(shown) < len(cases):
        print_line(f"... and {len(cases) - len(shown)} more")
    counts = ", ".join(f"{count} {word}" for word, count in record["counts"].items() if count)
    print_line("")
    took = format_measured(record["seconds"])
    print_line(f"{record['scenario']}: {record['verdict']} ({counts or 'no expectation'}) in {took}")
    if record["ended_early"]:
        print_line(f"ended early: {record['ended_early']}")
    for sentence in record.get("failed_code", ()):
        print_line(sentence)


def _short(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= MAX_MEASURED else line[: MAX_MEASURED - 3] + "..."
