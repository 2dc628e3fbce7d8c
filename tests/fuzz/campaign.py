"""The state of guided fuzzing that is stopped and goes on: what each target had so far, in a JSON file."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from zlib import crc32

__all__ = ["HEADER", "State", "Turn", "table"]

HEADER = f"{'target':48} {'inputs':>10} {'a second':>9} {'edges':>6} {'features':>8} {'kept':>5} {'findings':>8}"


@dataclass(frozen=True)
class Turn:
    """What one process of libFuzzer did; ``findings`` are inputs in hexadecimal digits."""

    inputs: int
    seconds: float
    edges: int
    features: int
    kept: int
    code: int
    findings: list[str]


@dataclass
class Total:
    """All turns of one target: edges and features are the most that a turn reached."""

    inputs: int = 0
    seconds: float = 0.0
    turns: int = 0
    edges: int = 0
    features: int = 0
    kept: int = 0
    findings: list[str] = field(default_factory=list)

    @property
    def rate(self) -> float:
        return self.inputs / self.seconds if self.seconds else 0.0


class State:
    """The totals by target; every turn is written to the file at once."""

    def __init__(self, file: Path | None) -> None:
        self.file = file
        self.totals: dict[str, Total] = {}

    @classmethod
    def read(cls, file: Path) -> State:
        """An empty state where there is no file."""
        state = cls(file)
        if file.exists():
            state.totals = {name: Total(**total) for name, total in json.loads(file.read_text("utf-8")).items()}
        return state

    def total(self, name: str) -> Total:
        """Nothing yet of a target that had no turn."""
        return self.totals.get(name, Total())

    def add(self, name: str, turn: Turn) -> None:
        total = self.totals.setdefault(name, Total())
        total.inputs += turn.inputs
        total.seconds += turn.seconds
        total.turns += 1
        total.edges, total.features = max(total.edges, turn.edges), max(total.features, turn.features)
        total.kept = turn.kept
        total.findings += [octets for octets in turn.findings if octets not in total.findings]
        if self.file is not None:
            part = self.file.with_name(f"{self.file.name}.part")
            part.write_text(json.dumps({name: asdict(self.totals[name]) for name in sorted(self.totals)}, indent=1))
            part.replace(self.file)

    def order(self, names: Collection[str], *, endless: bool) -> Iterator[str]:
        """The next target, ever again: the one with the least inputs, and in every second turn with the least time.

        By inputs alone, slow targets would keep all others waiting.  Without ``endless`` each target once.
        """
        if not endless:
            yield from names
            return
        number = 0
        while True:
            by_time = number % 2 == 1
            # of those with the same, one from anywhere in the alphabet
            yield min(names, key=lambda name: (self._had(name, by_time=by_time), crc32(name.encode())))
            number += 1

    def _had(self, name: str, *, by_time: bool) -> float:
        return self.total(name).seconds if by_time else self.total(name).inputs

    def row(self, name: str) -> str:
        one = self.total(name)
        figures = f"{one.inputs:>10} {one.rate:>9.0f} {one.edges:>6} {one.features:>8} {one.kept:>5}"
        return f"{name:48} {figures} {len(one.findings):>8}"


def table(state: State) -> str:
    """The totals as a table in Markdown: machines one by one, parsers by the module that they are in."""
    groups: dict[str, list[Total]] = {}
    for name, total in state.totals.items():
        group = name if name.startswith("machine ") else name.partition(".")[0]
        groups.setdefault(group, []).append(total)
    lines = [
        "| module or machine | targets | inputs | inputs a second | edges | features | kept |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]

    def line(name: str, totals: Collection[Total]) -> str:
        inputs, seconds = sum(one.inputs for one in totals), sum(one.seconds for one in totals)
        sums = [sum(getattr(one, key) for one in totals) for key in ("edges", "features", "kept")]
        rate = inputs / seconds if seconds else 0
        return f"| {name} | {len(totals)} | {inputs:,} | {rate:,.0f} | {' | '.join(f'{one:,}' for one in sums)} |"

    lines += [line(f"`{name}`", groups[name]) for name in sorted(groups)]
    return "\n".join([*lines, line("all", [total for totals in groups.values() for total in totals])])
