"""``pnfarm bench``: measures the cost of the farm and compares it with the floor of this machine, in one run."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from pnfarm.cli.completion import complete_benchmark
from pnfarm.farm.process.address_space import ENGINE, require_address_space
from pnfarm.terminal.streams import going_on_unread

__all__ = ["command"]


@going_on_unread()
def command(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME]...",
            help="Benchmarks, or single figures of them; default: all.",
            autocompletion=complete_benchmark,
        ),
    ] = None,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write the figures to this file as JSON.")] = None,
    markdown_file: Annotated[
        Path | None, typer.Option("--markdown", help="Write the figures to this file as a page of documentation.")
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option(min=0.1, max=3600, help="Length of each measurement; default: depends on the benchmark."),
    ] = None,
) -> None:
    """Run the benchmarks, and compare the farm with a minimal loop on this machine (the floor).

    Exit codes: 1 a goal was missed; 3 none was missed, but one could not be judged, because of other load.
    """
    from pnfarm.bench.catalogue import BENCHMARKS, chosen, measured
    from pnfarm.bench.report import markdown, print_table
    from pnfarm.bench.result import exit_code
    from pnfarm.cli.commands.run import check_writable

    require_address_space(ENGINE)
    wanted = chosen(names or [])
    for path in (json_file, markdown_file):
        if path is not None:
            check_writable(path)
    from pnfarm.links.kernel.sandbox import enter_sandbox

    enter_sandbox()
    # threads may exist from here on
    import anyio

    from pnfarm.cli.running import compile_ahead

    # compile beforehand, in a process of its own: otherwise the first benchmark would measure the compiler
    anyio.run(compile_ahead)
    results = []
    for place, (name, figures) in enumerate(wanted.items(), 1):
        counted = f" ({place} of {len(wanted)})" if len(wanted) > 1 else ""
        typer.echo(f"{name}{counted}: {(BENCHMARKS[name].run.__doc__ or '').splitlines()[0]}", err=True)
        results += measured(name, figures, seconds)
    print_table(results)
    if json_file is not None:
        json_file.write_text(json.dumps([asdict(r) for r in results], indent=1) + "\n", encoding="utf-8")
    if markdown_file is not None:
        markdown_file.write_text(markdown(results), encoding="utf-8")
    if code := exit_code(results):
        raise typer.Exit(code)
