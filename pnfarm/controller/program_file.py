"""Finds the class in a file of ``program: {python: FILE, class: NAME}``; what is wrong with it is one sentence."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING

from pnfarm.controller.axis_program import AxisProgram
from pnfarm.errors import ConfigError
from pnfarm.user_code.file import line_of, own_classes, placed, run_file
from pnfarm.vocabulary.quoting import did_you_mean

if TYPE_CHECKING:
    from pathlib import Path
    from types import ModuleType

    from pnfarm.config.controller import Program
    from pnfarm.controller.axis_program import Line
    from pnfarm.drives.telegrams.signal_view import Inputs, Outputs
    from pnfarm.farm.file.reading import FarmConfig

__all__ = ["load_program", "make_program", "program_of", "program_settings"]


def program_of(config: FarmConfig) -> type[AxisProgram] | None:
    """The class of the farm file's program, None where the controller runs one of its own.

    The path is relative to the farm file.  Raises :class:`ConfigError`.
    """
    section = program_settings(config)
    if section is None or section.python is None:
        return None
    return load_program(config.beside(section.python), section.class_name)


def program_settings(config: FarmConfig) -> Program | None:
    """The section of the file's program of one's own; None where it has none."""
    programs = (controller.program for controller in config.controllers)
    return next((program for program in programs if program.python is not None), None)


def load_program(path: Path, class_name: str | None = None) -> type[AxisProgram]:
    """Run the file and return its class; without a name, the only one.  Raises :class:`ConfigError`."""
    return _chosen(run_file(path, "controller.program.python"), path, class_name)


def _chosen(module: ModuleType, path: Path, class_name: str | None) -> type[AxisProgram]:
    own = {name: kind for name, kind in own_classes(module).items() if issubclass(kind, AxisProgram)}
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
    line = line_of(cycle)
    if inspect.iscoroutinefunction(cycle) or inspect.isgeneratorfunction(cycle) or inspect.isasyncgenfunction(cycle):
        raise ConfigError(f"{path}:{line}: cycle is called once a cycle and returns: neither `async` nor `yield`")
    for method, call, given in ((cycle, "cycle(self, inputs, outputs, now)", 4), (kind.__init__, "__init__(self)", 1)):
        try:
            inspect.signature(method).bind(*range(given))
        except TypeError:
            raise ConfigError(f"{path}:{line_of(method)}: {kind.__name__} needs {call}") from None
        except ValueError:
            continue  # of a base class in C
    return kind


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
