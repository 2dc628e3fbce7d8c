"""A drive and a program of ``configs/programs`` that is a function block of a PLC: set inputs, look at outputs."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from pnfarm.controller.line import VirtualLine
from pnfarm.farm.file.reading import parse_farm
from pnfarm.station.event_log import EventLog

if TYPE_CHECKING:
    from collections.abc import Callable

PROGRAMS = Path(__file__).parents[2] / "configs" / "programs"
FILE = """
farm: blocks
link: {{kind: memory{line}}}
drives:
  - {{name: axis, model: {model}, {address}, params: {params}, motion_tasks: {tasks}}}
controller:
  {own}
  telegram: {telegram}
  cycle: {cycle}
  program: {{python: "{program}"{kind}}}
"""


class BlockRig:
    """``kind``: the class in the file, by default the one that the farm file would run."""

    def __init__(
        self, file: str, kind: str = "", *, model: str = "profidrive", telegram: int, cycle: str = "2ms",
        params: str = "{}", tasks: str = "[]", line: bool = False,
    ) -> None:  # fmt: skip
        text = FILE.format(
            model=model, telegram=telegram, cycle=cycle, params=params, tasks=tasks, program=PROGRAMS / file,
            kind=f", class: {kind}" if kind else "", line=", baud: 12000000" if line else "",
            address="address: 11" if line else "ip: 10.77.0.11/24",
            own="address: 1\n  access: class-1" if line else "ip: 10.77.0.1/24",
        )  # fmt: skip
        self.line = asyncio.run(VirtualLine.create(parse_farm(text), plc_log=EventLog(quiet=True)))
        assert self.line.programs is not None
        self.world, self.block = self.line.world, self.line.programs.program("axis")
        self.axis = self.line.farm.columns.axis[0]

    def __enter__(self) -> Self:
        assert self.wait(lambda: self.block.connected, 10.0)
        return self

    def __exit__(self, *_: object) -> None:
        failure = self.line.programs.snapshot("axis")["failure"]
        asyncio.run(self.line.close())
        assert not failure

    def set(self, seconds: float = 0.02, **inputs: Any) -> None:
        """Inputs of the block, and time until the drive has seen them."""
        for name, value in inputs.items():
            assert hasattr(self.block, name), f"the block has no input {name}"
            setattr(self.block, name, value)
        self.world.run(seconds)

    def wait(self, condition: Callable[[], object], within: float = 5.0) -> bool:
        return bool(self.world.run(within, until=lambda: bool(condition()), look_ns=1_000_000))

    def inject(self, kind: str, **params: Any) -> None:
        self.line.farm.injections.inject({"kind": kind, "on": "axis", "params": params}, self.world.now)

    def clear(self) -> None:
        self.line.farm.injections.clear(None, self.world.now)

    @property
    def rpm(self) -> float:
        return float(self.axis.motor.velocity)

    @property
    def store(self) -> Any:
        """The drive's parameters."""
        return self.line.farm.axes[0].store
