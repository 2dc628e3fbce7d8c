"""``pnfarm verify``: known faults on a known farm on this machine, with a report for a test protocol."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pnfarm.errors import EnvironmentError_, InternalError
from pnfarm.farm.process.address_space import ENGINE, require_address_space
from pnfarm.terminal.output import print_line, print_next, print_section, print_table
from pnfarm.terminal.output import seconds as time_text
from pnfarm.terminal.streams import going_on_unread

if TYPE_CHECKING:
    from pnfarm.cli.verify.report import Answer, Limits, Part, Report

__all__ = ["verify"]

#: The process with a network of its own is ended after so long.
WIRE_SECONDS = 300.0


@going_on_unread()
def verify(
    quick: Annotated[
        bool, typer.Option("--quick", help="Only in memory, and without the machine's limits: about ten seconds.")
    ] = False,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write the report to this file as JSON.")
    ] = None,
    key: Annotated[
        Path | None,
        typer.Option(
            "--sign",
            metavar="KEY",
            help="Sign the JSON file with this private SSH key; the signature is in FILE.sig.",
            show_default=False,
        ),
    ] = None,
) -> int:
    """Check on this machine that a known farm shows known faults as expected, and measure the machine's limits.

    Takes about two minutes.  Needs no root and no PLC.

    Exit codes: 0 all as expected, 1 a difference, 2 bad input, 3 inconclusive (the machine stalled), 4 this machine
    cannot.
    """
    import anyio

    from pnfarm.cli.commands.run import check_writable
    from pnfarm.cli.running import compile_ahead
    from pnfarm.cli.verify.report import EXIT_CODES
    from pnfarm.cli.verify.signature import check_signing, sign

    require_address_space(ENGINE)
    if key is not None:
        if json_file is None:
            raise typer.BadParameter("signs the JSON file; add --json FILE", param_hint="--sign")
        check_signing(key)
    if json_file is not None:
        check_writable(json_file)
    anyio.run(compile_ahead)
    report = _report(quick=quick)
    # first: minutes of work are not lost with a full disk
    _print(report)
    if json_file is not None:
        try:
            json_file.write_text(report.model_dump_json(indent=2) + "\n", encoding="utf-8")
        except OSError as exc:
            raise EnvironmentError_(f"{json_file} cannot be written: {(exc.strerror or str(exc)).lower()}") from exc
    if key is not None and json_file is not None:
        print_line(f"signature: {sign(json_file, key)}")
    elif json_file is None:
        print_next("the same command with --json FILE writes the report, with --sign KEY also a signature")
    return EXIT_CODES[report.verdict]


def _report(*, quick: bool) -> Report:
    from datetime import UTC, datetime

    import anyio

    from pnfarm.cli.verify import machine
    from pnfarm.cli.verify.report import Answer, Finding, Report, Verdict, worst
    from pnfarm.cli.verify.run import in_memory
    from pnfarm.farm.doctor.machine import examine
    from pnfarm.table.compiling.compiled import IS_COMPILED

    date = datetime.now(UTC).isoformat(timespec="seconds")
    _say("memory: the known farm in virtual time")
    parts, limits, left_out = [anyio.run(in_memory)], None, []
    answer = Answer()
    if quick:
        left_out.append("wire and limits: --quick")
    else:
        from pnfarm.cli.verify.limits import limits as measured_limits

        answer = _on_wire()
        parts += [answer.part] if answer.part is not None else []
        _say("limits: the cost of a drive")
        limits, missing = measured_limits(answer.cycles)
        left_out = [*answer.left_out, *missing]
    return Report(
        date=date,
        verdict=worst([*(part.verdict for part in parts), *([] if answer.ended else [Verdict.INCONCLUSIVE])]),
        versions=machine.versions(),
        package=machine.package(),
        host=machine.host(),
        compiled=IS_COMPILED,
        seeds=sorted({fault.seed for part in parts for fault in part.faults if fault.seed is not None}),
        parts=parts,
        limits=limits,
        left_out=left_out,
        machine=[Finding(name=one.name, ok=one.ok, detail=one.detail) for one in examine()],
    )


def _say(what: str) -> None:
    typer.echo(what, err=True)


def _on_wire() -> Answer:
    """What a process with a network of its own found, as far as it came."""
    from pnfarm.cli.verify.report import Answer

    program = [sys.executable, "-m", "pnfarm.cli.verify.wire"]
    try:
        run = subprocess.run(program, stdout=subprocess.PIPE, timeout=WIRE_SECONDS, check=False)
    except subprocess.TimeoutExpired as exc:
        said, why = exc.stdout or b"", f"not at an end after {WIRE_SECONDS:g} s"
        if not said:
            return Answer(ended=False, left_out=[f"wire and shortest cycle: {why}"])
    else:
        said, why = run.stdout, f"its process ended with code {run.returncode}" if run.returncode else ""
        if not said:
            raise InternalError(f"the process with a network of its own ended with code {run.returncode}")
    answer = Answer.model_validate_json(said.splitlines()[-1])
    return answer.model_copy(update={"left_out": [f"shortest cycle: {why}"]}) if why else answer


# -- for people


def _print(report: Report) -> None:

    versions, host = report.versions, report.host
    print_table(
        ("WHAT", "~"),
        [
            ("date", report.date),
            ("versions", ", ".join(f"{name} {version}" for name, version in versions.model_dump().items())),
            ("package", f"{report.package.files} files, SHA-256 {report.package.sha256}"),
            ("engine", "compiled" if report.compiled else "interpreted (NUMBA_DISABLE_JIT)"),
            ("processor", f"{host.processor}, {host.usable_cores} of {host.cores} cores usable"),
            ("kernel", f"{host.kernel} ({host.architecture}); virtualisation: {host.virtualisation}"),
            ("seeds", ", ".join(map(str, report.seeds)) or "none"),
        ],
    )
    for part in report.parts:
        _print_part(part)
    if report.limits is not None:
        _print_limits(report.limits)
    print_line()
    for sentence in report.left_out:
        print_line(f"left out: {sentence}")
    for part in report.parts:
        print_line(f"{part.name}: {_counts(part)}")
    print_line(f"verdict: {report.verdict.value}")


def _counts(part: Part) -> str:
    verdicts = [check.verdict.value for check in part.checks]
    counted = ", ".join(f"{verdicts.count(word)} {word}" for word in dict.fromkeys(verdicts))
    late = "" if part.late_seconds is None else f", at most {time_text(part.late_seconds)} late, {part.stalls} stalls"
    return f"{len(verdicts)} checks in {part.seconds:.3g} s: {counted}{late}"


def _print_part(part: Part) -> None:
    print_line()
    print_line(f"{part.name}, by {part.scenario}:")
    rows = [(check.verdict.value, check.name, check.expected, check.observed) for check in part.checks]
    print_table(("VERDICT", "~CHECK", "~EXPECTED", "~OBSERVED"), rows)


def _print_limits(limits: Limits) -> None:
    from pnfarm.bench.load import LIMIT_CORES

    columns = ("CYCLE", ">DRIVES", ">LATE P50", ">P99", ">P99 OF THE FLOOR", ">MAX", ">STALLS", ">LOST", ">OTHERS", "")
    rows = [
        (
            time_text(one.cycle_seconds), one.drives, time_text(one.lateness_p50_seconds),
            time_text(one.lateness_p99_seconds), time_text(one.floor_p99_seconds), time_text(one.lateness_max_seconds),
            one.stalls, one.lost_connections, f"{one.others_cores:.2f} cores", "held" if one.held else "not held",
        )
        for one in limits.cycles
    ]  # fmt: skip
    if rows:
        print_section(columns, rows)
    print_line()
    if limits.cycles:
        shortest = limits.shortest_cycle_seconds
        print_line(f"shortest cycle that this machine holds: {time_text(shortest) if shortest else 'none of these'}")
        if any(one.others_cores > LIMIT_CORES for one in limits.cycles):
            print_line("other programs ran meanwhile: measure again on an idle machine")
    if limits.drives_at_1_ms is not None:
        print_line(
            f"drives with 1 ms: about {limits.drives_at_1_ms}, an estimate: a frame takes "
            f"{time_text(limits.frame_seconds)} and a step {time_text(limits.step_seconds)} of a processor"
        )
