"""``pnfarm run``: a scenario against a farm that it starts, or a running one, and the verdict."""

from __future__ import annotations

import signal
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self

import typer

from pnfarm.errors import ConfigError, EnvironmentError_, PnfarmError
from pnfarm.terminal.output import print_next
from pnfarm.terminal.settings import (
    TlsCaOption,  # noqa: TC001 - the command line is made from the annotations
    TokenOption,  # noqa: TC001 - the command line is made from the annotations
)
from pnfarm.terminal.streams import going_on_unread

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType

    from pnfarm.cli.run_progress import Progress
    from pnfarm.farm.capture import CaptureSettings
    from pnfarm.farm.file.reading import FarmConfig
    from pnfarm.scenario.definition.binding import Binding
    from pnfarm.scenario.definition.file import Scenario
    from pnfarm.scenario.own_farm import Outcome
    from pnfarm.scenario.run import ScenarioRun, Tell

__all__ = ["bound", "check_writable", "is_scenario", "run"]


def is_scenario(path: Path) -> bool:
    """Whether a file is a scenario, by its name."""
    return path.name.endswith((".scenario.yml", ".scenario.yaml"))


def bound(scenario: Scenario) -> tuple[Binding, FarmConfig]:
    """A scenario checked against its farm file.  Raises :class:`ConfigError`."""
    from pnfarm.buses.registry import fault_kinds
    from pnfarm.cli.farm_file import check_impairments, check_program, read
    from pnfarm.farm.farm import model_of
    from pnfarm.farm.file.reading import expand
    from pnfarm.farm.plant import known_signals
    from pnfarm.farm.state.files import StateFiles, states_folder
    from pnfarm.scenario.definition.binding import bind_scenario

    path = scenario.farm_path
    if path is None:
        raise ConfigError(f"scenario {scenario.name} names no farm file; add for example `farm: line-1.pnfarm.yml`")
    config = read(path).with_overrides(scenario.overrides, origin=f"{scenario.path}: with")
    check_impairments(config)
    check_program(config)
    drives = {axis.name: model_of(drive) for drive in expand(config) for axis in drive.axes}
    signals, kinds = known_signals(config, model_of)
    folder = states_folder(config.state_directory, None)
    states = [] if folder is None else [kept.name for kept in StateFiles(folder).kept()]
    return bind_scenario(scenario, drives, fault_kinds(), signals, kinds, states), config


@going_on_unread()
def run(
    file: Annotated[Path, typer.Argument(help="Scenario, *.scenario.yml.", metavar="SCENARIO", show_default=False)],
    virtual: Annotated[
        bool, typer.Option("--virtual", help="In memory in virtual time, with the farm file's controller.")
    ] = False,
    farm: Annotated[
        str | None,
        typer.Option("--farm", help="Farm file, or URL of a running farm, instead of the scenario's.", metavar="FARM"),
    ] = None,
    junit: Annotated[Path | None, typer.Option(help="Write JUnit XML to this file.", metavar="FILE")] = None,
    html: Annotated[Path | None, typer.Option(help="Write a report for a browser.", metavar="FILE")] = None,
    as_json: Annotated[Path | None, typer.Option("--json", help="Write all results as JSON.", metavar="FILE")] = None,
    pcap: Annotated[
        Path | None, typer.Option(help="Write the frames around each failure (pcapng).", metavar="FILE")
    ] = None,
    values: Annotated[
        list[str] | None,
        typer.Option("--set", help="Value of a variable of the scenario. Repeatable.", metavar="NAME=VALUE"),
    ] = None,
    token: TokenOption = None,
    tls_ca: TlsCaOption = None,
) -> int:
    """Run a scenario: faults, expectations, verdict.

    Exit codes: 0 passed, 1 an expectation failed, 2 bad input, 3 inconclusive (the farm itself was late, or the run
    was interrupted), 4 this machine cannot, or the farm was lost, 5 internal error.
    """
    from pnfarm.cli.errors import report
    from pnfarm.cli.run_progress import Progress, print_summary
    from pnfarm.scenario.definition.file import load_scenario
    from pnfarm.scenario.report.record import EXIT_CODES, Verdict
    from pnfarm.vocabulary.regular_file import beside

    variables = _variables(values or [])
    scenario = load_scenario(file, variables)
    if farm is not None:
        # relative to where the user is, not to the scenario
        for one in (scenario, *scenario.runs):
            one.farm = farm if "://" in farm else str(beside(Path.cwd(), farm))
    if scenario.is_remote and (virtual or pcap is not None):
        raise ConfigError(
            "--virtual and --pcap are for a farm that `run` starts, and this one runs already; "
            "to capture it, start it with `pnfarm up FILE --pcap OUT`"
        )
    if scenario.is_remote and scenario.runs:
        raise ConfigError(
            "matrix: starts a farm for each run, and this one runs already; "
            "use `repeat: {for: ...}` in the steps, or a farm file"
        )
    checked = [] if scenario.is_remote else [bound(one) for one in scenario.runs or (scenario,)]
    for path in (junit, html, as_json, pcap):
        if path is not None:
            check_writable(path)
    failure: Exception | None = None
    total = sum(1 for one in scenario.runs or (scenario,) for _ in one.every_step())
    with _Signals() as signals, Progress(scenario.name, total) as progress:
        if not checked:
            from pnfarm.cli.run_remote import run_remote

            record, failure = run_remote(scenario, token, tls_ca, progress, signals.why)
        else:
            # without a report traces have no reader
            traced = html is not None or as_json is not None
            record, failure = _every(scenario, checked, progress, signals, virtual=virtual, pcap=pcap, traced=traced)
    _write(record, junit, html, as_json)
    print_summary(record)
    if html is not None:
        print_next(f"open {html} in a browser: expectations, faults and the PLC's words on a timeline")
    elif record["verdict"] == Verdict.FAILED.value:
        print_next("the same command with --html report.html shows the PLC's words on a timeline")
    return EXIT_CODES[Verdict(record["verdict"])] if failure is None else report(failure)


class _Signals:
    """The first stop signal ends the run in order, the second one at once; before the run begins, the first one."""

    def __init__(self) -> None:
        self._why = ""
        self._waiting = False
        self._before: dict[int, Any] = {}

    def why(self) -> str:
        """What a run is ended with; empty while no signal came."""
        self._waiting = True
        return self._why

    def __enter__(self) -> Self:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            # it is ignored under nohup
            if signal.getsignal(number) is not signal.SIG_IGN:
                self._before[number] = signal.signal(number, self._came)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _came(self, number: int, frame: FrameType | None) -> None:
        del frame
        if self._why or not self._waiting:
            raise KeyboardInterrupt
        self._why = f"interrupted by {signal.Signals(number).name}"


def _variables(given: list[str]) -> dict[str, Any]:
    """``NAME=VALUE``, read as the file would be: ``n=3`` is a number, ``axis=axis-01`` a text."""
    from pnfarm.vocabulary.yaml_lines import YamlError, parse_yaml

    found: dict[str, Any] = {}
    for text in given:
        name, sign, value = text.partition("=")
        try:
            read = parse_yaml(value).root.plain() if sign and name and value else None
        except YamlError:
            read = None
        if not isinstance(read, (int, float, str)):
            raise ConfigError(f"--set {text!r} is not NAME=VALUE, such as --set axis=axis-01 or --set duration=10min")
        found[name.strip()] = read
    return found


def check_writable(path: Path) -> None:
    """Before a run of minutes, not after it; leaves no file where there was none.  Raises :class:`ConfigError`."""
    if path.is_dir() or not path.parent.is_dir():
        what = "is a folder" if path.is_dir() else f"is in {path.parent}, which is not a folder"
        raise ConfigError(f"{path} {what}; give the name of a file in a folder that exists")
    is_new = not path.exists()
    try:
        with path.open("ab"):
            pass
        if is_new:
            # what a link points to, not the link
            path.resolve().unlink(missing_ok=True)
    except OSError as exc:
        raise ConfigError(f"{path} cannot be written: {(exc.strerror or str(exc)).lower()}") from exc


def _every(
    scenario: Scenario,
    checked: list[tuple[Binding, FarmConfig]],
    progress: Progress,
    signals: _Signals,
    *,
    virtual: bool,
    pcap: Path | None,
    traced: bool,
) -> tuple[dict[str, Any], Exception | None]:
    """One run, or those of a matrix one after the other; those after one that was cut short do not begin."""
    from pnfarm.scenario.definition.matrix import not_begun, together

    records: list[dict[str, Any]] = []
    failure: Exception | None = None
    if pcap is not None:
        pcap.write_bytes(b"")
    for binding, config in checked:
        farm = config.farm or "farm"
        # before the first one a signal ends the program: its start may take long
        if failure is not None or (records and signals.why()):
            why = signals.why() or f"an earlier run failed: {failure}"
            records.append(not_begun(binding, farm, why, broken=failure is not None))
            continue
        if scenario.runs:
            progress.heading(binding.scenario.title)
        try:
            record, failure = _local(binding, config, progress, signals, virtual=virtual, pcap=pcap, traced=traced)
        except PnfarmError as error:
            if not records:
                raise
            failure = error
            record = not_begun(binding, farm, str(error), broken=True)
        records.append(record)
    return together(scenario, records) if scenario.runs else records[0], failure


def _local(
    binding: Binding,
    config: FarmConfig,
    progress: Progress,
    signals: _Signals,
    *,
    virtual: bool,
    pcap: Path | None,
    traced: bool,
) -> tuple[dict[str, Any], Exception | None]:
    import asyncio
    import tempfile
    import time

    from pnfarm.farm.capture import CaptureSettings
    from pnfarm.scenario.report.capture_slices import failure_windows, keep_failures, slice_capture
    from pnfarm.scenario.report.frame_ring import FrameRing

    if not virtual and config.link is not None and config.link.kind == "memory":
        if config.controller is None:
            raise ConfigError(
                "on a memory link the farm needs its own controller: add a `controller:` section to its file"
            )
        if pcap is not None:
            raise ConfigError("a memory link has no interface to capture from in real time: add --virtual")

    def passing(run: ScenarioRun, now: int) -> str:
        progress.passing(run, now)
        return signals.why()

    with tempfile.TemporaryDirectory(prefix="pnfarm-run-") as folder:
        # a run may last for days: only its last frames are held, and those around failures filed
        ring = FrameRing(Path(folder) / "failures.pcapng") if pcap is not None else None
        if virtual:
            from pnfarm.scenario.virtual import run_virtual

            tell = keep_failures(progress.tell, ring, None) if ring is not None else progress.tell
            task = run_virtual(binding, config, tell=tell, frames=ring, passing=passing, traced=traced)
            record, epoch = asyncio.run(task)
            failure = None
        else:
            import anyio

            from pnfarm.links.serial.eager_loop import LOOKING

            tell = keep_failures(progress.tell, ring, time.time_ns) if ring is not None else progress.tell
            settings = CaptureSettings(ring.current, sink=ring) if ring is not None else None
            outcome = anyio.run(_started, binding, config, tell, settings, passing, traced, backend_options=LOOKING)
            record, epoch, failure = outcome.record, outcome.epoch_ns, outcome.failure
        if pcap is not None and ring is not None:
            record["pcap_packets"] = 0
            record["pcap_not_whole"] = ring.not_whole
            if ring.current.exists():
                windows = failure_windows(record, epoch)
                record["pcap_packets"] = slice_capture(ring.current, pcap, windows)
            else:
                # a capture without frames, which readers know as one
                with pcap.open("ab") as out:
                    out.write(ring.head)
    return record, failure


async def _started(
    binding: Binding,
    config: FarmConfig,
    tell: Tell,
    capture: CaptureSettings | None,
    passing: Callable[[ScenarioRun, int], str],
    traced: bool,
) -> Outcome:
    from pnfarm.cli.running import compile_ahead
    from pnfarm.config.links import MemoryLink
    from pnfarm.farm.process.garbage import keep_what_is_loaded
    from pnfarm.scenario.own_farm import run_started

    compiling = partial(compile_ahead, in_memory=isinstance(config.link, MemoryLink))
    return await run_started(
        binding, config, tell, capture, passing,
        traced=traced, before=compiling, opened=keep_what_is_loaded,
    )  # fmt: skip


def _write(record: dict[str, Any], junit: Path | None, html: Path | None, as_json: Path | None) -> None:
    """Raises :class:`EnvironmentError_`, after having tried each."""
    import json

    from pnfarm.scenario.report.junit import write_junit
    from pnfarm.scenario.report.page import report_html

    failed: list[str] = []
    for path, write in (
        (junit, lambda path: write_junit(record, path)),
        (html, lambda path: path.write_text(report_html(record), "utf-8")),
        (as_json, lambda path: path.write_text(json.dumps(record, indent=2, allow_nan=False) + "\n", "utf-8")),
    ):
        if path is not None:
            try:
                write(path)
            except OSError as exc:
                failed.append(f"{path} cannot be written: {(exc.strerror or str(exc)).lower()}")
    if failed:
        raise EnvironmentError_("; ".join(failed))
