"""Runs a user's Python file; what is wrong with it, or with what it does later, is one sentence with file and line."""

from __future__ import annotations

import contextlib
import inspect
import sys
import traceback
from hashlib import sha256
from itertools import count
from types import ModuleType
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.vocabulary.regular_file import read_regular

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

__all__ = ["error_text", "line_of", "own_classes", "place_of", "placed", "run_file"]

#: Longest file, octets.
MAX_OCTETS = 1_000_000
#: Longest text of a user's exception that is repeated.
MAX_TEXT = 300
_numbers = count(1)


def run_file(path: Path, key: str) -> ModuleType:
    """The module that a file makes; ``key`` of the farm file names it in messages.  Raises :class:`ConfigError`."""
    try:
        source = read_regular(path, MAX_OCTETS + 1)
    except OSError as exc:
        raise ConfigError(f"{key}: {path} cannot be read: {(exc.strerror or '').lower()}") from exc
    if len(source) > MAX_OCTETS:
        raise ConfigError(f"{key}: {path} has more than {MAX_OCTETS} octets")
    digest = sha256(str(path.resolve()).encode()).hexdigest()[:8]
    module = ModuleType(f"pnfarm_user_{digest}_{next(_numbers)}")
    module.__file__ = str(path)
    try:
        code = compile(source, str(path), "exec")
    except SyntaxError as exc:
        raise ConfigError(f"{path}:{exc.lineno or 1}: {exc.msg}") from exc
    except (ValueError, RecursionError, MemoryError) as exc:
        raise ConfigError(f"{path}:1: {str(exc) or 'nested too deeply'}") from exc
    # dataclasses look their module up
    sys.modules[module.__name__] = module
    try:
        with _beside(path):
            exec(code, module.__dict__)  # noqa: S102 - the user's own code is to run
    except KeyboardInterrupt:
        del sys.modules[module.__name__]
        raise
    except BaseException as exc:  # a file may even call sys.exit()
        del sys.modules[module.__name__]
        raise ConfigError(placed(exc, module.__name__, str(path))) from exc
    return module


@contextlib.contextmanager
def _beside(path: Path) -> Iterator[None]:
    """Let the file import what lies beside it."""
    folder = str(path.resolve().parent)
    sys.path.insert(0, folder)
    try:
        yield
    finally:
        with contextlib.suppress(ValueError):
            sys.path.remove(folder)


def own_classes(module: ModuleType) -> dict[str, type]:
    """The classes that the file itself has, by name."""
    return {
        name: thing
        for name, thing in vars(module).items()
        if isinstance(thing, type) and thing.__module__ == module.__name__
    }


def line_of(function: object) -> int:
    """Where a function begins in its file; 1 where that is not known."""
    code = getattr(inspect.unwrap(function), "__code__", None)  # type: ignore[arg-type]  # any callable
    return code.co_firstlineno if code is not None else 1


def place_of(error: BaseException, file: str | None) -> tuple[str, int]:
    """File and line of the user's statement that failed: the innermost one in this file, or else the innermost."""
    frames = [(frame.f_code.co_filename, line) for frame, line in traceback.walk_tb(error.__traceback__)]
    own = [place for place in frames if place[0] == file]
    return (own or frames or [(file or "", 0)])[-1]


def placed(error: BaseException, module: str, file: str | None = None) -> str:
    """``FILE:LINE: KeyError: 'x'``, in one line."""
    known = file or getattr(sys.modules.get(module), "__file__", None)
    path, line = place_of(error, known)
    return f"{path}:{line}: {error_text(error)}"


def error_text(error: BaseException) -> str:
    """``KeyError: 'x'``, one line of bounded length."""
    try:
        text = " ".join(str(error).split())
    except Exception:  # noqa: BLE001 - a user's exception may fail at its own text
        text = ""
    kind = type(error).__name__
    return f"{kind}: {text[:MAX_TEXT]}" if text else kind
