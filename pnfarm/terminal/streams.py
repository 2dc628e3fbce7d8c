"""Standard output and error as a program finds them: closed, in another alphabet, with a reader that goes."""

from __future__ import annotations

import io
import os
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["going_on_unread", "prepare_streams", "silence"]


def prepare_streams() -> None:
    """What the terminal's alphabet lacks is written as an escape; what is written into a closed stream is dropped."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            # as after `>&-`
            null = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115 - it is open as long as the program
            setattr(sys, name, null)
        elif isinstance(stream, io.TextIOWrapper) and stream.errors == "strict":
            stream.reconfigure(errors="backslashreplace")


def silence(stream: TextIO) -> None:
    """Discard what is still buffered, and what is written from now on."""
    try:
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, stream.fileno())
        os.close(null)
    except (OSError, ValueError):
        # not a real stream (in a test): nothing is flushed at exit
        return


class _Unread:
    """A stream whose reader may go: what is written then is dropped."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        try:
            return self._stream.write(text)
        except BrokenPipeError:
            silence(self._stream)
            return len(text)

    def flush(self) -> None:
        try:
            self._stream.flush()
        except BrokenPipeError:
            silence(self._stream)


@contextmanager
def going_on_unread() -> Iterator[None]:
    """For commands that run until they are stopped, or whose exit code is a verdict: they come to their end and write
    their files although their output is not read any more, as in ``pnfarm run ... | head -1``.
    """
    before = sys.stdout
    sys.stdout = _Unread(before)
    try:
        yield
        sys.stdout.flush()
    finally:
        sys.stdout = before
