"""What takes a while says so: one line on a terminal, which goes when it is done."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

__all__ = ["working"]


@contextmanager
def working(title: str) -> Iterator[Callable[[str], None]]:
    """Show ``title`` on standard error while the block runs; nothing where that is no terminal.

    Gives a function that takes a word about how far it is.  Starts no thread: the line changes when it is called.
    """
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console
    from rich.progress import Progress, TextColumn, TimeElapsedColumn

    bar = Progress(
        TextColumn("{task.description}", markup=False), TimeElapsedColumn(),
        console=Console(stderr=True, emoji=False), transient=True, auto_refresh=False,
    )  # fmt: skip
    task = bar.add_task(title, total=None)

    def show(what: str) -> None:
        bar.update(task, description=f"{title}: {what}")
        bar.refresh()

    with bar:
        bar.refresh()
        yield show
