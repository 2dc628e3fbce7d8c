"""Turns every error of a command into one line on standard error and an exit code."""

from __future__ import annotations

import errno
import os
import sys
import traceback
from contextlib import suppress
from typing import TYPE_CHECKING

import typer

from pnfarm.errors import EnvironmentError_, InternalError, PnfarmError
from pnfarm.farm.process.address_space import is_exhausted
from pnfarm.terminal.settings import settings

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["BAD_INPUT", "INTERNAL", "report"]

BAD_INPUT = 2
INTERNAL = 5

#: A disk, or this user's part of it, is full.
_NO_ROOM = frozenset({errno.ENOSPC, errno.EDQUOT})

#: The base class of the framework's usage errors; its module differs between versions, its ``format_message`` does not.
_USAGE = next(kind for kind in typer.BadParameter.__mro__[::-1] if hasattr(kind, "format_message"))


def report(error: BaseException) -> int:
    """Print the error on standard error; returns its exit code.

    Of an exception group, as concurrent tasks raise it, the first error that is meant for a user is printed.
    """
    leaves = list(_leaves(error))
    shown = next((leaf for leaf in leaves if _is_for_users(leaf)), leaves[0])
    code, text = _code_and_text(shown)
    # the reader may have gone, the disk may be full: the exit code is the same
    with suppress(OSError):
        if settings.debug and not isinstance(shown, _USAGE):
            traceback.print_exception(error, file=sys.stderr)
        sys.stderr.write(f"{text}\n")
        sys.stderr.flush()
    return code


def _leaves(error: BaseException) -> Iterator[BaseException]:
    if isinstance(error, BaseExceptionGroup):
        for inner in error.exceptions:
            yield from _leaves(inner)
    else:
        yield error


def _is_for_users(error: BaseException) -> bool:
    return isinstance(error, PnfarmError) and not isinstance(error, InternalError)


def _code_and_text(error: BaseException) -> tuple[int, str]:
    if isinstance(error, _USAGE):
        return BAD_INPUT, _usage(error)
    if _is_for_users(error):
        assert isinstance(error, PnfarmError)
        # the errors of a file or a fault are one line each, and begin with their place
        lines = str(error) if hasattr(error, "issues") else f"pnfarm: {error}"
        return error.exit_code, lines
    if (sentence := is_exhausted(error)) is not None:
        return EnvironmentError_.exit_code, f"pnfarm: {sentence}"
    if isinstance(error, OSError) and error.errno in _NO_ROOM:
        where = error.filename or "what this command writes"
        return EnvironmentError_.exit_code, f"pnfarm: there is no room for {where}: {os.strerror(error.errno).lower()}"
    kind = "" if isinstance(error, InternalError) else f"{type(error).__name__}: "
    return INTERNAL, f"pnfarm: internal error: {kind}{error} (please report; details with --debug)"


def _usage(error: BaseException) -> str:
    sentence = " ".join(str(error.format_message()).split()).rstrip(".")  # type: ignore[attr-defined]  # every usage error has it
    # a choice that is none, in words of the framework
    sentence = sentence.replace(": Value error, ", ": ")
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "pnfarm"
    return f"pnfarm: {sentence[:1].lower()}{sentence[1:]}; see `{command} --help`"
