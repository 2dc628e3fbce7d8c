"""Finds the class in a file of ``program: {python: FILE, class: NAME}``; what is wrong with it is one sentence."""

from __future__ import annotations

import contextlib
import inspect
import sys
import traceback
from hashlib import sha256
from itertools import count
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from pnfarm.controller.axis_program import AxisProgram
from pnfarm.errors import ConfigError
from pnfarm.vocabulary.quoting import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.config.controller import Program
    from pnfarm.controller.axis_program import Line
    from pnfarm.drives.telegrams.signal_view import Inputs, Outputs
    from pnfarm.farm.file.reading import FarmConfig

__all__ = ["error_text", "load_program", "make_program", "place_of", "placed", "program_of", "program_settings"]

#: Longest file, octets.
MAX_OCTETS = 1_000_000
#: Longest text of somebody's exception that is repeated.
MAX_TEXT = 300
_numbers = count(1)


def program_of(config: FarmConfig) -> type[AxisProgram] | None:
    """The class of the farm file's program, None where the controller runs one of its own.

    The path is relative to the farm file.  Raises :class:`ConfigError`.
    """
    section = program_settings(config)
    if section is None or section.python is None:
        return None
    folder = config.path.parent if config.path is not None else Path()
    return load_program(folder / section.python, section.class_name)


def program_settings(config: FarmConfig) -> Program | None:
    """The section of the file's program of one's own; None where it has none."""
    programs = (controller.program for controller in config.controllers)
    return next((program for program in programs if program.python is not None), None)


def load_program(path: Path, class_name: str | None = None) -> type[AxisProgram]:
    """Run the file and return its class; without a name, the only one.  Raises :class:`ConfigError`."""
    try:
        source = path.read_bytes()
    except OSError as exc:
        raise ConfigError(f"controller.program.python: {path} cannot be read: {(exc.strerror or '').lower()}") from exc
    if len(source) > MAX_OCTETS:
        raise ConfigError(f"controller.program.python: {path} has {len(source)} octets; at most {MAX_OCTETS}")
    digest = sha256(str(path.resolve()).encode()).hexdigest()[:8]
    module = ModuleType(f"pnfarm_program_{digest}_{next(_numbers)}")
    module.__file__ = str(path)
    try:
        code = compile(source, str(path), "exec")
    except SyntaxError as exc:
        raise ConfigError(f"{path}:{exc.lineno or 1}: {exc.msg}") from exc
    except ValueError as exc:
        raise ConfigError(f"{path}:1: {exc}") from exc
    # dataclasses look their module up
    sys.modules[module.__name__] = module
    try:
        with _beside(path):
            exec(code, module.__dict__)  # noqa: S102 - the user's own program is to run
    except KeyboardInterrupt:
        del sys.modules[module.__name__]
        raise
    except BaseException as exc:  # a file may even call sys.exit()
        del sys.modules[module.__name__]
        raise ConfigError(placed(exc, module.__name__, str(path))) from exc
    return _chosen(module, path, class_name)


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


def _chosen(module: ModuleType, path: Path, class_name: str | None) -> type[AxisProgram]:
    own = {
        name: thing
        for name, thing in vars(module).items()
        if isinstance(thing, type) and issubclass(thing, AxisProgram) and thing.__module__ == module.__name__
    }
    if class_name is not None:
        if class_name not in own:
            have = f"it has {', '.join(own)}" if own else "it has none"
            hint = did_you_mean(class_name, own)
            raise ConfigError(f"{path} has no class {class_name!r} derived from pnfarm.AxisProgram{hint}; {have}")
        return _checked(own[class_name], path)
    last = [kind for kind in own.values() if not any(kind in other.__bases__ for other in own.values())]
    if not last:
        raise ConfigError(f"{path} has no class derived from pnfarm.AxisProgram with a method cycle")
    if len(set(last)) > 1:
        raise ConfigError(f"{path} has the classes {', '.join(own)}; choose one: program: {{python: ..., class: NAME}}")
    return _checked(last[0], path)


def _checked(kind: type[AxisProgram], path: Path) -> type[AxisProgram]:
    """Whether it can be called as a program is."""
    cycle = kind.cycle
    if cycle is AxisProgram.cycle:
        raise ConfigError(f"{path}: class {kind.__name__} has no method cycle(self, inputs, outputs, now)")
    line = _line_of(cycle)
    if inspect.iscoroutinefunction(cycle) or inspect.isgeneratorfunction(cycle) or inspect.isasyncgenfunction(cycle):
        raise ConfigError(f"{path}:{line}: cycle is called once a cycle and returns: neither `async` nor `yield`")
    for method, call, given in ((cycle, "cycle(self, inputs, outputs, now)", 4), (kind.__init__, "__init__(self)", 1)):
        try:
            inspect.signature(method).bind(*range(given))
        except TypeError:
            raise ConfigError(f"{path}:{_line_of(method)}: {kind.__name__} needs {call}") from None
        except ValueError:
            continue  # of a base class in C
    return kind


def _line_of(function: object) -> int:
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


def make_program(
    kind: type[AxisProgram], line: Line, *, name: str, model: str, cycle_ns: int, inputs: Inputs, outputs: Outputs
) -> AxisProgram:
    """An axis' program, ready to be called.  Raises :class:`ConfigError` where its ``__init__`` fails."""
    program = kind.__new__(kind)
    program.name, program.model, program.cycle_ns = name, model, cycle_ns
    program.inputs, program.outputs, program.line = inputs, outputs, line
    program.open_records, program.asked_records = [], []
    line.add(program)
    try:
        kind.__init__(program)
    except Exception as exc:
        raise ConfigError(f"the program of axis {name} cannot be made: {placed(exc, kind.__module__)}") from exc
    return program
