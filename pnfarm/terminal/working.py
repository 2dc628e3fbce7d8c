"""What takes a while says so: one line on a terminal, which goes when it is done."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

__all__ = ["working"]


def _show_nothing(done: int, what: str = "") -> None:
    del done, what


@contextmanager
def working(title: str, total: int | None = None) -> Iterator[Callable[..., None]]:
    """Show ``title`` on standard error while the block runs; nothing where that is no terminal.

    Gives a function that takes how much is done, of ``total`` if it is known, and a word about what is next.  Starts no
    thread: the line changes when the function is called.
    """
    if not sys.stderr.isatty():
        yield _show_nothing
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    known = (BarColumn(), MofNCompleteColumn()) if total is not None else ()
    bar = Progress(
        TextColumn("{task.description}", markup=False), *known, TimeElapsedColumn(),
        console=Console(stderr=True, emoji=False), transient=True, auto_refresh=False,
    )  # fmt: skip
    task = bar.add_task(title, total=total)

    def show(done: int, what: str = "") -> None:
        bar.update(task, completed=done, description=f"{title}: {what}" if what else title)
        bar.refresh()

    with bar:
        bar.refresh()
        yield show
