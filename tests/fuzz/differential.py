"""``--against PEER``: the same octets for our parsers and for another implementation, and where their answers differ.

The octets are good ones, each once, and changed ones by seed.  Differences are grouped by layer and kind.
``known_differences.toml`` holds the groups that are known, each with its reason; any other makes the exit code 1 and is
printed with its shortest input.
"""

# ruff: noqa: T201 - what it prints is its answer

from __future__ import annotations

import argparse
import importlib
import sys
import time
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from random import Random

from tests.fuzz.corpus import gather
from tests.fuzz.layers import LAYERS, Answer, Layer, ours
from tests.fuzz.machines_enip import enip_layers
from tests.fuzz.mutate import mutated

__all__ = ["PEERS", "Groups", "differences", "known", "main"]

PEERS = ("scapy", "tshark", "opener")
KNOWN = Path(__file__).with_name("known_differences.toml")
#: No input of a frame is longer.
LONGEST = 1500


def known(peer: str) -> dict[str, str]:
    """Reasons by group; a group is a pattern as of file names."""
    return dict(tomllib.loads(KNOWN.read_text("utf-8"))[peer])


def inputs(layer: Layer, layers: Mapping[str, Sequence[bytes]], seed: object, count: int) -> list[bytes]:
    """``count`` inputs: good ones first, each once, and changed ones."""
    pool = [octets for octets in layer.pool(layers) if len(octets) <= LONGEST]
    rng = Random(f"{seed}/{layer.name}")
    found = rng.sample(pool, min(len(pool), max(1, count // 4)))
    return found + [mutated(rng, rng.choice(pool), pool)[:LONGEST] for _ in range(count - len(found))]


def differences(mine: Answer, theirs: Answer) -> Iterator[str]:
    """The kinds of difference between two answers; none where both refuse, or read the same."""
    if isinstance(mine, str):
        if not isinstance(theirs, str):
            yield f"we refuse ({mine})"
        return
    if isinstance(theirs, str):
        yield f"they refuse ({theirs})"
        return
    for name, value in mine.items():
        other = theirs.get(name)
        if value is not None and other is not None and value != other:
            yield f"{name} {'absent' if other == 'absent' else 'differs'}"


@dataclass
class Groups:
    """Differences by group: how many, and the shortest input of each with both answers."""

    found: dict[str, tuple[int, bytes, object, object]] = field(default_factory=dict)

    def add(self, group: str, data: bytes, mine: object, theirs: object) -> None:
        count, *shortest = self.found.get(group, (0, data, mine, theirs))
        self.found[group] = (count + 1, *min(shortest, (data, mine, theirs), key=lambda one: len(one[0])))

    def report(self, reasons: Mapping[str, str]) -> int:
        """Print them all, those without a reason with an example; 1 if there is such a one."""
        new = 0
        for group, (count, shortest, mine, theirs) in sorted(self.found.items()):
            reason = next((text for pattern, text in reasons.items() if fnmatchcase(group, pattern)), None)
            print(f"{count:>8}  {group}: {reason or 'NEW'}")
            if reason is None:
                new += 1
                print(f"          input:  {shortest.hex()}\n          ours:   {mine}\n          theirs: {theirs}")
        count = sum(count for count, *_ in self.found.values())
        print(f"{count} differences in {len(self.found)} groups, {new} of them new")
        return int(new > 0)


def main(options: argparse.Namespace) -> int:
    """The worst of all peers: 1 where a difference is not known, 2 for a wrong argument, 4 for a missing peer."""
    return max(_opener(options) if name == "opener" else _layers(options, name) for name in options.against)


@cache
def _corpus() -> Mapping[str, Sequence[bytes]]:
    return {**gather().layers, **enip_layers()}


def _layers(options: argparse.Namespace, against: str) -> int:
    """Octets for parsers."""
    try:
        peer = importlib.import_module(f"tests.fuzz.against_{against}")
        told = peer.version()
    except (ImportError, FileNotFoundError) as exc:
        print(f"tests.fuzz: --against {against}: {exc}", file=sys.stderr)
        return 4
    names = [name for name in LAYERS if name in peer.LAYERS and fnmatchcase(name, options.target)]
    if not names:
        print(f"no layer is named {options.target!r}; there are {', '.join(peer.LAYERS)}", file=sys.stderr)
        return 2
    print(f"{told}; seed {options.seed}")
    print(f"{'layer':10} {'inputs':>8} {'read alike':>10} {'both refuse':>11} {'differ':>8} {'inputs a second':>15}")
    groups = Groups()
    for name in names:
        began = time.monotonic()
        layer = LAYERS[name]
        given = inputs(layer, _corpus(), options.seed, max(1, options.count // len(names)))
        tally: Counter[str] = Counter()
        for data, theirs in zip(given, peer.answers(name, given), strict=True):
            mine = ours(layer, data)
            kinds = list(differences(mine, theirs))
            tally["differ" if kinds else "refused" if isinstance(mine, str) else "read"] += 1
            for kind in kinds:
                groups.add(f"{name}: {kind}", data, mine, theirs)
        rate = len(given) / (time.monotonic() - began)
        print(
            f"{name:10} {len(given):>8} {tally['read']:>10} {tally['refused']:>11} {tally['differ']:>8} {rate:>15,.0f}"
        )
    return groups.report(known(against))


def _opener(options: argparse.Namespace) -> int:
    """Sequences of messages, for a built program of OpENer."""
    from tests.fuzz.against_opener import OpenerRig, Ours, compared
    from tests.fuzz.enip_sequences import sequence

    if options.opener is None or not Path(options.opener).is_file():
        print("tests.fuzz: --against opener needs --opener PATH, its built program", file=sys.stderr)
        return 2
    groups, mine, messages, alike = Groups(), Ours(), 0, 0
    began = time.monotonic()
    with OpenerRig(Path(options.opener)) as theirs:
        for number in range(options.count):
            sent = sequence(options.seed, number)
            for one, our_class, their_class in compared(sent, mine.answers(sent), theirs.answers(sent)):
                messages += 1
                alike += our_class == their_class
                if our_class != their_class:
                    groups.add(
                        f"{one.what}: ours {our_class}; theirs {their_class}", one.octets, our_class, their_class
                    )
    rate = messages / (time.monotonic() - began)
    print(f"{options.count} sequences, {messages} messages, {rate:,.0f} a second; {alike} answered alike")
    return groups.report(known("opener"))
