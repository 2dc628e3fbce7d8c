"""Every way in which a command can go wrong, as one sentence on standard error and an exit code."""

from __future__ import annotations

import os
import sys
import traceback
from typing import TYPE_CHECKING

import typer

from pnfarm.errors import EnvironmentError_, InternalError, PnfarmError
from pnfarm.farm.address_space import is_exhausted
from pnfarm.terminal.settings import settings

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["BAD_INPUT", "INTERNAL", "report", "silence_stdout"]

BAD_INPUT = 2
INTERNAL = 5

#: The framework's errors of usage; where it keeps them differs between its versions, what they answer to does not.
_USAGE = next(kind for kind in typer.BadParameter.__mro__[::-1] if hasattr(kind, "format_message"))


def report(error: BaseException) -> int:
    """Say what went wrong; the exit code that belongs to it.

    A group of errors, as tasks beside each other raise them, is told by its first error that is meant for a user.
    """
    leaves = list(_leaves(error))
    told = next((leaf for leaf in leaves if _is_ours(leaf)), leaves[0])
    if settings.debug and not isinstance(told, _USAGE):
        traceback.print_exception(error, file=sys.stderr)
    code, text = _told(told)
    sys.stderr.write(f"{text}\n")
    return code


def _leaves(error: BaseException) -> Iterator[BaseException]:
    if isinstance(error, BaseExceptionGroup):
        for inner in error.exceptions:
            yield from _leaves(inner)
    else:
        yield error


def _is_ours(error: BaseException) -> bool:
    return isinstance(error, PnfarmError) and not isinstance(error, InternalError)


def _told(error: BaseException) -> tuple[int, str]:
    if isinstance(error, _USAGE):
        return BAD_INPUT, _usage(error)
    if isinstance(error, PnfarmError) and not isinstance(error, InternalError):
        # a file's or a fault's errors begin with their own place, one line each
        lines = str(error) if hasattr(error, "issues") else f"pnfarm: {error}"
        return error.exit_code, lines
    if (sentence := is_exhausted(error)) is not None:
        return EnvironmentError_.exit_code, f"pnfarm: {sentence}"
    kind = "" if isinstance(error, InternalError) else f"{type(error).__name__}: "
    return INTERNAL, f"pnfarm: internal error: {kind}{error} (please report; details with --debug)"


def _usage(error: BaseException) -> str:
    sentence = str(error.format_message()).strip().rstrip(".")  # type: ignore[attr-defined]  # every usage error has it
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "pnfarm"
    return f"pnfarm: {sentence[:1].lower()}{sentence[1:]}; see `{command} --help`"


def silence_stdout() -> None:
    """Whoever read our output has gone: what is still buffered goes nowhere, without a word."""
    try:
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())
        os.close(null)
    except (OSError, ValueError):
        # not a real stream (a test's): nothing to flush at the end either
        return
