"""``pnfarm run``: a scenario against a farm that it starts, or a running one, and the verdict."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pnfarm.terminal.settings import TokenOption  # noqa: TC001 - the command line is made from the annotations

if TYPE_CHECKING:
    from pnfarm.farm.file.reading import FarmConfig
    from pnfarm.scenario.binding import Binding
    from pnfarm.scenario.file import Scenario
    from pnfarm.scenario.record import Case
    from pnfarm.scenario.run import Tell
    from pnfarm.scenario.steps import Step

__all__ = ["bound", "is_scenario", "run"]

_WORDS = {"passed": "PASS", "failed": "FAIL", "inconclusive": "????", "error": "ERROR", "not run": "----"}
_STYLES = {"passed": "green", "failed": "bold red", "error": "bold red", "inconclusive": "yellow", "not run": "dim"}
#: How often a running farm is asked for the state of its scenario.
ASK_SECONDS = 0.25


def is_scenario(path: Path) -> bool:
    """Whether a file is a scenario, by its name."""
    return path.name.endswith((".scenario.yml", ".scenario.yaml"))


def bound(scenario: Scenario) -> tuple[Binding, FarmConfig]:
    """A scenario checked against its farm file.  Raises :class:`ConfigError`."""
    from pnfarm.buses.registry import fault_kinds
    from pnfarm.cli.files import check_impairments, read
    from pnfarm.errors import ConfigError
    from pnfarm.farm.farm import model_of
    from pnfarm.farm.file.reading import expand
    from pnfarm.scenario.binding import bind_scenario

    path = scenario.farm_path
    if path is None:
        raise ConfigError(f"scenario {scenario.name} names no farm file; add for example `farm: line-1.pnfarm.yml`")
    config = read(path).with_overrides(scenario.overrides, origin=f"{scenario.path}: with")
    check_impairments(config)
    return bind_scenario(scenario, {drive.name: model_of(drive) for drive in expand(config)}, fault_kinds()), config


def run(
    file: Annotated[Path, typer.Argument(help="Scenario, *.scenario.yml.", metavar="SCENARIO", show_default=False)],
    virtual: Annotated[
        bool, typer.Option("--virtual", help="In memory in virtual time, with the farm file's controller.")
    ] = False,
    junit: Annotated[Path | None, typer.Option(help="Write JUnit XML to this file.", metavar="FILE")] = None,
    html: Annotated[Path | None, typer.Option(help="Write a report for a browser.", metavar="FILE")] = None,
    as_json: Annotated[Path | None, typer.Option("--json", help="Write all results as JSON.", metavar="FILE")] = None,
    pcap: Annotated[
        Path | None, typer.Option(help="Write the frames around each failure (pcapng).", metavar="FILE")
    ] = None,
    token: TokenOption = None,
) -> int:
    """Run a scenario: faults, expectations, verdict.

    Exit codes: 0 passed, 1 an expectation failed, 2 bad input, 3 inconclusive (the farm itself was late), 4 this
    machine cannot.
    """
    from pnfarm.errors import ConfigError
    from pnfarm.scenario.file import load_scenario
    from pnfarm.scenario.record import EXIT_CODES, Verdict

    scenario = load_scenario(file)
    for path in (junit, html, as_json, pcap):
        if path is not None:
            _check_writable(path)
    if scenario.is_remote:
        if virtual or pcap is not None:
            raise ConfigError(
                "--virtual and --pcap are for a farm that `run` starts; this scenario names a running one"
            )
        record = _remote(scenario, file, token)
    else:
        binding, config = bound(scenario)
        record = _local(binding, config, virtual=virtual, pcap=pcap)
    _write(record, junit, html, as_json)
    _conclude(record)
    return EXIT_CODES[Verdict(record["verdict"])]


def _check_writable(path: Path) -> None:
    """Before a run of minutes, not after it.  Raises :class:`ConfigError`."""
    from pnfarm.errors import ConfigError

    if path.is_dir() or not path.parent.is_dir():
        what = "is a folder" if path.is_dir() else f"is in {path.parent}, which is no folder"
        raise ConfigError(f"{path} {what}; give the name of a file in a folder that exists")
    try:
        with path.open("ab"):
            pass
    except OSError as exc:
        raise ConfigError(f"{path} cannot be written: {(exc.strerror or str(exc)).lower()}") from exc


def _local(binding: Binding, config: FarmConfig, *, virtual: bool, pcap: Path | None) -> dict[str, Any]:
    import asyncio
    import tempfile

    from pnfarm.errors import ConfigError
    from pnfarm.farm.capture import CaptureSettings
    from pnfarm.scenario.slices import failure_windows, slice_capture

    if not virtual and config.link is not None and config.link.kind == "memory":
        raise ConfigError("the farm is on a memory link, which runs in virtual time here: add --virtual")
    with tempfile.TemporaryDirectory(prefix="pnfarm-run-") as folder, _Progress(binding) as tell:
        whole = Path(folder) / "whole.pcapng" if pcap is not None else None
        if virtual:
            from pnfarm.scenario.virtual import run_virtual

            record, epoch = asyncio.run(run_virtual(binding, config, tell=tell, pcap=whole))
        else:
            import anyio

            from pnfarm.scenario.started import run_started

            settings = CaptureSettings(whole) if whole is not None else None
            record, epoch = anyio.run(run_started, binding, config, tell, settings)
        if pcap is not None and whole is not None:
            windows = [(epoch + round(begin * 1e9), epoch + round(end * 1e9)) for begin, end in failure_windows(record)]
            record["pcap_packets"] = slice_capture(whole, pcap, windows)
    return record


def _remote(scenario: Scenario, file: Path, token: str | None) -> dict[str, Any]:
    from pnfarm.terminal.client import FarmClient
    from pnfarm.terminal.output import print_line

    assert scenario.farm is not None
    with FarmClient(scenario.farm, token) as farm:
        begun = farm.post("scenarios", body={"text": file.read_text("utf-8")})
        shown = 0
        try:
            while True:
                found: dict[str, Any] = farm.get("scenarios", begun["id"])
                for case in found["cases"][shown:]:
                    print_line(_line(case["verdict"], case["name"], case["message"]))
                shown = len(found["cases"])
                if found["state"] == "ended":
                    return found
                time.sleep(ASK_SECONDS)
        except BaseException:
            farm.delete("scenarios", begun["id"])
            raise


def _line(verdict: str, name: str, message: str) -> str:
    return f"{_WORDS[verdict]:5} {name}" + (f": {message}" if message else "")


class _Progress:
    """A bar and a line for each case on a terminal; elsewhere plain lines."""

    def __init__(self, binding: Binding) -> None:
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        from pnfarm.terminal.output import console

        self._total = sum(1 for _ in binding.scenario.every_step())
        self._out = console()
        self._bar = Progress(
            TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
            console=self._out, transient=True, disable=not self._out.is_terminal,
        )  # fmt: skip
        self._task = self._bar.add_task(binding.scenario.name, total=self._total)

    def __enter__(self) -> Tell:
        if self._out.is_terminal:
            self._bar.start()
        return self._tell

    def __exit__(self, *_: object) -> None:
        if self._out.is_terminal:
            self._bar.stop()

    def _tell(self, step: Step, case: Case | None) -> None:
        from rich.text import Text

        from pnfarm.terminal.output import print_line

        if case is None:
            self._bar.update(self._task, description=step.title[:60], advance=1)
            if not self._out.is_terminal and step.kind != "expect":
                print_line(f"      {step.title}")
            return
        line = _line(case.verdict.value, step.title, case.message)
        if self._out.is_terminal:
            self._out.print(Text(line, style=_STYLES[case.verdict.value]))
        else:
            print_line(line)


def _write(record: dict[str, Any], junit: Path | None, html: Path | None, as_json: Path | None) -> None:
    import json

    if junit is not None:
        from pnfarm.scenario.junit import write_junit

        write_junit(record, junit)
    if html is not None:
        from pnfarm.scenario.report import report_html

        html.write_text(report_html(record), "utf-8")
    if as_json is not None:
        as_json.write_text(json.dumps(record, indent=2, allow_nan=False) + "\n", "utf-8")


def _conclude(record: dict[str, Any]) -> None:
    from pnfarm.terminal.output import print_line

    counts = ", ".join(f"{count} {word}" for word, count in record["counts"].items() if count)
    print_line(f"{record['scenario']}: {record['verdict']} ({counts or 'no expectation'}) in {record['seconds']:.3f} s")
    if record["ended_early"]:
        print_line(f"ended early: {record['ended_early']}")
