"""``pnfarm run`` against a running farm: the farm carries the scenario out, here its progress is shown."""

from __future__ import annotations

import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from pnfarm.errors import EnvironmentError_, PnfarmError, RemoteError
from pnfarm.terminal import client
from pnfarm.vocabulary.issues import FarmFileError, FileIssue

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from pnfarm.cli.run_progress import Progress
    from pnfarm.scenario.definition.file import Scenario

__all__ = ["run_remote"]

#: How often the farm is asked for the state of the scenario.
ASK_SECONDS = 0.25
#: How long a farm that does not answer is asked again.
PATIENCE_SECONDS = 5.0


def run_remote(
    scenario: Scenario, token: str | None, tls_ca: Path | None, progress: Progress, interrupted: Callable[[], str]
) -> tuple[dict[str, Any], Exception | None]:
    """The record, and what failed before the scenario was over, if anything did.  Raises :class:`PnfarmError`."""
    assert scenario.farm is not None
    with client.FarmClient(scenario.farm, token, tls_ca, option="--farm") as farm:
        return _Remote(scenario, farm, progress, interrupted).run()


def _issue(path: Path, found: Mapping[str, str]) -> FileIssue:
    """An error of a scenario's text, as the farm reports it, in the file that the text is from."""
    return FileIssue(str(path), int(found.get("line") or 0), 0, found["field"], found["what"], found.get("allowed", ""))


class _Remote:
    def __init__(
        self, scenario: Scenario, farm: client.FarmClient, progress: Progress, interrupted: Callable[[], str]
    ) -> None:
        self._scenario = scenario
        self._farm = farm
        self._progress = progress
        self._interrupted = interrupted

    def run(self) -> tuple[dict[str, Any], Exception | None]:
        # from now on a stop signal waits until the farm can be asked to stop
        self._interrupted()
        begun = self._begin()
        known: dict[str, Any] = begun
        cases: list[dict[str, Any]] = []
        try:
            while True:
                known = self._ask(begun["id"], len(cases))
                self._show(known)
                cases += known["cases"]
                if known["state"] == "ended":
                    return self._whole(begun["id"])
                if why := self._interrupted():
                    record = self._farm.delete("scenarios", begun["id"])
                    return {**record, "ended_early": why}, None
                time.sleep(ASK_SECONDS)
        except PnfarmError as error:
            return self._broken(begun, known, cases, error)
        except BaseException:
            with suppress(PnfarmError):
                self._farm.delete("scenarios", begun["id"])
            raise

    def _begin(self) -> dict[str, Any]:
        assert self._scenario.path is not None
        text = self._scenario.path.read_text("utf-8-sig")
        try:
            begun: dict[str, Any] = self._farm.post(
                "scenarios", body={"text": text, "variables": dict(self._scenario.given)}
            )
        except client.RefusedError as error:
            if not (issues := [_issue(self._scenario.path, found) for found in error.errors]):
                raise
            raise FarmFileError(issues) from error
        return begun

    def _ask(self, number: str, first: int) -> dict[str, Any]:
        """How far it is, with the cases from ``first`` on; a farm that does not answer is asked again."""
        end = time.monotonic() + PATIENCE_SECONDS
        while True:
            try:
                found: dict[str, Any] = self._farm.get("scenarios", number, query={"cases_from": first})
            except (EnvironmentError_, RemoteError):
                if time.monotonic() >= end or self._interrupted():
                    raise
                time.sleep(ASK_SECONDS)
            else:
                return found

    def _whole(self, number: str) -> tuple[dict[str, Any], Exception | None]:
        record: dict[str, Any] = self._farm.get("scenarios", number)
        if record["farm_ended"]:
            return record, EnvironmentError_(f"the farm at {self._farm.address} ended while the scenario ran")
        return record, None

    def _show(self, known: dict[str, Any]) -> None:
        for case in known["cases"]:
            self._progress.ended(case["verdict"], case["name"], case["message"])
        self._progress.began(known["step"], known["steps_begun"], silent=True)
        self._progress.left(known["left_seconds"])

    def _broken(
        self, begun: dict[str, Any], known: dict[str, Any], cases: list[dict[str, Any]], error: Exception
    ) -> tuple[dict[str, Any], Exception]:
        """What was known last, as a record that ended."""
        from pnfarm.scenario.report.record import Case, Verdict

        why = f"the farm was lost: {error}"
        reached = {case["number"] for case in cases}
        cases = cases + [
            Case(number, step, Verdict.NOT_RUN, 0, 0, message=why).as_dict(0)
            for number, step in self._scenario.expectations()
            if number not in reached
        ]
        counts = {verdict.value: sum(case["verdict"] == verdict for case in cases) for verdict in Verdict}
        record = {
            **begun,
            "state": "ended",
            "verdict": Verdict.ERROR.value,
            "ended_early": why,
            "farm_ended": True,
            "seconds": known["seconds"],
            "cases": sorted(cases, key=lambda case: case["number"]),
            "counts": counts,
        }
        return record, EnvironmentError_(why)
