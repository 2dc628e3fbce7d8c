"""Standard output: tables for users, JSON for programs."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from rich.console import Console
    from rich.table import Table

__all__ = [
    "console", "make_table", "number", "print_found", "print_json", "print_line", "print_next",
    "print_section", "print_table", "seconds",
]  # fmt: skip

_T = TypeVar("_T")
#: Width where standard output is not a terminal: nothing is truncated.
_UNBOUNDED = 10_000


def print_line(text: str = "") -> None:
    """Print one line and flush it: another program may wait for it on a pipe."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def print_next(step: str) -> None:
    """What to do next, for a user at a terminal; programs that read the output do not see it."""
    if sys.stdout.isatty():
        print_line(f"next: {step}")


def print_json(value: Any) -> None:
    """Print one JSON document, indented."""
    print_line(json.dumps(value, indent=2, default=str))


def print_found(found: _T, output: str, show: Callable[[_T], None]) -> None:
    """As JSON if ``output`` says so, else as ``show`` prints it for people."""
    if output == "json":
        print_json(found)
    else:
        show(found)


def console() -> Console:
    """Standard output; as wide as the terminal, unlimited for a file or pipe."""
    from rich.console import Console

    return Console(
        file=sys.stdout,
        width=None if sys.stdout.isatty() else _UNBOUNDED,
        highlight=False,
        markup=False,
        emoji=False,
        soft_wrap=False,
    )


def make_table(columns: Sequence[str], rows: Iterable[Sequence[object]], *, caption: str = "") -> Table:
    """A table without lines.

    A column whose name begins with ``>`` is right-aligned; one that begins with ``~`` holds text that may wrap in a
    narrow terminal, so that the other columns are not truncated.
    """
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), caption=caption or None, caption_justify="left")
    for column in columns:
        table.add_column(
            column.lstrip(">~"),
            justify="right" if column.startswith(">") else "left",
            no_wrap=not column.startswith("~"),
            overflow="fold" if column.startswith("~") else "ellipsis",
            header_style="bold",
        )
    for row in rows:
        # as Text: a name with brackets is a name, not markup
        table.add_row(*(cell if isinstance(cell, Text) else Text("" if cell is None else str(cell)) for cell in row))
    return table


def print_table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print :func:`make_table`; into a pipe, lines have no trailing blanks."""
    out = console()
    table = make_table(columns, rows)
    if sys.stdout.isatty():
        out.print(table)
        return
    with out.capture() as capture:
        out.print(table)
    for line in capture.get().splitlines():
        print_line(line.rstrip())


def print_section(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """A blank line, then the table."""
    print_line()
    print_table(columns, rows)


def seconds(value: float | None) -> str:
    """A time with a suitable unit: ``16 ms``, ``1.5 s``; empty for None."""
    if value is None:
        return ""
    if value < 1e-3:
        return f"{value * 1e6:.4g} us"
    if value < 1:
        return f"{value * 1e3:.4g} ms"
    return f"{value:.4g} s"


def number(value: float | None) -> str:
    """A number with thousands separators, at most one decimal; empty for None."""
    if value is None:
        return ""
    return f"{value:,}" if isinstance(value, int) else f"{value:,.1f}"
